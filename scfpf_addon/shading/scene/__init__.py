# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as shading sees it: arrays in world space."""
