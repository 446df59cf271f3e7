# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim: control surfaces found from what the image shall show.

``solver`` needs no rays. The modules here ask the scene: what a view shows, what stays in its place, what
hides a pin, and how good a solution is.
"""
