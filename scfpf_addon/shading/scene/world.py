# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that comes from each direction of a world, and a map of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...casting.common.geometry import Geometry
from ...projection.colors import linear_from_srgb
from ...projection.typing import Array, IndexArray
from ..nodes.context import ShadingContext, fit
from ..nodes.graph import Closure, MaterialGraph, Operation, Ref, finite, registers
from ..nodes.image import ImageData
from ..nodes.light_path import WORLD_LIGHT, WORLD_SEEN
from ..nodes.operations import OPERATIONS
from ..typing import Single
from ..vectors import unit
from .sky_map import COLUMNS, ROWS, WorldLight, map_directions

# Directions at which a world is evaluated at once.
MOST_AT_ONCE = 1 << 15
# The greatest radiance of a world: float32 sums of more would overflow.
BRIGHTEST = 1e12
UP = np.array([[0.0], [0.0], [1.0]])


class WorldContext(ShadingContext):
    """The inputs of world nodes at unit directions (3, n), which are their generated coordinates."""

    @classmethod
    def of(
        cls, direction: Array, images: Mapping[str, ImageData], blur: float, rays: Array = WORLD_SEEN
    ) -> WorldContext:
        """The inputs at directions (3, n). blur: angle between two of them, in radians. rays: of each."""
        count = direction.shape[1]
        return cls(
            geometry=NOWHERE,
            images=images,
            triangle=np.zeros(count, np.intp),
            barycentric=np.zeros((2, count)),
            position=direction,
            normal=-direction,
            flat=-direction,
            view=-direction,
            back=np.zeros((1, count)),
            blur=blur,
            rays=rays,
        )

    def layer(self, name: str, channels: int) -> tuple[Array, Array]:
        """The direction as generated coordinates; 0 for layers that only meshes have."""
        if name in {"GENERATED", "OBJECT"}:
            return fit(self.position, channels), np.ones((1, self.count))
        return np.zeros((channels, 1)), np.zeros((1, 1))

    def corners(self) -> tuple[Array, Array, Array]:
        """A triangle of the size of the sky, for nodes that depend on the size of a face."""
        across = np.zeros((3, self.count))
        across[0] = 1.0
        return np.zeros((3, self.count)), across, np.roll(across, 1, axis=0)


# Without triangles.
NOWHERE = Geometry(
    np.zeros((0, 3)),
    np.zeros((0, 3), np.int32),
    np.zeros((0, 3, 3), np.float32),
    np.zeros(0, np.int32),
    np.zeros(0, np.int32),
)


@dataclass(frozen=True)
class World:
    """Light by direction: the EMISSION closures of a graph. images: those that the graph reads."""

    graph: MaterialGraph
    images: Mapping[str, ImageData] = field(default_factory=dict)

    @classmethod
    def of_color(cls, color: Array) -> World:
        """A uniform world of radiance (3,)."""
        values = np.reshape(color, (3, 1)), np.ones((1, 1))
        operations = tuple(Operation("CONSTANT", (), {"value": value}) for value in values)
        return cls(MaterialGraph(operations, (Closure("EMISSION", Ref(1), {"color": Ref(0)}),)))

    @property
    def uniform(self) -> bool:
        """Return whether the light is the same in all directions and for all rays."""
        return self._reads_only({"CONSTANT"})

    @property
    def lights_evenly(self) -> bool:
        """Return whether the light on surfaces is the same from all directions."""
        return self._reads_only({"CONSTANT", "LIGHT_PATH"})

    def _reads_only(self, kinds: set[str]) -> bool:
        """Return whether the emission depends on no inputs but those of these kinds of operations."""
        emission = [each for each in self.graph.closures if each.kind == "EMISSION"]
        wanted = [ref.operation for each in emission for ref in (each.weight, each.inputs["color"])]
        while wanted:
            operation = self.graph.operations[wanted.pop()]
            if not operation.inputs and operation.kind not in kinds:
                return False
            wanted.extend(ref.operation for ref in operation.inputs)
        return True

    def radiance(self, direction: Array, rays: Array = WORLD_SEEN) -> Array:
        """Radiance (3, n), at least 0, from directions (3, n) of any length, in world space.

        rays: those that come from there, see ``nodes.light_path``.
        """
        return radiance_of(self.graph, self.images, direction, 0.0, rays)

    @cached_property
    def light(self) -> WorldLight:
        """The light on surfaces.

        Images are averaged to texels at least as large as the map's, so that no sun is missed between two.
        """
        if self.lights_evenly:
            return uniform_light(*self.radiance(UP, WORLD_LIGHT)[:, 0].tolist())
        images = {name: reduced(image) for name, image in self.images.items()}
        light = radiance_of(self.graph, images, map_directions(COLUMNS, ROWS), np.pi / ROWS, WORLD_LIGHT)
        return WorldLight.of(light.reshape(3, ROWS, COLUMNS))


@lru_cache(maxsize=2)
def uniform_light(red: float, green: float, blue: float) -> WorldLight:
    """The light of a uniform world."""
    color = np.reshape([red, green, blue], (3, 1, 1))
    return WorldLight.of(np.broadcast_to(color, (3, ROWS, COLUMNS)).copy())


def radiance_of(
    graph: MaterialGraph, images: Mapping[str, ImageData], direction: Array, blur: float, rays: Array
) -> Array:
    """Radiance (3, n) of a graph from directions (3, n). blur, rays: see ``WorldContext.of``."""
    count = direction.shape[1]
    light = np.zeros((3, count))
    for first in range(0, count, MOST_AT_ONCE):
        raise_if_cancelled()
        some = slice(first, first + MOST_AT_ONCE)
        own = rays if rays.shape[1] == 1 else rays[:, some]
        context = WorldContext.of(unit(direction[:, some]), images, blur, own)
        results = registers(graph, context, OPERATIONS)
        for closure in graph.closures:
            if closure.kind == "EMISSION":
                color, weight = closure.inputs["color"], closure.weight
                light[:, some] += finite(
                    results[color.operation][color.output] * results[weight.operation][weight.output]
                )
    return np.clip(light, 0.0, BRIGHTEST)


def reduced(image: ImageData) -> ImageData:
    """The image averaged down to at most COLUMNS × ROWS pixels; scene-linear."""
    height, width = image.pixels.shape[:2]
    down, along = -(-height // ROWS), -(-width // COLUMNS)
    if down <= 1 and along <= 1:
        return image
    columns: IndexArray = np.arange(0, width, along)
    share = np.diff(np.append(columns, width))[:, None].astype(np.float32)
    # A row at a time: an image may be large.
    made = [
        _mean_rows(image, slice(first, first + down), columns) / share for first in range(0, height, down)
    ]
    return replace(image, pixels=np.stack(made), encoded=False)


def _mean_rows(image: ImageData, rows: slice, columns: IndexArray) -> Single:
    """The mean of rows, summed from each of the columns to the next, (columns, 4)."""
    pixels = image.pixels[rows].astype(np.float32)
    if image.pixels.dtype == np.uint8:
        pixels /= np.float32(255)
    if image.encoded:
        pixels[..., :3] = linear_from_srgb(pixels[..., :3].astype(np.float64))
    sums: Single = np.add.reduceat(pixels.mean(axis=0), columns, axis=0)
    return sums
