# SPDX-License-Identifier: GPL-3.0-or-later
"""A material as data: operations in the order of evaluation, and the closures that they feed.

A register holds one output of an operation: an array (1, n) of numbers or (3, n) of
vectors and colours, float64, for the n hits of the material; n is 1 if the value is the same at all
hits, so that constants cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from ...projection.typing import Array
from .context import ShadingContext

ClosureKind = Literal["PRINCIPLED", "DIFFUSE", "GLOSSY", "EMISSION", "TRANSPARENT", "GLASS", "REFRACTION"]

Inputs: TypeAlias = Sequence[Array]
Settings: TypeAlias = Mapping[str, Any]
# Computes the outputs of an operation from its inputs, its settings and the hits.
Evaluator: TypeAlias = Callable[[Inputs, Settings, ShadingContext], tuple[Array, ...]]


class Ref(NamedTuple):
    """One output of an operation."""

    operation: int
    output: int = 0


@dataclass(frozen=True)
class Operation:
    """One step of a graph. kind: see ``operations.OPERATIONS``. inputs: outputs of earlier operations."""

    kind: str
    inputs: tuple[Ref, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Closure:
    """One shader of the sum that makes a surface. weight: its share. inputs: by name, see ``lobes``."""

    kind: ClosureKind
    weight: Ref
    inputs: Mapping[str, Ref]


@dataclass(frozen=True)
class MaterialGraph:
    """A material as data. operations: topologically ordered. closures: their sum is the surface.

    images: names of the images that operations read. layers: names of the layers of
    ``Geometry.layers`` that they read. reflects: whether rays may leave the volume, off mirrors or through
    glass.
    """

    operations: tuple[Operation, ...]
    closures: tuple[Closure, ...]
    images: frozenset[str] = frozenset()
    layers: frozenset[str] = frozenset()
    reflects: bool = False

    def is_always_black(self, ref: Ref) -> bool:
        """Return whether an output is the constant 0."""
        return self._is_always(ref, 0.0)

    @property
    def shines(self) -> bool:
        """Return whether any closure may emit light."""
        emitted = (
            each.inputs["color" if each.kind == "EMISSION" else "emission"]
            for each in self.closures
            if each.kind in {"EMISSION", "PRINCIPLED"}
        )
        return any(not self.is_always_black(ref) for ref in emitted)

    @property
    def lets_through(self) -> bool:
        """Return whether any closure may be transparent."""
        return any(
            each.kind == "TRANSPARENT"
            or (each.kind == "PRINCIPLED" and not self._is_always(each.inputs["alpha"], 1.0))
            for each in self.closures
        )

    @property
    def refracts(self) -> bool:
        """Return whether any closure may refract."""
        return any(
            each.kind in {"GLASS", "REFRACTION"}
            or (each.kind == "PRINCIPLED" and not self._is_always(each.inputs["transmission"], 0.0))
            for each in self.closures
        )

    def constant(self, ref: Ref) -> Array:
        """The value of an output that is a constant, (1,) or (3,)."""
        value: Array = self.operations[ref.operation].settings["value"]
        return value

    def _is_always(self, ref: Ref, value: float) -> bool:
        is_constant = self.operations[ref.operation].kind == "CONSTANT"
        return is_constant and bool(np.all(self.constant(ref) == value))


def finite(values: Array) -> Array:
    """Replace NaN and infinities with 0."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, posinf=0.0, neginf=0.0)


def registers(
    graph: MaterialGraph, context: ShadingContext, table: Mapping[str, Evaluator]
) -> list[tuple[Array, ...]]:
    """The outputs of all operations at the hits."""
    results: list[tuple[Array, ...]] = []
    # Any input may produce NaN; shading treats it as 0.
    with np.errstate(all="ignore"):
        for operation in graph.operations:
            inputs = [results[ref.operation][ref.output] for ref in operation.inputs]
            results.append(table[operation.kind](inputs, operation.settings, context))
    return results
