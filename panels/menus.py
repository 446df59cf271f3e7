# SPDX-License-Identifier: GPL-3.0-or-later
"""The menus of control surfaces, and the extension's entries in Blender's menus and Preferences."""

import bpy

from ..operators.common.target import active_object
from ..operators.common.words import label_text
from ..scfpf_addon.bridge.surfaces.kinds import BLENDER_KINDS

# Blender's menus with the commands that duplicate objects.
OBJECT_MENUS = ("VIEW3D_MT_object", "VIEW3D_MT_object_context_menu")
# The kinds that most volumes are made of.
USUAL = ("PLANE", "CYLINDER", "SPHERE", "POINT")
# Where to begin, each with its icon.
BEGINNINGS = (
    ("OUTLINER_OB_CAMERA", "Add > Camera > Flexible Camera adds a camera with the viewport's view."),
    ("CAMERA_DATA", "A camera of yours: its Data tab has the panel Flexible Projection."),
    ("PRESET", "Projection Preset, in the panel, bends the picture at once. Live View shows it."),
    ("WINDOW", "In a 3D viewport press N: the panel is in the tab Flexible Projection, too."),
    ("SCENE_DATA", "Add > Camera > Flexible Camera Tutorial Scene is a town to try it with."),
)


class SCFPF_MT_surface_add(bpy.types.Menu):
    """The kinds of control surface"""

    bl_label = "Control Surface"

    def draw(self, _context):
        _draw_kinds(self.layout, USUAL)
        self.layout.separator()
        self.layout.menu("SCFPF_MT_surface_add_more")


class SCFPF_MT_surface_add_more(bpy.types.Menu):
    """Further kinds of control surface"""

    bl_label = "More"

    def draw(self, _context):
        _draw_kinds(self.layout, [key for key in BLENDER_KINDS if key not in USUAL])


def _draw_kinds(layout, keys) -> None:
    """Draw the entries of kinds of control surface."""
    for key in keys:
        kind = BLENDER_KINDS[key]
        entry = layout.operator("scfpf.surface_add", text=kind.title, icon=kind.icon)
        # As Blender's Add does: G then moves what was added.
        entry.kind, entry.select = key, True


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
            self.layout.operator(
                "scfpf.volume_mirror", text=label_text("Mirror {0}", axis), icon="MOD_MIRROR"
            ).axis = axis
        self.layout.operator("scfpf.volume_to_lattice", icon="MOD_LATTICE")
        self.layout.operator("scfpf.distance_release", icon="UNLOCKED")
        self.layout.operator("scfpf.volume_single_user", icon="LIBRARY_DATA_DIRECT")
        self.layout.operator("scfpf.camera_duplicate", icon="DUPLICATE")


class SCFPF_MT_projection_mapping(bpy.types.Menu):
    """Pictures and files for video projectors"""

    bl_label = "Projection Mapping"

    def draw(self, _context):
        self.layout.operator("scfpf.video_projector_picture", icon="OUTLINER_OB_LIGHT")
        self.layout.operator_context = "INVOKE_REGION_WIN"
        self.layout.operator("scfpf.content_mesh_export", text="Export for Media Server...", icon="EXPORT")


def _mapping_entries(menu, _context):
    menu.layout.menu("SCFPF_MT_projection_mapping", icon="OUTLINER_OB_LIGHT")


def _camera_entries(menu, _context):
    menu.layout.operator_context = "EXEC_REGION_WIN"
    menu.layout.operator(
        "scfpf.camera_add", text="Flexible Camera", icon="OUTLINER_OB_CAMERA"
    ).preset = "VIEW"
    menu.layout.menu("SCFPF_MT_camera_add_preset", icon="PRESET")
    menu.layout.operator("scfpf.camera_from_screen", icon="DESKTOP")
    menu.layout.operator("scfpf.vr_pair", icon="CAMERA_STEREO")
    menu.layout.operator_context = "INVOKE_REGION_WIN"
    menu.layout.operator(
        "scfpf.camera_from_calibration",
        text="Flexible Camera from Calibration File...",
        icon="OUTLINER_DATA_CAMERA",
    ).source = "FILE"
    menu.layout.operator(
        "scfpf.camera_from_calibration",
        text="Flexible Camera from Lens Numbers...",
        icon="OUTLINER_DATA_CAMERA",
    ).source = "NUMBERS"
    menu.layout.operator_context = "EXEC_REGION_WIN"
    menu.layout.operator("scfpf.tutorial_scene", text="Flexible Camera Tutorial Scene", icon="SCENE_DATA")


def _surface_entries(menu, _context):
    menu.layout.menu("SCFPF_MT_surface_add", icon="SURFACE_DATA")


def _duplicate_entry(menu, context):
    camera = active_object(context)
    if camera is not None and camera.type == "CAMERA" and camera.scfpf.enabled:
        menu.layout.separator()
        menu.layout.operator("scfpf.camera_duplicate", icon="DUPLICATE")


class SCFPF_Preferences(bpy.types.AddonPreferences):
    """Where to begin"""

    # Blender finds the entry by the name of the extension's package.
    bl_idname = __package__.rpartition(".")[0]

    def draw(self, _context):
        column = self.layout.column(align=True)
        for icon, text in BEGINNINGS:
            column.label(text=text, icon=icon)


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SCFPF_Preferences,
        SCFPF_MT_surface_add_more,
        SCFPF_MT_surface_add,
        SCFPF_MT_surface_specials,
        SCFPF_MT_projection_mapping,
    )
)


def register():
    _register_classes()
    bpy.types.VIEW3D_MT_camera_add.append(_camera_entries)
    bpy.types.VIEW3D_MT_add.append(_surface_entries)
    bpy.types.VIEW3D_MT_object.append(_mapping_entries)
    for menu in OBJECT_MENUS:
        getattr(bpy.types, menu).append(_duplicate_entry)


def unregister():
    for menu in OBJECT_MENUS:
        getattr(bpy.types, menu).remove(_duplicate_entry)
    bpy.types.VIEW3D_MT_object.remove(_mapping_entries)
    bpy.types.VIEW3D_MT_add.remove(_surface_entries)
    bpy.types.VIEW3D_MT_camera_add.remove(_camera_entries)
    _unregister_classes()
