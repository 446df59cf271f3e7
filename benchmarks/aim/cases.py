# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and views that Aim is measured with: the demo's street, a room, a terrain and a figure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from benchmarks.hard_scenes import cube, sphere
from benchmarks.scenes import Mesh, joined, sheet
from scfpf_addon.aim.aim_scene import AimScene, HitFinder
from scfpf_addon.aim.detours import free_pins
from scfpf_addon.aim.judge import COLUMNS, Judge, Judgement
from scfpf_addon.aim.released import Released
from scfpf_addon.aim.rounds import JudgeResult, Round, solve_in_rounds
from scfpf_addon.aim.solver.problem import AimPins, AimProblem, AimResult
from scfpf_addon.aim.solver.start import projection_of, start_volume
from scfpf_addon.aim.stays import GRID, find_stays
from scfpf_addon.aim.view_map import ViewMap
from scfpf_addon.aim.views import sample_view
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.typing import Array
from scfpf_addon.projection.volume.inverse import find_in_image
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, ASPECT, NET, DEGREE = 1920, 2.0, (12, 8), 3
# The field of view across, and the halo in radii of the thing.
ANGLE, HALO = np.radians(55.0), 1.5


@dataclass(frozen=True)
class Place:
    """A scene, a camera in it and the thing that views show. eye, target, up: (3,). far: where it ends."""

    vertices: Array
    triangles: Array
    objects: Array
    thing: tuple[int, ...]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    far: float

    @cached_property
    def scene(self) -> AimScene:
        """The scene, built once."""
        return AimScene(CastScene(self.vertices, self.triangles), np.asarray(self.objects, np.int32))

    @cached_property
    def wanted(self) -> Array:
        """The thing's triangles."""
        return self.scene.triangles_of(np.array(self.thing))

    @cached_property
    def sphere(self) -> tuple[Array, float]:
        """The centre and the radius of a sphere around the thing."""
        points = self.vertices[np.unique(self.triangles[self.wanted])]
        low, high = points.min(axis=0), points.max(axis=0)
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2

    @cached_property
    def frame(self) -> Array:
        """Right, up and forward of the camera, rows."""
        forward = np.subtract(self.target, self.eye)
        return _frame(forward / np.linalg.norm(forward), np.array(self.up))

    @cached_property
    def base(self) -> Projection:
        """The straight projection of the camera."""
        right, up, forward = self.frame
        half = np.tan(ANGLE / 2)
        straight = NurbsAxis(order=2)
        planes = []
        for depth in (0.1, self.far):
            corners = [
                [self.eye + depth * (forward + half * (x * right + y / ASPECT * up)) for x in (-1, 1)]
                for y in (-1, 1)
            ]
            planes.append(NurbsPatch(np.array(corners), straight, straight))
        return Projection(ViewingVolume(tuple(planes)), aspect=ASPECT)

    def view(self, left: float, up: float, larger: float = 1.0) -> ViewMap:
        """The thing seen from degrees to the left and above, where the image has it, ``larger`` as wide."""
        centre, radius = self.sphere
        vertical = np.array(self.up)
        away = np.subtract(self.eye, centre)
        away = away - vertical * (away @ vertical)
        away /= np.linalg.norm(away)
        side = np.cross(away, vertical)
        turned = np.cos(np.radians(left)) * away + np.sin(np.radians(left)) * side
        towards = -(np.cos(np.radians(up)) * turned + np.sin(np.radians(up)) * vertical)
        right, above, forward = _frame(towards, vertical)
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([right, above, -forward])
        matrix[:3, 3] = -matrix[:3, :3] @ (centre - 10 * radius * towards)
        x, y = (float(a[0]) for a in find_in_image(self.base, centre[:, None])[:2])
        depth = float((centre - self.eye) @ self.frame[2])
        width = larger * radius / (depth * np.tan(ANGLE / 2))
        return ViewMap(matrix, True, centre, radius, (x, y), width, 0.0, ASPECT)


