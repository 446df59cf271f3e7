# SPDX-License-Identifier: GPL-3.0-or-later
"""Blend cameras, or a camera and a preset, by one factor that can be animated."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...scfpf_addon.bridge.aim.kept_volume import volume_kept
from ...scfpf_addon.bridge.blender.scene_objects import absent_text
from ...scfpf_addon.bridge.blender.slot_animation import BLEND_MORE, remove_slot
from ...scfpf_addon.bridge.blends.blend_bake import bake_map
from ...scfpf_addon.bridge.blends.blend_ends import (
    MOST_ENDS,
    ends_of,
    is_map_animated,
    knows_its_ends,
    least_faces,
    read_map,
    seams_of,
)
from ...scfpf_addon.bridge.blends.camera_blend import is_baked, new_blend_camera, set_blend
from ...scfpf_addon.bridge.camera.flexible_camera import make_flexible
from ...scfpf_addon.bridge.camera.read_projection import read_projection, world_to_camera
from ...scfpf_addon.bridge.camera.shown_lens import approximate_lens
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.editing.blending import blended
from ...scfpf_addon.projection.user_error import Message, UserError
from ...scfpf_addon.projection.volume.folds import find_folds
from ..common.target import flexible_camera_of, poll_flexible_camera, selected_objects
from ..common.tool import Tool, select_only, wholly_made
from ..common.words import report_text
from .presets import preset_choices, preset_items, shipped_preset


def blend_camera(context, first, second, second_name: str, further=()):
    """A new flexible camera between a camera and a projection in world space, active and the scene camera.

    further: cameras that the blend has besides. Raises USER_ERRORS before anything is made.
    """
    others = [second, *(_seen(context, end) for end in further)]
    own, blend = _blend(context, first, others, first)
    camera = new_blend_camera(first, f"{first.name} to {second_name}")
    settings = camera.scfpf
    settings.blend_ends.first = first
    for end in further:
        settings.blend_more.add().camera = end
    settings.pixel_error, settings.samples = first.scfpf.pixel_error, first.scfpf.samples
    set_blend(camera, blend, image_aspect(context.scene))
    make_flexible(camera)
    approximate_lens(camera, own)
    select_only(context, camera)
    context.scene.camera = camera
    return camera


def _blend(context, first, others, camera):
    """The first camera's projection, and its blend with other projections, both in ``camera``'s space.

    others: in world space. Raises UserError.
    """
    inward = world_to_camera(camera)
    own = _seen(context, first).transformed(inward)
    ends = [own, *(other.transformed(inward) for other in others)]
    return own, blended(ends, least_faces(camera), seams_of(camera), image_aspect(context.scene))


def _seen(context, camera):
    """A camera's projection in world space. Raises UserError."""
    return read_projection(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene))


def _preset_before(context, camera, preset):
    """A preset's projection placed at a camera, in world space."""
    world = np.array(camera.matrix_world, np.float64)
    return preset.projection(image_aspect(context.scene)).transformed(world)


def _done(camera) -> str:
    return report_text("'{0}' is the scene camera: its Blend goes from one picture to the other", camera.name)


class SCFPF_OT_camera_blend(Tool, bpy.types.Operator):
    """Make a flexible camera between selected ones, whose Blend goes from another one's picture to that of
    the active one, and beyond both; further cameras have a map each"""

    bl_idname = "scfpf.camera_blend"
    bl_label = "Blend Cameras"

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not _chosen(context):
            cls.poll_message_set("Select two or more flexible cameras: the blend goes to the active one")
            return False
        return True

    def edit(self, context, camera):
        first, *further = _chosen(context)
        _require_room(len(further) + 2)
        with wholly_made(context):
            made = blend_camera(context, first, _seen(context, camera), camera.name, further)
            made.scfpf.blend_ends.second = camera
            return _done(made)


def _chosen(context) -> list:
    """The selected flexible cameras besides the active one, by name."""
    active = flexible_camera_of(context)
    found = [
        obj
        for obj in selected_objects(context)
        if obj.type == "CAMERA" and obj.scfpf.enabled and obj != active
    ]
    return sorted(found, key=lambda obj: obj.name)


def _require_room(count: int) -> None:
    """Raise UserError if a blend cannot have so many cameras."""
    if count > MOST_ENDS:
        raise UserError("A blend has at most {0} cameras: blend some of them first", MOST_ENDS)


class SCFPF_OT_camera_blend_preset(Tool, bpy.types.Operator):
    """Make a flexible camera between this one and a preset at the same place, whose Blend goes from this
    camera's picture to the preset's, and beyond both"""

    bl_idname = "scfpf.camera_blend_preset"
    bl_label = "Blend with Preset"

    preset: EnumProperty(
        name="Preset", description="The projection at which the blend ends", items=preset_choices
    )

    def edit(self, context, camera):
        preset = shipped_preset(self.preset)
        second = _preset_before(context, camera, preset)
        with wholly_made(context):
            made = blend_camera(context, camera, second, preset.name)
            made.scfpf.blend_ends.preset = self.preset
            return _done(made)


