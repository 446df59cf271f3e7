# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of a flexible camera: the same in the camera's Data tab and in the 3D viewport's sidebar."""

import textwrap

import bpy

from ..operators.common.target import camera_of, flexible_camera_of
from ..operators.image.pick import pick_readout
from ..scfpf_addon.bridge.blender.mesh_grid import SurfaceError
from ..scfpf_addon.bridge.camera.image_fit import needs_fit
from ..scfpf_addon.bridge.camera.read_projection import is_lattice_volume
from ..scfpf_addon.bridge.camera.surface_scale import is_scaled, whole_scale, world_sizes
from ..scfpf_addon.bridge.render import render_job
from ..scfpf_addon.bridge.render.image_size import image_aspect
from ..scfpf_addon.bridge.render.render_errors import RenderError
from ..scfpf_addon.bridge.render.result_image import result_image
from ..scfpf_addon.bridge.surfaces.surface_object import parameter_properties
from ..scfpf_addon.bridge.sync.handlers import sharers
from ..scfpf_addon.casting.scene.embreex import caster_fault
from ..scfpf_addon.cycles.engine_choice import engine_name, ignored_camera
from ..scfpf_addon.cycles.rig_data import rig_of
from ..scfpf_addon.projection.editing.volume_edits import EditingError
from .blend import draw_blend
from .mapping_stack import draw_stack
from .surface_list import absence_of

# Letters that a line of the sidebar holds, about.
LINE = 36
# Where a control surface may be that the scene does not have.
ABSENT = {
    "deleted": "A control surface was deleted",
    "in another scene": "A control surface is in another scene",
    "in no scene": "A control surface is in no scene",
}


def problems(scene, camera) -> list[str]:
    """Reasons why a flexible camera cannot render, in a few words each."""
    slots = camera.scfpf.surfaces
    found = []
    if len(slots) < 2 and not is_lattice_volume(slots):
        found.append("A volume needs two control surfaces")
    absent = {absence_of(scene, slot) for slot in slots}
    return found + [text for where, text in ABSENT.items() if where in absent]


def draw_render(layout, context, camera) -> None:
    """The Render button, or the progress of the render that is running; then what the last one did."""
    job = render_job.current()
    row = layout.row(align=True)
    row.scale_y = 1.5
    if job is None:
        row.operator("scfpf.render", text="Render", icon="RENDER_STILL").camera = camera.name
        if result_image() is not None:
            row.operator("scfpf.result_show", text="", icon="IMAGE_DATA")
    else:
        text = "Canceling" if job.cancelled else f"Rendering {job.progress:.0%}"
        row.progress(factor=job.progress, text=text)
        row.operator("scfpf.render_cancel", text="", icon="X")
    for problem in problems(context.scene, camera):
        layout.label(text=problem, icon="ERROR")
    if ignored_camera(context.scene) == camera:
        draw_ignored(layout, context.scene, camera)
    if context.scene.render.use_multiview:
        layout.label(text="One view: F12 renders all", icon="INFO")
    draw_caster_fault(layout)
    draw_parts(layout, camera.scfpf.report)


def draw_ignored(layout, scene, camera) -> None:
    """A line and buttons while F12 ignores the flexible camera; offers a rig if the scene has none."""
    column = layout.column(align=True)
    column.label(text=f"F12 ({engine_name(scene)}) ignores the volume", icon="ERROR")
    column.operator("scfpf.engine_use", icon="RENDER_STILL")
    rig = rig_of(scene)
    if rig is None or rig.scfpf_rig.camera != camera:
        column.operator("scfpf.cycles_rig", icon="SHADING_RENDERED")


def draw_parts(layout, text: str) -> None:
    """The parts of a report in small lines."""
    if text:
        column = layout.column(align=True)
        column.scale_y = 0.8
        column.active = False
        for part in text.split(" · "):
            column.label(text=part)


def draw_caster_fault(layout) -> None:
    """Why the Render button cannot work, in lines that fit the sidebar, and what works all the same."""
    fault = caster_fault()
    if fault:
        column = layout.column(align=True)
        column.alert = True
        draw_text(column, f"Rendering is off: {fault}", "ERROR")
        draw_text(column, "Editing, the live preview and Cycles work without it.", "BLANK1")


def draw_text(layout, text: str, icon: str) -> None:
    """A text in as many lines of the sidebar as it needs, with an icon before the first."""
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, LINE)):
        column.label(text=line, icon="BLANK1" if number else icon)


def draw_fit(layout, scene, camera) -> None:
    """A button while the resolution has another shape than the volume was made for."""
    try:
        wanted = needs_fit(camera, image_aspect(scene))
    except RenderError:
        return  # Rendering says that the picture is too large.
    if wanted:
        layout.operator("scfpf.volume_fit_picture", icon="MOD_LENGTH")


