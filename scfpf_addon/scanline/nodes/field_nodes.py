# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as nodes: sockets that can be added, multiplied and compared in Python."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ...bridge.blender import versions
from ...bridge.blender.node_builder import NodeBuilder

# Node groups of an older build in a file are not used any more; raise it with every change of a group.
BUILD = 8
BUILD_KEY = "scfpf_build"
# The name that a node group was made with, by which it is known once the artist has renamed it.
NAME_KEY = "scfpf_name"

_SYMBOLS = {"ADD": "+", "SUBTRACT": "−", "MULTIPLY": "×", "DIVIDE": "÷", "SCALE": "×"}


class Value:
    """An output socket, float or vector, that formulas can be written with."""

    __slots__ = ("nodes", "socket")

    def __init__(self, nodes: FieldBuilder, socket):
        self.nodes, self.socket = nodes, socket

    @property
    def is_vector(self) -> bool:
        return self.socket.type == "VECTOR"

    def __add__(self, other):
        return self.nodes.combine("ADD", self, other)

    def __sub__(self, other):
        return self.nodes.combine("SUBTRACT", self, other)

    def __rtruediv__(self, other):
        return self.nodes.combine("DIVIDE", other, self)

    def __rsub__(self, other):
        return self.nodes.combine("SUBTRACT", other, self)

    def __mul__(self, other):
        return self.nodes.combine("MULTIPLY", self, other)

    def __truediv__(self, other):
        return self.nodes.combine("DIVIDE", self, other)

    __radd__, __rmul__ = __add__, __mul__

    def __gt__(self, other):
        return self.nodes.compare(self, "GREATER_THAN", other)

    def __lt__(self, other):
        return self.nodes.compare(self, "LESS_THAN", other)

    def floor(self):
        return self.nodes.combine("FLOOR", self)

    def absolute(self):
        return self.nodes.combine("ABSOLUTE", self)

    def least(self, other):
        return self.nodes.combine("MINIMUM", self, other)

    def most(self, other):
        return self.nodes.combine("MAXIMUM", self, other)

    def cross(self, other):
        return self.nodes.combine("CROSS_PRODUCT", self, other)

    def dot(self, other):
        return self.nodes.combine("DOT_PRODUCT", self, other)

    def length(self):
        return self.nodes.combine("LENGTH", self)

    def parts(self):
        """x, y and z of a vector."""
        node = self.nodes.node("ShaderNodeSeparateXYZ", "x, y, z", {0: self})
        return tuple(Value(self.nodes, socket) for socket in node.outputs)


