# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors: ordinary cameras whose pictures, by any engine, together hold what an image shows.

The caster knows the first hit of every sample. An anchor sees a part of these hits from nearly the same
direction and with enough pixels, so that their colours can be looked up in its picture.

Which surface a pixel of an anchor shows is found by casting, not from the engine's passes: Workbench has none
of them, and none has Grease Pencil. The sky is rendered without things and looked up by direction.
"""
