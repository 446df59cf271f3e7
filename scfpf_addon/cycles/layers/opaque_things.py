# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether all that renders show is opaque and where its mesh is: then positions need no materials."""

from __future__ import annotations

import bpy

from ...bridge.scene.instances import NO_THINGS
from ..skipping.reasons import displaces, has_volume, links

# Nodes of shaders through which no camera ray passes, or that mix others.
OPAQUE = {
    "ADD_SHADER",
    "BSDF_DIFFUSE",
    "BSDF_GLASS",
    "BSDF_GLOSSY",
    "BSDF_METALLIC",
    "BSDF_PRINCIPLED",
    "BSDF_REFRACTION",
    "BSDF_SHEEN",
    "BSDF_TOON",
    "BSDF_TRANSLUCENT",
    "EMISSION",
    "GROUP",
    "GROUP_INPUT",
    "MIX_SHADER",
    "REROUTE",
    "SUBSURFACE_SCATTERING",
}


def is_all_opaque(depsgraph) -> bool:
    """Return whether every material of an evaluated scene is opaque, and none moves or fills surfaces."""
    scene = depsgraph.scene_eval
    if scene.cycles.film_transparent_glass or has_volume(scene.world):
        return False
    known: dict[int, bool] = {}
    return not any(_lets_through(each, known) for each in depsgraph.ids)


def _lets_through(datablock, known: dict[int, bool]) -> bool:
    """Return whether camera rays may pass a material or an object. known: of trees, by address."""
    if isinstance(datablock, bpy.types.Object):
        # Lights count as catchers of shadows, too.
        return datablock.type == "VOLUME" or (datablock.is_shadow_catcher and datablock.type not in NO_THINGS)
    if not isinstance(datablock, bpy.types.Material) or datablock.node_tree is None:
        return False
    return (
        displaces(datablock)
        or links(datablock, "OUTPUT_MATERIAL", "Volume")
        or not links(datablock, "OUTPUT_MATERIAL", "Surface")
        or not _is_opaque(datablock.node_tree, known)
    )


def _is_opaque(tree, known: dict[int, bool]) -> bool:
    """Return whether no shader of a tree, or of a group in it, lets rays through. known: the answers."""
    # Evaluated trees have no session ids.
    key = tree.as_pointer()
    if key not in known:
        shaders = [node for node in tree.nodes if any(out.type == "SHADER" for out in node.outputs)]
        known[key] = all(node.type in OPAQUE and _is_solid(node) for node in shaders) and all(
            node.node_tree is None or _is_opaque(node.node_tree, known)
            for node in shaders
            if node.type == "GROUP"
        )
    return known[key]


def _is_solid(node) -> bool:
    """Return whether the alpha of a node is always 1."""
    alpha = node.inputs.get("Alpha") if node.type == "BSDF_PRINCIPLED" else None
    return alpha is None or (not alpha.is_linked and alpha.default_value == 1.0)
