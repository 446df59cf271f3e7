# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as nodes: sockets that can be added, multiplied and compared in Python."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from math import pi

import bpy

from ...bridge.blender import versions
from ...bridge.blender.node_builder import NodeBuilder

# A node group of another build in a file is not used: raise the number with every change of a group.
BUILD = 8
BUILD_KEY = "scfpf_build"
# Custom property: the name that a node group was made with. The artist may rename the group.
NAME_KEY = "scfpf_name"

_SYMBOLS = {"ADD": "+", "SUBTRACT": "−", "MULTIPLY": "×", "DIVIDE": "÷", "SCALE": "×"}


class Value:
    """An output socket that formulas can be written with.

    Numbers and vectors: + - * /, max, min, absolute, floor. Numbers: < >, near, root, and divmod of whole
    numbers. Vectors: cross, dot, length, parts, largest. Booleans: & | ~.
    """

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

    def __and__(self, other):
        return self.nodes.logic("And", self, other)

    def __or__(self, other):
        return self.nodes.logic("Or", self, other)

    def __invert__(self):
        return self.nodes.logic("Not", self)

    def __divmod__(self, count):
        # Half more: rounding must not make a whole number fall short.
        quotient = ((self + 0.5) / count).floor()
        return quotient, self - quotient * count

    def near(self, other, tolerance=0.5):
        """Whether two numbers differ by less than a tolerance; whole numbers: whether they are equal."""
        return (self - other).absolute() < tolerance

    def floor(self):
        return self.nodes.combine("FLOOR", self)

    def absolute(self):
        return self.nodes.combine("ABSOLUTE", self)

    def min(self, other):
        return self.nodes.combine("MINIMUM", self, other)

    def max(self, other):
        return self.nodes.combine("MAXIMUM", self, other)

    def root(self):
        return self.nodes.combine("SQRT", self)

    def cross(self, other):
        return self.nodes.combine("CROSS_PRODUCT", self, other)

    def dot(self, other):
        return self.nodes.combine("DOT_PRODUCT", self, other)

    def length(self):
        return self.nodes.combine("LENGTH", self)

    def parts(self) -> tuple[Value, Value, Value]:
        """x, y and z of a vector."""
        return self.nodes.outs("ShaderNodeSeparateXYZ", "x, y, z", {0: self}, 0, 1, 2)

    def largest(self) -> Value:
        """The largest of x, y and z."""
        x, y, z = self.parts()
        return x.max(y).max(z)


class FieldBuilder(NodeBuilder):
    """A NodeBuilder whose sockets are ``Value``s."""

    def node(self, kind: str, label: str, inputs: dict, **settings):
        plain = {key: value.socket if isinstance(value, Value) else value for key, value in inputs.items()}
        return super().node(kind, label, plain, **settings)

    def out(self, kind: str, label: str, inputs: dict, output: int | str = 0, **settings) -> Value:
        """One output of a new node."""
        return Value(self, self.node(kind, label, inputs, **settings).outputs[output])

    def outs(self, kind: str, label: str, inputs: dict, *outputs: int | str, **settings) -> tuple[Value, ...]:
        """Several outputs of a new node."""
        node = self.node(kind, label, inputs, **settings)
        return tuple(Value(self, node.outputs[output]) for output in outputs)

    def combine(self, operation: str, a, b=None) -> Value:
        """A math node, or a vector math node if a side is a vector."""
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

    def logic(self, label: str, *sides) -> Value:
        """And, Or, Not."""
        return self.out("FunctionNodeBooleanMath", label, dict(enumerate(sides)), operation=label.upper())

    def position(self) -> Value:
        return self.out("GeometryNodeInputPosition", "Position", {})

    def index(self) -> Value:
        return self.out("GeometryNodeInputIndex", "Index", {})

    def xyz(self, x, y, z, label: str) -> Value:
        return self.out("ShaderNodeCombineXYZ", label, {0: x, 1: y, 2: z})

    def switch(self, condition, false, true, kind: str, label: str) -> Value:
        inputs = {"Switch": condition}
        inputs |= {key: side for key, side in (("False", false), ("True", true)) if side is not None}
        return self.out("GeometryNodeSwitch", label, inputs, input_type=kind)

    def choose(self, index, choices: list, kind: str, label: str) -> Value:
        """The choice of an index: sockets, constants, or None for zero."""
        node = self.node("GeometryNodeIndexSwitch", label, {"Index": index}, data_type=kind)
        while len(node.index_switch_items) < len(choices):
            node.index_switch_items.new()
        for number, choice in enumerate(choices):
            if isinstance(choice, bpy.types.NodeSocket):
                self.tree.links.new(choice, node.inputs[str(number)])
            elif choice is not None:
                node.inputs[str(number)].default_value = choice
        return Value(self, node.outputs[0])

    def polar(self, x, y) -> tuple[Value, Value]:
        """The angle of (x, y) as a share of a turn, from 0 to 1, and its distance from the origin."""
        turn = self.combine("ARCTAN2", y, x) / (2 * pi)
        return turn - turn.floor(), (x * x + y * y).root()

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
        node.location.x = self.COLUMN * self._columns[node.name]
        return Value(self, node.outputs[0])

    def point(self, position, matrix, label: str = "Transform Point") -> Value:
        return self.out("FunctionNodeTransformPoint", label, {0: position, 1: matrix})

    def mix(self, factor, a, b) -> Value:
        """a + (b - a) · factor; vectors component by component."""
        return a + (b - a) * factor

    def matrix(self, columns, last_row=(0.0, 0.0, 0.0, 1.0)) -> Value:
        """The 4 × 4 matrix of four column vectors over a last row."""
        inputs = {}
        for column, (vector, last) in enumerate(zip(columns, last_row, strict=True)):
            for row, part in enumerate((*vector.parts(), last)):
                inputs[4 * column + row] = part
        return self.out("FunctionNodeCombineMatrix", "Matrix", inputs)

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
        end.location = (self.COLUMN * max(columns), 0)
        return {name: Value(self, end.outputs[name]) for name in state}


def node_group(
    name: str, description: str, inputs: dict, outputs: dict, build: Callable, modifier: bool = False
):
    """Return the node group of a name: the file's own if this build made it, renamed or not, else a new one.

    A group that another version of the add-on made keeps its users, under another name.

    inputs: label → (socket type without "NodeSocket", default or None, description). outputs: label →
    socket type. build: (nodes, given values by label) → values by output label. modifier: whether the group
    is offered as a modifier.
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
    """Whether this build made a node group; not None."""
    return group is not None and group.get(BUILD_KEY) == BUILD


def _was_called(group, name: str) -> bool:
    return group.library is None and is_current(group) and group.get(NAME_KEY) == name


def remove_attributes(nodes: FieldBuilder, geometry, pattern: str) -> Value:
    """Remove the named attributes that a pattern with * matches."""
    node = nodes.node("GeometryNodeRemoveAttribute", "Clear up", {"Geometry": geometry, "Name": pattern})
    versions.set_node_menu(node, "Pattern Mode", "pattern_mode", "WILDCARD")
    return Value(nodes, node.outputs[0])
