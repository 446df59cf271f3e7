# SPDX-License-Identifier: GPL-3.0-or-later
"""Shading: the colours of hits, and frames made of them. NumPy without bpy."""
