# SPDX-License-Identifier: GPL-3.0-or-later
"""An estimate of the light that images lack: that of glowing things on others, and bounces between things.

It is made at some places that the image shows, before it is rendered. Only the largest triangles are cast at:
walls are large, and the estimate need not be finer. What glows counts as far as it is seen from the places:
smaller triangles near to it, such as a lamp's shade, cast shadows then as well.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..casting.common.geometry import Geometry, renumbered
from ..casting.common.hits import NothingToCastAt
from ..casting.common.ray_visibility import SHADOW, visible_to
from ..casting.continuation import first_triangles
from ..casting.scene.cast_scene import CastScene
from ..projection.colors import LUMINANCE
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection
from .nodes.light_path import WORLD_LIGHT
from .scene.shading_scene import Light, Scene
from .scene.sky_map import map_areas, map_directions
from .scene.world import UP
from .tracing.glows import emitted
from .vectors import dot

# Image positions across and up, rays from each place, and the most triangles that they can meet.
ACROSS, UPWARD, RAYS, LARGEST = 24, 16, 16, 20_000
# Triangles whose areas are computed at once, and the most glowing ones whose light is summed.
AT_ONCE, MOST_GLOWING = 1 << 18, 512
# A share of glow that is worth a look at its shadows, and rays from each place to what glows. Besides the
# largest triangles, so many cast shadows that are closer to it than a share of its usual distance.
WORTH, GLOW_RAYS, NEAR_SHARE, MOST_NEAR = 0.05, 16, 0.1, 50_000
# The most lamps, the brightest, and rows of the world's map.
MOST_LAMPS, WORLD_ROWS = 16, 8
# Fewer places tell nothing.
FEWEST = 8
# Straight pieces of a curved projector.
PIECES = 24


class MissingLight(NamedTuple):
    """The light that an image lacks, as means over places that it shows.

    glow: the share of glowing things in the light that arrives, in [0, 1]. enclosed: the share of directions
    in which a place meets things that do not glow, in [0, 1]. is_lit: whether any light arrives.
    """

    glow: float = 0.0
    enclosed: float = 0.0
    is_lit: bool = False


class _Places(NamedTuple):
    """N places that the image shows, in cast space.

    scene: the largest triangles. occluders: those of them that cast shadows, None for none. numbers: (K,) of
    the largest in the geometry. triangle: (N,) of the places, among them. position: (3, N). normal: (3, N)
    unit, to the side that is seen.
    """

    scene: CastScene
    occluders: CastScene | None
    numbers: IndexArray
    triangle: IndexArray
    position: Array
    normal: Array

    def is_open(self, direction: Array, distance: Array) -> BoolArray:
        """Return whether nothing is between the places and what is in unit directions at distances, (N,)."""
        if self.occluders is None:
            return np.ones(len(self.triangle), bool)
        origin = self.scene.offset_origins(self.position, self.triangle, direction)
        return ~self.occluders.occluded(origin, direction, distance)


def missing_light(scene: Scene, projection: Projection) -> MissingLight:
    """Estimate the light that a scene's image lacks. projection: in world space."""
    radiance = emitted(scene)
    glows = (radiance > 0.0).take(scene.geometry.material)
    places = _places(scene.geometry, projection, glows)
    if places is None:
        return MissingLight()
    hidden = _hidden(places, glows.take(places.numbers))
    others = _world_irradiance(scene) * (1.0 - hidden) + _lamp_irradiance(scene, places)
    own, glow = np.zeros_like(hidden), 0.0
    if glows.any():
        glowing = _Glowing.of(scene.geometry, radiance, glows, places)
        own = glowing.arriving.sum(axis=1)
        glow = _mean_share(own, others)
        if glow > WORTH:
            own = own * _seen_shares(scene, places, glowing)
            glow = _mean_share(own, others)
    return MissingLight(glow, float(hidden.mean()), bool((own + others).any()))


def _mean_share(own: Array, others: Array) -> float:
    """The mean share of ``own`` (N,) in the sum of both."""
    total = own + others
    return float(np.divide(own, total, out=np.zeros_like(own), where=total > 0.0).mean())


