# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped presets, and operators that give a camera the volume of a preset."""

import functools
import pathlib

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...scfpf_addon.bridge.aim.kept_volume import volume_kept
from ...scfpf_addon.bridge.camera.flexible_camera import apply_preset
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.presets.preset import PresetError, read_preset
from ...scfpf_addon.projection.user_error import Message
from ..common.scene_box import scene_boxes
from ..common.target import camera_of, poll_camera
from ..common.tool import Action, tooltip_of
from ..common.words import report_text
from .camera_placement import around_subject, reaching_depth, reaching_scale

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "presets"
Item = tuple[str, str, str]
# The group of presets whose file names none.
OTHER_GROUP = "Other"


@functools.cache
def preset_groups() -> tuple[tuple[str, tuple[Item, ...]], ...]:
    """Every shipped preset as (identifier, name, description), by group, in alphabetical order.

    Cached, as Blender keeps only pointers to the strings.
    """
    groups: dict[str, list[Item]] = {}
    for path in sorted(FOLDER.glob("*.json")):
        try:
            preset = read_preset(path)
        except PresetError as error:
            # The menu lists it, and choosing it reports the error.
            group, item = OTHER_GROUP, (path.stem, path.stem, str(error))
        else:
            group = preset.group or OTHER_GROUP
            item = (path.stem, preset.name, preset.description)
        groups.setdefault(group, []).append(item)
    return tuple((group, tuple(sorted(groups[group], key=lambda item: item[1]))) for group in sorted(groups))


@functools.cache
def preset_items() -> tuple[Item, ...]:
    """The shipped presets of ``preset_groups`` in one list."""
    return tuple(item for _group, items in preset_groups() for item in items)


def preset_choices(_operator, _context) -> tuple[Item, ...]:
    """The shipped presets as the items of an EnumProperty."""
    return preset_items()


def shipped_preset(identifier: str):
    """Read a shipped preset by its identifier. Raises PresetError."""
    return read_preset(FOLDER / f"{identifier}.json")


def use_preset(context, camera, preset, fit: bool) -> None:
    """Replace the camera's volume by a preset's.

    fit: scale the volume, or place the camera, so that the preset holds the selection or the scene.
    """
    aspect = image_aspect(context.scene)
    boxes = scene_boxes(context) if fit else None
    scale = depth = 1.0
    if boxes is not None:
        things = (scene_boxes(context, selected_only=True) or boxes).things
        if preset.subject is not None:
            camera.matrix_world, scale = around_subject(preset.subject, things)
        else:
            volume = preset.fitted(aspect).volume()
            scale = reaching_scale(volume, camera.matrix_world, things)
            depth = reaching_depth(volume, camera.matrix_world, scale, boxes.whole)
    apply_preset(camera, preset, aspect, scale, depth)


class PresetOperator(Action):
    """Give the camera the volume of the preset that ``read`` returns."""

    fit: BoolProperty(
        name="Fit to Scene",
        description="Make the volume reach beyond the scene, or, if the preset is made around a subject, "
        "surround the selected objects or else the whole scene",
        default=True,
    )

    poll = classmethod(poll_camera)

    def read(self):
        raise NotImplementedError

    def title(self, preset) -> str | Message:
        """The name of the preset as reports show it: an artist's own name is not translated."""
        title: str = preset.name
        return title

    def act(self, context):
        preset = self.read()
        camera = camera_of(context)
        with volume_kept(camera):
            use_preset(context, camera, preset, self.fit)
        return report_text("The camera has the volume of the preset {0}", self.title(preset))


class ReadsPresetFile:
    """An operator that asks for a preset file to read."""

    filepath: StringProperty(name="File", description="The preset file to read", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def read(self):
        return read_preset(pathlib.Path(bpy.path.abspath(self.filepath)))

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SCFPF_OT_preset_apply(PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset"""

    bl_idname = "scfpf.preset_apply"
    bl_label = "Apply Projection Preset"

    preset: EnumProperty(
        name="Preset", description="The projection that the camera gets", items=preset_choices
    )

    @classmethod
    def description(cls, _context, properties):
        return tooltip_of(cls, preset_items(), properties.preset)

    def read(self):
        return shipped_preset(self.preset)

    def title(self, preset):
        return Message(preset.name)


class SCFPF_OT_preset_load(ReadsPresetFile, PresetOperator, bpy.types.Operator):
    """Replace the camera's control surfaces by those of a preset file (JSON)"""

    bl_idname = "scfpf.preset_load"
    bl_label = "Load Projection Preset"


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_preset_apply, SCFPF_OT_preset_load))
