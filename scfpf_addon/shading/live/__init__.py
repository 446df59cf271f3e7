# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View: what the projectors of a coarse image hit, and its colours as in Blender's Solid shading."""