def _places(geometry: Geometry, projection: Projection, glows: BoolArray) -> _Places | None:
    """Places that an image shows and that do not glow; None if they are too few."""
    numbers = _largest(geometry)
    used, triangles = renumbered(geometry.triangles.take(numbers, axis=0), len(geometry.vertices))
    try:
        scene = CastScene(geometry.vertices.take(used, axis=0), triangles)
    except NothingToCastAt:
        return None
    triangle, position, ahead = _first_hits(scene, projection.transformed(scene.matrix))
    shown = np.flatnonzero(~glows.take(numbers.take(triangle)))
    if len(shown) < FEWEST:
        return None
    triangle, position, ahead = triangle.take(shown), position.take(shown, 1), ahead.take(shown, 1)
    normal = scene.normals(triangle)
    normal *= np.copysign(1.0, -dot(normal, ahead))
    rays = geometry.visibility
    occluders = scene.only(None if rays is None else visible_to(rays.take(numbers), SHADOW))
    return _Places(scene, occluders, numbers, triangle, position, normal)


def _first_hits(scene: CastScene, projection: Projection) -> tuple[IndexArray, Array, Array]:
    """Triangles (N,) that projectors meet, the places (3, N) and the directions (3, N) in which they come.

    projection: in cast space. Projectors are taken for polylines, which is coarse and quick.
    """
    x, y = np.meshgrid((np.arange(ACROSS) + 0.5) / ACROSS, (np.arange(UPWARD) + 0.5) / UPWARD)
    projectors, spans = projection.projectors(x.ravel(), y.ravel()), projection.volume.spans
    weights, _ = spans.weights(np.linspace(0.0, 1.0, 2 if spans.is_straight else PIECES + 1))
    curve = np.einsum("ks,kcn->scn", weights, projectors.points)
    left = np.flatnonzero(projectors.valid & np.isfinite(curve).all(axis=(0, 1)))
    found: list[tuple[IndexArray, Array, Array]] = []
    for start, end in pairwise(curve):
        origin, way = start.take(left, 1), (end - start).take(left, 1)
        limits = np.ones(len(left), np.float32)
        triangle = scene.mesh.trace(origin.astype(np.float32), way.astype(np.float32), limits)
        met = np.flatnonzero(triangle >= 0)
        first, ahead = triangle.take(met), way.take(met, 1)
        height, slope = scene.heights(origin.take(met, 1), first), dot(scene.normals(first), ahead)
        share = np.divide(height, -slope, out=np.zeros_like(height), where=slope != 0.0)
        found.append((first, origin.take(met, 1) + ahead * np.clip(share, 0.0, 1.0), ahead))
        left = left[triangle < 0]
    triangle, position, ahead = (np.concatenate(part, axis=-1) for part in zip(*found, strict=True))
    return triangle, position, ahead


def _largest(geometry: Geometry) -> IndexArray:
    """The numbers of the largest triangles, in order."""
    count = len(geometry.triangles)
    kept, size = np.zeros(0, np.intp), np.zeros(0)
    for first in range(0, count, AT_ONCE):
        more = np.arange(first, min(first + AT_ONCE, count))
        kept, size = np.concatenate([kept, more]), np.concatenate([size, _areas(geometry, more)])
        if len(kept) > LARGEST:
            best = np.argpartition(size, len(size) - LARGEST)[-LARGEST:]
            kept, size = kept.take(best), size.take(best)
    return np.sort(kept)


def _areas(geometry: Geometry, which: IndexArray) -> Array:
    """The areas of triangles ``which`` (n,)."""
    first, second, third = _corners(geometry, which)
    area: Array = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    return area


def _corners(geometry: Geometry, which: IndexArray) -> tuple[Array, Array, Array]:
    vertex = geometry.triangles.take(which, axis=0)
    first, second, third = (geometry.vertices.take(vertex[:, k], axis=0) for k in range(3))
    return first, second, third


def _hidden(places: _Places, glows: BoolArray) -> Array:
    """The shares (N,) of directions, weighted by their cosines, in which places meet what does not glow.

    glows: (K,) whether the triangles do.
    """
    generator = np.random.default_rng(0)
    count = places.position.shape[1]
    met = np.zeros(count)
    for _ in range(RAYS):
        # A unit vector added to the normal is distributed by its cosine.
        ball = generator.normal(size=(3, count))
        direction = places.normal + ball / np.linalg.norm(ball, axis=0)
        direction /= np.maximum(np.linalg.norm(direction, axis=0), 1e-9)
        origin = places.scene.offset_origins(places.position, places.triangle, direction)
        found = first_triangles(places.scene, origin, direction)
        met += (found >= 0) & ~glows.take(found)
    return met / RAYS


