# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes and projections to shade."""

from types import SimpleNamespace

import numpy as np
import pytest

from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.lights.lamps import Lamp
from scfpf_addon.shading.lights.lighting import Lighting
from scfpf_addon.shading.materials.coefficients import MaterialCoefficients
from scfpf_addon.shading.materials.constants import Materials
from scfpf_addon.shading.sampling.point_samples import PointSamples
from scfpf_addon.shading.scene.shading_scene import Scene
from scfpf_addon.shading.scene.surface import SurfaceTable


def placed(location=(0, 0, 0), shines=(0, 0, -1)):
    """A matrix at location whose local -Z points along ``shines``."""
    z = -np.asarray(shines, float) / np.linalg.norm(shines)
    x = np.cross([0, 1, 0] if abs(z[1]) < 0.9 else [1, 0, 0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([x, np.cross(z, x), z, location])
    return matrix


def geometry(*parts):
    """One geometry of parts (vertices (V, 3), triangles (T, 3), corner normals or None for flat)."""
    vertices, triangles, normals, material, start = [], [], [], [], 0
    for index, (points, faces, corners) in enumerate(parts):
        points, faces = np.asarray(points, float), np.asarray(faces)
        if corners is None:
            a, b, c = points[faces].transpose(1, 0, 2)
            flat = np.cross(b - a, c - a)
            corners = np.repeat((flat / np.linalg.norm(flat, axis=1, keepdims=True))[:, None], 3, 1)
        vertices.append(points)
        triangles.append(faces + start)
        normals.append(corners)
        material.append(np.full(len(faces), index))
        start += len(points)
    material = np.concatenate(material).astype(np.int32)
    return Geometry(
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(normals).astype(np.float32),
        material,
        material,
    )


def square(half=1.0, height=0.0, centre=(0.0, 0.0)):
    """A horizontal square that faces +Z."""
    x, y = centre
    corners = [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
    return np.column_stack([corners, np.full(4, height)]), [[0, 1, 2], [0, 2, 3]], None


def sphere(rings, centre=(0, 0, 0), radius=1.0):
    """A sphere of rings × 2·rings quads, cut into triangles, with smooth normals."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings, indexing="ij"
    )
    ring = np.sin(polar)
    unit = np.stack([ring * np.cos(around), ring * np.sin(around), np.cos(polar)], -1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij"))
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    faces = np.concatenate(
        [
            np.stack([a, a + 2 * rings, b + 2 * rings], -1)[i < rings - 1],
            np.stack([a, b + 2 * rings, b], -1)[i > 0],
        ]
    )
    return unit * radius + np.asarray(centre), faces, unit[faces]


def materials(count=1, base=(1, 1, 1), metallic=0.0, roughness=0.5, f0=0.0, emission=(0, 0, 0)):
    """``count`` equal materials; by default white and without a highlight."""
    return Materials(
        np.tile(np.asarray(base, float), (count, 1)),
        np.full(count, metallic),
        np.full(count, roughness),
        np.full(count, f0),
        np.tile(np.asarray(emission, float), (count, 1)),
    )


def scene(parts=None, lights=(), world=(0, 0, 0), **material):
    """A scene of the parts (default: one square), all of the same material."""
    parts = parts or [square()]
    made = materials(len(parts), **material)
    return Scene(geometry(*parts), made, tuple(lights), np.asarray(world, float))


def shade(what, triangle, position, tangent=(0, 0, -1), sample=0, samples=1):
    """Radiance (3, N) of a scene at world positions (3, N) on triangle (N,), seen along tangent."""
    return shade_samples(what, triangle, position, tangent, [sample], samples)[0]


def mean_shade(what, triangle, position, samples):
    """As ``shade``, the mean of all samples."""
    return np.mean(shade_samples(what, triangle, position, (0, 0, -1), range(samples), samples), axis=0)


def shade_samples(what, triangle, position, tangent, chosen, samples):
    """As ``shade``, a list of the radiance of each of the chosen samples."""
    cast_scene = CastScene(what.geometry.vertices, what.geometry.triangles)
    position = np.asarray(position, float).reshape(3, -1)
    count = position.shape[1]
    triangle = np.broadcast_to(np.asarray(triangle, np.int32), count)
    cast_position = cast_scene.matrix[:3, :3] @ position + cast_scene.matrix[:3, 3:]
    shadows = any(light.casts_shadow for light in what.lights)
    points = SurfaceTable.of(what.geometry, cast_scene, shadows).points(
        triangle,
        cast_scene.barycentric(cast_position, triangle),
        cast_position,
        np.broadcast_to(np.reshape(np.asarray(tangent, float), (3, -1)), (3, count)),
    )
    lamps = tuple(Lamp.of(light, cast_scene.matrix, samples) for light in what.lights)
    coefficients = MaterialCoefficients.of(what.materials, what.world_color)
    place = np.zeros(count, np.uint32)
    lighting = Lighting(lamps, cast_scene)
    return [
        lighting.radiance(points, coefficients, PointSamples(place, sample, samples)) for sample in chosen
    ]


def looking_down(*heights, size=2.0, shifts=None, basis="BEZIER", **projection):
    """Level squares of the same size, one above the other, first the near one."""
    shifts = shifts or [0.0] * len(heights)
    surfaces = tuple(
        Plane(matrix=placed((shift, 0, height)), width=size, height=size)
        for height, shift in zip(heights, shifts, strict=True)
    )
    return Projection(ViewingVolume(surfaces, basis), **projection)


@pytest.fixture(scope="session")
def build():
    """The functions above."""
    return SimpleNamespace(
        placed=placed,
        geometry=geometry,
        square=square,
        sphere=sphere,
        materials=materials,
        scene=scene,
        shade=shade,
        mean_shade=mean_shade,
        looking_down=looking_down,
    )
