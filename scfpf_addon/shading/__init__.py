# SPDX-License-Identifier: GPL-3.0-or-later
"""What colour a hit has, and the frame that hits make: NumPy, no bpy."""
