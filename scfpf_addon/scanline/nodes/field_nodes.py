# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as nodes: sockets that can be added, multiplied and compared in Python."""

from __future__ import annotations

from math import pi

import bpy

from ...bridge.blender.node_builder import NodeBuilder

_SYMBOLS = {"ADD": "+", "SUBTRACT": "−", "MULTIPLY": "×", "DIVIDE": "÷", "SCALE": "×"}


def _unary(operation: str):
    return lambda self: self.nodes.combine(operation, self)


def _binary(operation: str):
    return lambda self, other: self.nodes.combine(operation, self, other)


def _swapped(operation: str):
    return lambda self, other: self.nodes.combine(operation, other, self)


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

    __add__ = __radd__ = _binary("ADD")
    __mul__ = __rmul__ = _binary("MULTIPLY")
    __sub__, __rsub__ = _binary("SUBTRACT"), _swapped("SUBTRACT")
    __truediv__, __rtruediv__ = _binary("DIVIDE"), _swapped("DIVIDE")
    min, max = _binary("MINIMUM"), _binary("MAXIMUM")
    cross, dot, length = _binary("CROSS_PRODUCT"), _binary("DOT_PRODUCT"), _unary("LENGTH")
    floor, absolute, root = _unary("FLOOR"), _unary("ABSOLUTE"), _unary("SQRT")

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
        """Return whether two numbers differ by less than a tolerance; whole ones: whether they are equal."""
        return (self - other).absolute() < tolerance

    def parts(self) -> tuple[Value, Value, Value]:
        """x, y and z of a vector."""
        return self.nodes.outs("ShaderNodeSeparateXYZ", "x, y, z", {0: self}, 0, 1, 2)

    def largest(self) -> Value:
        """The largest of x, y and z."""
        x, y, z = self.parts()
        return x.max(y).max(z)


class FieldBuilder(NodeBuilder):
    """A NodeBuilder whose sockets are ``Value``s: formulas in node trees of any type."""

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

    def shader_attribute(self, name: str, output: str = "Vector") -> Value:
        """An attribute of the mesh, in a material."""
        return self.out("ShaderNodeAttribute", name, {}, output, attribute_name=name)

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
