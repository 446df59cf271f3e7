# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of surfaces in a viewport, by the colour setting of its Shading popover."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ...projection.typing import BoolArray, IndexArray
from ..blender import versions
from ..blender.shader_nodes import output_shaders, resolve
from ..scene.read_materials import read_material
from .live_images import ImageUse, active_image, image_use
from .random_color import random_color

# Workbench's roughness of surfaces that are not coloured by a material, and its grey of empty slots.
PLAIN_ROUGHNESS = 0.4
EMPTY = (0.8, 0.8, 0.8, 1.0, 0.0, PLAIN_ROUGHNESS)
# Inputs that an image can colour in Material Preview, in order of preference.
COLOR_INPUTS = ("Base Color", "Color")


class MaterialValues(NamedTuple):
    """The viewport display of M materials: (M, 6) linear colour, alpha, metallic, roughness; and images."""

    values: np.ndarray
    images: tuple[ImageUse | None, ...]


class ObjectValues(NamedTuple):
    """The viewport display of n objects: (n, 4) linear colour and alpha; and whether meshes have the layers.

    has_color: (n,) a colour attribute. has_uv: (n,) texture coordinates.
    """

    color: np.ndarray
    has_color: BoolArray
    has_uv: BoolArray


def read_material_values(uids: IndexArray, kind: str) -> MaterialValues:
    """Read materials by their session_uids; one that does not exist, such as 0, is an empty slot.

    kind: "VIEWPORT" for the values of Viewport Display, "TEXTURE" for these and images, "NODES" for those
    of Material Preview.
    """
    wanted = set(uids.tolist()) - {0}
    by_uid = {one.session_uid: one for one in bpy.data.materials if one.session_uid in wanted}
    values, images = np.tile(np.array(EMPTY, np.float32), (len(uids), 1)), []
    for row, uid in enumerate(uids.tolist()):
        material = by_uid.get(uid)
        image = None
        if material is not None and kind == "NODES":
            found = read_material(material)[0]
            color = np.maximum(found.base_color, found.emission)
            values[row] = *color, 1.0, found.metallic, found.roughness
            image = _colored_by(material)
        elif material is not None:
            values[row] = *material.diffuse_color, material.metallic, material.roughness
            image = active_image(material) if kind == "TEXTURE" else None
        images.append(image)
    return MaterialValues(np.nan_to_num(values), tuple(images))


def _colored_by(material) -> ImageUse | None:
    """The image whose node feeds the colour of a material's surface directly."""
    if not versions.uses_nodes(material):
        return None
    for node, groups in output_shaders(material.node_tree):
        for name in COLOR_INPUTS:
            if name in node.inputs:
                source = resolve(node.inputs[name], groups)[0]
                if source.is_output and (found := image_use(source.node)) is not None:
                    return found
    return None


def read_object_values(uids: IndexArray, depsgraph, is_random: bool) -> ObjectValues:
    """Read objects by their session_uids. is_random: whether colours are the random ones."""
    color = np.ones((len(uids), 4), np.float32)
    has_color, has_uv = np.zeros(len(uids), bool), np.zeros(len(uids), bool)
    rows = {uid: row for row, uid in enumerate(uids.tolist())}
    for original in bpy.data.objects:
        # Evaluated objects have no session_uid of their own.
        row = rows.get(original.session_uid)
        if row is None:
            continue
        obj = original.evaluated_get(depsgraph)
        color[row] = obj.color
        if is_random:
            library = obj.library.filepath if obj.library else ""
            color[row, :3] = random_color(obj.name, library)
        data = obj.data
        if obj.type == "MESH":
            has_color[row] = len(data.color_attributes) > 0
            has_uv[row] = len(data.uv_layers) > 0
    return ObjectValues(color, has_color, has_uv)
