# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of what suns without shadows shine on.

The sums are those of ``SurfaceTable.points`` and ``lighting.radiance``. As neither places nor unit normals
and views are asked for, lengths are divided out of the scalar products instead of the vectors: with a normal
N and a way W of any length the cosines are ± N·L / |N|, ± N·W / |N| |W| and - W·L / |W|. Rows of pixels are
written one by one: NumPy takes twice as long for three at once where they do not lie one behind the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...casting.visible_triangles import TrianglesSeen
from ...projection.typing import IndexArray
from ..lights.light_table import LightTable, ViewTerms
from ..lights.lighting import Lamp
from ..materials.microfacet import facets
from ..scene.surface import TINY, SurfaceTable
from ..typing import Single


@dataclass(frozen=True)
class SunColors:
    """What colours the triangles that are seen.

    background: (4,) what is seen where there is none, of alpha 1 or empty.
    """

    surface: SurfaceTable
    coefficients: LightTable
    lamps: tuple[Lamp, ...]
    background: Single

    def write(self, seen: TrianglesSeen, sample: int, into: Single) -> None:
        """The colours of N projectors, with alpha, into (4, N), however that lies in memory."""
        hit = seen.triangle >= 0
        # Often there is sky without any hit above or below everything.
        first, last = int(hit.argmax()), len(hit) - int(hit[::-1].argmax())
        if not hit[first]:
            last = first
        into[:, :first], into[:, last:] = self.background[:, None], self.background[:, None]
        if first == last:
            return
        some = slice(first, last)
        seen, hit, into = seen.part(some), hit[some], into[:, some]
        rows = np.empty((11, len(hit)), np.float32)
        color, share, behind = rows[:3], rows[3], rows[4]
        self._sum(seen, sample, color, rows[3:])
        # A background is seen through or not at all.
        into[3] = 1 if self.background[3] else hit
        if hit.all():
            for shown, channel in zip(into, color, strict=False):
                shown[:] = channel
            return
        share[:] = hit
        for shown, channel, background in zip(into, color, self.background, strict=False):
            if background:
                channel *= share
                np.multiply(share, -background, out=behind)
                behind += background
                np.add(channel, behind, out=shown)
            else:
                np.multiply(channel, share, out=shown)

    def _sum(self, seen: TrianglesSeen, sample: int, color: Single, rows: Single) -> None:
        """Write colours (3, n), anything where nothing is hit; rows (8, n) are used up."""
        triangle = seen.triangle.astype(np.intp)
        normal, way = rows[:3], seen.way
        side, facing, length, received, term = rows[3:]
        # NumPy is quickest at this mode, and takes the last triangle for -1.
        self.surface.flat.take(triangle, axis=1, out=normal, mode="wrap")
        _dot(normal, way, facing, term)
        # Which side is seen is the triangle's to say; its normal looks along the way on the other.
        if self.surface.smooth is None or seen.weights is None:
            np.copysign(np.float32(1), facing, out=side)
        else:
            _interpolate(self.surface.smooth, triangle, seen.weights, normal, rows[5:8])
            np.copysign(_length(normal, length), facing, out=side)
            _dot(normal, way, facing, term)
        if self.coefficients.glossy:
            _length(way, length)
            facing /= side
            facing /= length
        material = self._materials(triangle)
        viewed = self.coefficients.seen(material, facing) if self.coefficients.glossy else ViewTerms()
        emitted = self.coefficients.unlit(material, viewed)
        begun = not self.lamps or bool(emitted.any())
        if begun:
            color[:] = emitted
        for lamp in self.lamps:
            along = -lamp.towards[:, sample]
            np.einsum("cn,c->n", normal, along, out=received)
            received /= side
            np.maximum(received, 0, out=received)
            if self.coefficients.glossy and lamp.light.mirrored:
                np.einsum("cn,c->n", way, along, out=term)
                term /= length
                density, cosine = facets(received, facing, term, self.coefficients.alpha.take(material))
            if lamp.light.receivers is not None and self.surface.linked is not None:
                linked = self.surface.linked.take(triangle, mode="wrap")
                received *= lamp.light.receivers.take(linked)
            tint = lamp.color[:, None]
            if lamp.light.scattered:
                arrived = received if viewed.under is None else received * viewed.under
                _add(color, self.coefficients.diffuse.take(material, axis=1) * tint, arrived, term, begun)
                begun = True
            if self.coefficients.glossy and lamp.light.mirrored:
                density *= received
                shine = self.coefficients.shine(material, cosine, viewed)
                density = np.multiply(shine, density, out=shine)
                if density.ndim == 1:
                    _add(color, tint, density, term, begun)
                else:
                    density *= tint
                    color[:] = color + density if begun else density
                begun = True
        if not begun:
            color[:] = 0

    def _materials(self, triangle: IndexArray) -> IndexArray:
        """The materials of triangles (n,), (1,) if they are all alike."""
        if self.surface.single:
            return self.surface.material[:1]
        return self.surface.material.take(triangle, mode="wrap")


def _dot(a: Single, b: Single, into: Single, term: Single) -> None:
    """Write scalar products (n,) of vectors (3, n); term: (n,) is used up."""
    np.multiply(a[0], b[0], out=into)
    for k in (1, 2):
        into += np.multiply(a[k], b[k], out=term)


def _length(vector: Single, into: Single) -> Single:
    """Write lengths (n,) of vectors (3, n), never 0."""
    np.einsum("cn,cn->n", vector, vector, out=into)
    into += TINY
    return np.sqrt(into, out=into)


def _interpolate(
    table: Single, triangle: IndexArray, weights: Sequence[Single], normal: Single, term: Single
) -> None:
    """Write normals (3, n), of any length, from ``SurfaceTable.smooth``; term: (3, n) is used up."""
    table[3:6].take(triangle, axis=1, out=normal, mode="wrap")
    normal *= weights[0]
    table[6:].take(triangle, axis=1, out=term, mode="wrap")
    term *= weights[1]
    normal += term
    table[:3].take(triangle, axis=1, out=term, mode="wrap")
    normal += term


def _add(color: Single, share: Single, factor: Single, term: Single, begun: bool) -> None:
    """Add share (3, 1) or (3, n) times factor (n,) to a colour, or begin it so; term: (n,) is used up."""
    if not begun:
        np.multiply(share, factor, out=color)
        return
    for channel, own in zip(color, share, strict=True):
        np.multiply(own, factor, out=term)
        channel += term
