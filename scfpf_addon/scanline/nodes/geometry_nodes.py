# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry node groups built in code: the operations on geometry and fields, and the groups themselves."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

import bpy

from ...bridge.blender import versions
from .field_nodes import FieldBuilder, Value

# A node group of another build in a file is not used: raise the number with every change of a group.
BUILD = 16
BUILD_KEY = "scfpf_build"
# Custom property: the name that a node group was made with. The artist may rename the group.
NAME_KEY = "scfpf_name"


class GeometryBuilder(FieldBuilder):
    """A FieldBuilder for trees of Geometry Nodes, with thousands of nodes: ``lay_out`` places all at once."""

    NAMED = False

    def __init__(self, tree):
        super().__init__(tree)
        self._places: dict[str, tuple[float, float]] = {}

    def place(self, node, x: float, y: float) -> None:
        self._places[node.name] = x, y

    def lay_out(self) -> None:
        """Move all nodes to their places: one by one, each would update the whole tree."""
        places = [self._places.get(node.name, (0.0, 0.0)) for node in self.tree.nodes]
        self.tree.nodes.foreach_set("location", [part for place in places for part in place])

    def _move_to_column(self, node) -> None:
        x, y = self.COLUMN * self._columns[node.name], self._places[node.name][1]
        self.place(node, x, y)

    def position(self) -> Value:
        return self.out("GeometryNodeInputPosition", "Position", {})

    def index(self) -> Value:
        return self.out("GeometryNodeInputIndex", "Index", {})

    def attribute(self, name: str | Value, kind: str = "FLOAT") -> Value:
        label = name if isinstance(name, str) else "Attribute"
        return self.out("GeometryNodeInputNamedAttribute", label, {"Name": name}, data_type=kind)

    def store(self, geometry, name: str, value, kind: str, domain: str = "POINT", selection=None) -> Value:
        inputs = {"Geometry": geometry, "Name": name, "Value": value}
        if selection is not None:
            inputs["Selection"] = selection
        return self.out(
            "GeometryNodeStoreNamedAttribute", f"Store {name}", inputs, data_type=kind, domain=domain
        )

    def sample(self, geometry, value, index, kind: str, label: str, domain: str = "POINT") -> Value:
        """The value of a field at an element of another geometry; the index is clamped."""
        inputs = {"Geometry": geometry, "Value": value, "Index": index}
        return self.out("GeometryNodeSampleIndex", label, inputs, data_type=kind, domain=domain, clamp=True)

    def sample_attribute(
        self, geometry, name: str, index, label: str, kind: str = "FLOAT_VECTOR", domain: str = "POINT"
    ) -> Value:
        """The value of a named attribute at an element of another geometry; the index is clamped."""
        return self.sample(geometry, self.attribute(name, kind), index, kind, label, domain)

    def statistic(self, geometry, value, which: str, label: str, selection=None, domain="POINT") -> Value:
        inputs = {"Geometry": geometry, "Attribute": value}
        if selection is not None:
            inputs["Selection"] = selection
        kind = "FLOAT_VECTOR" if value.is_vector else "FLOAT"
        return self.out("GeometryNodeAttributeStatistic", label, inputs, which, data_type=kind, domain=domain)

    def evaluate_on(self, value, domain: str, kind: str, label: str) -> Value:
        """A field evaluated on a domain, then interpolated to the domain that it is used on."""
        return self.out("GeometryNodeFieldOnDomain", label, {0: value}, data_type=kind, domain=domain)

    def at_index(self, value, index, domain: str, kind: str) -> Value:
        inputs = {0: value, 1: index}
        return self.out("GeometryNodeFieldAtIndex", "There", inputs, data_type=kind, domain=domain)

    def object_info(self, obj) -> tuple[Value, Value]:
        """An object's geometry, and the matrix from its space into the modified object's."""
        kind = "GeometryNodeObjectInfo"
        geometry = self.out(kind, "Its Shape", {"Object": obj}, "Geometry")
        place = self.out(kind, "Its Place", {"Object": obj}, "Transform", transform_space="RELATIVE")
        return geometry, place

    def set_position(self, geometry, position, label: str) -> Value:
        inputs = {"Geometry": geometry, "Position": position}
        return self.out("GeometryNodeSetPosition", label, inputs)

    def domain_size(self, geometry, which: str, component: str = "MESH") -> Value:
        """The number of a geometry's elements. which: the output, such as "Face Count"."""
        kind = "GeometryNodeAttributeDomainSize"
        return self.out(kind, which, {0: geometry}, which, component=component)

    def face_of_corner(self) -> Value:
        """The index of the face of each corner."""
        return self.out("GeometryNodeFaceOfCorner", "Face of Corner", {}, "Face Index")

    def faces_at_edge(self) -> Value:
        """The number of faces of each edge."""
        return self.out("GeometryNodeInputMeshEdgeNeighbors", "Faces at the Edge", {}) + 0.0

    def direction(self, vector, matrix, label: str) -> Value:
        """A vector transformed without the matrix' translation."""
        return self.out("FunctionNodeTransformDirection", label, {0: vector, 1: matrix})

    def separate(self, geometry, selection, label: str, domain: str = "FACE") -> tuple[Value, Value]:
        """The selected elements and the others."""
        inputs = {"Geometry": geometry, "Selection": selection}
        return self.outs("GeometryNodeSeparateGeometry", label, inputs, 0, 1, domain=domain)

    def join(self, *parts: Value) -> Value:
        """Several geometries as one, in order."""
        node = self.node("GeometryNodeJoinGeometry", "Join", {0: parts[-1]})
        # Of several links into one socket the last comes first.
        for part in parts[-2::-1]:
            self.tree.links.new(part.socket, node.inputs[0])
            self._columns[node.name] = max(self._columns[node.name], self._columns[part.socket.node.name] + 1)
        self._move_to_column(node)
        return Value(self, node.outputs[0])

    def call(self, group, label: str, inputs: dict, given: dict | None = None) -> dict[str, Value]:
        """A node of another group; its outputs by name.

        inputs: values by name of the group's input. given: further values; the group takes those that have
        the name of one of its other inputs.
        """
        wanted = [item.name for item in group.interface.items_tree if item.in_out == "INPUT"]
        shared = {name: given[name] for name in wanted if name in given} if given else {}
        node = self.node("GeometryNodeGroup", label, shared | inputs, node_tree=group)
        return {socket.name: Value(self, socket) for socket in node.outputs}

    def repeat(
        self,
        iterations,
        state: dict[str, tuple[str, Value]],
        label: str,
        body: Callable,
        goes_on: Callable | None = None,
    ) -> dict[str, Value]:
        """A Repeat Zone.

        state: name → (socket type, first value). body: state → next state, by name. goes_on: state → whether
        it changes; an iteration without a change costs nothing, since a Switch evaluates one side only.
        """
        start = self.node("GeometryNodeRepeatInput", f"{label}: each time", {})
        end = self.tree.nodes.new("GeometryNodeRepeatOutput")
        end.label = f"{label}: the end"
        start.pair_with_output(end)
        end.repeat_items.clear()
        for name, (kind, _) in state.items():
            end.repeat_items.new(kind, name)
        for name, (_, value) in ({"Iterations": ("INT", iterations)} | state).items():
            if value is None:
                continue
            if isinstance(value, Value):
                self.tree.links.new(value.socket, start.inputs[name])
                column = self._columns[value.socket.node.name] + 1
                self._columns[start.name] = max(self._columns[start.name], column)
            else:
                start.inputs[name].default_value = value
        self._move_to_column(start)
        present = {name: Value(self, start.outputs[name]) for name in state}
        after = body(present)
        if goes_on is not None:
            some = goes_on(present)
            for name, (kind, _) in state.items():
                after[name] = self.switch(some, present[name], after[name], kind, "Any Left?")
        for name, value in after.items():
            self.tree.links.new(value.socket, end.inputs[name])
        columns = [self._columns[value.socket.node.name] + 1 for value in after.values()]
        self._columns[end.name] = max(columns)
        end.parent = self._frame
        self.place(end, self.COLUMN * max(columns), 0.0)
        return {name: Value(self, end.outputs[name]) for name in state}


