# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack of mappings of the image over a re-parameterisation; inverse and partial mappings.

A place of the image goes through the mappings from the first to the last, then through the base to (u, v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array, BoolArray
from ..volume.reparameterisation import ImageMap, ImagePoints, Polar, Reparameterisation
from .grids import found_by_search, inverse_jacobian

# Places this far outside of the image still count as on its border: a hundredth of a pixel of a
# thousand, since curves and images are float32.
BORDER = 1e-5
# A disc's rim is tested this far inside and outside of it, at this many places.
RIM_GAP, RIM_PLACES = 1e-3, 64


@dataclass(frozen=True, eq=False)
class InverseMapping(Reparameterisation):
    """The inverse of a mapping: it leads from a seen place to the place that sees it."""

    mapping: Reparameterisation

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The (u, v) of image positions; the mask is False where the mapping leads nowhere."""
        place_x, place_y, found = self._places(x, y, aspect)
        image = self.mapping.map(place_x, place_y, aspect)
        inverse, regular = inverse_jacobian(image.jacobian)
        return ImageMap(place_x, place_y, inverse, found & image.mask & regular)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        return ImagePoints(*self._places(x, y, aspect))

    def _places(self, x: Array, y: Array, aspect: float) -> tuple[Array, Array, BoolArray]:
        place_x, place_y = self.mapping.image_positions(x, y, aspect)
        found = np.isfinite(place_x) & np.isfinite(place_y)
        return np.where(found, place_x, 0.5), np.where(found, place_y, 0.5), found

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        """The place that the mapping sees at (u, v), NaN if it sees nothing."""
        image = self.mapping.points(u, v, aspect)
        return np.where(image.mask, image.u, np.nan), np.where(image.mask, image.v, np.nan)


@dataclass(frozen=True, eq=False)
class PartialMapping(Reparameterisation):
    """A mapping whose places move by ``factor`` times their way; above 1 it is exaggerated."""

    mapping: Reparameterisation
    factor: float

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        image = self.mapping.map(x, y, aspect)
        jacobian = image.jacobian * self.factor
        jacobian[0, 0] += 1.0 - self.factor
        jacobian[1, 1] += 1.0 - self.factor
        return ImageMap(*self._mixed(x, y, image), jacobian, image.mask)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        image = self.mapping.points(x, y, aspect)
        return ImagePoints(*self._mixed(x, y, image), image.mask)

    def _mixed(self, x: Array, y: Array, image: ImageMap | ImagePoints) -> tuple[Array, Array]:
        return x + self.factor * (image.u - x), y + self.factor * (image.v - y)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        return found_by_search(self, u, v, aspect)


@dataclass(frozen=True, eq=False)
class Stack(Reparameterisation):
    """Mappings of the image, the first nearest to the image, over a base that leads to (u, v)."""

    mappings: tuple[Reparameterisation, ...]
    base: Reparameterisation

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """The (u, v) of image positions; nothing is seen outside of the base's image."""
        jacobian, mask = None, np.ones(len(x), bool)
        for mapping in self.mappings:
            image = mapping.map(x, y, aspect)
            x, y, mask = image.u, image.v, mask & image.mask
            jacobian = _chained(image.jacobian, jacobian)
        x, y, inside = self._clipped(x, y)
        image = self.base.map(x, y, aspect)
        return ImageMap(image.u, image.v, _chained(image.jacobian, jacobian), mask & inside & image.mask)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        place = mapped_places(self.mappings, x, y, aspect)
        x, y, inside = self._clipped(place.u, place.v)
        image = self.base.points(x, y, aspect)
        return ImagePoints(image.u, image.v, place.mask & inside & image.mask)

    def _clipped(self, x: Array, y: Array) -> tuple[Array, Array, BoolArray]:
        """Places clamped to the base's image, and whether they were inside."""
        return np.clip(x, 0.0, 1.0), np.clip(y, 0.0, 1.0), _in_image(x, y)

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        """The image positions of (u, v), NaN where the image does not show them."""
        x, y = self.base.image_positions(u, v, aspect)
        for mapping in reversed(self.mappings):
            x, y = mapping.image_positions(x, y, aspect)
        inside = _in_image(x, y)
        return np.where(inside, x, np.nan), np.where(inside, y, np.nan)


def _in_image(x: Array, y: Array) -> BoolArray:
    inside: BoolArray = (np.abs(x - 0.5) <= 0.5 + BORDER) & (np.abs(y - 0.5) <= 0.5 + BORDER)
    return inside


def _chained(outer: Array, inner: Array | None) -> Array:
    """The Jacobian (2, 2, N) of a mapping after another one."""
    return outer if inner is None else np.einsum("abn,bcn->acn", outer, inner)


def seen_through(mappings: tuple[Reparameterisation, ...], base: Reparameterisation) -> Reparameterisation:
    """A base behind a stack of mappings; the base itself for an empty stack."""
    return Stack(mappings, base) if mappings else base


def mapped_places(mappings: tuple[Reparameterisation, ...], x: Array, y: Array, aspect: float) -> ImagePoints:
    """The places, (N,) each, to which a stack of mappings alone leads; perhaps outside of the image."""
    mask = np.ones(len(x), bool)
    for mapping in mappings:
        image = mapping.points(x, y, aspect)
        x, y, mask = image.u, image.v, mask & image.mask
    return ImagePoints(x, y, mask)


def is_disc(image: Reparameterisation, aspect: float) -> bool:
    """Return whether the image is the disc that touches its nearer borders, as if polar.

    Mappings before a polar base keep the disc if they move its rim onto itself.
    """
    if isinstance(image, Polar):
        return True
    if not (isinstance(image, Stack) and isinstance(image.base, Polar)):
        return False
    angle = np.arange(RIM_PLACES) * (2 * np.pi / RIM_PLACES)
    for radius, shown in ((1.0 - RIM_GAP, True), (1.0 + RIM_GAP, False), (0.5, True)):
        x = 0.5 + 0.5 * radius * np.cos(angle) / max(aspect, 1.0)
        y = 0.5 + 0.5 * radius * np.sin(angle) / max(1 / aspect, 1.0)
        if (image.points(x, y, aspect).mask != shown).any():
            return False
    return True
