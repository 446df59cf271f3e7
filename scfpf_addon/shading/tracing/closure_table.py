# SPDX-License-Identifier: GPL-3.0-or-later
"""The closures at the hits of a wave: rows of a table for constants, and rows made at hits by node graphs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...projection.typing import Array, BoolArray, IndexArray
from ..materials.constants import Materials
from ..materials.lobes import bodies, scatters, split
from ..materials.parameters import ClosureRows
from ..nodes.context import ShadingContext
from ..nodes.graph import MaterialGraph, registers
from ..nodes.graph_kinds import GraphKind, graph_kinds
from ..nodes.operations import OPERATIONS
from ..scene.world import NOWHERE

# Hits whose graph is evaluated at once: a large graph keeps a hundred arrays of them.
MOST_AT_ONCE = 1 << 14


class HitClosures(NamedTuple):
    """Closures at hits of a wave. where: (n,) the hits. normal: (3, n) unit, float64."""

    where: IndexArray
    rows: ClosureRows
    normal: Array

    def take(self, index: IndexArray) -> HitClosures:
        """The closures at ``index``."""
        return HitClosures(self.where.take(index), self.rows.take(index), self.normal.take(index, axis=1))

    def scattering(self) -> HitClosures:
        """The closures that send light on."""
        return self.take(np.flatnonzero(scatters(self.rows)))

    @classmethod
    def joined(cls, parts: Sequence[HitClosures]) -> HitClosures:
        """The closures of one or several parts, in order."""
        if len(parts) == 1:
            return parts[0]
        where, normal = (np.concatenate([each[k] for each in parts], axis=-1) for k in (0, 2))
        return cls(where, ClosureRows.joined([each.rows for each in parts]), normal)


@dataclass(frozen=True)
class ClosureTable:
    """The closures of a scene's materials.

    constants: (J, M) a material's closures that are constants, as rows of the table, -1 for none. rows: of
    them; the first M are those of materials without graphs. scatters: (R,) whether closures send light on.
    kinds: of graphs that are evaluated at hits. kind: (M,) number of a material's, -1 for none. variant: (M,)
    number in the kind. shown_beyond: (M,) whether hits beyond a limit of bounces shine or let light through.
    """

    constants: IndexArray
    rows: ClosureRows
    scatters: BoolArray
    kinds: tuple[GraphKind, ...]
    kind: IndexArray
    variant: IndexArray
    shown_beyond: BoolArray

    @classmethod
    def of(cls, materials: Materials) -> ClosureTable:
        """The table of a scene's materials."""
        count = len(materials.metallic)
        kind, variant, alone = np.full(count, -1), np.zeros(count, np.intp), np.arange(count)
        alone[list(materials.graphs)] = -1
        shown = np.asarray(materials.emission).any(axis=1)
        constants, parts, total = [alone], [ClosureRows.empty(count)], count
        evaluated: list[GraphKind] = []
        for each in graph_kinds(materials.graphs):
            if not each.constant:
                kind[each.members], variant[each.members] = len(evaluated), np.arange(len(each.members))
                shown[each.members] = each.graph.lets_through or each.graph.shines
                evaluated.append(each)
                continue
            for number, closures in enumerate(_constant_closures(each)):
                if number == len(constants):
                    constants.append(np.full(count, -1))
                constants[number][each.members] = total + np.arange(closures.count)
                shown[each.members] |= closures["emission"].any(axis=0) | closures["transparent"].any(axis=0)
                parts.append(closures)
                total += closures.count
        rows = ClosureRows.joined(parts)
        return cls(np.stack(constants), rows, scatters(rows), tuple(evaluated), kind, variant, shown)

    def all_constants(self, materials: Materials) -> Materials:
        """The constants of the table's rows. materials: those that the table is made of."""
        count = len(materials.metallic)
        return materials.followed_by(bodies(self.rows.take(np.arange(count, self.rows.count))))

    def constants_at(self, material: IndexArray) -> Iterator[tuple[IndexArray, IndexArray]]:
        """The closures that are constants at hits on materials (n,): places and rows, (m,) each."""
        for table in self.constants:
            row = table.take(material)
            which = np.flatnonzero(row >= 0)
            if len(which):
                yield which, row.take(which)

    def made_at(
        self, material: IndexArray, context_of: Callable[[IndexArray], ShadingContext]
    ) -> HitClosures | None:
        """The closures that graphs make at hits on materials (n,), None for none; context_of: some hits."""
        kind = self.kind.take(material) if self.kinds else np.zeros(0, np.intp)
        made: list[HitClosures] = []
        for number in np.unique(kind[kind >= 0]):
            everywhere = np.flatnonzero(kind == number)
            for first in range(0, len(everywhere), MOST_AT_ONCE):
                raise_if_cancelled()
                which = everywhere[first : first + MOST_AT_ONCE]
                context = replace(context_of(which), variant=self.variant.take(material.take(which)))
                made.extend(
                    HitClosures(which, split(rows), normal)
                    for rows, normal in closures_at(self.kinds[number].graph, context)
                )
        return HitClosures.joined(made) if made else None


def closures_at(graph: MaterialGraph, context: ShadingContext) -> Iterator[tuple[ClosureRows, Array]]:
    """The closures of a graph at n hits, before their lobes are split, and their normals (3, n)."""
    results = registers(graph, context, OPERATIONS)
    for closure in graph.closures:
        rows = ClosureRows.empty(context.count)
        rows.fill(closure, results)
        ref = closure.inputs["normal"]
        yield rows, np.broadcast_to(results[ref.operation][ref.output], (3, context.count))


def _constant_closures(kind: GraphKind) -> Iterator[ClosureRows]:
    """The closures of graphs of constants, one row a graph."""
    count = len(kind.members)
    nothing = np.zeros((3, count))
    nowhere = ShadingContext(
        geometry=NOWHERE,
        images={},
        triangle=np.zeros(count, np.intp),
        barycentric=nothing[:2],
        position=nothing,
        normal=nothing,
        flat=nothing,
        view=nothing,
        back=nothing[:1],
        variant=np.arange(count),
    )
    for rows, _ in closures_at(kind.graph, nowhere):
        yield split(rows)
