# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of graphs: those that differ in constants alone are one graph, with tables of constants."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...projection.typing import Array, IndexArray
from .graph import Closure, MaterialGraph, Operation, Ref


@dataclass(frozen=True)
class GraphKind:
    """Some materials' graphs as one.

    graph: constants in which the materials differ are PARAMETER operations. members: (K,) the materials'
    numbers, in the order of the parameters' columns.
    """

    graph: MaterialGraph
    members: IndexArray

    @property
    def constant(self) -> bool:
        """Return whether the closures are the same at all hits of a material, but for the normal."""
        return all(each.kind in {"CONSTANT", "PARAMETER", "NORMAL"} for each in self.graph.operations)


def graph_kinds(graphs: Mapping[int, MaterialGraph]) -> tuple[GraphKind, ...]:
    """The kinds of graphs, by materials' numbers."""
    groups: dict[Hashable, tuple[MaterialGraph, list[int], list[list[Array]]]] = {}
    for number, graph in graphs.items():
        spread, constants = _with_slots(graph)
        _, members, rows = groups.setdefault(_key(spread), (spread, [], []))
        members.append(number)
        rows.append(constants)
    made = []
    for graph, members, rows in groups.values():
        tables = [np.concatenate(slot, axis=1) for slot in zip(*rows, strict=True)]
        made.append(GraphKind(_filled(graph, tables), np.array(members, np.intp)))
    return tuple(made)


def _with_slots(graph: MaterialGraph) -> tuple[MaterialGraph, list[Array]]:
    """The graph with a constant of its own for each use of one, and the values (channels, 1) of these.

    Graphs list a constant once, however many inputs have its value by chance.
    """
    constants: list[Array] = []
    roots = [ref for each in graph.closures for ref in (each.weight, *each.inputs.values())]
    operations, moved = _spread(graph.operations, roots, constants)
    refs = iter(moved)
    closures = tuple(
        Closure(each.kind, next(refs), {name: next(refs) for name in each.inputs}) for each in graph.closures
    )
    return replace(graph, operations=tuple(operations), closures=closures), constants


def _spread(
    operations: Sequence[Operation], roots: Sequence[Ref], constants: list[Array]
) -> tuple[list[Operation], list[Ref]]:
    """The operations and outputs ``roots`` of a graph with slots; the slots' values are appended."""
    made: list[Operation] = []
    numbers: dict[int, int] = {}

    def moved(ref: Ref) -> Ref:
        """An output in the new operations."""
        operation = operations[ref.operation]
        if operation.kind != "CONSTANT":
            return Ref(numbers[ref.operation], ref.output)
        value = np.asarray(operation.settings["value"], np.float64).reshape(-1, 1)
        made.append(Operation("CONSTANT", (), {"slot": len(constants), "channels": len(value)}))
        constants.append(value)
        return Ref(len(made) - 1)

    for number, operation in enumerate(operations):
        if operation.kind == "CONSTANT":
            continue
        settings = dict(operation.settings)
        if "height" in settings:
            inner, (output,) = _spread(settings["height"].operations, [settings["output"]], constants)
            settings |= {"height": replace(settings["height"], operations=tuple(inner)), "output": output}
        inputs = tuple(moved(ref) for ref in operation.inputs)
        numbers[number] = len(made)
        made.append(Operation(operation.kind, inputs, settings))
    return made, [moved(ref) for ref in roots]


def _key(value: Any) -> Hashable:
    """A key that graphs and settings share if they are alike."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, MaterialGraph):
        return _key(value.operations), _key(value.closures)
    if isinstance(value, Operation):
        return value.kind, value.inputs, _key(value.settings)
    if isinstance(value, Closure):
        return value.kind, value.weight, _key(value.inputs)
    if isinstance(value, Mapping):
        return tuple((name, _key(value[name])) for name in sorted(value))
    if isinstance(value, (tuple, list)):
        return tuple(_key(each) for each in value)
    hashable: Hashable = value
    return hashable


def _filled(graph: MaterialGraph, tables: list[Array]) -> MaterialGraph:
    """The graph with the values (channels, K) of its slots: constants where all K are alike."""

    def filled(operation: Operation) -> Operation:
        """An operation with its values."""
        settings = operation.settings
        if "slot" in settings:
            table = tables[settings["slot"]]
            if (table == table[:, :1]).all():
                return Operation("CONSTANT", (), {"value": table[:, 0]})
            return Operation("PARAMETER", (), {"values": table})
        if "height" in settings:
            return replace(operation, settings={**settings, "height": _filled(settings["height"], tables)})
        return operation

    return replace(graph, operations=tuple(filled(each) for each in graph.operations))
