# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers for Blender's API: objects, nodes, handlers, files, versions."""
