# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of t, depth, (u, v, t) and mist in Cycles: AOVs of the portals, and a group for the compositor.

The AOVs describe the chord of the pixel. The place along it is known only to the surface that was met, whose
material should not have to change: the group finds it from Cycles' Position pass.
"""

from __future__ import annotations

import bpy

from ..bridge.blender import versions
from ..bridge.blender.drivers import add_property, new_driver
from ..scanline.nodes.field_nodes import FieldBuilder, Value
from ..scanline.nodes.geometry_nodes import BUILD, BUILD_KEY, is_current
from .portals.pass_nodes import AOV_ALONG, AOV_PLACE, AOV_RATE, AOV_START, AOVS

GROUP = "SCFPF Passes"
LAYER = "SCFPF Render Layer"
# Marks nodes and compositor trees as made here.
MADE_KEY = "scfpf_passes"
# Depth of an empty pixel, as in Blender's own engines.
FARTHEST = 1e10
# Least share of the samples that meet something, and least divisor.
MET, TINY = 1e-6, 1e-30
POSITION = "Position"
# Inputs of the group with the mist of the scene's world: start, depth and exponent of the falloff.
MIST_INPUTS = {
    "Mist Start": (5.0, "Distance at which the world's mist begins"),
    "Mist Depth": (25.0, "Distance from there to full mist"),
    "Mist Falloff": (2.0, "Exponent of the mist's density: 2 is Quadratic, 1 Linear, 0.5 Inverse Quadratic"),
}
# What drives them: the setting of a world's mist, and the expression.
MIST_PATHS = {
    "Mist Start": ("start", "mist"),
    "Mist Depth": ("depth", "mist"),
    "Mist Falloff": ("falloff", "2 if mist == 0 else 1 if mist == 1 else 0.5"),
}
# Cycles' mist in a scene without a world.
NO_MIST = {"Mist Start": 0.0, "Mist Depth": 100.0, "Mist Falloff": 1.0}
# Outputs of the group.
RESULTS = {
    "t": ("Float", "Place along the projector: 0 on the near surface, 1 on the far one"),
    "Depth": (
        "Float",
        "Distance along the camera's axis, as Cycles' Depth, if the volume is the view of the camera's own "
        "lens; otherwise the length of the projector from the near surface",
    ),
    "UVT": ("Vector", "u, v and t of what the pixel shows"),
    "Mist": (
        "Float",
        "The world's mist, as Cycles' pass Mist, by the distance from the camera; in other volumes by the "
        "length of the projector from the near surface",
    ),
}


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
    source[MADE_KEY] = True
    source.scene = scene
    source.name = source.label = LAYER
    node = tree.nodes.new("CompositorNodeGroup")
    node[MADE_KEY] = True
    node.node_tree = _group()
    node.name = node.label = GROUP
    source.location, node.location = (left, below), (left + 400.0, below)
    # The render layers' sockets follow the view layer's passes.
    for name in (POSITION, *AOVS):
        tree.links.new(source.outputs[name], node.inputs[name])
    renew(scene)


def renew(scene) -> None:
    """Have a scene's group be of this version, and its mist that of the scene's world; links to it stay."""
    for node in _groups(scene):
        if not is_current(node.node_tree):
            node.node_tree = _group()
        for name, (path, expression) in MIST_PATHS.items():
            socket = node.inputs[name]
            if scene.world is None:
                socket.driver_remove("default_value")
                socket.default_value = NO_MIST[name]
            else:
                driver = new_driver(socket, "default_value", expression)
                add_property(driver, scene.world, f"mist_settings.{path}", "mist", "WORLD")


def is_in_step(scene) -> bool:
    """Return whether a scene's group, if it has one, is of this version and has the mist of its world."""
    groups = _groups(scene)
    if not all(is_current(node.node_tree) for node in groups):
        return False
    animation = groups[0].id_data.animation_data if groups else None
    drivers = {} if animation is None else {curve.data_path: curve.driver for curve in animation.drivers}
    for node in groups:
        sockets = {name: node.inputs[name] for name in MIST_PATHS}
        followed = [drivers.get(socket.path_from_id("default_value")) for socket in sockets.values()]
        worlds = {driver.variables[0].targets[0].id for driver in followed if driver is not None}
        # An artist may have removed drivers, to have another mist.
        is_left = not worlds and all(sockets[name].default_value == NO_MIST[name] for name in NO_MIST)
        if (
            worlds - {scene.world}
            or (scene.world is None and worlds)
            or (scene.world is not None and is_left)
        ):
            return False
    return True


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
    for node in _made_nodes(scene):
        for socket in node.inputs:
            socket.driver_remove("default_value")
        tree.nodes.remove(node)
    versions.drop_compositor_tree(scene, MADE_KEY)
    group = bpy.data.node_groups.get((GROUP, None))
    if group is not None and group.users == 0:
        bpy.data.node_groups.remove(group)