class _Glowing(NamedTuple):
    """G glowing triangles, and the irradiance of each at N places, without shadows; both sides glow.

    corners: (3, G, 3), in the space of the geometry. arriving: (N, G). distance: the mean distance of what
    arrives, in the space of the geometry.
    """

    corners: Array
    arriving: Array
    distance: float

    @classmethod
    def of(cls, geometry: Geometry, radiance: Array, glows: BoolArray, places: _Places) -> _Glowing:
        """Some of the glowing triangles. radiance: (M,) of materials. glows: (T,) of triangles."""
        which = np.flatnonzero(glows)
        share = 1.0
        if len(which) > MOST_GLOWING:
            share = len(which) / MOST_GLOWING
            which = np.sort(np.random.default_rng(0).choice(which, MOST_GLOWING, replace=False))
        corners = np.stack(_corners(geometry, which))
        # In cast space, where lengths are relative: areas and squares of distances are so alike.
        middle = (corners.mean(axis=0) - places.scene.centre).T * places.scene.scale
        across = np.cross(corners[1] - corners[0], corners[2] - corners[0]).T * 0.5 * places.scene.scale**2
        area = np.linalg.norm(across, axis=0)
        power = radiance.take(geometry.material.take(which)) * share
        way = middle[:, None] - places.position[:, :, None]
        square = np.einsum("cng,cng->ng", way, way)
        received = np.maximum(np.einsum("cng,cn->ng", way, places.normal), 0.0)
        sent = np.abs(np.einsum("cng,cg->ng", way, across))
        # A triangle's own area bounds the light near to it.
        arriving: Array = power * received * sent / np.maximum(square * (square + area), 1e-30)
        total = arriving.sum()
        mean = float((arriving * np.sqrt(square)).sum() / total) if total > 0.0 else 0.0
        return cls(corners, arriving, mean / places.scene.scale)


def _seen_shares(scene: Scene, places: _Places, glowing: _Glowing) -> Array:
    """The shares (N,) of the glow's light at places that nothing hides."""
    whole, blockers, numbers = _blockers(scene, places, glowing)
    if blockers is None:
        return np.ones(len(glowing.arriving))
    outward = places.position / places.scene.scale + places.scene.centre[:, None]
    position = (outward - whole.centre[:, None]) * whole.scale
    triangle = np.searchsorted(numbers, places.numbers.take(places.triangle))
    generator, count = np.random.default_rng(0), len(glowing.arriving)
    sums = np.cumsum(glowing.arriving, axis=1)
    seen = np.zeros(count)
    for number in range(GLOW_RAYS):
        # A triangle by its share in the light, and a place on it.
        part = (number + generator.random(count)) / GLOW_RAYS * sums[:, -1]
        aim = np.minimum((sums < part[:, None]).sum(axis=1), sums.shape[1] - 1)
        weights = generator.exponential(size=(3, count))
        weights /= weights.sum(axis=0)
        target = np.einsum("kn,knc->cn", weights, glowing.corners.take(aim, axis=1))
        way = (target - whole.centre[:, None]) * whole.scale - position
        distance = np.maximum(np.linalg.norm(way, axis=0), 1e-12)
        direction = way / distance
        origin = whole.offset_origins(position, triangle, direction)
        seen += ~blockers.occluded(origin, direction, distance)
    return seen / GLOW_RAYS


def _blockers(
    scene: Scene, places: _Places, glowing: _Glowing
) -> tuple[CastScene, CastScene | None, IndexArray]:
    """The largest triangles and those near to what glows, those of them that cast shadows, and their numbers.

    Triangles whose material lets light through cast none. numbers: (K,) in the geometry, in order.
    """
    geometry = scene.geometry
    near = _near(geometry, glowing.corners.mean(axis=0), NEAR_SHARE * glowing.distance)
    numbers = np.union1d(places.numbers, near)
    used, triangles = renumbered(geometry.triangles.take(numbers, axis=0), len(geometry.vertices))
    whole = CastScene(geometry.vertices.take(used, axis=0), triangles)
    blocks = ~scene.materials.is_clear.take(geometry.material.take(numbers))
    rays = geometry.visibility
    if rays is not None:
        casting = visible_to(rays.take(numbers), SHADOW)
        blocks = blocks if casting is None else blocks & casting
    return whole, whole.only(blocks), numbers


