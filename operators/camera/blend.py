# SPDX-License-Identifier: GPL-3.0-or-later
"""Blend two cameras, or a camera and a preset, by one factor that can be animated."""

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.blender.scene_objects import absent_text, object_by_uid
from ...scfpf_addon.bridge.camera.blend_bake import bake_map
from ...scfpf_addon.bridge.camera.camera_blend import (
    is_baked,
    is_map_animated,
    knows_its_ends,
    least_faces,
    new_blend_camera,
    read_field,
    seams_of,
    set_blend,
)
from ...scfpf_addon.bridge.camera.flexible_camera import make_flexible
from ...scfpf_addon.bridge.camera.read_projection import read_projection, world_to_camera
from ...scfpf_addon.bridge.camera.shown_lens import approximate_lens
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.settings.blend_properties import FIELD_KINDS
from ...scfpf_addon.projection.editing.blending import BlendError, blended
from ...scfpf_addon.projection.volume.folds import find_folds
from ...scfpf_addon.shading.picking.find import find, points_of
from ..common.target import flexible_camera_of, poll_flexible_camera
from ..common.tool import Tool, select_only
from ..common.words import say
from ..image.find import wanted_objects
from ..image.preparation import poll_no_render, prepared_inputs
from .presets import preset_choices, preset_items, shipped_preset


def blend_camera(context, first, second, second_name: str):
    """A new flexible camera between a camera and a projection in world space, active and the scene camera.

    Raises an error of BAD_INPUT before anything is made.
    """
    own, blend = _blend(context, first, second, first)
    camera = new_blend_camera(first, f"{first.name} to {second_name}")
    settings = camera.scfpf
    settings.blend_ends.first = first
    settings.pixel_error, settings.samples = first.scfpf.pixel_error, first.scfpf.samples
    set_blend(camera, blend, image_aspect(context.scene))
    make_flexible(camera)
    approximate_lens(camera, own)
    select_only(context, camera)
    context.scene.camera = camera
    return camera


def _blend(context, first, second, camera):
    """The first camera's projection, and its blend with a projection ``second``, both in ``camera``'s space.

    second: in world space. Raises ProjectionError.
    """
    inward = world_to_camera(camera)
    own = read_projection(first, context.evaluated_depsgraph_get(), image_aspect(context.scene))
    own = own.transformed(inward)
    seams, aspect = seams_of(camera), image_aspect(context.scene)
    return own, blended(own, second.transformed(inward), least_faces(camera), seams, aspect)


def _preset_before(context, camera, preset):
    """A preset's projection placed at a camera, in world space."""
    world = np.array(camera.matrix_world, np.float64)
    return preset.projection(image_aspect(context.scene)).transformed(world)


def _done(camera) -> str:
    return say("'{0}' is the scene camera: its Blend goes from one picture to the other", camera.name)


class SCFPF_OT_camera_blend(Tool, bpy.types.Operator):
    """Make a flexible camera between two selected ones, whose Blend goes from the other one's picture to
    that of the active one, and beyond both"""

    bl_idname = "scfpf.camera_blend"
    bl_label = "Blend Cameras"

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if len(_chosen(context)) != 1:
            cls.poll_message_set("Select two flexible cameras: the blend ends at the active one")
            return False
        return True

    def edit(self, context, camera):
        (first,) = _chosen(context)
        aspect = image_aspect(context.scene)
        second = read_projection(camera, context.evaluated_depsgraph_get(), aspect)
        made = blend_camera(context, first, second, camera.name)
        made.scfpf.blend_ends.second = camera
        return _done(made)


def _chosen(context) -> list:
    """The selected flexible cameras besides the active one."""
    active = flexible_camera_of(context)
    return [
        obj
        for obj in context.selected_objects
        if obj.type == "CAMERA" and obj.scfpf.enabled and obj != active
    ]


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
        made = blend_camera(context, camera, second, preset.name)
        made.scfpf.blend_ends.preset = self.preset
        return _done(made)


