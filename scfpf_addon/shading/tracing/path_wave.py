# SPDX-License-Identifier: GPL-3.0-or-later
"""Path states: where light is gathered for pixel samples, and the sum of what their paths gather."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import Hits
from ...projection.typing import Array, BoolArray, IndexArray
from ..nodes.light_path import path_rays
from ..passes.light_passes import LightParts
from ..typing import Single

# Rows of ``PathWave.depth``.
TOTAL, GLOSSY, TRANSMISSION, TRANSPARENT = range(4)


class PathWave(NamedTuple):
    """The states of n paths, all after one step.

    hits: their places; tangents point where light is looked for. pixel: (n,) number of the pixel sample that
    a path belongs to; several may belong to one. throughput: (3, n) share of the light that reaches it.
    on_ray: (n,) whether the path has left its projector for straight rays. from_glass: (n,) whether its last
    scattering was a refraction; singular: (n,) whether it was sharp. spread: (n,) the solid angle, in
    steradians, of the light that a path stands for among the samples of its pixel. depth: (4, n) scattering
    events so far, by kind.
    """

    hits: Hits
    pixel: IndexArray
    throughput: Array
    on_ray: BoolArray
    from_glass: BoolArray
    singular: BoolArray
    spread: Array
    depth: NDArray[np.int16]

    @classmethod
    def first(cls, hits: Hits) -> PathWave:
        """The paths that begin at the hits of projectors, one a pixel sample."""
        count = len(hits.t)
        return cls(
            hits,
            pixel=np.arange(count),
            throughput=np.ones((3, count)),
            on_ray=np.zeros(count, bool),
            from_glass=np.zeros(count, bool),
            singular=np.zeros(count, bool),
            spread=np.zeros(count),
            depth=np.zeros((4, count), np.int16),
        )

    @classmethod
    def joined(cls, waves: Sequence[PathWave]) -> PathWave:
        """The paths of one or several waves, in order."""
        if len(waves) == 1:
            return waves[0]
        hits = Hits(*(np.concatenate(each, axis=-1) for each in zip(*(w.hits for w in waves), strict=True)))
        rest = (np.concatenate(each, axis=-1) for each in zip(*(w[1:] for w in waves), strict=True))
        return cls(hits, *rest)

    def take(self, index: IndexArray) -> PathWave:
        """The states at ``index``."""
        return PathWave(
            self.hits.take(index),
            pixel=self.pixel.take(index),
            throughput=self.throughput.take(index, axis=1),
            on_ray=self.on_ray.take(index),
            from_glass=self.from_glass.take(index),
            singular=self.singular.take(index),
            spread=self.spread.take(index),
            depth=self.depth.take(index, axis=1),
        )

    @property
    def rays(self) -> Array:
        """The rays that meet the places, as the Light Path node tells, see ``nodes.light_path``."""
        return path_rays(self.on_ray, self.from_glass, self.singular, self.depth)

    @property
    def weight(self) -> Array:
        """Mean throughput of the three channels, (n,)."""
        mean: Array = self.throughput.mean(axis=0)
        return mean


class PathFilm:
    """The radiance, alpha and light parts of ``count`` pixel samples, as their paths add to them.

    Sums are float64, as many small shares are added. parts: None unless ``split``.
    """

    def __init__(self, count: int, split: bool) -> None:
        self._color = np.zeros((3, count))
        self._alpha = np.ones(count)
        self.parts = LightParts(count, np.float64) if split else None

    def parts_of_hits(self, count: int) -> LightParts | None:
        """Empty parts for ``count`` hits to be gathered with; None where parts are not wanted."""
        return LightParts(count) if self.parts else None

    def gather(
        self, pixel: IndexArray, throughput: Array, color: Single, parts: LightParts | None, on_ray: BoolArray
    ) -> None:
        """Add radiance (3, n) with its parts to pixel samples (n,); the others as in ``PathWave``."""
        self._add(pixel, throughput * color)
        if self.parts and parts:
            self.parts.gather(pixel, throughput, parts, on_ray)

    def catch(self, wave: PathWave, shown: Single, left: Single) -> None:
        """Add the background with alpha (4, n) that shadow catchers show; left: see ``Catchers.left``."""
        self._add(wave.pixel, wave.throughput * shown[:3])
        self.cut(wave.pixel, wave.weight * (1.0 - shown[3]))
        if self.parts:
            self.parts.catch(wave.pixel, wave.throughput, shown, left)

    def miss(self, wave: PathWave, world: Array, clear: BoolArray) -> None:
        """Add the world's light, (3, n) or (3, 1), to paths that end in it.

        clear: (n,) which of them make the image transparent instead.
        """
        self._add(wave.pixel, wave.throughput * world * ~clear)
        if self.parts:
            self.parts.miss(wave.pixel, wave.throughput * world, wave.on_ray)
        self.cut(wave.pixel, wave.weight * clear)

    def cut(self, pixel: IndexArray, share: Array) -> None:
        """Take shares (n,) from the alpha of pixel samples."""
        self._alpha -= np.bincount(pixel, share, len(self._alpha))

    def image(self) -> Single:
        """Radiance and alpha, (4, count)."""
        return np.concatenate([self._color, self._alpha[None]]).astype(np.float32)

    def _add(self, pixel: IndexArray, color: Array) -> None:
        for channel, values in zip(self._color, color, strict=True):
            channel += np.bincount(pixel, values, len(self._alpha))
