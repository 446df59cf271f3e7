# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim: control surfaces found from what the image shall show."""
