# SPDX-License-Identifier: GPL-3.0-or-later
"""Where projectors first hit the scene: NumPy and embreex, no bpy."""