def node_group(
    name: str, description: str, inputs: dict, outputs: dict, build: Callable, modifier: bool = False
):
    """Return the node group of a name: the file's own if this build made it, renamed or not, else a new one.

    A group that another version of the add-on made, or that has lost a group in it, keeps its users, under
    another name.

    inputs: label → (socket type without "NodeSocket", default or None, description). outputs: label →
    socket type. build: (nodes, given values by label) → values by output label. modifier: whether the group
    is offered as a modifier.
    """
    existing = bpy.data.node_groups.get((name, None))
    is_own = existing and existing.bl_idname == "GeometryNodeTree" and is_current(existing)
    if is_own and has_all_groups(existing):
        return existing
    called_so = (group for group in bpy.data.node_groups if _was_called(group, name))
    renamed = next((group for group in called_so if has_all_groups(group)), None)
    if renamed is not None:
        return renamed
    if existing:
        existing.name = f"{name} (before)"
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.is_modifier = modifier
    tree.description = description
    for label, kind in outputs.items():
        tree.interface.new_socket(label, in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
    for label, (kind, default, text) in inputs.items():
        socket = tree.interface.new_socket(
            label, description=text, in_out="INPUT", socket_type=f"NodeSocket{kind}"
        )
        if default is not None:
            socket.default_value = default
    nodes = GeometryBuilder(tree)
    source = nodes.node("NodeGroupInput", "Given", {})
    made = build(nodes, {label: Value(nodes, source.outputs[label]) for label in inputs})
    nodes.close_frame()
    nodes.node("NodeGroupOutput", "Result", made)
    nodes.lay_out()
    tree[BUILD_KEY], tree[NAME_KEY] = BUILD, name
    return tree


def defines_group(name: str, inputs: dict, outputs: dict, modifier: bool = False) -> Callable:
    """Decorate a function that builds a node group: called without arguments, it returns the ``node_group``.

    The first line of its docstring describes the group in the interface, in American spelling.
    """

    def decorate(build: Callable) -> Callable:
        description = (build.__doc__ or "").partition("\n")[0].rstrip(".")

        @wraps(build)
        def group():
            return node_group(name, description, inputs, outputs, build, modifier)

        return group

    return decorate


def is_current(group) -> bool:
    """Return whether this build made a node group; not None."""
    return group is not None and group.get(BUILD_KEY) == BUILD


def has_all_groups(group) -> bool:
    """Return whether no group within a node group has been deleted."""
    inner = (node.node_tree for node in group.nodes if node.type == "GROUP")
    return all(tree is not None and has_all_groups(tree) for tree in set(inner))


def _was_called(group, name: str) -> bool:
    return group.library is None and is_current(group) and group.get(NAME_KEY) == name


def remove_attributes(nodes: GeometryBuilder, geometry, pattern: str) -> Value:
    """Remove the named attributes that a pattern with * matches."""
    node = nodes.node("GeometryNodeRemoveAttribute", "Clear up", {"Geometry": geometry, "Name": pattern})
    versions.set_node_menu(node, "Pattern Mode", "pattern_mode", "WILDCARD")
    return Value(nodes, node.outputs[0])