@dataclass(frozen=True)
class Setting:
    """A problem and what its solution is judged by. columns: of the image that is judged."""

    place: Place
    before: Projection
    problem: AimProblem
    halos: Array
    columns: int = COLUMNS

    @cached_property
    def judge(self) -> Judge:
        """The judge of its solutions."""
        pins, place = self.problem.pins, self.place
        return Judge(place.scene, self.before, pins, self.halos, self.shown, WIDTH, self.columns)

    def judged(self, after: Projection, released: Released | None = None) -> Judgement:
        """The judgement of a solution."""
        return self.judge.judgement_of(after, released)

    @cached_property
    def old(self) -> Judgement:
        """The judgement of the image before."""
        return self.judged(self.before)

    def solved(self) -> Round | None:
        """The best of the rounds."""
        return solve_in_rounds(self.problem, self.judged_result, self.old, free=self.freed)

    def judged_result(self, result: AimResult, released: Released | None = None) -> Judgement:
        """The judgement of a result."""
        return self.judged(result.projection(ASPECT), released)

    def freed(self, found: Round) -> tuple[AimProblem, JudgeResult] | None:
        """The problem that frees the hidden pins of a round, and its judge."""
        place, result, judgement = self.place, found.result, found.judgement
        freed = free_pins(place.scene, self.problem, self.shown, result, judgement)
        if freed is None:
            return None
        return freed[0], partial(self.judged_result, released=freed[1])

    @property
    def shown(self) -> Array:
        """The triangles of things that views show, (T,)."""
        return self.place.wanted & bool((self.problem.pins.views >= 0).any())


def setting(
    place: Place,
    pins: AimPins,
    halo: float,
    alone: bool = False,
    net: tuple[int, int] = NET,
    degree: int = DEGREE,
    columns: int = COLUMNS,
    grid: tuple[int, int] = GRID,
) -> Setting:
    """Aim pins in a place. halo: in world units. alone: nothing stays. grid: of stays. See ``Setting``."""
    depth = float(np.median(place.frame[2] @ (pins.points - np.array(place.eye)[:, None])))
    start = start_volume(place.base, WIDTH, net, degree, subject=depth / place.far)
    before = projection_of(start.patches, ASPECT)
    halos = np.full(pins.count, halo)
    is_view = bool((pins.views >= 0).any())
    wanted = place.wanted & is_view
    stays = () if alone else (find_stays(before, place.scene, pins, halos, wanted, WIDTH, grid),)
    finder = HitFinder(place.scene, wanted)
    problem = AimProblem(start.patches, WIDTH, ASPECT, pins, stays, first_hits=finder)
    return Setting(place, before, problem, halos, columns)


def view_setting(
    place: Place, left: float, up: float, degree: int = DEGREE, grid: tuple[int, int] = GRID
) -> Setting:
    """A single view of the place's thing; everything else stays."""
    pins = sample_view(place.scene, place.wanted, place.view(left, up))
    return setting(place, pins, HALO * place.sphere[1], degree=degree, grid=grid)


def random_setting(
    place: Place,
    seed: int,
    degrees: float,
    shift: float,
    net: tuple[int, int] = NET,
    columns: int = COLUMNS,
    grid: tuple[int, int] = GRID,
) -> Setting:
    """5 to 12 pins on what the image shows, shifted and turned at random; the rest is free to follow."""
    random = np.random.default_rng(seed)
    count = int(random.integers(5, 13))
    positions = np.zeros((2, 0))
    while positions.shape[1] < count:
        one = random.uniform(0.12, 0.88, (2, 1))
        apart = np.hypot(*((positions - one) * np.array([[1.0], [1.0 / ASPECT]])))
        hits = place.scene.hits(place.base, one[0], one[1], WIDTH)
        if hits.triangle[0] >= 0 and apart.min(initial=1.0) > 0.08:
            positions = np.hstack([positions, one])
    hits = place.scene.hits(place.base, *positions, WIDTH)
    points = place.scene.world(hits.position)
    directions = hits.tangent / np.linalg.norm(hits.tangent, axis=0)
    axes = np.cross(directions.T, random.normal(size=(count, 3)))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angle = np.radians(degrees) * random.random(count)
    directions = directions * np.cos(angle) + axes.T * np.sin(angle)
    moved = positions + random.uniform(-shift, shift, (2, count))
    depth = place.frame[2] @ (points - np.array(place.eye)[:, None])
    halo = 0.1 * float(np.median(depth)) * 2 * np.tan(ANGLE / 2)
    return setting(place, AimPins(points, moved, directions), halo, net=net, columns=columns, grid=grid)


def _frame(forward: Array, up: Array) -> Array:
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _assembled(parts: list[tuple[Mesh, int]]) -> tuple[Array, Array, Array]:
    """Vertices, triangles and objects of meshes with the numbers of their objects."""
    vertices, triangles = joined([mesh for mesh, _ in parts])
    return vertices, triangles, np.concatenate([np.full(len(mesh[1]), n) for mesh, n in parts])


def _box(low: tuple[float, float, float], high: tuple[float, float, float], cells: int = 1) -> Mesh:
    vertices, triangles = cube(cells)
    a, b = np.array(low), np.array(high)
    return a + (vertices + 1) / 2 * (b - a), triangles