class SCFPF_OT_blend_update(Tool, bpy.types.Operator):
    """Update the blend to changes of its two cameras and of the resolution: keyframes of Blend stay, edits
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
        done = _updated(context, camera)
        if was_baked and is_map_animated(camera):
            bake_map(camera, scene, scene.frame_start, scene.frame_end)
        return done


class SCFPF_OT_blend_map(Tool, bpy.types.Operator):
    """Choose where in the picture the second camera of the blend counts, and update the blend"""

    bl_idname = "scfpf.blend_map"
    bl_label = "Blend Map"

    kind: EnumProperty(
        name="Blend Map", description="Where in the picture the second camera counts", items=FIELD_KINDS
    )

    poll = SCFPF_OT_blend_update.poll

    def edit(self, context, camera):
        settings = camera.scfpf
        before, factor = settings.blend_field.kind, settings.blend_factor
        settings.blend_field.kind = self.kind
        if before == "NONE" and factor == 0.0:
            settings.blend_factor = 1.0  # else the map would show nothing
        try:
            return _updated(context, camera)
        except Exception:
            settings.blend_field.kind, settings.blend_factor = before, factor
            raise


class SCFPF_OT_blend_map_bake(Tool, bpy.types.Operator):
    """Write the keyframes of the map into shapes that drivers mix, so that pictures follow them"""

    bl_idname = "scfpf.blend_map_bake"
    bl_label = "Bake Map"

    start: IntProperty(name="Start", description="First frame; 0 is the scene's", default=0, min=0)
    end: IntProperty(name="End", description="Last frame; 0 is the scene's", default=0, min=0)

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context) or not poll_no_render(cls, context):
            return False
        if not is_map_animated(flexible_camera_of(context)):
            cls.poll_message_set("The map has no keyframes: insert some on its center, size, angle or border")
            return False
        return True

    def edit(self, context, camera):
        scene = context.scene
        _updated(context, camera)
        kept = bake_map(camera, scene, self.start or scene.frame_start, self.end or scene.frame_end)
        return f"The map is baked into {kept} shapes of each surface"


class SCFPF_OT_blend_map_around(Tool, bpy.types.Operator):
    """Put the map's circle or rectangle around the selected objects, as the first camera sees them"""

    bl_idname = "scfpf.blend_map_around"
    bl_label = "Map around Selection"

    @classmethod
    def poll(cls, context):
        if not SCFPF_OT_blend_update.poll.__func__(cls, context) or not poll_no_render(cls, context):
            return False
        if not wanted_objects(context):
            cls.poll_message_set("Select the objects as well, the camera last")
            return False
        return True

    def edit(self, context, camera):
        uid = camera.session_uid
        first = _end(context, camera, camera.scfpf.blend_ends.first)
        name = first.name
        left, low, right, high = _seen_box(context, first)
        camera = object_by_uid(uid)
        field = camera.scfpf.blend_field
        if field.kind not in ("RADIAL", "RECTANGLE"):
            field.kind = "RADIAL"
        field.center, field.angle = ((left + right) / 2, (low + high) / 2), 0.0
        aspect, border = image_aspect(context.scene), field.border
        # Half of the border is inside.
        if field.kind == "RECTANGLE":
            field.size = right - left + border, high - low + border * aspect
        else:
            field.size[0] = float(np.hypot(right - left, (high - low) / aspect)) + border
        _updated(context, camera)
        return say("The map is around the selection as '{0}' sees it", name)


def _seen_box(context, camera) -> tuple[float, float, float, float]:
    """The borders of the selected objects in a camera's image. Raises an error of BAD_INPUT."""
    names = {obj.name for obj in wanted_objects(context)}
    title = camera.name
    inputs = prepared_inputs(context, camera)
    points = points_of(inputs.scene, names)
    if not points.size:
        raise BlendError("Renders show no faces of the selected objects: select others")
    pixel = 1 / inputs.settings.width, 1 / inputs.settings.height
    found = find(inputs.projection, inputs.scene, points, names, pixel)
    if found is None:
        raise BlendError(say("'{0}' does not see the selected objects: select others, or turn it", title))
    return found.box


def _updated(context, camera) -> str:
    """Make a blend anew from its ends. Returns what there is to say; raises an error of BAD_INPUT."""
    ends, field = camera.scfpf.blend_ends, camera.scfpf.blend_field
    if field.kind == "IMAGE" and field.image is not None and read_field(camera) is None:
        raise BlendError(say("The image '{0}' has no pixels: paint or load it", field.image.name))
    first = _end(context, camera, ends.first)
    if ends.second is not None:
        other = _end(context, camera, ends.second)
        aspect = image_aspect(context.scene)
        second = read_projection(other, context.evaluated_depsgraph_get(), aspect)
        name = other.name
    else:
        if ends.preset not in (stem for stem, _name, _text in preset_items()):
            raise BlendError(
                say("There is no preset '{0}': choose a camera at which the blend ends", ends.preset)
            )
        preset = shipped_preset(ends.preset)
        second, name = _preset_before(context, first, preset), preset.name
    own, blend = _blend(context, first, second, camera)
    set_blend(camera, blend, image_aspect(context.scene))
    approximate_lens(camera, own)
    context.view_layer.update()
    made = read_projection(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene))
    folds = find_folds(made)
    folded = say("; {0:.1%} of it folds", folds.share).replace("%", " %") if folds else ""
    return say(
        "The blend '{0}' is updated: it goes from '{1}' to '{2}'{3}", camera.name, first.name, name, folded
    )


def _end(context, camera, end):
    """``end``, a flexible camera other than the blend itself that the scene has. Raises BlendError."""
    if lost := absent_text(end, context.scene, "choose another camera"):
        raise BlendError(lost)
    if end == camera or end.type != "CAMERA" or not end.scfpf.enabled:
        raise BlendError(say("'{0}' is not a flexible camera: choose another one", end.name))
    return end


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_camera_blend,
        SCFPF_OT_camera_blend_preset,
        SCFPF_OT_blend_update,
        SCFPF_OT_blend_map,
        SCFPF_OT_blend_map_around,
        SCFPF_OT_blend_map_bake,
    )
)
