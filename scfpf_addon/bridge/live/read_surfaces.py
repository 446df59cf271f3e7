# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of surfaces in a viewport, by the colour setting of its Shading popover."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ..blender import versions
from ..blender.shader_nodes import color_input, constant_glow, output_shaders, resolve, value_input
from .live_images import ImageUse, active_image, image_use
from .random_color import random_color

# Workbench's roughness of surfaces that are not coloured by a material, and its grey of empty slots.
PLAIN_ROUGHNESS = 0.4
EMPTY = (0.8, 0.8, 0.8, 1.0, 0.0, PLAIN_ROUGHNESS)
# Shaders that Material Preview takes constants of, in order of preference; the roughness of those that glow.
PREVIEWED = ("BSDF_PRINCIPLED", "BSDF_DIFFUSE", "BSDF_GLOSSY", "EMISSION")
GLOWING_ROUGHNESS = 0.5
# Inputs that an image can colour in Material Preview, in order of preference.
COLOR_INPUTS = ("Base Color", "Color")


class MaterialLook(NamedTuple):
    """The viewport display of a material: linear colour, alpha, metallic, roughness; and its image."""

    values: tuple[float, ...]
    image: ImageUse | None


class ObjectValues(NamedTuple):
    """The viewport display of n objects: (n, 4) linear colour and alpha; and whether meshes have the layers.

    has_color: (n,) a colour attribute. has_uv: (n,) texture coordinates.
    """

    color: np.ndarray
    has_color: BoolArray
    has_uv: BoolArray


def read_material_looks(uids: set[int], kind: str) -> dict[int, MaterialLook]:
    """Read materials by their session_uids; one that does not exist, such as 0, is an empty slot.

    kind: "VIEWPORT" for the values of Viewport Display, "TEXTURE" for these and images, "NODES" for those
    of Material Preview.
    """
    found = dict.fromkeys(uids, MaterialLook(EMPTY, None))
    for material in bpy.data.materials:
        if material.session_uid not in found:
            continue
        if kind == "NODES":
            color, metallic, roughness = _previewed(material)
            values, image = (*color, 1.0, metallic, roughness), _colored_by(material)
        else:
            values = *material.diffuse_color, material.metallic, material.roughness
            image = active_image(material) if kind == "TEXTURE" else None
        found[material.session_uid] = MaterialLook(values, image)
    return found


def _previewed(material) -> tuple[Array, float, float]:
    """The colour (3,), metallic and roughness that stand for a material's surface.

    They are constants of the first Principled BSDF behind the active output, through groups, Mix and Add
    nodes; without one of the first Diffuse, Glossy or Emission. A glow counts as a colour. An input that a
    texture feeds, and other shaders, take the values of Viewport Display. This asks for four inputs of one
    node, in a tenth of the time that the whole graph takes.
    """
    usual = np.array(material.diffuse_color[:3], np.float64)
    if not versions.uses_nodes(material):
        return usual, 0.0, 1.0
    glow = constant_glow(material.node_tree)
    if glow is not None:
        return np.maximum(glow, 0.0), 0.0, GLOWING_ROUGHNESS
    shaders = list(output_shaders(material.node_tree))
    kind = next((each for each in PREVIEWED if any(node.type == each for node, _ in shaders)), None)
    if kind is None:
        return usual, material.metallic, material.roughness
    node, groups = next(each for each in shaders if each[0].type == kind)

    def color(name: str) -> Array:
        found = color_input(node, groups, name)
        return usual if found is None else found

    def value(name: str, otherwise: float) -> float:
        found = value_input(node, groups, name)
        return otherwise if found is None else found

    if kind == "BSDF_DIFFUSE":
        return np.maximum(color("Color"), 0.0), 0.0, 1.0
    if kind == "EMISSION":
        return np.maximum(color("Color") * value("Strength", 1.0), 0.0), 0.0, GLOWING_ROUGHNESS
    roughness = value("Roughness", material.roughness)
    if kind == "BSDF_GLOSSY":
        return np.maximum(color("Color"), 0.0), 1.0, roughness
    strength = value("Emission Strength", 1.0)
    glow = color("Emission Color") * strength if strength else np.zeros(3)
    return np.maximum(color("Base Color"), glow), value("Metallic", material.metallic), roughness


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
