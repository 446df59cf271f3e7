# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: a ready-made projection for a camera."""

import functools
import pathlib

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..scfpf_addon.bridge.flexible_camera import apply_preset
from ..scfpf_addon.bridge.render_job import picture_aspect
from ..scfpf_addon.projection.preset import PresetError, read_preset
from .errors import BAD_INPUT
from .placement import around_subject, reaching_scale, scene_box
from .target import camera_of, poll_camera

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "presets"


@functools.cache
def preset_items() -> tuple[tuple[str, str, str], ...]:
    """(identifier, name, description) of every shipped preset, kept: Blender holds on to the strings."""
    items = []
    for path in sorted(FOLDER.glob("*.json")):
        try:
            preset = read_preset(path)
        except PresetError as error:
            # Listed all the same: choosing it reports what is wrong with it.
            items.append((path.stem, path.stem, str(error)))
        else:
            items.append((path.stem, preset.name, preset.description))
    return tuple(items)


def _items(_operator, _context):
    return preset_items()


def shipped_preset(identifier: str):
    """The preset of an item of ``preset_items``."""
    return read_preset(FOLDER / f"{identifier}.json")


def use_preset(context, camera, preset, fit: bool) -> None:
    """Replace the camera's volume by a preset's. fit: as the operators' property of that name."""
    aspect = picture_aspect(context.scene)
    box = (scene_box(context, selected_only=True) or scene_box(context)) if fit else None
    scale = 1.0
    if box is not None and preset.subject is not None:
        camera.matrix_world, scale = around_subject(preset.subject, box)
    elif box is not None:
        scale = reaching_scale(preset.fitted(aspect).volume(), camera.matrix_world, box)
    apply_preset(camera, preset, aspect, scale)


class _PresetOperator:
    bl_options = {"REGISTER", "UNDO"}

    fit: BoolProperty(
        name="Fit to Scene",
        description="Let the volume reach beyond the scene. A preset made around a subject moves the camera, "
        "so that its subject is what is selected, or else the whole scene",
        default=True,
    )

    poll = classmethod(poll_camera)

    def read(self):
        raise NotImplementedError

    def execute(self, context):
        try:
            preset = self.read()
            use_preset(context, camera_of(context), preset, self.fit)
        except BAD_INPUT as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"The camera now has the volume of the preset {preset.name}")
        return {"FINISHED"}


class SCFPF_OT_preset_apply(_PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset"""

    bl_idname = "scfpf.preset_apply"
    bl_label = "Apply Projection Preset"

    preset: EnumProperty(name="Preset", description="The projection that the camera gets", items=_items)

    @classmethod
    def description(cls, _context, properties):
        texts = {identifier: text for identifier, _name, text in preset_items()}
        return texts.get(properties.preset, cls.__doc__)

    def read(self):
        return shipped_preset(self.preset)


class SCFPF_OT_preset_load(_PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset file (JSON)"""

    bl_idname = "scfpf.preset_load"
    bl_label = "Load Projection Preset"

    filepath: StringProperty(name="File", description="The preset file to read", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def read(self):
        return read_preset(pathlib.Path(bpy.path.abspath(self.filepath)))

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_preset_apply, SCFPF_OT_preset_load))
