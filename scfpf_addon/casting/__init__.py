# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting: the first hits of projectors in a scene, with NumPy and embreex, without bpy."""
