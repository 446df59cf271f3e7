# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of what suns without shadows shine on.

The sums are those of ``SurfaceTable.points`` and ``lighting.radiance``. As neither places nor unit normals
and views are asked for, lengths are divided out of the scalar products instead of the vectors: with a normal
N and a way W of any length the cosines are ± N·L / |N|, ± N·W / |N| |W| and - W·L / |W|.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..casting.triangles_seen import TrianglesSeen
from ..projection.typing import IndexArray
from .highlight import facets
from .lighting import Lamp
from .surface import TINY, LightTable, SurfaceTable
from .typing import Single


@dataclass(frozen=True)
class SunColors:
    """What colours the triangles that are seen.

    background: (4,) what is seen where there is none, of alpha 1 or empty.
    """

    surface: SurfaceTable
    phong: LightTable
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
        rows = np.empty((12, len(hit)), np.float32)
        color = rows[:3]
        self._sum(seen, sample, color, rows[3:])
        if hit.all():
            into[:3], into[3] = color, 1
            return
        # A background is seen through or not at all.
        into[3] = 1 if self.background[3] else hit
        if not self.background[:3].any():
            np.multiply(color, hit, out=into[:3])
            return
        color *= hit
        missed = np.subtract(1, hit, out=rows[3], dtype=np.float32)
        for channel in range(3):
            if self.background[channel]:
                color[channel] += np.multiply(missed, self.background[channel], out=rows[4])
        into[:3] = color

    def _sum(self, seen: TrianglesSeen, sample: int, color: Single, rows: Single) -> None:
        """Write colours (3, n), anything where nothing is hit; rows (9, n) are used up."""
        triangle = seen.triangle.astype(np.intp)
        normal, way = rows[:3], seen.way
        side, facing, length, received, mirror, term = rows[3:]
        # NumPy is quickest at this mode, and takes the last triangle for -1.
        self.surface.flat.take(triangle, axis=1, out=normal, mode="wrap")
        _dot(normal, way, facing)
        # Which side is seen is the triangle's to say; its normal looks along the way on the other.
        np.copysign(np.float32(1), facing, out=side)
        if self.surface.smooth is not None and seen.weights is not None:
            _interpolate(self.surface.smooth, triangle, seen.weights, normal, rows[4:7])
            _dot(normal, way, facing)
            squared = _dot(normal, normal, length)
            squared += TINY
            side /= np.sqrt(squared, out=squared)
        if self.phong.glossy:
            _dot(way, way, length)
            length += TINY
            np.sqrt(length, out=length)
            facing *= side
            facing /= length
        material = self._materials(triangle)
        emitted = self.phong.emitted.take(material, axis=1)
        begun = not self.lamps or bool(emitted.any())
        if begun:
            color[:] = emitted
        for lamp in self.lamps:
            light = lamp.towards[:, sample]
            cosine = _dot(normal, light, received)
            cosine *= side
            if self.phong.glossy and lamp.light.mirrored:
                np.negative(_dot(way, light, term), out=term)
                term /= length
                np.negative(cosine, out=mirror)
                density, grazing = facets(mirror, facing, term, self.phong.alpha.take(material))
            # Negative, as side is where its light can be seen.
            np.minimum(received, 0, out=received)
            if lamp.light.receivers is not None and self.surface.linked is not None:
                linked = self.surface.linked.take(triangle, mode="wrap")
                received *= lamp.light.receivers.take(linked)
            tint = -lamp.color[:, None]
            if lamp.light.scattered:
                _add(color, self.phong.diffuse.take(material, axis=1) * tint, received, term, begun)
                begun = True
            if self.phong.glossy and lamp.light.mirrored:
                density *= received
                grazing *= density
                _add(color, self.phong.front.take(material, axis=1) * tint, density, term, begun)
                _add(color, self.phong.edge.take(material, axis=1) * tint, grazing, term, True)
                begun = True
        if not begun:
            color[:] = 0

    def _materials(self, triangle: IndexArray) -> IndexArray:
        """The materials of triangles (n,), (1,) if they are all alike."""
        if self.surface.single:
            return self.surface.material[:1]
        return self.surface.material.take(triangle, mode="wrap")


def _dot(a: Single, b: Single, into: Single) -> Single:
    """Scalar products of vectors (3, n) with others, (3, n), or one, (3,), into (n,)."""
    np.einsum("cn,cn->n" if b.ndim == 2 else "cn,c->n", a, b, out=into)
    return into


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
