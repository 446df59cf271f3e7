# SPDX-License-Identifier: GPL-3.0-or-later
"""The random choices on paths: directions of rough reflections, and the ends of faint paths."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from ..materials.ggx_sampling import R2_STEP
from ..sampling.point_samples import PointSamples
from ..sampling.sample_positions import scramble
from ..sampling.sample_sets import GOLDEN
from .path_wave import TOTAL, TRANSPARENT, PathWave

# The dimensions of the scrambles that begin a pixel's sequences of rough reflections and of survival.
REFLECTION, SURVIVAL = 6, 7
# The throughput below which paths survive at random, in proportion to it: less than what a window or a coat
# reflects, so that only reflections of reflections have noise.
SURE = 1.0 / 32.0


class PathSamples(NamedTuple):
    """The random choices on the paths of pixel samples. first: the samples, at their first hits."""

    first: PointSamples

    def at(self, wave: PathWave, which: IndexArray) -> PointSamples:
        """The samples at the places ``which`` (m,) of a wave; each depth has its own random numbers."""
        depth = wave.depth.take(which, axis=1).astype(np.uint32)
        seed = depth[TOTAL] << np.uint32(16) | depth[TRANSPARENT]
        return self.first.take(wave.pixel.take(which))._replace(seed=seed)

    def facets(self, which: IndexArray, depth: IndexArray) -> Array:
        """(2, m) in [0, 1) for rough reflections of pixel samples, after ``depth`` (m,) scattering events.

        A pixel's samples fill the square evenly; each pixel and depth begins its sequence elsewhere.
        """
        samples = self.first.take(which)
        own = scramble(samples.pixel() ^ scramble(depth.astype(np.uint32), REFLECTION), REFLECTION)
        start = np.stack([own & np.uint32(0xFFFF), own >> np.uint32(16)]) / 65536.0
        step = np.where(depth == 0, R2_STEP[:, None], R2_STEP[::-1, None])
        share: Array = (start + samples.number * step) % 1.0
        return share

    def survival(self, wave: PathWave, kind: IndexArray, throughput: Array) -> Array:
        """The factor (m,) by which throughputs (3, m) of paths along kinds of lobes grow; 0 for an end.

        Faint paths end at random; the others make up for them, so that the mean stays.
        """
        chance = np.minimum(throughput.max(axis=0) / SURE, 1.0)
        branch = (wave.depth[TOTAL] * 8 + kind).astype(np.uint32)
        branch ^= scramble(wave.hits.triangle.astype(np.uint32), SURVIVAL)
        samples = self.first.take(wave.pixel)
        own = scramble(samples.pixel() ^ scramble(branch, SURVIVAL), SURVIVAL)
        drawn = (own * 2.0**-32 + samples.number * GOLDEN) % 1.0
        factor: Array = np.divide(drawn < chance, chance, out=np.zeros_like(chance), where=chance > 0.0)
        return factor
