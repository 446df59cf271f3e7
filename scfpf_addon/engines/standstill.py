# SPDX-License-Identifier: GPL-3.0-or-later
"""Find out whether ordinary renders of a scene are the same at all frames, by what Blender's data say.

In case of doubt they are not. Cameras and control surfaces may move: renders from a fixed place show neither.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..bridge.blender import versions
from ..bridge.blender.rig_mark import has_other_animation
from ..bridge.camera.flexible_camera import control_objects
from ..bridge.camera.preset_folder import PACKAGE
from ..cycles.skipping.stillness import motion_of

# Engines without noise that changes with the frame.
NOISELESS = {versions.EEVEE, "BLENDER_WORKBENCH"}
# Images that change with the frame.
MOVING_IMAGES = {"SEQUENCE", "MOVIE"}
# What runs at each frame and may change anything.
FRAME_EVENTS = ("frame_change_pre", "frame_change_post", "render_init", "render_pre")


def stands_still(scene, engine: str) -> bool:
    """Return whether all renders of a scene from fixed places are the same at all frames. engine: that
    renders, by its identifier."""
    if engine not in NOISELESS or has_other_animation(scene) or scene.rigidbody_world is not None:
        return False
    if any(_is_foreign(handler) for event in FRAME_EVENTS for handler in getattr(bpy.app.handlers, event)):
        return False
    absent = control_objects()
    unseen = {obj for obj in bpy.data.objects if obj.type == "CAMERA" or obj.name_full in absent}
    if motion_of(scene, unseen).movers:
        return False
    if any(image.source in MOVING_IMAGES for image in bpy.data.images):
        return False
    return not any(_may_change(owner, unseen) for owner in _shading_owners())


def _is_foreign(handler) -> bool:
    """Return whether a handler of Blender's events is another add-on's or a script's."""
    return not getattr(handler, "__module__", "").startswith(PACKAGE)


def _shading_owners() -> Iterator[bpy.types.ID]:
    """The datablocks of the file by which things look as they do."""
    data = bpy.data
    for owners in (data.materials, data.worlds, data.lights, data.textures, data.node_groups):
        yield from owners


def _may_change(owner, unseen: set) -> bool:
    """Return whether what a datablock shades may change with the frame. unseen: objects that may move."""
    tree = owner if isinstance(owner, bpy.types.NodeTree) else getattr(owner, "node_tree", None)
    if has_other_animation(owner) or (tree is not None and has_other_animation(tree)):
        return True
    for node in () if tree is None else tree.nodes:
        # Such an attribute may be the number of the frame.
        if getattr(node, "attribute_type", "") == "VIEW_LAYER" or getattr(node, "object", None) in unseen:
            return True
    return False