class FieldBuilder(NodeBuilder):
    """A NodeBuilder whose sockets are ``Value``s."""

    def node(self, kind: str, label: str, inputs: dict, **settings):
        plain = {key: value.socket if isinstance(value, Value) else value for key, value in inputs.items()}
        return super().node(kind, label, plain, **settings)

    def out(self, kind: str, label: str, inputs: dict, output: int | str = 0, **settings) -> Value:
        """One output of a new node."""
        return Value(self, self.node(kind, label, inputs, **settings).outputs[output])

    def combine(self, operation: str, a, b=None) -> Value:
        """A math node, or a vector math node where one side is a vector."""
        label = _SYMBOLS.get(operation, operation.replace("_", " ").title())
        vectors = [isinstance(side, tuple) or (isinstance(side, Value) and side.is_vector) for side in (a, b)]
        if not any(vectors):
            return self.out(
                "ShaderNodeMath", label, {0: a} if b is None else {0: a, 1: b}, operation=operation
            )
        a, b = ((side,) * 3 if isinstance(side, (int, float)) and operation != "MULTIPLY" else side
                for side in (a, b))  # fmt: skip
        inputs = {0: a}
        if operation == "MULTIPLY" and not all(vectors):
            operation = "SCALE"
            inputs = {0: a if vectors[0] else b, "Scale": b if vectors[0] else a}
        elif b is not None:
            inputs[1] = b
        output = "Value" if operation in {"DOT_PRODUCT", "LENGTH"} else "Vector"
        return self.out("ShaderNodeVectorMath", label, inputs, output, operation=operation)

    def compare(self, a, operation: str, b) -> Value:
        label = {"GREATER_THAN": ">", "LESS_THAN": "<"}[operation]
        inputs = {0: a, 1: b}
        return self.out("FunctionNodeCompare", label, inputs, data_type="FLOAT", operation=operation)

    def both(self, a, b) -> Value:
        return self.out("FunctionNodeBooleanMath", "And", {0: a, 1: b}, operation="AND")

    def either(self, a, b) -> Value:
        return self.out("FunctionNodeBooleanMath", "Or", {0: a, 1: b}, operation="OR")

    def negate(self, a) -> Value:
        return self.out("FunctionNodeBooleanMath", "Not", {0: a}, operation="NOT")

    def xyz(self, x, y, z, label: str) -> Value:
        return self.out("ShaderNodeCombineXYZ", label, {0: x, 1: y, 2: z})

    def switch(self, condition, false, true, kind: str, label: str) -> Value:
        inputs = {"Switch": condition}
        inputs |= {key: side for key, side in (("False", false), ("True", true)) if side is not None}
        return self.out("GeometryNodeSwitch", label, inputs, input_type=kind)

    def integer(self, operation: str, a, b) -> Value:
        label = _SYMBOLS.get(operation, operation.replace("_", " ").title())
        return self.out("FunctionNodeIntegerMath", label, {0: a, 1: b}, operation=operation)

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
        """The value of a field at a point of another geometry; the index is clamped."""
        inputs = {"Geometry": geometry, "Value": value, "Index": index}
        return self.out("GeometryNodeSampleIndex", label, inputs, data_type=kind, domain=domain, clamp=True)

    def statistic(self, geometry, value, which: str, label: str, selection=None, domain="POINT") -> Value:
        inputs = {"Geometry": geometry, "Attribute": value}
        if selection is not None:
            inputs["Selection"] = selection
        kind = "FLOAT_VECTOR" if value.is_vector else "FLOAT"
        return self.out("GeometryNodeAttributeStatistic", label, inputs, which, data_type=kind, domain=domain)

    def evaluate_on(self, value, domain: str, kind: str, label: str) -> Value:
        """A field evaluated on a domain first, whatever domain it is used on."""
        return self.out("GeometryNodeFieldOnDomain", label, {0: value}, data_type=kind, domain=domain)

    def at_index(self, value, index, domain: str, kind: str) -> Value:
        inputs = {0: value, 1: index}
        return self.out("GeometryNodeFieldAtIndex", "There", inputs, data_type=kind, domain=domain)

    def separate(self, geometry, selection, label: str, domain: str = "FACE") -> tuple[Value, Value]:
        """The faces, or points, that are selected, and the others."""
        inputs = {"Geometry": geometry, "Selection": selection}
        node = self.node("GeometryNodeSeparateGeometry", label, inputs, domain=domain)
        return Value(self, node.outputs[0]), Value(self, node.outputs[1])

    def join(self, *parts: Value) -> Value:
        """Several geometries as one, in order."""
        node = self.node("GeometryNodeJoinGeometry", "Join", {0: parts[-1]})
        # Of several links into one socket the last comes first.
        for part in parts[-2::-1]:
            self.tree.links.new(part.socket, node.inputs[0])
            self._columns[node.name] = max(self._columns[node.name], self._columns[part.socket.node.name] + 1)
        node.location.x = self.COLUMN * self._columns[node.name]
        return Value(self, node.outputs[0])

    def point(self, position, matrix, label: str = "Transform Point") -> Value:
        return self.out("FunctionNodeTransformPoint", label, {0: position, 1: matrix})

    def mix(self, factor, a, b) -> Value:
        """a + (b - a) · factor, each part of its own."""
        return a + (b - a) * factor

    def matrix(self, columns, last_row=(0.0, 0.0, 0.0, 1.0)) -> Value:
        """The 4 × 4 matrix of four column vectors over a last row."""
        inputs = {}
        for column, (vector, last) in enumerate(zip(columns, last_row, strict=True)):
            for row, part in enumerate((*vector.parts(), last)):
                inputs[4 * column + row] = part
        return self.out("FunctionNodeCombineMatrix", "Matrix", inputs)

    def call(self, group, label: str, inputs: dict) -> dict[str, Value]:
        """A node of another group; its outputs by name."""
        node = self.node("GeometryNodeGroup", label, inputs, node_tree=group)
        return {socket.name: Value(self, socket) for socket in node.outputs}

    def repeat(self, iterations, state: dict[str, tuple[str, Value]], label: str, body: Callable) -> dict:
        """A Repeat Zone. state: name → (socket type, first value); body: state → next state, by name."""
        start = self.node("GeometryNodeRepeatInput", f"{label}: each time", {})
        end = self.tree.nodes.new("GeometryNodeRepeatOutput")
        end.name = end.label = f"{label}: the end"
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
        start.location.x = self.COLUMN * self._columns[start.name]
        after = body({name: Value(self, start.outputs[name]) for name in state})
        for name, value in after.items():
            self.tree.links.new(value.socket, end.inputs[name])
        columns = [self._columns[value.socket.node.name] + 1 for value in after.values()]
        self._columns[end.name] = max(columns)
        end.parent = self._frame
        end.location = (self.COLUMN * max(columns), 0)
        return {name: Value(self, end.outputs[name]) for name in state}


def node_group(
    name: str, description: str, inputs: dict, outputs: dict, build: Callable, modifier: bool = False
):
    """The node group of a name: the file's own if this build made it, renamed or not, else a new one.

    One that another version of the add-on made stays, under another name, with what uses it.

    inputs: label → (socket type without "NodeSocket", default or None, description). outputs: label →
    socket type. build: (nodes, given values by label) → values by output label.
    """
    existing = bpy.data.node_groups.get((name, None))
    if existing and existing.bl_idname == "GeometryNodeTree" and is_current(existing):
        return existing
    renamed = next((group for group in bpy.data.node_groups if _was_called(group, name)), None)
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
    nodes = FieldBuilder(tree)
    source = nodes.node("NodeGroupInput", "Given", {})
    made = build(nodes, {label: Value(nodes, source.outputs[label]) for label in inputs})
    nodes.close_frame()
    nodes.node("NodeGroupOutput", "Result", made)
    tree[BUILD_KEY], tree[NAME_KEY] = BUILD, name
    return tree


def is_current(group) -> bool:
    """Whether this build made a node group; not None."""
    return group is not None and group.get(BUILD_KEY) == BUILD


def _was_called(group, name: str) -> bool:
    return group.library is None and is_current(group) and group.get(NAME_KEY) == name


def remove_attributes(nodes: FieldBuilder, geometry, pattern: str) -> Value:
    """Remove the named attributes that a pattern with * matches."""
    node = nodes.node("GeometryNodeRemoveAttribute", "Clear up", {"Geometry": geometry, "Name": pattern})
    versions.set_node_menu(node, "Pattern Mode", "pattern_mode", "WILDCARD")
    return Value(nodes, node.outputs[0])