def _near(geometry: Geometry, middles: Array, reach: float) -> IndexArray:
    """The numbers of triangles whose middles are in the neighbourhood of points (G, 3), the largest ones.

    reach: the edge of the cells of a grid. Cells with a point, and their neighbours, are the neighbourhood.
    """
    if reach <= 0.0:
        return np.zeros(0, np.intp)
    low, high = middles.min(axis=0) - 2.0 * reach, middles.max(axis=0) + 2.0 * reach
    steps = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    cells = np.floor((middles - low) / reach)[:, None] + steps
    shape = np.ceil((high - low) / reach) + 1.0
    wanted = np.unique(_cell_numbers(cells.reshape(-1, 3), shape))
    kept, size = np.zeros(0, np.intp), np.zeros(0)
    for first in range(0, len(geometry.triangles), AT_ONCE):
        more = np.arange(first, min(first + AT_ONCE, len(geometry.triangles)))
        corners = _corners(geometry, more)
        middle = np.mean(corners, axis=0)
        inside = np.flatnonzero(((middle > low) & (middle < high)).all(axis=1))
        cell = _cell_numbers(np.floor((middle.take(inside, axis=0) - low) / reach), shape)
        place = np.minimum(np.searchsorted(wanted, cell), len(wanted) - 1)
        more = more.take(inside[wanted[place] == cell])
        kept, size = np.concatenate([kept, more]), np.concatenate([size, _areas(geometry, more)])
        if len(kept) > MOST_NEAR:
            best = np.argpartition(size, len(size) - MOST_NEAR)[-MOST_NEAR:]
            kept, size = kept.take(best), size.take(best)
    return kept


def _cell_numbers(cells: Array, shape: Array) -> Array:
    """The number of each cell (N, 3) in a grid of a shape, as whole float64."""
    numbers: Array = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    return numbers


def _world_irradiance(scene: Scene) -> float:
    """The irradiance of the world where nothing hides it."""
    world = scene.world
    if world is None:
        return float(np.pi * (LUMINANCE @ scene.world_color))
    if world.lights_evenly:
        return float(np.pi * (LUMINANCE @ world.radiance(UP, WORLD_LIGHT)[:, 0]))
    directions = map_directions(2 * WORLD_ROWS, WORLD_ROWS)
    light = LUMINANCE @ world.radiance(directions, WORLD_LIGHT)
    areas = np.repeat(map_areas(2 * WORLD_ROWS, WORLD_ROWS), 2 * WORLD_ROWS)
    return float(np.pi * (light * areas).sum() / areas.sum())


def _lamp_irradiance(scene: Scene, places: _Places) -> Array:
    """The irradiance (N,) of the brightest lamps, as from a point or a direction each, with shadows."""
    arriving = np.zeros(places.position.shape[1])
    power = [float(LUMINANCE @ light.color) for light in scene.lights]
    for number in np.argsort(power)[::-1][:MOST_LAMPS]:
        arriving += power[number] * _lamp_share(scene.lights[number], places)
    return arriving


def _lamp_share(light: Light, places: _Places) -> Array:
    """The irradiance (N,) of a lamp of power 1."""
    matrix, scale = np.asarray(light.matrix, np.float64), places.scene.scale
    if light.kind == "SUN":
        direction = np.broadcast_to(matrix[:3, 2:3], places.position.shape)
        distance, strength = np.full(1, np.inf), np.ones(1)
    else:
        way = ((matrix[:3, 3] - places.scene.centre) * scale)[:, None] - places.position
        distance = np.maximum(np.linalg.norm(way, axis=0), 1e-9)
        direction = way / distance
        strength = (scale / distance) ** 2 / (4.0 * np.pi)
        facing = np.einsum("c,cn->n", matrix[:3, 2], direction)
        if light.kind == "AREA":
            strength = strength * 4.0 * np.maximum(facing, 0.0)
        elif light.kind == "SPOT":
            strength = strength * (facing >= np.cos(0.5 * light.spot_angle))
    received = np.maximum(dot(places.normal, direction), 0.0) * strength
    if light.casts_shadow:
        received = received * places.is_open(direction, distance)
    return received
