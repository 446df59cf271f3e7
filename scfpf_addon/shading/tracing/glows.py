# SPDX-License-Identifier: GPL-3.0-or-later
"""Glowing things as rough reflections look for them: spheres around them, and cones towards these.

A small bright thing that a lobe's rays meet by chance is in few samples: white speckles. A share of the rays
is aimed at such things, and light is divided by the density of both ways to choose a ray, so that its mean
stays (one-sample multiple importance sampling with the balance heuristic; Veach and Guibas 1995).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...casting.common.ray_visibility import MIRROR, visible_to
from ...casting.scene.cast_scene import CastScene
from ...projection.colors import LUMINANCE
from ...projection.typing import Array
from ..materials.ggx_sampling import RoughLobe
from ..nodes.context import ShadingContext
from ..nodes.graph import MaterialGraph
from ..nodes.light_path import WORLD_LIGHT
from ..scene.shading_scene import Scene
from ..scene.sky_map import map_directions
from ..scene.world import WorldContext
from ..vectors import perpendicular
from .closure_table import closures_at

# The most things that rays are aimed at, the brightest; and the greatest share of such rays.
MOST, MOST_AIMED = 8, 0.5
# Nothing darker than white makes white speckles.
LEAST_RADIANCE = 1.0
TINY = 1e-30


def emitted(scene: Scene) -> Array:
    """The luminance that each material emits to others, (M,); of graphs the mean over directions."""
    found: Array = np.asarray(scene.materials.emission, np.float64) @ LUMINANCE
    context = WorldContext.of(map_directions(8, 4), scene.images, 0.0, WORLD_LIGHT)
    used = set(np.unique(scene.geometry.material).tolist())
    for number, graph in scene.materials.graphs.items():
        found[number] = _graph_emission(graph, context) if number in used and graph.shines else 0.0
    return np.nan_to_num(found).clip(0.0)


def _graph_emission(graph: MaterialGraph, context: ShadingContext) -> float:
    total = sum(LUMINANCE @ (rows["emission"] * rows["weight"]) for rows, _ in closures_at(graph, context))
    return float(np.mean(total))


class Aims(NamedTuple):
    """The aims of rays from n places at K glowing things.

    axis: (3, K, n) unit, towards their middles. height: (K, n) 1 - cos of half the angle of their cones.
    radiance: (K, 1). chance: (K, n) of a ray that it is aimed at each; the rest follows the lobe.
    """

    axis: Array
    height: Array
    radiance: Array
    chance: Array

    def aimed(self, direction: Array, share: Array) -> Array:
        """Directions (3, n) of which some are turned towards glowing things.

        direction: of the lobe's own rays, that are made with ``remaining`` numbers. share: (2, n) in [0, 1).
        """
        until = np.cumsum(self.chance, axis=0)
        which = np.flatnonzero(share[0] < until[-1])
        if not len(which):
            return direction
        place = share.take(which, axis=1)
        thing = np.argmax(place[0] < until.take(which, axis=1), axis=0)
        chance, end = self.chance[thing, which], until[thing, which]
        lower = self.height[thing, which] * np.clip((place[0] - end + chance) / chance, 0.0, 1.0)
        axis = self.axis[:, thing, which]
        across, up = perpendicular(axis)
        aside, turn = np.sqrt(lower * (2.0 - lower)), 2.0 * np.pi * place[1]
        turned = direction.copy()
        turned[:, which] = axis * (1.0 - lower) + aside * (across * np.cos(turn) + up * np.sin(turn))
        return turned

    def remaining(self, share: Array) -> Array:
        """The numbers (2, n) in [0, 1) of rays that follow the lobe, spread evenly again."""
        aimed = self.chance.sum(axis=0)
        return np.stack([np.clip((share[0] - aimed) / (1.0 - aimed), 0.0, 1.0 - 1e-9), share[1]])

    def density(self, direction: Array, own: Array) -> tuple[Array, Array]:
        """The density (n,) of directions (3, n), and the radiance (n,) of what they are aimed at, 0 for none.

        own: (n,) the lobe's density.
        """
        inside = np.einsum("ckn,cn->kn", self.axis, direction) >= 1.0 - self.height - 1e-12
        each = np.divide(self.chance, 2.0 * np.pi * self.height, out=np.zeros_like(self.chance), where=inside)
        density = (1.0 - self.chance.sum(axis=0)) * own + each.sum(axis=0)
        return density, (self.radiance * inside).max(axis=0)


class Glows(NamedTuple):
    """Glowing things in cast space: spheres around them, and cones towards bright parts of the world.

    centre: (3, K). radius, radiance: (K,). axis: (3, L) unit, of cones. height: (L,) 1 - cos of half their
    angles. far: (L,) their radiance.
    """

    centre: Array
    radius: Array
    radiance: Array
    axis: Array
    height: Array
    far: Array

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene) -> Glows | None:
        """The brightest glowing things that mirrors show, and the world's bright parts; None for none."""
        spheres = sorted(_spheres(scene, cast_scene), key=lambda each: each.weight, reverse=True)[:MOST]
        spots = scene.world.light.spots if scene.world else ()
        spots = tuple(spot for spot in spots if spot.radiance > LEAST_RADIANCE)
        if not spheres and not spots:
            return None
        return cls(
            np.reshape([each.centre for each in spheres], (-1, 3)).T,
            np.array([each.radius for each in spheres]),
            np.array([each.radiance for each in spheres]),
            np.reshape([each.direction for each in spots], (-1, 3)).T,
            np.array([1.0 - each.cosine for each in spots]),
            np.array([each.radiance for each in spots]),
        )

    def aims(self, position: Array, lobe: RoughLobe, samples: int) -> Aims | None:
        """The aims of rays of lobes at positions (3, n), None if no ray is aimed. samples: of a pixel."""
        count = position.shape[1]
        way = self.centre[:, :, None] - position[:, None]
        distance = np.sqrt(np.einsum("ckn,ckn->kn", way, way))
        sine = self.radius[:, None] / np.maximum(distance, TINY)
        # No ray is aimed at what is all around.
        sine = np.where(sine < 1.0, sine, 0.0)
        near = sine**2 / (1.0 + np.sqrt(1.0 - sine**2))
        height = np.concatenate([near, np.broadcast_to(self.height[:, None], (len(self.height), count))])
        beyond = np.broadcast_to(self.axis[:, :, None], (*self.axis.shape, count))
        axis = np.concatenate([way / np.maximum(distance, TINY), beyond], axis=1)
        radiance = np.concatenate([self.radiance, self.far])[:, None]
        # The chance that one of the lobe's own rays meets a thing, and how much its light varies by that.
        # What several samples meet anyway needs no aim: they are spread evenly.
        met = lobe.met(axis, 2.0 * np.pi * height)
        varies = radiance * np.sqrt(met) / (1.0 + (samples * met) ** 2)
        chance = MOST_AIMED * varies / (1.0 + varies.sum(axis=0))
        return Aims(axis, height, radiance, chance) if chance.any() else None


class _Sphere(NamedTuple):
    """A sphere around an object's glowing triangles. centre: (3,). radiance: the greatest of them."""

    centre: Array
    radius: float
    radiance: float

    @property
    def weight(self) -> float:
        """The number to which the light on a far place is in proportion."""
        return self.radiance * self.radius**2


def _spheres(scene: Scene, cast_scene: CastScene) -> Iterator[_Sphere]:
    """The spheres around glowing objects that mirrors show."""
    geometry, radiance = scene.geometry, emitted(scene)
    glows = (radiance > LEAST_RADIANCE).take(geometry.material)
    shown = visible_to(geometry.visibility, MIRROR)
    numbers = np.flatnonzero(glows if shown is None else glows & shown)
    owner = geometry.object_index.take(numbers)
    for each in np.unique(owner):
        triangles = numbers[owner == each]
        corners = geometry.vertices.take(np.unique(geometry.triangles.take(triangles, axis=0)), axis=0)
        corners = (corners - cast_scene.centre) * cast_scene.scale
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        radius = float(np.sqrt(((corners - middle) ** 2).sum(axis=1).max()))
        yield _Sphere(middle, radius, float(radiance.take(geometry.material.take(triangles)).max()))
