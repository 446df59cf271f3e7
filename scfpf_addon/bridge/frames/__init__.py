# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames with handles over a flexible camera's image: where regions show them, and what the mouse is over."""