def draw_shared(layout, camera) -> None:
    """A line and a button while another camera has surfaces of this one: duplicating a camera shares them."""
    others = sharers(camera)
    if others:
        with_whom = f"'{others[0]}'" if len(others) == 1 else f"{len(others)} cameras"
        column = layout.column(align=True)
        column.label(text=f"Surfaces shared with {with_whom}", icon="INFO")
        column.operator("scfpf.volume_single_user", icon="LIBRARY_DATA_DIRECT")


def draw_pick(layout, settings) -> None:
    """The picked projector: switch, button, and what it met."""
    row = layout.row(align=True)
    row.prop(settings, "show_pick", text="Pick")
    row.operator("scfpf.pick", text="", icon="EYEDROPPER")
    if settings.show_pick:
        column = layout.column(align=True)
        column.active = False
        for text in pick_readout(settings):
            column.label(text=text)


def draw_found(layout, settings) -> None:
    """The object found in the picture: switch, button, and how much of it is to be seen."""
    row = layout.row(align=True)
    row.prop(settings, "show_found", text="Found")
    row.operator("scfpf.find_in_image", text="", icon="VIEWZOOM")
    if settings.show_found:
        column = layout.column(align=True)
        column.active = False
        for text in settings.found_object.split(" · "):
            column.label(text=text)


def draw_world_sizes(layout, scene, surface) -> None:
    """The sizes of a scaled surface in the world, and the button that puts the scale into them."""
    units = scene.unit_settings
    try:
        sizes = world_sizes(surface)
    except SurfaceError:
        return  # Said where the sizes would stand.
    except EditingError:
        factors = " × ".join(f"{factor:.4g}" for factor in whole_scale(surface))
        layout.label(text=f"In the World: Scaled {factors}", icon="INFO")
    else:
        for number, (label, length) in enumerate(sizes):
            text = f"{length:.4g}"
            if units.system != "NONE":
                text = bpy.utils.units.to_string(
                    units.system, "LENGTH", length * units.scale_length, precision=4, split_unit=False
                )
            layout.label(text=f"{label} in the World: {text}", icon="BLANK1" if number else "INFO")
    layout.operator("scfpf.surface_apply_scale", icon="CON_SIZELIKE")


class _MainSection:
    bl_label = "Flexible Projection"
    names_camera = False

    def draw_header(self, context):
        camera = camera_of(context)
        if camera is not None:
            icon = "CHECKBOX_HLT" if camera.scfpf.enabled else "CHECKBOX_DEHLT"
            self.layout.operator("scfpf.camera_toggle", text="", icon=icon, emboss=False)

    def draw(self, context):
        layout = self.layout
        camera = camera_of(context)
        if camera is None:
            layout.label(text="The scene has no camera", icon="INFO")
            layout.operator("scfpf.camera_add", icon="OUTLINER_OB_CAMERA")
            return
        if self.names_camera:
            layout.label(text=camera.name, icon="OUTLINER_OB_CAMERA")
        if camera.scfpf.enabled:
            draw_render(layout, context, camera)
            draw_fit(layout, context.scene, camera)
            draw_shared(layout, camera)
            draw_blend(layout, camera)
            layout.menu("SCFPF_MT_presets", text="Projection Preset", icon="PRESET")
            return
        column = layout.column(align=True)
        column.operator("scfpf.camera_toggle", text="Make This Camera Flexible", icon="OUTLINER_OB_CAMERA")
        column.menu("SCFPF_MT_presets", text="Start from a Preset", icon="PRESET")


class _Subsection:
    """A part of the panel. bl_order: what is edited most comes first."""

    @classmethod
    def poll(cls, context):
        return flexible_camera_of(context) is not None and super().poll(context)

    def draw(self, context):
        self.layout.use_property_split = True
        camera = flexible_camera_of(context)
        self.draw_settings(context, camera, camera.scfpf)


class _StatisticsSection(_Subsection):
    bl_label = "Statistics"
    bl_order = 0  # registered before the surfaces, which have the same
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(flexible_camera_of(context).scfpf.statistics)

    def draw_settings(self, _context, _camera, settings):
        draw_parts(self.layout, settings.statistics)


