# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Flexible Projection, in the camera's Data tab and in the 3D viewport's sidebar."""

import bpy

from ..operators.camera.presets import preset_items
from ..operators.common.target import active_object, camera_of, flexible_camera_of
from ..operators.common.words import label_text, translated_label
from ..operators.image.pick import pick_readout
from ..scfpf_addon.bridge.blends.blend_ends import ends_of, is_map_animated, knows_its_ends
from ..scfpf_addon.bridge.blends.camera_blend import is_baked, is_blend, is_too_coarse
from ..scfpf_addon.bridge.settings.blend_properties import MAP_KINDS
from .base import DataTab, Sidebar, Subsection, draw_lines, section_panels, shows_internals
from .mapping_stack import draw_stack
from .messages import draw_messages
from .render_button import draw_render, draw_report
from .surface_list import draw_surfaces
from .ways import draw_ways

# What each kind of map shows.
MAP_SETTINGS = {
    "NONE": (),
    "LINEAR": ("center", "angle", "border"),
    "RADIAL": ("center", "size", "border"),
    "RECTANGLE": ("center", "size", "angle", "border"),
    "IMAGE": ("is_sharp",),
    "VIEWS": ("border",),
}


class SCFPF_UL_blend(bpy.types.UIList):
    """The further cameras of a blend"""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index):
        row = layout.row(align=True)
        # A row has no room for the panel's split into name and value.
        row.use_property_split = row.use_property_decorate = False
        row.prop(item, "camera", text="", icon="CAMERA_DATA" if item.camera else "ERROR")
        row.prop(item.field, "weight", text="")


def draw_blend(layout, camera) -> None:
    """Draw the factor, the ends and the button Update Blend of a blended camera."""
    settings = camera.scfpf
    column = layout.column(align=True)
    column.prop(settings, "blend_factor", slider=True)
    if not knows_its_ends(camera):
        return
    ends = settings.blend_ends
    column.prop(ends, "first", text="", icon="CAMERA_DATA")
    if ends.second is None:
        names = {stem: name for stem, name, _text in preset_items()}
        name = translated_label(names.get(ends.preset, ends.preset))
        column.label(text=label_text("To the preset {0}, or to:", name))
    column.prop(ends, "second", text="", icon="CAMERA_DATA")
    column.operator("scfpf.blend_update", icon="FILE_REFRESH")
    second, *further = ends_of(camera)
    column = layout.column(align=True)
    draw_blend_map(column, second, bool(further))
    column = layout.column(align=True)
    draw_further(column, settings)
    if settings.active_blend < len(further):
        draw_blend_map(column, further[settings.active_blend], False)
    if is_map_animated(camera):
        column.operator("scfpf.blend_map_bake", icon="ACTION")
        if not is_baked(camera):
            column.label(text="Keyframes of the map act once baked", icon="INFO")
    if is_too_coarse(camera):
        column.label(text="Update Blend makes it finer", icon="INFO")


def draw_further(column, settings) -> None:
    """Draw the list of the further cameras of a blend, and the buttons that change it."""
    if not len(settings.blend_more):
        column.operator("scfpf.blend_camera_add", icon="ADD")
        return
    row = column.row()
    row.template_list(
        "SCFPF_UL_blend", "", settings, "blend_more", settings, "active_blend", rows=2, sort_lock=True
    )
    buttons = row.column(align=True)
    buttons.operator("scfpf.blend_camera_add", text="", icon="ADD")
    buttons.operator("scfpf.blend_camera_remove", text="", icon="REMOVE")


def draw_blend_map(column, end, has_weight: bool) -> None:
    """Draw where in the image a camera of a blend counts. has_weight: whether to draw its weight, too."""
    blend_map = end.settings
    title = next(name for kind, name, _text in MAP_KINDS if kind == blend_map.kind)
    menu = column.operator_menu_enum(
        "scfpf.blend_map", "kind", text=label_text("Map: {0}", title), icon="IMAGE_ALPHA"
    )
    menu.number = end.number
    if blend_map.kind == "IMAGE":
        column.template_ID(blend_map, "image", new="image.new", open="image.open")
    for name in MAP_SETTINGS[blend_map.kind]:
        column.prop(blend_map, name)
    if blend_map.kind in ("RADIAL", "RECTANGLE"):
        column.operator("scfpf.blend_map_around", icon="PIVOT_BOUNDBOX").number = end.number
    if blend_map.kind != "NONE":
        column.prop(blend_map, "is_inverted")
    if has_weight:
        column.prop(blend_map, "weight")


def draw_pick(layout, settings) -> None:
    """Draw the switch and button of the picked projector, and what it meets."""
    row = layout.row(align=True)
    row.prop(settings, "show_pick", text="Pick")
    row.operator("scfpf.pick", text="", icon="EYEDROPPER")
    if settings.show_pick:
        draw_lines(layout, pick_readout(settings), height=1.0)


