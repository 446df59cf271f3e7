# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of flexible cameras by any render engine, through anchors: ordinary renders that are joined.

F12 itself cannot do it: an engine may not render other scenes while Blender waits for its pixels.
"""
