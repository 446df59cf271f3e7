# SPDX-License-Identifier: GPL-3.0-or-later
"""What an image shows through each of its volumes: the things of its layers, and the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..casting.layers.layer_keys import layer_keys
from ..casting.layers.layer_parts import Box, Hull
from ..casting.scene.cast_scene import CastScene
from ..projection.typing import Array, BoolArray
from ..projection.volume.viewing_volume import ImageLayer, Projection
from .seen_scene import Halo, SeenScene
from .shown_points import ShownPoints, shown_points


@dataclass(frozen=True)
class LayerBounds:
    """A layer, and the bounds of its things, in world space."""

    layer: ImageLayer
    box: Box
    hull: Hull


@dataclass(frozen=True)
class ImagePart:
    """What an image shows through one of its volumes.

    number: of the layer, 0 for the rest. scene: what cameras see of it. projection: in world
    space, without layers. bounds: None for the rest.
    """

    number: int
    scene: SeenScene
    projection: Projection
    bounds: LayerBounds | None = None

    def points(
        self, x: Array, y: Array, pixel_size: tuple[float, float], pixel_error: float = 0.1
    ) -> ShownPoints:
        """Cast at image positions (N,), as ``shown_points``; layers have points on their things only."""
        if self.bounds is None:
            return shown_points(self.scene, self.projection, x, y, pixel_size, pixel_error)
        own = self.bounds
        is_met = own.layer.shown_at(x, y)
        is_met[is_met] = own.hull.may_be_met(self.projection, x[is_met], y[is_met], own.layer.halo)
        which = np.flatnonzero(is_met)
        found = shown_points(self.scene, self.projection, x[which], y[which], pixel_size, pixel_error)
        found = found.take(np.flatnonzero(found.is_hit))
        return found._replace(number=which[found.number])

    def keys(self, layers: Sequence[ImageLayer], points: ShownPoints) -> Array:
        """The keys (n,) of points, by which layers hide each other. layers: of the image."""
        middle = None if self.bounds is None else self.bounds.box.middle
        return layer_keys(layers, self.number, points.position, points.is_hit, middle)


def image_parts(
    scene: CastScene,
    shown: BoolArray | None,
    one_sided: BoolArray | None,
    directional: BoolArray | None,
    numbers: NDArray[np.uint8] | None,
    projection: Projection,
) -> list[ImagePart]:
    """The parts of an image, the rest first; [] if cameras see no triangle.

    scene: of all T triangles. shown: (T,), those that cameras see, None for all. one_sided,
    directional: see ``SeenScene``. numbers: (T,), of their layers, None for 0. projection: with its layers,
    in world space.
    """
    shown = np.ones(len(scene.usable), bool) if shown is None else shown
    numbers = np.zeros(len(scene.usable), np.uint8) if numbers is None else numbers
    if not (shown & scene.usable).any():
        return []
    rest = scene.only(shown & (numbers == 0))
    alone = replace(projection, layers=())
    seen = SeenScene(rest or scene, one_sided, is_empty=rest is None, directional=directional)
    parts = [ImagePart(0, seen, alone)]
    for number, layer in enumerate(projection.layers, 1):
        own = shown & (numbers == number) & scene.usable
        if not own.any():
            continue
        points = scene.points_of(own) / scene.scale + scene.centre[:, None]
        box = Box.around(points)
        halo, kept = None, own
        hull = Hull.around(points)
        if layer.halo > 0.0:
            # Halos are distances from the box.
            kept, hull = own | (shown & (numbers == 0)), Hull.around(box.corners)
            halo = Halo(layer.transformed(scene.matrix), Box.around(scene.points_of(own)), numbers == number)
        part = scene.only(kept)
        assert part is not None
        seen = SeenScene(part, one_sided, halo=halo, directional=directional)
        bounds = LayerBounds(layer, box, hull)
        parts.append(ImagePart(number, seen, layer.projection, bounds))
    return parts