def draw_found(layout, settings) -> None:
    """Draw the switch and button of the object found in the image, and how much of it is visible."""
    row = layout.row(align=True)
    row.prop(settings, "show_found", text="Found")
    row.operator("scfpf.find_in_image", text="", icon="VIEWZOOM")
    if settings.show_found:
        draw_lines(layout, settings.found_object.split(" · "), height=1.0)


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
        # In the Data tab of a camera that Aim sees a view from, the panel is that of the aimed one.
        if self.names_camera or camera != active_object(context):
            layout.label(text=camera.name, icon="OUTLINER_OB_CAMERA", translate=False)
        if camera.scfpf.enabled:
            draw_render(layout, camera)
            draw_ways(layout, context, camera)
            layout.menu("SCFPF_MT_presets", text="Projection Preset", icon="PRESET")
            draw_messages(layout, context, camera)
            return
        column = layout.column(align=True)
        column.operator("scfpf.camera_toggle", text="Make This Camera Flexible", icon="OUTLINER_OB_CAMERA")
        column.menu("SCFPF_MT_presets", text="Start from a Preset", icon="PRESET")


class _BlendSection(Subsection):
    bl_label = "Blend"
    bl_order = 3

    def draw_settings(self, _context, camera, _settings):
        if is_blend(camera) or knows_its_ends(camera):
            draw_blend(self.layout, camera)
            return
        column = self.layout.column(align=True)
        column.operator("scfpf.camera_blend", icon="IPO_EASE_IN_OUT")
        column.menu("SCFPF_MT_blend_presets", icon="PRESET")


class _StatisticsSection(Subsection):
    bl_label = "Statistics"
    bl_order = 11
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        if not (super().poll(context) and shows_internals(context)):
            return False
        return bool(flexible_camera_of(context).scfpf.statistics)

    def draw_settings(self, _context, _camera, settings):
        draw_report(self.layout, settings.statistics)


class _SurfacesSection(Subsection):
    bl_label = "Control Surfaces"
    bl_order = 4

    def draw_settings(self, context, _camera, settings):
        draw_surfaces(self.layout, context, settings)


class _ProjectorsSection(Subsection):
    bl_label = "Projectors"
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, _camera, settings):
        layout = self.layout
        # The sidebar is narrow: labels are short, and the tooltips have the full names.
        layout.prop(settings, "basis", text="Shape")
        layout.prop(settings, "reparameterisation", text="Mapping")
        for axis in "uv":
            column = layout.column(align=True)
            column.prop(settings, f"{axis}_range", index=0, text=label_text("{0} Start", axis.upper()))
            column.prop(settings, f"{axis}_range", index=1, text="End")
        column = layout.column(align=True)
        column.prop(settings, "fit")
        row = column.row()
        row.active = settings.fit != "NONE"
        row.prop(settings, "fitted_aspect", text="Aspect")


class _MappingsSection(Subsection):
    bl_label = "Image Mappings"
    bl_order = 6
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, camera, _settings):
        draw_stack(self.layout, camera)


class _QualitySection(Subsection):
    bl_label = "Quality"
    bl_order = 7
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, _camera, settings):
        self.layout.prop(settings, "pixel_error")
        self.layout.prop(settings, "samples")


class _DisplaySection(Subsection):
    bl_label = "Viewport Display"
    bl_order = 10
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, context, _camera, settings):
        self.layout.prop(settings, "show_projectors", text="Projectors")
        row = self.layout.row()
        row.active = settings.show_projectors
        row.prop(settings, "projector_count", text="Count")
        column = self.layout.column()
        column.active = settings.show_projectors
        column.prop(settings, "show_folds", text="Folds")
        if shows_internals(context):
            column.prop(settings, "iso_surfaces", text="Iso Count")
            row = column.row()
            row.active = settings.iso_surfaces == 1
            row.prop(settings, "iso_t", text="Iso t")
        draw_pick(column, settings)
        draw_found(column, settings)


def _lens_note(panel, context):
    """Say in Blender's panel Lens that the lens of a flexible camera approximates its volume."""
    if DataTab.poll(context) and active_object(context).scfpf.enabled:
        column = panel.layout.column(align=True)
        column.label(text="Pictures show the volume.", icon="INFO")
        column.label(text="This lens is an approximation.", icon="BLANK1")


class SCFPF_PT_data(DataTab, _MainSection, bpy.types.Panel):
    pass


class SCFPF_PT_view(Sidebar, _MainSection, bpy.types.Panel):
    pass


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SCFPF_UL_blend,
        SCFPF_PT_data,
        SCFPF_PT_view,
        *section_panels(_BlendSection, "blend"),
        *section_panels(_SurfacesSection, "surfaces"),
        *section_panels(_ProjectorsSection, "projectors"),
        *section_panels(_MappingsSection, "mappings"),
        *section_panels(_QualitySection, "quality"),
        *section_panels(_DisplaySection, "display"),
        *section_panels(_StatisticsSection, "statistics"),
    )
)


def register():
    _register_classes()
    bpy.types.DATA_PT_lens.prepend(_lens_note)


def unregister():
    bpy.types.DATA_PT_lens.remove(_lens_note)
    _unregister_classes()