class _SurfacesSection(_Subsection):
    bl_label = "Control Surfaces"
    bl_order = 0

    def draw_settings(self, context, _camera, settings):
        layout = self.layout
        row = layout.row()
        row.template_list(
            "SCFPF_UL_surfaces", "", settings, "surfaces", settings, "active_surface", rows=5, sort_lock=True
        )
        column = row.column(align=True)
        column.menu("SCFPF_MT_surface_add", text="", icon="ADD")
        column.operator("scfpf.surface_remove", text="", icon="REMOVE")
        column.separator()
        column.operator("scfpf.surface_move", text="", icon="TRIA_UP").direction = "UP"
        column.operator("scfpf.surface_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        column.separator()
        column.menu("SCFPF_MT_surface_specials", text="", icon="DOWNARROW_HLT")
        row = layout.row(align=True)
        row.operator("scfpf.edit_volume", icon="EDITMODE_HLT", depress=settings.edit_volume)
        row.operator("scfpf.volume_frame", text="", icon="VIEW_PAN")
        if settings.active_surface < len(settings.surfaces):
            self.draw_surface(context, settings.surfaces[settings.active_surface], settings.basis)

    def draw_surface(self, context, slot, basis):
        if where := absence_of(context.scene, slot):
            is_gone = where == "deleted"
            text = "Remove it from the list with -" if is_gone else "Link it to the scene, or press -"
            self.layout.label(text=text, icon="ERROR")
            return
        column = self.layout.column()
        if basis == "NURBS":
            column.prop(slot, "weight")
        column.prop(slot.object.scfpf_surface, "kind")
        try:
            for label, owner, name in parameter_properties(slot.object):
                column.prop(owner, name, text=label)
        except SurfaceError as error:
            draw_text(column, str(error), "ERROR")
        if is_scaled(slot.object):
            draw_world_sizes(self.layout.column(align=True), context.scene, slot.object)


class _ProjectorsSection(_Subsection):
    bl_label = "Projectors"
    bl_order = 1

    def draw_settings(self, _context, _camera, settings):
        layout = self.layout
        # Short labels: the sidebar is narrow, and the tooltips have the full names.
        layout.prop(settings, "basis", text="Shape")
        layout.prop(settings, "reparameterisation", text="Mapping")
        for axis in "uv":
            column = layout.column(align=True)
            column.prop(settings, f"{axis}_range", index=0, text=f"{axis.upper()} Start")
            column.prop(settings, f"{axis}_range", index=1, text="End")
        column = layout.column(align=True)
        column.prop(settings, "fit")
        row = column.row()
        row.active = settings.fit != "NONE"
        row.prop(settings, "fitted_aspect", text="Aspect")


class _MappingsSection(_Subsection):
    bl_label = "Image Mappings"
    bl_order = 1
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, camera, _settings):
        draw_stack(self.layout, camera)


class _QualitySection(_Subsection):
    bl_label = "Quality"
    bl_order = 3

    def draw_settings(self, _context, _camera, settings):
        self.layout.prop(settings, "pixel_error")
        self.layout.prop(settings, "samples")


class _DisplaySection(_Subsection):
    bl_label = "Viewport Display"
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, _camera, settings):
        self.layout.prop(settings, "show_projectors", text="Projectors")
        row = self.layout.row()
        row.active = settings.show_projectors
        row.prop(settings, "projector_count", text="Count")
        column = self.layout.column()
        column.active = settings.show_projectors
        column.prop(settings, "show_folds", text="Folds")
        column.prop(settings, "iso_surfaces", text="Iso Count")
        row = column.row()
        row.active = settings.iso_surfaces == 1
        row.prop(settings, "iso_t", text="Iso t")
        draw_pick(column, settings)
        draw_found(column, settings)


class _DataTab:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        # A pinned camera's data may be shown while another object is active.
        obj = context.object
        return obj is not None and obj.type == "CAMERA" and obj.data == context.camera


def _lens_note(panel, context):
    """Say in Blender's own panel Lens what the lens of a flexible camera is for."""
    if _DataTab.poll(context) and context.object.scfpf.enabled:
        column = panel.layout.column(align=True)
        column.label(text="Pictures show the volume.", icon="INFO")
        column.label(text="This lens is an approximation.", icon="BLANK1")


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Flexible"
    names_camera = True

    @classmethod
    def poll(cls, _context):
        return True


class SCFPF_PT_data(_DataTab, _MainSection, bpy.types.Panel):
    pass


class SCFPF_PT_data_statistics(_StatisticsSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_data_surfaces(_SurfacesSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_data_projectors(_ProjectorsSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_data_mappings(_MappingsSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_data_quality(_QualitySection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_data_display(_DisplaySection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_view(_Sidebar, _MainSection, bpy.types.Panel):
    pass


class SCFPF_PT_view_statistics(_StatisticsSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


class SCFPF_PT_view_surfaces(_SurfacesSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


class SCFPF_PT_view_projectors(_ProjectorsSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


class SCFPF_PT_view_mappings(_MappingsSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


class SCFPF_PT_view_quality(_QualitySection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


class SCFPF_PT_view_display(_DisplaySection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SCFPF_PT_data,
        SCFPF_PT_data_statistics,
        SCFPF_PT_data_surfaces,
        SCFPF_PT_data_projectors,
        SCFPF_PT_data_mappings,
        SCFPF_PT_data_quality,
        SCFPF_PT_data_display,
        SCFPF_PT_view,
        SCFPF_PT_view_statistics,
        SCFPF_PT_view_surfaces,
        SCFPF_PT_view_projectors,
        SCFPF_PT_view_mappings,
        SCFPF_PT_view_quality,
        SCFPF_PT_view_display,
    )
)


def register():
    _register_classes()
    bpy.types.DATA_PT_lens.prepend(_lens_note)


def unregister():
    bpy.types.DATA_PT_lens.remove(_lens_note)
    _unregister_classes()