def _made_nodes(scene) -> list:
    """The nodes that ``add`` has made in a scene's compositor."""
    tree = versions.present_compositor_tree(scene)
    return [] if tree is None else [node for node in tree.nodes if MADE_KEY in node]


def _groups(scene) -> list:
    """The nodes of ``add`` that hold the group: one, or more if the artist has copied it."""
    return [node for node in _made_nodes(scene) if node.type == "GROUP" and node.node_tree is not None]


def _group():
    existing = bpy.data.node_groups.get((GROUP, None))
    if is_current(existing) and existing.bl_idname == "CompositorNodeTree":
        return existing
    tree = bpy.data.node_groups.new(GROUP, "CompositorNodeTree")
    tree.description = "t, depth, u, v and mist of what each pixel shows through the Cycles rig"
    for label in (POSITION, *AOVS):
        tree.interface.new_socket(
            label,
            in_out="INPUT",
            socket_type="NodeSocketVector" if label == POSITION else "NodeSocketColor",
            description="The Position pass" if label == POSITION else f"The AOV “{label}”",
        )
    for label, (default, description) in MIST_INPUTS.items():
        options = {"socket_type": "NodeSocketFloat", "description": description}
        socket = tree.interface.new_socket(label, in_out="INPUT", **options)
        socket.default_value, socket.min_value = default, 0.0
    for label, (kind, description) in RESULTS.items():
        options = {"socket_type": f"NodeSocket{kind}", "description": description}
        tree.interface.new_socket(label, in_out="OUTPUT", **options)
    nodes = FieldBuilder(tree)
    source = nodes.node("NodeGroupInput", "Given", {})
    given = {label: Value(nodes, source.outputs[label]) for label in (POSITION, *AOVS, *MIST_INPUTS)}
    nodes.node("NodeGroupOutput", "Result", _passes(nodes, given))
    tree[BUILD_KEY] = BUILD
    return tree


def _passes(nodes: FieldBuilder, given: dict[str, Value]) -> dict[str, Value]:
    nodes.open_frame("The mean of those samples that meet something, if the first one does")

    def parts(name: str, share=None) -> tuple[Value, ...]:
        values = given[name].parts()
        return values if share is None else tuple(value * share for value in values)

    u, v, cover = parts(AOV_PLACE)
    share = 1.0 / cover.max(MET)
    start, rate, (t, depth, distance) = (parts(name, share) for name in (AOV_START, AOV_RATE, AOV_ALONG))
    position = parts(POSITION)

    def dot(one, other) -> Value:
        x, y, z = (a * b for a, b in zip(one, other, strict=True))
        return x + y + z

    # Position is that of a pixel's first sample.
    met = nodes.combine("GREATER_THAN", dot(position, position), 0.0)
    met = met * nodes.combine("GREATER_THAN", cover, MET)
    nodes.open_frame("How far along the chord the position is")
    away = [p - s for p, s in zip(position, start, strict=True)]
    squared = dot(rate, rate).max(TINY)
    step = dot(away, rate) / squared
    depth = depth + step * squared.root()
    nodes.open_frame("Mist")
    full = given["Mist Depth"].max(TINY)
    # Materials of earlier versions write no distance.
    share_of_mist = (depth * distance.max(1.0) - given["Mist Start"]) / full
    density = nodes.combine("POWER", share_of_mist.max(0.0).min(1.0), given["Mist Falloff"])
    nodes.open_frame("Where something is met")
    t = (t + step) * met
    return {
        "t": t,
        # Not a mix: depth would be lost beside what it is mixed with.
        "Depth": depth * met + (1.0 - met) * FARTHEST,
        "UVT": nodes.xyz(u * share * met, v * share * met, t, "u, v, t"),
        "Mist": 1.0 - cover * met * (1.0 - density),
    }
