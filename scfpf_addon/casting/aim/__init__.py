# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim: what needs rays: what stays, what a view shows, what hides a pin, and how good a solution is."""
