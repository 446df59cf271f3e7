# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexible Projection for Blender.

``projection``, ``casting`` and ``shading`` import no bpy and are usable as a
plain Python library; ``bridge`` is the only way between them and Blender.
"""
