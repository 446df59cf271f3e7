# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of t, depth and (u, v, t) in Cycles: AOVs that the portals write, and a group for the compositor.

The AOVs describe the chord of the pixel. The place along it is known only to the surface that was met, whose
material should not have to change: the group finds it from Cycles' Position pass.
"""

from __future__ import annotations

import bpy

from ..bridge.blender import versions
from ..scanline.nodes.field_nodes import FieldBuilder, Value
from ..scanline.nodes.geometry_nodes import BUILD, BUILD_KEY, is_current
from .portals.pass_nodes import AOV_ALONG, AOV_PLACE, AOV_RATE, AOV_START, AOVS

GROUP = "SCFPF Passes"
LAYER = "SCFPF Render Layer"
# Marks nodes and compositor trees as made here.
MADE_KEY = "scfpf_passes"
# Depth of an empty pixel, as in Blender's own engines.
FARTHEST = 1e10
# A pixel is empty if a smaller share of its samples meets anything.
MET = 0.5
# Least divisor.
TINY = 1e-30
POSITION = "Position"


def add(scene) -> None:
    """Give all view layers of a scene the AOVs, and its compositor the group that makes passes of them."""
    for layer in scene.view_layers:
        if not layer.use_pass_position:
            layer.use_pass_position = layer[MADE_KEY] = True
        for name in AOVS:
            if layer.aovs.get(name) is None:
                aov = layer.aovs.add()
                aov.name, aov.type = name, "COLOR"
    tree = versions.compositor_tree(scene, MADE_KEY)
    if any(MADE_KEY in node for node in tree.nodes):
        return
    left = min((node.location.x for node in tree.nodes), default=0.0)
    below = min((node.location.y - node.height for node in tree.nodes), default=0.0) - 200.0
    source = tree.nodes.new("CompositorNodeRLayers")
    source.scene = scene
    source.name = source.label = LAYER
    node = tree.nodes.new("CompositorNodeGroup")
    node.node_tree = _group()
    node.name = node.label = GROUP
    source.location, node.location = (left, below), (left + 400.0, below)
    for made in (source, node):
        made[MADE_KEY] = True
    # The render layers' sockets follow the view layer's passes.
    for name in (POSITION, *AOVS):
        tree.links.new(source.outputs[name], node.inputs[name])


def remove(scene) -> None:
    """Remove everything that ``add`` has made, and links to it."""
    for layer in scene.view_layers:
        for name in AOVS:
            aov = layer.aovs.get(name)
            if aov is not None:
                layer.aovs.remove(aov)
        if layer.pop(MADE_KEY, False):
            layer.use_pass_position = False
    tree = versions.present_compositor_tree(scene)
    if tree is None:
        return
    for node in [node for node in tree.nodes if MADE_KEY in node]:
        tree.nodes.remove(node)
    versions.drop_compositor_tree(scene, MADE_KEY)
    group = bpy.data.node_groups.get((GROUP, None))
    if group is not None and group.users == 0:
        bpy.data.node_groups.remove(group)


def _group():
    existing = bpy.data.node_groups.get((GROUP, None))
    if is_current(existing) and existing.bl_idname == "CompositorNodeTree":
        return existing
    tree = bpy.data.node_groups.new(GROUP, "CompositorNodeTree")
    tree.description = "t, depth, u and v of what each pixel shows through the Cycles rig"
    for label in (POSITION, *AOVS):
        tree.interface.new_socket(
            label,
            in_out="INPUT",
            socket_type="NodeSocketVector" if label == POSITION else "NodeSocketColor",
            description="The Position pass" if label == POSITION else f"The AOV “{label}”",
        )
    for label, kind in (("t", "Float"), ("Depth", "Float"), ("UVT", "Vector")):
        tree.interface.new_socket(label, in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
    nodes = FieldBuilder(tree)
    source = nodes.node("NodeGroupInput", "Given", {})
    given = {label: Value(nodes, source.outputs[label]) for label in (POSITION, *AOVS)}
    nodes.node("NodeGroupOutput", "Result", _passes(nodes, given))
    tree[BUILD_KEY] = BUILD
    return tree


def _passes(nodes: FieldBuilder, given: dict[str, Value]) -> dict[str, Value]:
    nodes.open_frame("The mean of those samples that meet something")

    def parts(name: str, share=None) -> tuple[Value, ...]:
        values = given[name].parts()
        return values if share is None else tuple(value * share for value in values)

    u, v, cover = parts(AOV_PLACE)
    share = 1.0 / cover.max(MET)
    met = nodes.combine("GREATER_THAN", cover, MET)
    start, rate, (t, length, _) = (parts(name, share) for name in (AOV_START, AOV_RATE, AOV_ALONG))
    nodes.open_frame("How far along the chord the position is")
    away = [p - s for p, s in zip(parts(POSITION), start, strict=True)]

    def dot(one, other) -> Value:
        x, y, z = (a * b for a, b in zip(one, other, strict=True))
        return x + y + z

    squared = dot(rate, rate).max(TINY)
    step = dot(away, rate) / squared
    depth = length + step * squared.root()
    nodes.open_frame("Where something is met")
    t = (t + step) * met
    return {
        "t": t,
        # Not a mix: depth would be lost beside what it is mixed with.
        "Depth": depth * met + (1.0 - met) * FARTHEST,
        "UVT": nodes.xyz(u * share * met, v * share * met, t, "u, v, t"),
    }
