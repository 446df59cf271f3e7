# SPDX-License-Identifier: GPL-3.0-or-later
"""Blend two cameras, or a camera and a preset, by one factor that can be animated."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..scfpf_addon.bridge.camera_blend import give_shapes, new_blend_camera
from ..scfpf_addon.bridge.flexible_camera import (
    FlexibleCameraError,
    approximate_lens,
    make_flexible,
    replace_surfaces,
)
from ..scfpf_addon.bridge.read_projection import read_projection
from ..scfpf_addon.bridge.render_job import picture_aspect
from ..scfpf_addon.projection.blending import blended
from .presets import preset_items, shipped_preset
from .target import flexible_camera_of, poll_flexible_camera
from .tool import Tool


def blend_camera(context, first, second, second_name: str):
    """A new flexible camera between a camera and a projection in world space; returns it, made active.

    Raises what BAD_INPUT lists; nothing is left behind then.
    """
    scene = context.scene
    aspect = picture_aspect(scene)
    world = np.array(first.matrix_world, np.float64)
    if abs(np.linalg.det(world[:3, :3])) < np.finfo(np.float32).tiny:
        raise FlexibleCameraError(f"'{first.name}' has a scale of 0: clear it with Alt-S")
    inward = np.linalg.inv(world)
    own = read_projection(first, context.evaluated_depsgraph_get(), aspect).transformed(inward)
    blend = blended(own, second.transformed(inward))
    camera = new_blend_camera(first, f"{first.name} to {second_name}")
    last = len(blend.layers) - 1
    names = ["Near" if k == 0 else "Far" if k == last else f"Layer {k + 1}" for k in range(last + 1)]
    replace_surfaces(
        camera,
        [(name, "GRID", np.eye(4), None, layer[0]) for name, layer in zip(names, blend.layers, strict=True)],
    )
    give_shapes(camera, blend)
    settings = camera.scfpf
    settings.basis = blend.basis
    settings.reparameterisation = "POLAR" if blend.polar else "RECTANGLE"
    settings.fitted_aspect = aspect
    settings.pixel_error, settings.samples = first.scfpf.pixel_error, first.scfpf.samples
    make_flexible(camera)
    approximate_lens(camera, own)
    for obj in context.selected_objects:
        obj.select_set(False)
    camera.select_set(True)
    context.view_layer.objects.active = camera
    scene.camera = camera
    return camera


def _done(camera) -> str:
    return f"'{camera.name}' is the scene's camera now: its Blend goes from one picture to the other"


class SCFPF_OT_camera_blend(Tool, bpy.types.Operator):
    """Make a flexible camera between two selected ones: its Blend, which can be animated, goes from the other
    one's picture to that of the active one, and beyond both"""

    bl_idname = "scfpf.camera_blend"
    bl_label = "Blend Cameras"

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if len(_chosen(context)) != 1:
            cls.poll_message_set("Select two flexible cameras: the active one is what the blend comes to")
            return False
        return True

    def edit(self, context, camera):
        (first,) = _chosen(context)
        aspect = picture_aspect(context.scene)
        second = read_projection(camera, context.evaluated_depsgraph_get(), aspect)
        return _done(blend_camera(context, first, second, camera.name))


def _chosen(context) -> list:
    """The selected flexible cameras besides the active one."""
    active = flexible_camera_of(context)
    return [
        obj
        for obj in context.selected_objects
        if obj.type == "CAMERA" and obj.scfpf.enabled and obj != active
    ]


def _items(_operator, _context):
    return preset_items()


class SCFPF_OT_camera_blend_preset(Tool, bpy.types.Operator):
    """Make a flexible camera between this one and a preset where it stands: its Blend, which can be animated,
    goes from this camera's picture to the preset's, and beyond both"""

    bl_idname = "scfpf.camera_blend_preset"
    bl_label = "Blend with Preset"

    preset: EnumProperty(name="Preset", description="The projection that the blend comes to", items=_items)

    def edit(self, context, camera):
        preset = shipped_preset(self.preset)
        world = np.array(camera.matrix_world, np.float64)
        second = preset.projection(picture_aspect(context.scene)).transformed(world)
        return _done(blend_camera(context, camera, second, preset.name))


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_camera_blend, SCFPF_OT_camera_blend_preset)
)
