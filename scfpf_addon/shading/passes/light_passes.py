# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of light: the parts that the image is the sum of, with its samples and filter.

Diffuse + specular + emission + environment is the image. Light that arrives by mirrors and through glass is
specular, whatever its source; the world's uniform light on a surface is diffuse. Past transparent surfaces
the parts stay the same.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import DTypeLike

from ...projection.typing import Array, BoolArray, IndexArray
from ..typing import Single

# Rows of ``LightParts``: four colours, then the lamps' light that arrives, the same without shadows, and the
# share of light that shadows take from shadow catchers.
DIFFUSE, SPECULAR, EMISSION, ENVIRONMENT = (slice(row, row + 3) for row in (0, 3, 6, 9))
COLORS = 12
ARRIVED, FULL = 12, 13
TAKEN = slice(14, 17)
# In a film the last rows are the ratio of the two, and the share that shadows leave.
SHADOW, CAUGHT = slice(COLORS, COLORS + 1), slice(COLORS + 1, COLORS + 4)

# Passes and their rows. A transparent film shows the environment too, as in Cycles.
LIGHT_PASSES = {
    "DIFFUSE": DIFFUSE,
    "SPECULAR": SPECULAR,
    "EMISSION": EMISSION,
    "ENVIRONMENT": ENVIRONMENT,
    "SHADOW": SHADOW,
    "SHADOW_CATCHER": CAUGHT,
}
# The passes that are light, not shares of it.
EXPOSED = frozenset({"DIFFUSE", "SPECULAR", "EMISSION", "ENVIRONMENT"})
# Values where nothing is hit, if not 0; the environment has the background there.
LIGHT_MISS = {"SHADOW": 1.0, "SHADOW_CATCHER": 1.0}


class LightParts:
    """The parts that the colours of ``count`` hits are the sum of. rows: (17, count), see above."""

    def __init__(self, count: int, kind: DTypeLike = np.float32) -> None:
        self.rows = np.zeros((TAKEN.stop, count), kind)

    def part(self, some: slice) -> LightParts:
        """The parts of some of the hits, which share memory with these."""
        part = LightParts(0)
        part.rows = self.rows[:, some]
        return part

    def shine(self, emission: Single, emitted: Single) -> None:
        """Add emission, and ``emitted``: emission with the world's light; each (3, count) or (3, 1)."""
        self.rows[EMISSION] += emission
        self.rows[DIFFUSE] += emitted - emission

    def receive(self, full: Single, arrived: Single, color: Single) -> None:
        """Add the irradiance (count,) of a lamp of a colour (3,), without shadows and with them."""
        bright = color.mean()
        self.rows[FULL] += full * bright
        self.rows[ARRIVED] += arrived * bright

    def gather(self, pixel: IndexArray, share: Array, parts: LightParts, on_ray: BoolArray) -> None:
        """Add the parts of n path states to the pixel samples (n,) that they belong to.

        share: (3, n) of their light. on_ray: (n,) whether it comes by mirrors or through glass.
        """
        count = self.rows.shape[1]
        light = parts.rows[:COLORS].reshape(4, 3, -1) * share
        light[1] += on_ray * (light[0] + light[2] + light[3])
        light[[0, 2, 3]] *= ~on_ray
        # The shadow passes show the surfaces that the projector itself meets.
        direct = share.mean(axis=0) * ~on_ray
        for row, values in zip(
            self.rows, (*light.reshape(COLORS, -1), *(parts.rows[COLORS:] * direct)), strict=True
        ):
            row += np.bincount(pixel, values, count)

    def catch(self, pixel: IndexArray, share: Array, shown: Single, left: Single) -> None:
        """Add hits (n,) on shadow catchers, by shares (3, n) of a pixel's light.

        shown: (4, n) of the background. left: (3, n), see ``Catchers.left``.
        """
        part, count = share.mean(axis=0), self.rows.shape[1]
        mean = (left[0] + left[1] + left[2]) / 3
        values = np.concatenate([share * shown[:3], part * mean[None], part[None], part * (1 - left)])
        for row, value in zip((*self.rows[ENVIRONMENT], *self.rows[COLORS:]), values, strict=True):
            row += np.bincount(pixel, value, count)

    def miss(self, pixel: IndexArray, light: Array, on_ray: BoolArray) -> None:
        """Add the world's light (3, n), seen by paths that miss."""
        count = self.rows.shape[1]
        for rows, which in ((SPECULAR, on_ray), (ENVIRONMENT, ~on_ray)):
            for row, values in zip(self.rows[rows], light * which, strict=True):
                row += np.bincount(pixel, values, count)


class LightFilm:
    """The sums of the samples of ``count`` pixels, part by part. background: (3,) radiance."""

    def __init__(self, count: int, background: Array) -> None:
        self._sum: Single = np.zeros((CAUGHT.stop, count), np.float32)
        self._empty: Single = np.zeros((CAUGHT.stop, 1), np.float32)
        self._empty[ENVIRONMENT, 0] = background

    @classmethod
    def of(cls, names: Collection[str], count: int, background: Array) -> LightFilm | None:
        """The film of the passes of these names; None without light passes."""
        return None if LIGHT_PASSES.keys().isdisjoint(names) else cls(count, background)

    def add(self, pixel: IndexArray, shown: BoolArray, hit: IndexArray, parts: LightParts) -> None:
        """Add one sample of the pixels (m,). shown, hit: as in ``AdaptiveFilm.add``. parts: of the hits."""
        sample = self._empty * shown
        arrived, full = parts.rows[ARRIVED], parts.rows[FULL]
        sample[COLORS:] = 1.0
        sample[:COLORS, hit] = parts.rows[:COLORS]
        sample[COLORS, hit] = np.divide(arrived, full, out=np.ones_like(full), where=full > 0.0)
        sample[CAUGHT, hit] = 1.0 - parts.rows[TAKEN]
        self._sum[:, pixel] += sample

    def develop(self, pixel: IndexArray, samples: Single | float, into: dict[str, Single]) -> None:
        """Write the means of pixels (m,), of so many samples, into those passes (m, 3) that are wanted."""
        for name in into.keys() & LIGHT_PASSES.keys():
            into[name][:] = (self._sum[LIGHT_PASSES[name]][:, pixel] / samples).T
