# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: a ready-made projection for a camera."""

import functools
import pathlib

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...scfpf_addon.bridge.camera.flexible_camera import apply_preset
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.presets.preset import PresetError, read_preset
from ..common.errors import BAD_INPUT, refused
from ..common.placement import around_subject, reaching_scale, scene_box
from ..common.target import camera_of, poll_camera

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "presets"


Item = tuple[str, str, str]
# Where a preset is listed whose file names no group.
OTHER_GROUP = "Other"


@functools.cache
def preset_groups() -> tuple[tuple[str, tuple[Item, ...]], ...]:
    """Every shipped preset as (identifier, name, description), by the groups that the files name.

    Groups and names are in alphabetical order. Kept: Blender holds on to the strings.
    """
    groups: dict[str, list[Item]] = {}
    for path in sorted(FOLDER.glob("*.json")):
        try:
            preset = read_preset(path)
        except PresetError as error:
            # Listed all the same: choosing it reports what is wrong with it.
            group, item = OTHER_GROUP, (path.stem, path.stem, str(error))
        else:
            group = preset.group or OTHER_GROUP
            item = (path.stem, preset.name, preset.description)
        groups.setdefault(group, []).append(item)
    return tuple((group, tuple(sorted(groups[group], key=lambda item: item[1]))) for group in sorted(groups))


@functools.cache
def preset_items() -> tuple[Item, ...]:
    """The shipped presets of ``preset_groups`` in one row."""
    return tuple(item for _group, items in preset_groups() for item in items)


def _items(_operator, _context):
    return preset_items()


def shipped_preset(identifier: str):
    """The preset of an item of ``preset_items``."""
    return read_preset(FOLDER / f"{identifier}.json")


def use_preset(context, camera, preset, fit: bool) -> None:
    """Replace the camera's volume by a preset's. fit: as the operators' property of that name."""
    aspect = image_aspect(context.scene)
    box = (scene_box(context, selected_only=True) or scene_box(context)) if fit else None
    scale = 1.0
    if box is not None and preset.subject is not None:
        camera.matrix_world, scale = around_subject(preset.subject, box)
    elif box is not None:
        scale = reaching_scale(preset.fitted(aspect).volume(), camera.matrix_world, box)
    apply_preset(camera, preset, aspect, scale)


class PresetOperator:
    """Gives the camera the volume of the preset that ``read`` answers with."""

    bl_options = {"REGISTER", "UNDO"}

    fit: BoolProperty(
        name="Fit to Scene",
        description="Make the volume reach beyond the scene. A preset made around a subject moves the camera "
        "so that it surrounds the selected objects, or else the whole scene",
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
            return refused(self, error)
        self.report({"INFO"}, f"The camera has the volume of the preset {preset.name}")
        return {"FINISHED"}


class SCFPF_OT_preset_apply(PresetOperator, bpy.types.Operator):
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


class SCFPF_OT_preset_load(PresetOperator, bpy.types.Operator):
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
