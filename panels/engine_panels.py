# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the Properties editor for the render engine Flexible Projection: its own, and Blender's."""

import bpy

from ..operators.common.target import active_object
from ..scfpf_addon.bridge.blender.rig_mark import camera_behind
from ..scfpf_addon.bridge.render.render_engine import ENGINE
from ..scfpf_addon.bridge.render.render_passes import PASS_SWITCHES
from ..scfpf_addon.cycles.engine_choice import ignored_camera
from .base import draw_text, split_properties
from .render_button import draw_caster_fault, draw_ignored

# Panels for every engine are marked BLENDER_RENDER. These have settings without effect here, or are plainer
# versions of those in TAKEN.
LEFT_OUT = ("DATA_PT_light", "DATA_PT_spot", "NODE_DATA_PT_light", "MATERIAL_PT_freestyle_line")
LEFT_OUT_FAMILIES = ("RENDER_PT_freestyle", "VIEWLAYER_PT_freestyle")
# EEVEE's panels of materials, worlds and lights, which work for this engine too.
TAKEN = (
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "DATA_PT_EEVEE_light",
    "DATA_PT_EEVEE_light_shadow",
    "NODE_DATA_PT_EEVEE_light",
)


def _blenders_panels():
    """Blender's panels that this engine shows too."""
    for panel in bpy.types.Panel.__subclasses__():
        name = panel.__name__
        shared = "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())
        if name in TAKEN or (shared and name not in LEFT_OUT and not name.startswith(LEFT_OUT_FAMILIES)):
            yield panel


class EnginePanel:
    """A panel of the Properties editor that only the engine Flexible Projection shows."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class SCFPF_PT_engine_camera(EnginePanel, bpy.types.Panel):
    """The camera of F12, and how exactly it is rendered"""

    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context):
        layout = split_properties(self)
        draw_caster_fault(layout)
        scene = context.scene
        layout.prop(scene, "camera")
        camera = camera_behind(scene.camera)
        if camera is None:
            layout.operator("scfpf.camera_add", icon="ADD")
            return
        column = layout.column()
        column.prop(camera.scfpf, "samples")
        row = column.row()
        # Straight projectors have no such error.
        row.active = camera.scfpf.enabled
        row.prop(camera.scfpf, "pixel_error")
        column.prop(scene.scfpf_sampling, "world_shadows")
        if scene.scfpf_sampling.world_shadows:
            column.label(text="Up to half the time again, for worlds of one color", icon="TIME")
        if not camera.scfpf.enabled:
            layout.label(text="An ordinary camera: F12 renders its view", icon="INFO")


class SCFPF_PT_engine_pattern(EnginePanel, bpy.types.Panel):
    """Placement of samples; the Render button uses it too"""

    bl_label = "Pattern and Adaptive Sampling"
    bl_parent_id = "SCFPF_PT_engine_camera"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = split_properties(self)
        options = context.scene.scfpf_sampling
        row = layout.row()
        row.active = not options.use_adaptive
        row.prop(options, "pattern")
        layout.prop(options, "use_adaptive")
        column = layout.column()
        column.active = options.use_adaptive
        column.prop(options, "adaptive_threshold")
        column.prop(options, "adaptive_least")
        camera = camera_behind(context.scene.camera)
        if options.use_adaptive and camera and camera.scfpf.samples <= options.adaptive_least:
            layout.label(text="No effect: raise Samples above Min Samples", icon="INFO")


class SCFPF_PT_engine_motion_blur(EnginePanel, bpy.types.Panel):
    """Blur of objects, lights, cameras and control surfaces that move while the shutter is open"""

    bl_label = "Motion Blur"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        layout = split_properties(self)
        scene = context.scene
        layout.active = scene.render.use_motion_blur
        layout.prop(scene.render, "motion_blur_position")
        layout.prop(scene.render, "motion_blur_shutter")
        layout.prop(scene.scfpf_sampling, "motion_steps")
        camera = camera_behind(scene.camera)
        if camera and camera.scfpf.samples < scene.scfpf_sampling.motion_steps:
            layout.label(text="Fewer samples than steps: raise Samples", icon="INFO")


class SCFPF_PT_engine_light_paths(EnginePanel, bpy.types.Panel):
    """Limits of reflections, refractions and transparency: the scene's settings for Cycles"""

    bl_label = "Light Paths"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.scene, "cycles")

    def draw(self, context):
        layout = split_properties(self, decorate=False)
        cycles = context.scene.cycles
        column = layout.column(align=True)
        column.prop(cycles, "max_bounces", text="Max Bounces")
        column.prop(cycles, "glossy_bounces", text="Mirrors")
        column.prop(cycles, "transmission_bounces", text="Glass")
        layout.prop(cycles, "transparent_max_bounces", text="Transparent")


class SCFPF_PT_engine_film(EnginePanel, bpy.types.Panel):
    """The pixel filter, and the background of the picture"""

    bl_label = "Film"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = split_properties(self, decorate=False)
        scene = context.scene
        if hasattr(scene, "cycles"):
            layout.prop(scene.cycles, "film_exposure")
        layout.prop(scene.render, "film_transparent", text="Transparent")
        layout.use_property_decorate = True
        layout.prop(scene.scfpf_sampling, "pixel_filter")
        row = layout.row()
        row.active = scene.scfpf_sampling.pixel_filter != "BOX"
        row.prop(scene.render, "filter_size")


