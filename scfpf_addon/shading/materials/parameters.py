# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of closures: every shader is a Principled surface with some of its inputs fixed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...projection.typing import Array, IndexArray
from ..nodes.graph import Closure, MaterialGraph, Ref, finite

# The least index of refraction.
LEAST_IOR = 1e-5

# The parameters of a closure, each with its value where a shader does not have it.
#
# weight: share of the surface. metallic … alpha, emission: of the Principled shader. multiscatter: share of
# the light between facets that is not lost. grazing: of the way from F0 to 1 at which a metal's F90 lies.
# lit: 1 for closures that lamps light. whole: 1 where refraction is not dimmed by Fresnel's reflection.
# clear: tint of light that passes straight. mirrored: tint of what glass reflects.
#
# From body on they are of its lobes, see ``lobes.split``.
NUMBERS = {
    "weight": 1.0,
    "metallic": 0.0,
    "roughness": 1.0,
    "ior": 1.5,
    "specular_level": 0.0,
    "transmission": 0.0,
    "alpha": 1.0,
    "multiscatter": 1.0,
    "grazing": 1.0,
    "lit": 1.0,
    "whole": 0.0,
    "body": 1.0,
    "metal": 0.0,
    "dielectric": 0.0,
    "glass": 0.0,
    "f0": 0.0,
}
COLORS = {"base_color": 0.0, "emission": 0.0, "clear": 1.0, "mirrored": 1.0, "transparent": 0.0}
USUAL = np.array([*NUMBERS.values(), *np.repeat([*COLORS.values()], 3)])[:, None]
PLACES = {name: slice(row, row + 1) for row, name in enumerate(NUMBERS)} | {
    name: slice(row, row + 3) for row, name in zip(range(len(NUMBERS), len(USUAL), 3), COLORS, strict=True)
}


def _share(values: Array) -> Array:
    return np.clip(values, 0.0, 1.0)


def _positive(values: Array) -> Array:
    return np.maximum(values, 0.0)


# What the inputs of shaders are limited to; emission may be of any sign.
LIMITS: dict[str, Callable[[Array], Array]] = {
    **dict.fromkeys(("metallic", "roughness", "transmission", "alpha", "multiscatter"), _share),
    **dict.fromkeys(("base_color", "color", "specular_level"), _positive),
    "ior": lambda values: np.maximum(values, LEAST_IOR),
}


@dataclass(frozen=True)
class Shader:
    """A kind of shader as a Principled surface.

    inputs: the parameters that its inputs give, by name; one input may give several. fixed: parameters that
    differ from the usual.
    """

    inputs: Mapping[str, tuple[str, ...]]
    fixed: Mapping[str, float] = field(default_factory=dict)


OF_PRINCIPLED = (
    *("base_color", "metallic", "roughness", "ior", "specular_level"),
    *("transmission", "alpha", "emission", "multiscatter"),
)
SHADERS = {
    "DIFFUSE": Shader({"color": ("base_color",)}),
    "EMISSION": Shader({"color": ("emission",)}),
    "GLASS": Shader(
        {"color": ("base_color", "mirrored"), "roughness": ("roughness",), "ior": ("ior",)},
        {"transmission": 1.0, "specular_level": 0.5},
    ),
    "GLOSSY": Shader(
        {"color": ("base_color",), "roughness": ("roughness",), "multiscatter": ("multiscatter",)},
        {"metallic": 1.0, "grazing": 0.0},
    ),
    "PRINCIPLED": Shader({name: (name,) for name in OF_PRINCIPLED}),
    "REFRACTION": Shader(
        {"color": ("base_color",), "ior": ("ior",)},
        {"transmission": 1.0, "lit": 0.0, "whole": 1.0, "mirrored": 0.0},
    ),
    "TRANSPARENT": Shader({"color": ("clear",)}, {"alpha": 0.0}),
}
# Light that enters a Principled surface and leaves it is tinted twice, that of these at each boundary.
TINTED_ONCE = {"GLASS", "REFRACTION"}


@dataclass(frozen=True)
class ClosureRows:
    """Parameters of n closures, by name: (1, n) of NUMBERS, (3, n) of COLORS.

    rows: of m closures, (31, m) float64. index: (n,) the closures among them, None for all in order. A
    parameter is looked up where it is asked for, as most are not.
    """

    rows: Array
    index: IndexArray | None = None

    def __getitem__(self, name: str) -> Array:
        values: Array = self.rows[PLACES[name]]
        return values if self.index is None else values.take(self.index, axis=1)

    @property
    def count(self) -> int:
        """The number of closures."""
        return len(self.rows[0]) if self.index is None else len(self.index)

    @classmethod
    def empty(cls, count: int) -> ClosureRows:
        """Usual parameters, to be filled in."""
        return cls(np.repeat(USUAL, count, axis=1))

    def take(self, index: IndexArray) -> ClosureRows:
        """The closures at ``index``."""
        return ClosureRows(self.rows, index if self.index is None else self.index.take(index))

    @classmethod
    def joined(cls, parts: Sequence[ClosureRows]) -> ClosureRows:
        """The closures of all parts, in order."""
        tables = {id(each.rows): each.rows for each in parts}
        if len(tables) == 1 == len(parts):
            return parts[0]
        first = dict(
            zip(tables, np.cumsum([0, *(table.shape[1] for table in tables.values())]), strict=False)
        )
        index = [
            first[id(each.rows)] + (np.arange(each.count) if each.index is None else each.index)
            for each in parts
        ]
        whole = [*tables.values()]
        return cls(whole[0] if len(whole) == 1 else np.concatenate(whole, axis=1), np.concatenate(index))

    def fill(self, closure: Closure, results: list[tuple[Array, ...]]) -> None:
        """Write a closure's parameters at all rows. results: of the operations that its inputs refer to."""

        def of(ref: Ref) -> Array:
            """The output of an operation, without NaN."""
            return finite(results[ref.operation][ref.output])

        shader = SHADERS[closure.kind]
        for name, number in shader.fixed.items():
            self[name][:] = number
        self["weight"][:] = _positive(of(closure.weight))
        for name, given in shader.inputs.items():
            values = of(closure.inputs[name])
            # A shader's colour has its limit whatever parameter it gives; emission has none.
            if given != ("emission",):
                values = LIMITS[name](values)
            for each in given:
                self[each][:] = values
        if closure.kind in TINTED_ONCE:
            self["base_color"][:] = self["base_color"] ** 2

    def fill_constants(self, graphs: Mapping[int, MaterialGraph]) -> None:
        """Write the parameters of graphs that have one closure of constants each. graphs: by row."""
        kinds: dict[str, list[int]] = {}
        for number, graph in graphs.items():
            kinds.setdefault(graph.closures[0].kind, []).append(number)
        for numbers in kinds.values():
            closures = [(graphs[number], graphs[number].closures[0]) for number in numbers]
            _, first = closures[0]
            names = [name for name in first.inputs if name != "normal"]
            values = [[graph.constant(each.inputs[name]) for graph, each in closures] for name in names]
            weights = [graph.constant(each.weight) for graph, each in closures]
            results: list[tuple[Array, ...]] = [(np.stack(each, axis=1),) for each in (weights, *values)]
            alike = Closure(first.kind, Ref(0), {name: Ref(k) for k, name in enumerate(names, 1)})
            rows = ClosureRows.empty(len(numbers))
            rows.fill(alike, results)
            self.rows[:, numbers] = rows.rows
