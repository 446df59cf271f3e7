# SPDX-License-Identifier: GPL-3.0-or-later
"""Menus, and our entries in Blender's own."""

import bpy

from ..operators.camera.presets import preset_groups
from ..scfpf_addon.bridge.surfaces.kinds import BLENDER_KINDS
from .thumbnails import draw_entries

# Blender's menus that duplicate objects.
OBJECT_MENUS = ("VIEW3D_MT_object", "VIEW3D_MT_object_context_menu")


class SCFPF_MT_surface_add(bpy.types.Menu):
    """The kinds of control surface"""

    bl_label = "Control Surface"

    def draw(self, _context):
        for key, kind in BLENDER_KINDS.items():
            self.layout.operator("scfpf.surface_add", text=kind.title, icon=kind.icon).kind = key


def _group_menu(identifier: str, group: str, items, operator: str) -> type[bpy.types.Menu]:
    """A menu of one group of presets, whose entries call an operator."""

    def draw(self, _context):
        self.layout.operator_context = "EXEC_REGION_WIN"
        draw_entries(self.layout, operator, items)

    contents = {"__doc__": f"Ready-made projections: {group}", "bl_label": group, "draw": draw}
    return type(identifier, (bpy.types.Menu,), contents)


def _group_menus(prefix: str, operator: str) -> tuple[type[bpy.types.Menu], ...]:
    return tuple(
        _group_menu(f"{prefix}_{number}", group, items, operator)
        for number, (group, items) in enumerate(preset_groups())
    )


APPLY_MENUS = _group_menus("SCFPF_MT_presets_group", "scfpf.preset_apply")
BLEND_MENUS = _group_menus("SCFPF_MT_blend_group", "scfpf.camera_blend_preset")
ADD_MENUS = _group_menus("SCFPF_MT_camera_add_group", "scfpf.camera_add")


class SCFPF_MT_presets(bpy.types.Menu):
    """Ready-made projections for this camera"""

    bl_label = "Projection Presets"

    def draw(self, _context):
        for menu in APPLY_MENUS:
            # Beside entries with icons a long name would be cut off without one.
            self.layout.menu(menu.__name__, icon="BLANK1")
        self.layout.separator()
        self.layout.menu("SCFPF_MT_presets_own", icon="USER")
        self.layout.operator(
            "scfpf.camera_from_camera", text="This Camera's Own Frustum", icon="OUTLINER_OB_CAMERA"
        )
        self.layout.operator("scfpf.preset_load", text="From File...", icon="FILE_FOLDER")


class SCFPF_MT_camera_add_preset(bpy.types.Menu):
    """Flexible cameras with a ready-made projection"""

    bl_label = "Flexible Camera Preset"

    def draw(self, _context):
        for menu in ADD_MENUS:
            self.layout.menu(menu.__name__)


class SCFPF_MT_blend_presets(bpy.types.Menu):
    """Ready-made projections that this camera can be blended with"""

    bl_label = "Blend with Preset"

    def draw(self, _context):
        for menu in BLEND_MENUS:
            self.layout.menu(menu.__name__)


class SCFPF_MT_surface_specials(bpy.types.Menu):
    """More about control surfaces"""

    bl_label = "Control Surface Specials"

    def draw(self, _context):
        self.layout.operator("scfpf.surface_select", icon="RESTRICT_SELECT_OFF")
        self.layout.operator("scfpf.surface_attach", icon="LINKED")
        self.layout.separator()
        self.layout.operator("scfpf.surface_insert", icon="ADD")
        self.layout.operator("scfpf.surface_duplicate", icon="DUPLICATE")
        self.layout.operator("scfpf.surface_subdivide", icon="MOD_SUBSURF")
        self.layout.operator("scfpf.surface_equalise", icon="MOD_LENGTH")
        self.layout.operator("scfpf.surface_to_patch", icon="SURFACE_NSURFACE")
        self.layout.operator("scfpf.surface_to_grid", icon="MESH_GRID")
        self.layout.operator("scfpf.surface_apply_scale", icon="CON_SIZELIKE")
        self.layout.operator("scfpf.surface_align", icon="CON_ROTLIKE")
        self.layout.operator("scfpf.surface_snap_to_view", icon="HIDE_OFF")
        self.layout.separator()
        self.layout.operator("scfpf.volume_frame", icon="VIEW_CAMERA")
        self.layout.operator("scfpf.volume_fit", icon="SHADING_BBOX")
        self.layout.operator("scfpf.volume_swap", icon="ARROW_LEFTRIGHT")
        for axis in "UV":
            self.layout.operator("scfpf.volume_mirror", text=f"Mirror {axis}", icon="MOD_MIRROR").axis = axis
        self.layout.operator("scfpf.volume_to_lattice", icon="MOD_LATTICE")
        self.layout.operator("scfpf.volume_single_user", icon="LIBRARY_DATA_DIRECT")
        self.layout.operator("scfpf.camera_duplicate", icon="DUPLICATE")
        self.layout.operator("scfpf.camera_blend", icon="IPO_EASE_IN_OUT")
        self.layout.menu("SCFPF_MT_blend_presets", icon="IPO_EASE_IN_OUT")


def _camera_entries(menu, _context):
    menu.layout.operator_context = "EXEC_REGION_WIN"
    menu.layout.operator(
        "scfpf.camera_add", text="Flexible Camera", icon="OUTLINER_OB_CAMERA"
    ).preset = "VIEW"
    menu.layout.menu("SCFPF_MT_camera_add_preset", icon="PRESET")
    menu.layout.operator("scfpf.tutorial_scene", text="Flexible Camera Tutorial Scene", icon="SCENE_DATA")


def _surface_entries(menu, _context):
    menu.layout.menu("SCFPF_MT_surface_add", icon="SURFACE_DATA")


def _duplicate_entry(menu, context):
    camera = context.object
    if camera is not None and camera.type == "CAMERA" and camera.scfpf.enabled:
        menu.layout.separator()
        menu.layout.operator("scfpf.camera_duplicate", icon="DUPLICATE")


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SCFPF_MT_surface_add,
        *APPLY_MENUS,
        SCFPF_MT_presets,
        *ADD_MENUS,
        *BLEND_MENUS,
        SCFPF_MT_blend_presets,
        SCFPF_MT_camera_add_preset,
        SCFPF_MT_surface_specials,
    )
)


def register():
    _register_classes()
    bpy.types.VIEW3D_MT_camera_add.append(_camera_entries)
    bpy.types.VIEW3D_MT_add.append(_surface_entries)
    for menu in OBJECT_MENUS:
        getattr(bpy.types, menu).append(_duplicate_entry)


def unregister():
    for menu in OBJECT_MENUS:
        getattr(bpy.types, menu).remove(_duplicate_entry)
    bpy.types.VIEW3D_MT_add.remove(_surface_entries)
    bpy.types.VIEW3D_MT_camera_add.remove(_camera_entries)
    _unregister_classes()
