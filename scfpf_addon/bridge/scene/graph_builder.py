# SPDX-License-Identifier: GPL-3.0-or-later
"""The construction of a material graph: constants are folded, and each is listed once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...projection.typing import Array
from ...shading.nodes import colors, numbers
from ...shading.nodes.graph import Closure, MaterialGraph, Operation, Ref, finite

# Operations that need no shading context: of constants they give constants.
PURE = {**colors.OPERATIONS, **numbers.OPERATIONS}


class GraphBuilder:
    """Gathers operations and closures. notes: on parts that are not shown as they are, in order."""

    def __init__(self) -> None:
        self.notes: dict[str, None] = {}
        self.closures: list[Closure] = []
        self._operations: list[Operation] = []
        self._constants: dict[bytes, Ref] = {}
        self._normal: Ref | None = None

    def constant(self, *value: float) -> Ref:
        """The constant of one number or three; NaN and infinity become 0."""
        return self._constant(finite(np.array(value, np.float64)))

    def _constant(self, value: Array) -> Ref:
        key = value.tobytes()
        if key not in self._constants:
            self._constants[key] = self._append(Operation("CONSTANT", (), {"value": value}))
        return self._constants[key]

    def _append(self, operation: Operation) -> Ref:
        self._operations.append(operation)
        return Ref(len(self._operations) - 1)

    def add(self, kind: str, /, *inputs: Ref, outputs: int = 1, **settings) -> list[Ref]:
        """Add an operation and return its outputs; pure operations of constants give constants."""
        values = [self.value(ref) for ref in inputs]
        if inputs and kind in PURE and all(value is not None for value in values):
            found = PURE[kind]([value.reshape(-1, 1) for value in values], settings, None)
            return [self._constant(finite(each.reshape(-1))) for each in found]
        number = self._append(Operation(kind, inputs, settings)).operation
        return [Ref(number, output) for output in range(outputs)]

    def one(self, kind: str, /, *inputs: Ref, **settings) -> Ref:
        """Add an operation with one output and return that."""
        return self.add(kind, *inputs, **settings)[0]

    def value(self, ref: Ref) -> Array | None:
        """The value of a constant, (1,) or (3,); None for other operations."""
        operation = self._operations[ref.operation]
        return operation.settings["value"] if operation.kind == "CONSTANT" else None

    def is_always(self, ref: Ref, value: float) -> bool:
        """Return whether an output is a constant of this value."""
        found = self.value(ref)
        return found is not None and bool((found == value).all())

    def normal(self) -> Ref:
        """The shading normal."""
        if self._normal is None:
            self._normal = self.one("NORMAL")
        return self._normal

    def product(self, a: Ref, b: Ref) -> Ref:
        """a × b."""
        if self.is_always(a, 1.0):
            return b
        return a if self.is_always(b, 1.0) else self.one("MULTIPLY", a, b)

    def convert(self, ref: Ref, source: str, target: str) -> Ref:
        """Convert a value as a link between sockets of two types does."""
        if target == "VECTOR" or target == "RGBA":
            return ref if source in {"VECTOR", "RGBA", "ROTATION"} else self.one("CONVERT", ref, to="SPREAD")
        if source == "RGBA":
            return self.one("CONVERT", ref, to="GREY")
        return self.one("CONVERT", ref, to="MEAN") if source in {"VECTOR", "ROTATION"} else ref

    def layer(self, name: str, channels: int) -> list[Ref]:
        """The outputs of a layer: vector, mean, alpha, and 1 where the layer exists, else 0."""
        return self.add("LAYER", outputs=4, name=name, channels=channels)

    def apart(self, ref: Ref) -> tuple[MaterialGraph, Ref]:
        """The operations behind an output, as a graph without closures, and the output in it."""
        self.closures.append(Closure("EMISSION", ref, {}))
        graph = self.graph(False)
        self.closures.pop()
        return replace(graph, closures=()), graph.closures[-1].weight

    def graph(self, reflects: bool) -> MaterialGraph:
        """The graph of all operations that the closures need. reflects: see ``MaterialGraph``."""
        wanted = [ref for closure in self.closures for ref in (closure.weight, *closure.inputs.values())]
        used = set()
        while wanted:
            number = wanted.pop().operation
            if number not in used:
                used.add(number)
                wanted.extend(self._operations[number].inputs)
        new_numbers = {old: new for new, old in enumerate(sorted(used))}
        operations = [self._operations[old] for old in sorted(used)]
        settings = [operation.settings for operation in operations]
        return MaterialGraph(
            tuple(
                Operation(each.kind, tuple(_moved(ref, new_numbers) for ref in each.inputs), each.settings)
                for each in operations
            ),
            tuple(
                Closure(
                    each.kind,
                    _moved(each.weight, new_numbers),
                    {name: _moved(ref, new_numbers) for name, ref in each.inputs.items()},
                )
                for each in self.closures
            ),
            frozenset(_names(settings, "image")),
            frozenset(_names(settings, "name", "layer")),
            reflects,
        )


def _names(settings: list, *keys: str) -> set[str]:
    """The values of these settings of operations, and of those in graphs within them."""
    found = {each[key] for each in settings for key in keys if each.get(key) is not None}
    for each in settings:
        if "height" in each:
            found |= each["height"].images if "image" in keys else each["height"].layers
    return found


def _moved(ref: Ref, new_numbers: dict[int, int]) -> Ref:
    return Ref(new_numbers[ref.operation], ref.output)