class SCFPF_OT_blend_update(Tool, bpy.types.Operator):
    """Update the blend to changes of its cameras and of the resolution: keyframes of Blend stay, edits
    of the blend's own surfaces are lost"""

    bl_idname = "scfpf.blend_update"
    bl_label = "Update Blend"

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not knows_its_ends(flexible_camera_of(context)):
            cls.poll_message_set("This camera is not a blend: make one with Blend Cameras")
            return False
        return True

    def edit(self, context, camera):
        was_baked, scene = is_baked(camera), context.scene
        with volume_kept(camera):
            done = updated(context, camera)
            if was_baked and is_map_animated(camera):
                bake_map(camera, scene, scene.frame_start, scene.frame_end)
            return done


class SCFPF_OT_blend_camera_add(Tool, bpy.types.Operator):
    """Add the other selected flexible cameras to the blend: each has a map that says where it counts"""

    bl_idname = "scfpf.blend_camera_add"
    bl_label = "Add Camera to Blend"

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context):
            return False
        if not _chosen(context):
            cls.poll_message_set("Select the cameras to add as well, the blend last")
            return False
        return True

    def edit(self, context, camera):
        settings = camera.scfpf
        before, chosen = len(settings.blend_more), _chosen(context)
        _require_room(before + len(chosen) + 2)
        with volume_kept(camera):
            for end in chosen:
                settings.blend_more.add().camera = end
            done = updated(context, camera)
            settings.active_blend = len(settings.blend_more) - 1
            return done


class SCFPF_OT_blend_camera_remove(Tool, bpy.types.Operator):
    """Take the further camera that is selected in the list out of the blend"""

    bl_idname = "scfpf.blend_camera_remove"
    bl_label = "Remove Camera from Blend"

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context):
            return False
        settings = flexible_camera_of(context).scfpf
        if settings.active_blend >= len(settings.blend_more):
            cls.poll_message_set("Choose a further camera in the list first")
            return False
        return True

    def edit(self, context, camera):
        with volume_kept(camera):
            remove_slot(camera.scfpf, camera.scfpf.active_blend, BLEND_MORE)
            return updated(context, camera)


def updated(context, camera) -> str:
    """Make a blend anew from its ends. Returns what there is to say; raises USER_ERRORS."""
    for end in ends_of(camera):
        _require_map(end)
    ends = camera.scfpf.blend_ends
    first = flexible_end(context, camera, ends.first)
    further = [flexible_end(context, camera, end.camera) for end in camera.scfpf.blend_more]
    if ends.second is not None:
        other = flexible_end(context, camera, ends.second)
        second, name = _seen(context, other), other.name
    else:
        if ends.preset not in (stem for stem, _name, _text in preset_items()):
            raise UserError("There is no preset '{0}': choose a camera at which the blend ends", ends.preset)
        preset = shipped_preset(ends.preset)
        second, name = _preset_before(context, first, preset), report_text(preset.name)
    own, blend = _blend(context, first, [second, *(_seen(context, end) for end in further)], camera)
    set_blend(camera, blend, image_aspect(context.scene))
    approximate_lens(camera, own)
    context.view_layer.update()
    folds = find_folds(_seen(context, camera))
    folded = report_text("; {0:.1%} of it folds", folds.share).replace("%", " %") if folds else ""
    name = "', '".join([name, *(end.name for end in further)])
    return report_text(
        "The blend '{0}' is updated: it goes from '{1}' to '{2}'{3}", camera.name, first.name, name, folded
    )


def _require_map(end) -> None:
    """Raise UserError if an end's map has nothing to be read from."""
    settings = end.settings
    if settings.kind == "NONE" or read_map(end) is not None:
        return
    if settings.kind == "VIEWS":
        if end.camera is None:
            raise UserError("A preset has no views: choose a camera at which the blend ends, or another map")
        raise UserError("'{0}' has no views of Aim: press Add View, or choose another map", end.camera.name)
    if settings.image is not None:
        raise UserError("The image '{0}' has no pixels: paint or load it", settings.image.name)


def flexible_end(context, camera, end):
    """``end``, a flexible camera other than the blend itself that the scene has. Raises UserError."""
    if end is None:
        raise UserError("A further camera of the blend is gone: choose one in the list, or remove it there")
    if lost := absent_text(end, context.scene, Message("choose another camera")):
        raise UserError(lost)
    if end == camera or end.type != "CAMERA" or not end.scfpf.enabled:
        raise UserError("'{0}' is not a flexible camera: choose another one", end.name)
    return end


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_camera_blend,
        SCFPF_OT_camera_blend_preset,
        SCFPF_OT_blend_update,
        SCFPF_OT_blend_camera_add,
        SCFPF_OT_blend_camera_remove,
    )
)
