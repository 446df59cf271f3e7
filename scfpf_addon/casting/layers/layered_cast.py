# SPDX-License-Identifier: GPL-3.0-or-later
"""First and next hits of an image with layers: each volume meets its own things, and the nearest key wins.

Every hit is a point of the one scene. Its key says how far it is: its distance from the image's eye, or that
of the middle of its layer's things, or its layer's place in the list.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.viewing_volume import Projection, Projectors
from ..cast import cast, cast_at_nothing, near_order, needs_order
from ..common.hits import CastCounts, Hits
from ..continuation import TileProjectors
from .layer_keys import layer_keys
from .layer_parts import LayerParts

# Hits of one volume that are passed at most to find the first one in a halo or behind a transparent hit.
MOST_PASSED = 64


# The key of a layer's nearest thing is at least this share of the distance to its box: hits of curves lie in
# their triangles but for the pixel error.
NEARER = 1.0 - 2.0**-10
ONE = np.ones(1, bool)


class LayeredHits(NamedTuple):
    """The first hits of N image positions. layer: (N,) number of the layer of each; 0 for misses."""

    hits: Hits
    layer: NDArray[np.uint8]


class _Meeting(NamedTuple):
    """Image positions (n,) at which a layer may be seen, by their numbers, and the projection of these.

    Where casting needs it, those that follow one another are near to each other.
    """

    which: IndexArray
    projection: Projection


@dataclass(frozen=True)
class KnownProjectors(Projection):
    """A projection whose projectors are known. which: (n,) those of its image positions, None for all."""

    known: Projectors | None = None
    which: IndexArray | None = None

    @classmethod
    def of(cls, projection: Projection, known: Projectors) -> KnownProjectors:
        """The projection bound to the image positions of its projectors ``known``."""
        return cls(**{each.name: getattr(projection, each.name) for each in fields(Projection)}, known=known)

    def projectors(self, x: Array, y: Array) -> Projectors:
        assert self.known is not None
        if self.which is None:
            return self.known
        return Projectors(self.known.points.take(self.which, 2), self.known.valid.take(self.which))

    def subset(self, which: IndexArray) -> Projection:
        return replace(self, which=which if self.which is None else self.which[which])


@dataclass(frozen=True, kw_only=True)
class LayeredCast:
    """A cast at the parts of a scene.

    projection: with its layers, in cast space. The others are as for ``cast``.
    """

    parts: LayerParts
    projection: Projection
    pixel_size: tuple[float, float]
    pixel_error: float
    weighted: bool = True

    def first_hits(self, x: Array, y: Array, counts: CastCounts, columns: int | None = None) -> LayeredHits:
        """The first hits at image positions x, y (N,). columns: as for ``cast``.

        The counts' projectors are those of layer 0 alone: one for each position.
        """
        (found,) = self.in_front(x, y, [self.rest_hits(x, y, counts, columns)], counts)
        return found

    def rest_hits(self, x: Array, y: Array, counts: CastCounts, columns: int | None) -> Hits:
        """The first hits of layer 0 alone at image positions x, y (N,). columns: as for ``cast``."""
        if self.parts.rest is None:
            return cast_at_nothing(self.projection, x, y)
        rest = self.pixel_size, self.pixel_error
        return cast(self.parts.rest, self.projection, x, y, *rest, counts, columns, self.weighted)

    def in_front(self, x: Array, y: Array, rests: Sequence[Hits], counts: CastCounts) -> list[LayeredHits]:
        """The first hits of S samples of N pixels, one result a sample.

        x, y: (S·N,) image positions, sample by sample. rests: each sample's hits (N,) of layer 0, which are
        changed in place. All samples share the chords of curved layers: planning them takes longer than
        casting.
        """
        size = max(len(x) // len(rests), 1)
        layer = np.zeros(len(x), np.uint8)
        nearest = np.concatenate([self.keys(0, rest) for rest in rests])
        rests = [rest._replace(mask=rest.mask.copy()) for rest in rests]
        for number in range(1, len(self.projection.layers) + 1):
            seen = self._meeting(number, x, y, nearest)
            which = seen.which
            if not len(which):
                continue
            own = CastCounts()
            found = self._hits_of(number, seen.projection, x[which], y[which], own, in_order=True)
            counts.add(replace(own, projectors=0))
            key = self.keys(number, found)
            better = np.flatnonzero(key < nearest[which])
            won = which[better]
            nearest[won], layer[won] = key[better], number
            sample = won // size
            for place, rest in enumerate(rests):
                some = np.flatnonzero(sample == place)
                rest.put(won[some] - place * size, found.take(better[some]))
        return [LayeredHits(*each) for each in zip(rests, layer.reshape(len(rests), -1), strict=True)]

    def may_meet(self, number: int, x: Array, y: Array) -> BoolArray:
        """Return whether a layer from 1 on may be seen at image positions (N,)."""
        met = np.zeros(len(x), bool)
        met[self._meeting(number, x, y).which] = True
        return met

    def _meeting(self, number: int, x: Array, y: Array, nearest: Array | None = None) -> _Meeting:
        """The image positions (N,) at which a layer from 1 on may be seen, nearer than keys (N,) if given."""
        layer, part = self.projection.layers[number - 1], self.parts.parts[number - 1]
        projection = layer.projection
        if part is None:
            return _Meeting(np.zeros(0, np.intp), projection)
        which = np.arange(len(x)) if part.bounds is None else np.flatnonzero(part.bounds.hold(x, y))
        if nearest is not None:
            which = which[nearest.take(which) > self._least_key(number)]
        # The frame of the layer's picture first: projectors cost more.
        image = projection.reparameterisation.points(x[which], y[which], projection.aspect)
        shown = layer.shown_at(x[which], y[which]) & image.mask
        if part.cells is not None:
            shown &= part.cells.hold(image.u, image.v)
        which = which[shown]
        if not len(which):
            return _Meeting(which, projection)
        met: IndexArray = np.arange(len(which))
        if part.bounds is None and part.cells is None:
            known = projection.projectors(x[which], y[which])
            is_straight = projection.volume.spans.is_straight
            met = np.flatnonzero(part.hull.met_by(known, is_straight, part.around(layer)))
            which, projection = which[met], KnownProjectors.of(projection, known)
        if len(which) and needs_order(projection, self.pixel_error):
            order = near_order(x[which], y[which], self.pixel_size)
            which, met = which[order], met[order]
        return _Meeting(which, projection.subset(met))

    def _least_key(self, number: int) -> float:
        """A key that no hit of a layer from 1 on is below."""
        layer, part = self.projection.layers[number - 1], self.parts.parts[number - 1]
        assert part is not None
        if layer.front == "DEPTH":
            away = float(part.box.distance(layer.eye[:, None])[0]) - part.around(layer)
            return max(away, 0.0) * NEARER
        middle = part.box.middle
        return float(layer_keys(self.projection.layers, number, middle[:, None], ONE, middle)[0])

    def hits_of(self, number: int, which: IndexArray, x: Array, y: Array, counts: CastCounts) -> Hits:
        """The first hits of one layer alone at some (n,) of the image positions x, y (N,)."""
        if not number:
            alone = replace(self, projection=self.projection.subset(which))
            return alone.rest_hits(x[which], y[which], counts, None)
        projection = self.projection.layers[number - 1].projection
        return self._hits_of(number, projection, x[which], y[which], counts)

    def _hits_of(
        self,
        number: int,
        projection: Projection,
        x: Array,
        y: Array,
        counts: CastCounts,
        in_order: bool = False,
    ) -> Hits:
        """The first hits of a layer from 1 on at image positions x, y (N,). in_order: as for ``cast``."""
        part = self.parts.parts[number - 1]
        if part is None:
            return cast_at_nothing(projection, x, y)
        rest = self.pixel_size, self.pixel_error
        hits = cast(part.scene, projection, x, y, *rest, counts, None, self.weighted, in_order)
        if part.has_surroundings:
            tile = TileProjectors(part.scene, projection, x, y, hits.mask, *rest)
            self.pass_beyond_halo(number, hits, tile, np.arange(len(x)), counts)
        return hits

    def pass_beyond_halo(
        self, number: int, hits: Hits, tile: TileProjectors, which: IndexArray, counts: CastCounts
    ) -> None:
        """Follow the projectors of a layer, in place, past hits of layer 0 that are beyond the halo.

        hits: (n,) of the projectors ``which`` (n,) of a tile through the layer's scene. In a feather each
        projector meets or passes the surroundings, by chance, as often as the halo's share says.
        """
        part, layer = self.parts.parts[number - 1], self.projection.layers[number - 1]
        if not part or not part.has_surroundings:
            return
        beyond = np.arange(len(which))
        for _ in range(MOST_PASSED):
            there = hits.triangle[beyond]
            beyond = beyond[(there >= 0) & (self.parts.numbers.take(there) != number)]
            share = layer.halo_share(part.box.distance(hits.position.take(beyond, 1)))
            beyond = beyond[share <= chances(tile.x[which[beyond]], tile.y[which[beyond]])]
            if not len(beyond):
                return
            counts.rays += len(beyond)
            hits.put(beyond, tile.next_hits(which[beyond], hits.t[beyond], hits.triangle[beyond]))
        hits.t[beyond], hits.triangle[beyond] = np.inf, -1

    def keys(self, number: int, hits: Hits) -> Array:
        """The keys (N,) of hits of a layer, infinite for misses."""
        part = self.parts.parts[number - 1] if number else None
        middle = part.box.middle if part else None
        return layer_keys(self.projection.layers, number, hits.position, hits.triangle >= 0, middle)


def chances(x: Array, y: Array) -> Array:
    """Numbers (N,) in [0, 1) that image positions (N,) decide, and that look random.

    The mixing of bits is that of SplitMix64 (Steele et al., "Fast Splittable Pseudorandom Number Generators",
    2014).
    """
    bits = x.astype(np.float64).view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    bits ^= y.astype(np.float64).view(np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    chances: Array = ((bits ^ (bits >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return chances


@dataclass(frozen=True)
class LayeredProjectors:
    """The projectors of a tile through all volumes of an image; see ``continuation.TileProjectors``.

    x, y: (N,) image positions. mask: (N,) whether the image's own projectors exist.
    A transparent hit of layer 0 in another layer's halo continues as one of layer 0.
    """

    cast: LayeredCast
    x: Array
    y: Array
    mask: BoolArray

    @cached_property
    def _tiles(self) -> tuple[TileProjectors, ...]:
        """The projectors through each volume, by layer."""
        own, made = self.cast, []
        for number, projection in enumerate(own.projection.of_layers):
            part = own.parts.parts[number - 1] if number else None
            scene = part.scene if part else own.parts.rest or own.parts.whole
            mask = own.may_meet(number, self.x, self.y) if number else self.mask
            made.append(
                TileProjectors(scene, projection, self.x, self.y, mask, own.pixel_size, own.pixel_error)
            )
        return tuple(made)

    def exit_tangents(self, which: IndexArray) -> Array:
        """Tangents (3, n) where the image's own projectors leave the volume."""
        return self._tiles[0].exit_tangents(which)

    def next_hits(self, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits of projectors past those at t (n,) on ``triangle`` (n,), by their keys."""
        layer = self.cast.parts.numbers.take(triangle)
        passed = np.zeros(len(which))
        for number, tile in enumerate(self._tiles):
            own = np.flatnonzero(layer == number)
            if len(own):
                there = Hits.empty(len(own))._replace(position=tile.positions(which[own], t[own]))
                passed[own] = self.cast.keys(number, there._replace(triangle=np.zeros(len(own), np.int32)))
        result = self._next_of(0, which, t, triangle, layer, passed)
        nearest = self.cast.keys(0, result)
        for number in range(1, len(self._tiles)):
            found = self._next_of(number, which, t, triangle, layer, passed)
            key = self.cast.keys(number, found)
            better = np.flatnonzero(key < nearest)
            result.put(better, found.take(better))
            nearest[better] = key[better]
        return result

    def _next_of(
        self,
        number: int,
        which: IndexArray,
        t: Array,
        triangle: IndexArray,
        layer: NDArray[np.uint8],
        passed: Array,
    ) -> Hits:
        """The next hits (n,) in one layer; projectors of other layers begin there, behind keys ``passed``."""
        tile, empty = self._tiles[number], number == 0 and self.cast.parts.rest is None
        found = cast_at_nothing(tile.projection.subset(which), self.x[which], self.y[which])
        own = np.flatnonzero(layer == number)
        if len(own):
            found.put(own, self._following(number, which[own], t[own], triangle[own]))
        open_ = np.flatnonzero((layer != number) & tile.mask[which])
        if empty or not len(open_):
            return found
        found.put(open_, self.cast.hits_of(number, which[open_], self.x, self.y, CastCounts()))
        for _ in range(MOST_PASSED):
            some = found.take(open_)
            key = self.cast.keys(number, some)
            before = (key < passed[open_]) | ((key == passed[open_]) & (number < layer[open_]))
            again = np.flatnonzero(before & (some.triangle >= 0))
            if not len(again):
                break
            open_, some = open_[again], some.take(again)
            found.put(open_, self._following(number, which[open_], some.t, some.triangle))
        return found

    def _following(self, number: int, which: IndexArray, t: Array, triangle: IndexArray) -> Hits:
        """The next hits (n,) of one layer alone."""
        found = self._tiles[number].next_hits(which, t, triangle)
        if number:
            self.cast.pass_beyond_halo(number, found, self._tiles[number], which, CastCounts())
        return found
