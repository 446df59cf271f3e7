# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own presets: save, apply and remove them, and share them as files."""

import pathlib
import time

import bpy
from bpy.props import BoolProperty, StringProperty

from ...scfpf_addon.bridge.camera import preset_folder
from ...scfpf_addon.bridge.camera.camera_preset import preset_of
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.presets.preset import PresetError, read_preset
from ..common.target import flexible_camera_of
from ..common.tool import Action, Tool, tooltip_of
from ..common.words import report_text
from .presets import PresetOperator, ReadsPresetFile

# By file name: the file's time and size when it was read, the preset's name and its description.
_read: dict[str, tuple[tuple[int, int], str, str]] = {}
# Seconds that a menu may spend on reading files; the others wait until it is opened again.
MENU_SECONDS = 2.0


def own_presets() -> list[tuple[str, str, str]]:
    """(stem, name, description) of each own preset, by name; a damaged file has its error as description."""
    found = []
    start = time.monotonic()
    for path in preset_folder.own_files():
        try:
            facts = path.stat()
        except OSError:
            continue
        key = facts.st_mtime_ns, facts.st_size
        known = _read.get(path.name)
        if known is None or known[0] != key:
            if time.monotonic() - start > MENU_SECONDS:
                found.append((path.stem, path.stem, "Not read yet: open the menu again"))
                continue
            try:
                preset = read_preset(path)
                known = (key, preset.name, preset.description)
            except PresetError as error:
                known = (key, path.stem, str(error))
            _read[path.name] = known
        found.append((path.stem, known[1], known[2]))
    return sorted(found, key=lambda item: item[1].lower())


def _store(preset, replace: bool) -> str:
    """Add a preset to the list with an image of its volume; returns the message to report."""
    path = preset_folder.store_own(preset, replace)
    message = report_text("The preset '{0}' is in the menu under Your Own", preset.name)
    try:
        preset_folder.store_thumbnail(preset, path)
    except PresetError as error:
        return report_text("{0}, without a thumbnail: {1}", message, error)
    return message


class _SavesVolume(Tool):
    """Make a preset of the camera's volume at this frame."""

    bl_options = {"REGISTER"}

    name: StringProperty(name="Name", description="Name of the preset in menus", maxlen=63)
    description: StringProperty(
        name="Description", description="Description of the projection: the tooltip in the menu", maxlen=1000
    )

    def invoke(self, context, event):
        if not self.name:
            self.name = flexible_camera_of(context).name
        return self.ask(context, event)

    def preset(self, context, camera):
        """The camera's volume as a preset. Raises USER_ERRORS."""
        if not self.name.strip():
            raise PresetError("Give the preset a name")
        aspect = image_aspect(context.scene)
        depsgraph = context.evaluated_depsgraph_get()
        return preset_of(camera, depsgraph, aspect, self.name, self.description)


class SCFPF_OT_preset_save(_SavesVolume, bpy.types.Operator):
    """Save the camera's volume and mappings as a preset of your own, which the preset menus list"""

    bl_idname = "scfpf.preset_save"
    bl_label = "Save as Preset"

    replace: BoolProperty(
        name="Replace", description="Replace a preset of your own that has this name", default=False
    )

    def ask(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def edit(self, context, camera):
        preset = self.preset(context, camera)
        return _store(preset, self.replace)


class SCFPF_OT_preset_export(_SavesVolume, bpy.types.Operator):
    """Write the camera's volume and mappings into a preset file (JSON) to share"""

    bl_idname = "scfpf.preset_export"
    bl_label = "Export Projection Preset"

    filepath: StringProperty(name="File", description="The preset file to write", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    # Blender's file browser looks for this property of exporters.
    check_existing: BoolProperty(
        name="Check Existing", description="Warn before a file is replaced", default=True, options={"HIDDEN"}
    )

    def ask(self, context, _event):
        if not self.filepath:
            self.filepath = f"{preset_folder.stem_of(self.name)}.json"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def edit(self, context, camera):
        if not self.filepath:
            raise PresetError("Choose a file to write the preset into")
        path = pathlib.Path(bpy.path.abspath(bpy.path.ensure_ext(self.filepath, ".json")))
        preset_folder.write_preset(self.preset(context, camera), path)
        return report_text("The preset is in {0}", path.name)


class SCFPF_OT_preset_import(ReadsPresetFile, Action, bpy.types.Operator):
    """Add a preset file (JSON) to your own presets: it is checked, and cannot run code"""

    bl_idname = "scfpf.preset_import"
    bl_label = "Import Projection Preset"
    bl_options = {"REGISTER"}

    replace: BoolProperty(
        name="Replace", description="Replace a preset of your own that has the same name", default=False
    )

    def act(self, _context):
        return _store(self.read(), self.replace)


class SCFPF_OT_preset_apply_own(PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset of your own"""

    bl_idname = "scfpf.preset_apply_own"
    bl_label = "Apply Your Own Preset"

    preset: StringProperty(name="Preset", description="The name of the preset's file, without its ending")

    @classmethod
    def description(cls, _context, properties):
        return tooltip_of(cls, own_presets(), properties.preset)

    def read(self):
        return read_preset(preset_folder.own_file(self.preset))


class SCFPF_OT_preset_remove(Action, bpy.types.Operator):
    """Remove a preset of your own; its file is deleted"""

    bl_idname = "scfpf.preset_remove"
    bl_label = "Remove Your Own Preset"
    bl_options = {"REGISTER"}

    preset: StringProperty(name="Preset", description="The name of the preset's file, without its ending")

    def act(self, _context):
        preset_folder.remove_own(self.preset)
        return report_text("The preset '{0}' is removed", self.preset)

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_preset_save,
        SCFPF_OT_preset_export,
        SCFPF_OT_preset_import,
        SCFPF_OT_preset_apply_own,
        SCFPF_OT_preset_remove,
    )
)
