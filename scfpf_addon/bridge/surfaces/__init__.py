# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as Blender objects."""
