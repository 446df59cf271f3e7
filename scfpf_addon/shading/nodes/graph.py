# SPDX-License-Identifier: GPL-3.0-or-later
"""A material as data: operations in the order in which they are reckoned, and the shaders they feed.

A register is what one output of an operation gives: an array (1, n) of numbers or (3, n) of
vectors and colours, float64, for the n hits of the material; n is 1 for what is the same at all
of them, so that constants cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from ...projection.typing import Array
from .context import ShadingContext

ClosureKind = Literal["PRINCIPLED", "DIFFUSE", "GLOSSY", "EMISSION", "TRANSPARENT", "GLASS", "REFRACTION"]

# What an operation does: its inputs, its settings, where the hits are → its outputs.
Evaluator: TypeAlias = Callable[[Sequence[Array], Mapping[str, Any], ShadingContext], tuple[Array, ...]]


class Ref(NamedTuple):
    """One output of an operation."""

    operation: int
    output: int = 0


@dataclass(frozen=True)
class Operation:
    """kind: of ``operations.OPERATIONS``. inputs: of operations before. settings: by kind."""

    kind: str
    inputs: tuple[Ref, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Closure:
    """One shader of the sum that a surface is. weight: its share; inputs: by name (``lobes``)."""

    kind: ClosureKind
    weight: Ref
    inputs: Mapping[str, Ref]


@dataclass(frozen=True)
class MaterialGraph:
    """operations: topologically ordered. closures: their sum is the surface.

    images: names of the images that are looked up. layers: names of the layers of
    ``Geometry.layers`` that are. reflects: whether light can be sent on to what the volume does not hold.
    """

    operations: tuple[Operation, ...]
    closures: tuple[Closure, ...]
    images: frozenset[str] = frozenset()
    layers: frozenset[str] = frozenset()
    reflects: bool = False

    def is_always_black(self, ref: Ref) -> bool:
        """Whether an output is the constant 0."""
        return self._is_always(ref, 0.0)

    @property
    def lets_through(self) -> bool:
        """Whether light may go straight through."""
        return any(
            each.kind == "TRANSPARENT"
            or (each.kind == "PRINCIPLED" and not self._is_always(each.inputs["alpha"], 1.0))
            for each in self.closures
        )

    def _is_always(self, ref: Ref, value: float) -> bool:
        operation = self.operations[ref.operation]
        return operation.kind == "CONSTANT" and bool(np.all(operation.settings["value"] == value))


def finite(values: Array) -> Array:
    """Replace NaN and infinities with 0."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, posinf=0.0, neginf=0.0)


def registers(
    graph: MaterialGraph, place: ShadingContext, table: Mapping[str, Evaluator]
) -> list[tuple[Array, ...]]:
    """The outputs of all operations at the hits."""
    results: list[tuple[Array, ...]] = []
    # Numbers that are none may come of any input; what shades takes them for 0.
    with np.errstate(all="ignore"):
        for operation in graph.operations:
            inputs = [results[ref.operation][ref.output] for ref in operation.inputs]
            results.append(table[operation.kind](inputs, operation.settings, place))
    return results
