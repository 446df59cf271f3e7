# SPDX-License-Identifier: GPL-3.0-or-later
"""A plan of anchors as text, with what it was made for: files keep it, renders use it if it still fits."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from .anchor import Anchor, Window
from .plan import FEWEST_TEXELS

VERSION = 3
# Image positions along a side at which projectors are compared.
PLACES = 9


@dataclass(frozen=True)
class KeptPlan:
    """The anchors of a picture.

    made_for: the digest of what they were planned for. size: of the picture in pixels. shown: the share of
    its points on things that an anchor shows. is_one_eye: whether all its projectors have one eye. layers:
    the numbers of the anchors' layers, 0 for the rest; () if all are of that. texels: see ``PlanLimits``.
    """

    anchors: tuple[Anchor, ...]
    made_for: str
    size: tuple[int, int]
    shown: float
    is_one_eye: bool
    layers: tuple[int, ...] = ()
    texels: float = FEWEST_TEXELS

    def of_layer(self, number: int) -> tuple[Anchor, ...]:
        """The anchors of a layer, or of the rest for 0."""
        numbers = self.layers or (0,) * len(self.anchors)
        return tuple(anchor for anchor, own in zip(self.anchors, numbers, strict=True) if own == number)

    @property
    def pixels(self) -> float:
        """The pixels of all anchors, as a multiple of the picture's."""
        return sum(anchor.count for anchor in self.anchors) / (self.size[0] * self.size[1])

    @property
    def text(self) -> str:
        """The plan as text, which ``read`` takes."""
        anchors = [
            [
                each.matrix.ravel().tolist(),
                [*each.window],
                [*each.size],
                [each.start, each.end],
                each.is_parallel,
            ]
            for each in self.anchors
        ]
        made_for = self.made_for, [*self.size], self.texels
        kept = [VERSION, *made_for, self.shown, self.is_one_eye, anchors, [*self.layers]]
        return json.dumps(kept, separators=(",", ":"))

    @classmethod
    def read(cls, text: str) -> KeptPlan | None:
        """The plan that a text holds; None if it holds none, as one of another version."""
        try:
            version, made_for, (width, height), texels, shown, is_one_eye, anchors, layers = json.loads(text)
            if version != VERSION or len(layers) not in (0, len(anchors)):
                return None
            return cls(
                tuple(_anchor(*each) for each in anchors),
                str(made_for),
                (int(width), int(height)),
                float(shown),
                bool(is_one_eye),
                tuple(map(int, layers)),
                float(texels),
            )
        except (ValueError, TypeError):
            return None


def _anchor(
    matrix: list[float], window: list[float], size: list[int], ends: list[float], is_parallel: bool
) -> Anchor:
    start, end = (float(each) for each in ends)
    across, up = (int(each) for each in size)
    if min(across, up) < 2 or not end > start:
        raise ValueError("an anchor without extent")
    turned = np.array(matrix, np.float64).reshape(4, 4)
    return Anchor(turned, Window(*map(float, window)), (across, up), start, end, bool(is_parallel))


def digest(
    vertices: Array,
    triangles: NDArray[np.int32],
    arrays: Sequence[NDArray[Any] | None],
    projection: Projection,
    size: tuple[int, int],
    texels: float,
) -> str:
    """The digest of what a plan depends on: triangles, projectors, also of layers, and the size in pixels.

    arrays: (T,) each, of the triangles, such as which of them are seen. texels: see ``PlanLimits``.
    """
    place = np.linspace(0.0, 1.0, PLACES)
    x, y = (grid.ravel() for grid in np.meshgrid(place, place))
    halos = [(layer.halo, layer.feather) for layer in projection.layers]
    found = blake2b(repr((size, texels, halos)).encode(), digest_size=16)
    for number, array in enumerate((vertices, triangles, *arrays)):
        if array is not None:
            found.update(bytes([number]))
            found.update(np.ascontiguousarray(array).view(np.uint8).data)
    for own in projection.of_layers:
        with np.errstate(invalid="ignore", over="ignore"):
            projectors = np.nan_to_num(own.projectors(x, y).points.astype(np.float32))
        found.update(np.ascontiguousarray(projectors).view(np.uint8).data)
    return found.hexdigest()