class SCFPF_PT_engine_performance(EnginePanel, bpy.types.Panel):
    """Number of threads, which does not change the picture, and memory"""

    bl_label = "Performance"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = split_properties(self, decorate=False)
        render = context.scene.render
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == "FIXED"
        column.prop(render, "threads")
        layout.prop(render, "use_persistent_data", text="Keep Scene in Memory")


class SCFPF_PT_engine_passes(EnginePanel, bpy.types.Panel):
    """Passes that F12 makes beside the picture"""

    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout = split_properties(self, decorate=False)
        view_layer = context.view_layer
        for heading in ("Data", "Light", "Projectors", "Indices"):
            column = layout.column(heading=heading, align=True)
            for each in PASS_SWITCHES:
                if each.heading == heading:
                    owner = each.owner(view_layer)
                    label = each.label or owner.bl_rna.properties[each.property].name
                    column.prop(owner, each.property, text=label)
        column = layout.column(heading="Cryptomatte", align=True)
        column.prop(view_layer, "use_pass_cryptomatte_object", text="Object")
        column.prop(view_layer, "use_pass_cryptomatte_material", text="Material")
        row = column.row()
        row.active = view_layer.use_pass_cryptomatte_object or view_layer.use_pass_cryptomatte_material
        row.prop(view_layer, "pass_cryptomatte_depth", text="Levels")
        if view_layer.use_pass_z:
            draw_text(layout, "Depth: Cycles' in a camera's own view, else from the near surface", "INFO")


class SCFPF_PT_engine_filter(EnginePanel, bpy.types.Panel):
    """Parts of the scene that the view layer leaves out, and overrides of its material and world"""

    bl_label = "Filter and Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = split_properties(self, decorate=False)
        view_layer = context.view_layer
        column = layout.column(heading="Include", align=True)
        column.prop(view_layer, "use_sky", text="Environment")
        column.prop(view_layer, "use_solid", text="Surfaces")
        row = layout.row(heading="Use")
        row.active = context.scene.render.use_motion_blur
        row.prop(view_layer, "use_motion_blur", text="Motion Blur")
        layout.prop(view_layer, "material_override")
        layout.prop(view_layer, "world_override")


class SCFPF_PT_engine_beam(EnginePanel, bpy.types.Panel):
    """Spread of an area light's light"""

    bl_label = "Beam Shape"
    bl_parent_id = "DATA_PT_EEVEE_light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None and context.light.type == "AREA"

    def draw(self, context):
        layout = split_properties(self)
        layout.prop(context.light, "spread")
        if hasattr(context.light, "cycles"):
            layout.prop(context.light.cycles, "is_portal", text="Portal")


class SCFPF_PT_engine_ray_visibility(EnginePanel, bpy.types.Panel):
    """Kinds of rays that meet this object, or kinds of light that a light gives"""

    bl_label = "Ray Visibility"
    bl_parent_id = "OBJECT_PT_visibility"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        return (
            super().poll(context)
            and active_object(context) is not None
            and active_object(context).type != "CAMERA"
        )

    def draw(self, context):
        layout = split_properties(self)
        owner = active_object(context)
        if owner.type == "LIGHT":
            layout.prop(owner, "visible_diffuse", text="Diffuse")
            layout.prop(owner, "visible_glossy", text="Highlights")
            return
        layout.prop(owner, "visible_camera", text="Projectors")
        layout.prop(owner, "visible_glossy", text="Mirrors")
        layout.prop(owner, "visible_transmission", text="Glass")
        layout.prop(owner, "visible_shadow", text="Shadow")
        layout.prop(owner, "is_shadow_catcher")


class SCFPF_PT_engine_world_visibility(EnginePanel, bpy.types.Panel):
    """Visibility of the world to projectors that meet nothing"""

    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context):
        layout = split_properties(self)
        layout.prop(context.world.cycles_visibility, "camera", text="Projectors")


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SCFPF_PT_engine_camera,
        SCFPF_PT_engine_pattern,
        SCFPF_PT_engine_motion_blur,
        SCFPF_PT_engine_light_paths,
        SCFPF_PT_engine_film,
        SCFPF_PT_engine_performance,
        SCFPF_PT_engine_passes,
        SCFPF_PT_engine_filter,
        SCFPF_PT_engine_beam,
        SCFPF_PT_engine_ray_visibility,
        SCFPF_PT_engine_world_visibility,
    )
)


def draw_engine(self, context):
    """Warn below the choice of the render engine if F12 ignores a flexible camera."""
    camera = ignored_camera(context.scene)
    if camera is not None:
        column = self.layout.column()
        # The button of the Cycles rig must act on this camera, whichever object is active.
        column.context_pointer_set("object", camera)
        draw_ignored(column, context.scene)
        column.operator("scfpf.engine_use", icon="RENDER_STILL")
        column.operator("scfpf.cycles_use", icon="SHADING_RENDERED")


def register():
    _register_classes()
    bpy.types.RENDER_PT_context.append(draw_engine)
    for panel in _blenders_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    bpy.types.RENDER_PT_context.remove(draw_engine)
    for panel in _blenders_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    _unregister_classes()
