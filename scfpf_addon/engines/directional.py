# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that look different from different directions: gloss, glass, rims, and looks that follow cameras.

Renders show them right from near the projectors' directions only.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..bridge.blender import versions
from ..bridge.blender.shader_nodes import has_node
from ..projection.typing import BoolArray, IndexArray

# The roughness from which on highlights change little within ``anchors.shown_points.ANGLE``: one by GGX has
# half its height 18° off for 0.5. Of metals little else is seen.
DULL, DULL_METAL = 0.5, 0.9
# Shaders with a roughness, and other nodes with what of them depends on the direction.
GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC", "EEVEE_SPECULAR"}
CLEAR = {"BSDF_GLASS", "BSDF_REFRACTION"}
OUTPUTS = {
    "FRESNEL": ("Fac", "Factor"),
    "LAYER_WEIGHT": ("Fresnel", "Facing"),
    "CAMERA": ("View Vector", "View Z Depth", "View Distance"),
    "TEX_COORD": ("Camera", "Window", "Reflection"),
    "NEW_GEOMETRY": ("Incoming",),
}


def directional(material_names: Sequence[str], material: IndexArray) -> BoolArray | None:
    """Return which triangles look different from different directions, (T,); None if none.

    material: (T,), of each triangle the place in the names. Of several materials of a name, which may be
    linked from other files, one is enough.
    """
    known: dict[int, bool] = {}
    wanted = set(material_names)
    named = {each.name for each in bpy.data.materials if each.name in wanted and _is_directional(each, known)}
    found = np.array([name in named for name in material_names], bool)
    if not found.any():
        return None
    result: BoolArray = found[material]
    return result


def _is_directional(material, known: dict[int, bool]) -> bool:
    if not versions.uses_nodes(material):
        return material.roughness < DULL
    return has_node(material.node_tree, _changes, known)


def _changes(node) -> bool:
    """Return whether what a shader node gives changes with the direction."""
    if node.mute or not any(output.is_linked for output in node.outputs):
        return False
    if node.type == "BSDF_PRINCIPLED":
        return _may_exceed(node, "Coat Weight") or _may_exceed(node, "Transmission Weight") or _shines(node)
    if node.type in GLOSSY:
        return _may_be_below(node, "Roughness", DULL_METAL)
    if node.type == "BSDF_TOON":
        return node.component == "GLOSSY"
    if node.type == "VECT_TRANSFORM":
        return "CAMERA" in (node.convert_from, node.convert_to)
    names = OUTPUTS.get(node.type, ())
    return node.type in CLEAR or any(out.is_linked for out in node.outputs if out.name in names)


def _shines(principled) -> bool:
    if _may_exceed(principled, "Metallic"):
        return _may_be_below(principled, "Roughness", DULL_METAL)
    has_layer = _may_exceed(principled, "Specular IOR Level") and _may_exceed(principled, "IOR", 1.0)
    return has_layer and _may_be_below(principled, "Roughness", DULL)


def _may_exceed(node, name: str, value: float = 0.0) -> bool:
    """Return whether an input is linked, or above a value."""
    given = node.inputs.get(name)
    return given is not None and (given.is_linked or given.default_value > value)


def _may_be_below(node, name: str, value: float) -> bool:
    """Return whether an input is linked, or below a value."""
    given = node.inputs.get(name)
    return given is None or given.is_linked or given.default_value < value