def _ball(centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Mesh:
    vertices, triangles = sphere(12)
    return vertices * np.array(radii) + np.array(centre), triangles


def room() -> Place:
    """A room of 8 × 10 × 3 m with furniture; the thing is an armchair. Z is up, the camera looks along y."""
    parts = [(_box((-4, -5, -0.1), (4, 5, 0)), 0), (_box((-4, 5, 0), (4, 5.1, 3)), 1)]
    parts += [(_box((-4.1, -5, 0), (-4, 5, 3)), 2), (_box((4, -5, 0), (4.1, 5, 3)), 3)]
    parts += [(_box((-4, -5, 3), (4, 5, 3.1)), 4), (_box((-3.9, 2, 0), (-3.3, 4.8, 2.1)), 5)]
    parts += [(_box((1.6, 3.4, 0), (3.4, 4.6, 0.75)), 6), (_box((-1.2, 4.9, 1.2), (1.2, 5, 2.3)), 7)]
    chair = [((-0.45, 0.3, 0.25), (0.45, 1.2, 0.45)), ((-0.45, 1.05, 0.45), (0.45, 1.25, 1.1))]
    chair += [((-0.6, 0.3, 0), (-0.45, 1.25, 0.65)), ((0.45, 0.3, 0), (0.6, 1.25, 0.65))]
    parts += [(_box(low, high), 8) for low, high in chair]
    return Place(*_assembled(parts), (8,), (0.3, -4.6, 1.6), (0.0, 1.0, 1.0), (0, 0, 1), 12.0)


def terrain() -> Place:
    """Hills of 400 m; the thing is a peak of its own."""
    x, y = np.meshgrid(np.linspace(-200, 200, 121), np.linspace(0, 400, 121))
    z = 6 * np.sin(0.045 * x) * np.cos(0.037 * y) + 3 * np.sin(0.11 * x + 1) * np.sin(0.09 * y)
    peak_x, peak_y = np.meshgrid(np.linspace(-25, 25, 41), np.linspace(-25, 25, 41))
    distance = np.hypot(peak_x, peak_y)
    height = 26 * np.exp(-((distance / 13) ** 2)) * (1 + 0.15 * np.cos(5 * np.arctan2(peak_y, peak_x))) - 4
    peak = sheet(np.stack([peak_x + 5, peak_y + 120, height], axis=-1))
    parts = [(sheet(np.stack([x, y, z - 4], axis=-1)), 0), (peak, 1)]
    return Place(*_assembled(parts), (1,), (0.0, -20.0, 22.0), (5.0, 120.0, 8.0), (0, 0, 1), 480.0)


def figure() -> Place:
    """A figure of balls among columns; the thing is the figure."""
    body = [((0, 0, 0.95), (0.24, 0.17, 0.42)), ((0, -0.02, 1.58), (0.13, 0.15, 0.17))]
    body += [((0, -0.17, 1.56), (0.03, 0.06, 0.04)), ((-0.33, 0, 1.0), (0.08, 0.09, 0.38))]
    body += [((0.33, 0, 1.0), (0.08, 0.09, 0.38)), ((-0.12, 0, 0.36), (0.1, 0.11, 0.4))]
    body += [((0.12, 0, 0.36), (0.1, 0.11, 0.4)), ((-0.12, -0.1, 0.05), (0.08, 0.18, 0.06))]
    body += [((0.12, -0.1, 0.05), (0.08, 0.18, 0.06))]
    parts = [(_box((-30, -10, -0.1), (30, 40, 0)), 0)]
    spots = [(-3, 2), (3, 2), (-2, 6), (2.5, 7), (-5, 10), (0.5, 12), (6, 11)]
    parts += [(_box((a - 0.2, b - 0.2, 0), (a + 0.2, b + 0.2, 3)), n + 1) for n, (a, b) in enumerate(spots)]
    parts += [(_ball(centre, radii), 9) for centre, radii in body]
    return Place(*_assembled(parts), (9,), (0.4, -4.5, 1.5), (0.0, 0.0, 1.0), (0, 0, 1), 45.0)


def street() -> Place:
    """The demo's street; the thing is the car. It replaces Blender's open file."""
    import bpy

    from benchmarks.street.portals_passed import register
    from demo.render_demo import build_street
    from scfpf_addon.bridge.scene.read_scene import read_scene

    register()
    build_street()
    geometry = read_scene(bpy.context.evaluated_depsgraph_get()).geometry
    names = geometry.object_names
    car = tuple(n for n, name in enumerate(names) if name.startswith("Car"))
    objects = np.broadcast_to(geometry.object_index, len(geometry.triangles))
    arrays = geometry.vertices, geometry.triangles, objects
    return Place(*arrays, car, (-1.5, -12.0, 2.4), (0.0, 0.0, 1.0), (0, 0, 1), 190.0)
