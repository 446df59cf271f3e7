# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's own presets: the present volume saved, listed in the menu, shared as files, removed."""

import pathlib
import time

import bpy
from bpy.props import BoolProperty, StringProperty

from ...scfpf_addon.bridge.camera import camera_preset
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.presets.preset import PresetError, read_preset
from ..common.errors import BAD_INPUT, refused
from ..common.target import flexible_camera_of
from ..common.tool import Tool
from .presets import PresetOperator

# Names and descriptions by file, and the file's time and size when they were read; strings only.
_read: dict[str, tuple[tuple[int, int], str, str]] = {}
# Seconds that a menu may spend on reading files; it reads the others when it is opened again.
MENU_SECONDS = 2.0


def own_presets() -> list[tuple[str, str, str]]:
    """(stem, name, description) of each own preset, by name; a file that is none says so."""
    found = []
    start = time.monotonic()
    for path in camera_preset.own_files():
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


def _kept(preset, replace: bool) -> str:
    """Take a preset into the list, with a picture of its volume; returns what to say of it."""
    path = camera_preset.store_own(preset, replace)
    message = f"The preset '{preset.name}' is in the menu under Your Own"
    try:
        camera_preset.store_picture(preset, path)
    except PresetError as error:
        return f"{message}, without a thumbnail: {error}"
    return message


class _SavesVolume(Tool):
    """Makes a preset of the camera's present volume."""

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
        """The volume as it is now. Raises what BAD_INPUT lists."""
        if not self.name.strip():
            raise PresetError("Give the preset a name")
        aspect = image_aspect(context.scene)
        depsgraph = context.evaluated_depsgraph_get()
        return camera_preset.preset_of(camera, depsgraph, aspect, self.name, self.description)


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
        return _kept(preset, self.replace)


class SCFPF_OT_preset_export(_SavesVolume, bpy.types.Operator):
    """Write the camera's volume and mappings into a preset file (JSON), to be shared"""

    bl_idname = "scfpf.preset_export"
    bl_label = "Export Projection Preset"

    filepath: StringProperty(name="File", description="The preset file to write", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def ask(self, context, _event):
        if not self.filepath:
            self.filepath = f"{camera_preset.stem_of(self.name)}.json"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def edit(self, context, camera):
        if not self.filepath:
            raise PresetError("Choose a file to write the preset into")
        path = pathlib.Path(bpy.path.abspath(bpy.path.ensure_ext(self.filepath, ".json")))
        camera_preset.write_preset(self.preset(context, camera), path)
        return f"The preset is in {path.name}"


class SCFPF_OT_preset_import(bpy.types.Operator):
    """Add a preset file (JSON) to your own presets. It is checked, and is data only"""

    bl_idname = "scfpf.preset_import"
    bl_label = "Import Projection Preset"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", description="The preset file to read", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    replace: BoolProperty(
        name="Replace", description="Replace a preset of your own that has the same name", default=False
    )

    def execute(self, _context):
        try:
            preset = read_preset(pathlib.Path(bpy.path.abspath(self.filepath)))
            message = _kept(preset, self.replace)
        except BAD_INPUT as error:
            return refused(self, error)
        self.report({"INFO"}, message)
        return {"FINISHED"}

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SCFPF_OT_preset_apply_own(PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset of your own"""

    bl_idname = "scfpf.preset_apply_own"
    bl_label = "Apply Your Own Preset"

    preset: StringProperty(name="Preset", description="The name of the preset's file, without its ending")

    @classmethod
    def description(cls, _context, properties):
        texts = {stem: text for stem, _name, text in own_presets()}
        return texts.get(properties.preset) or cls.__doc__

    def read(self):
        return read_preset(camera_preset.own_file(self.preset))


class SCFPF_OT_preset_remove(bpy.types.Operator):
    """Remove a preset of your own; its file is deleted"""

    bl_idname = "scfpf.preset_remove"
    bl_label = "Remove Your Own Preset"
    bl_options = {"REGISTER"}

    preset: StringProperty(name="Preset", description="The name of the preset's file, without its ending")

    def execute(self, _context):
        try:
            camera_preset.remove_own(self.preset)
        except BAD_INPUT as error:
            return refused(self, error)
        self.report({"INFO"}, f"The preset '{self.preset}' is removed")
        return {"FINISHED"}

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
