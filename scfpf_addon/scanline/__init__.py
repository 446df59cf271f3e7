# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: node groups that invert the viewing volume, Q⁻¹: scene → (x, y, depth)."""
