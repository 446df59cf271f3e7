# SPDX-License-Identifier: GPL-3.0-or-later
"""Two projections as alike surfaces: each comes back from its half of the blend."""

import numpy as np
import pytest

from scfpf_addon.projection.editing.blend_map import BlendMap
from scfpf_addon.projection.editing.blending import blended
from scfpf_addon.projection.mappings.radial import Distortion
from scfpf_addon.projection.mappings.stack import Stack
from scfpf_addon.projection.surfaces.surface import Disc, Grid, Plane, SphereSector
from scfpf_addon.projection.surfaces.uv_chart import UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.user_error import UserError
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume


def plane(half, depth, x=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, 0.0, -depth
    return Plane(2 * half, half, matrix=matrix)


STRAIGHT = ViewingVolume((plane(1, 1), plane(10, 20)))
BENT = ViewingVolume((plane(1, 1), plane(3, 6, 2.0), plane(5, 14, -6.0), plane(8, 24, 4.0)))
CORNERED = ViewingVolume((plane(1, 1), plane(3, 6, 2.0), plane(5, 14, -4.0)), "POLYLINE")
LONG = ViewingVolume(tuple(plane(1 + k, 1 + 4 * k, (-1) ** k) for k in range(6)), "POLYLINE")
WEIGHTED = ViewingVolume((plane(1, 1), plane(3, 6, 3.0), plane(5, 14)), "NURBS", (1.0, 3.0, 1.0))
BALLS = ViewingVolume((SphereSector(0.5, 2.0, -0.7, 0.7), SphereSector(20.0, 2.0, -0.7, 0.7)))
DISCS = ViewingVolume((Disc(0.1), Disc(2.0)))


# What curves that are not alike are off as polylines: an eighth of the bend of a twelfth, of the size.
@pytest.mark.parametrize(
    ("first", "second", "basis", "layers", "share"),
    [
        (STRAIGHT, BENT, "BEZIER", 4, 1e-12),
        (BENT, BALLS, "BEZIER", 4, 5e-4),
        (CORNERED, LONG, "POLYLINE", 11, 1e-12),
        (CORNERED, STRAIGHT, "POLYLINE", 3, 1e-12),
        (CORNERED, BENT, "POLYLINE", 13, 0.02),
        (WEIGHTED, BALLS, "POLYLINE", 13, 0.04),
    ],
)
def test_each_half_of_a_blend_is_one_of_the_two(first, second, basis, layers, share):
    projections = Projection(first, aspect=2.0), Projection(second, aspect=2.0)
    blend = blended(projections)
    assert (blend.basis, len(blend.layers), blend.polar) == (basis, layers, False)
    x, y, t = np.random.default_rng(4).uniform(size=(3, 500))
    for half, projection in enumerate(projections):
        volume = ViewingVolume(tuple(Grid(layer[half]) for layer in blend.layers), blend.basis)
        wanted = projection.volume.evaluate(x, y, t).position
        off = np.linalg.norm(volume.evaluate(x, y, t).position - wanted, axis=0)
        assert off.max() <= share * np.ptp(wanted, axis=1).max()


def test_ranges_and_mappings_become_part_of_the_grids():
    mapped = Stack((Distortion((-0.05, 0.0, 0.0)),), Unrolled())
    projection = Projection(STRAIGHT, mapped, (0.25, 0.75), (0.5, 1.0), aspect=2.0)
    blend = blended((projection, Projection(BALLS, aspect=2.0)))
    x, y, t = np.random.default_rng(4).uniform(size=(3, 500))
    image = projection.parameters(x, y)
    wanted = projection.volume.evaluate(image.u, image.v, t).position
    volume = ViewingVolume(tuple(Grid(layer[0]) for layer in blend.layers))
    off = np.linalg.norm(volume.evaluate(x, y, t).position - wanted, axis=0)
    assert off.max() < 5e-4 * np.ptp(wanted, axis=1).max()


def test_polar_images_stay_polar():
    blend = blended((Projection(DISCS, Polar()), Projection(DISCS, Polar(), (0.0, 0.5))))
    assert blend.polar and len(blend.layers) == 2
    u = np.linspace(0, 1, 50)
    far = Grid(blend.layers[1][0]).evaluate(u, np.ones(50)).position
    np.testing.assert_allclose(np.hypot(far[0], far[1]), 2.0, rtol=1e-3)
    half = Grid(blend.layers[1][1]).evaluate(np.array([1.0]), np.array([1.0])).position
    np.testing.assert_allclose(half[:, 0], [-2, 0, 0], atol=1e-9)


def test_empty_parts_cannot_be_blended():
    empty = Stack((Distortion((0.5, 0.0, 0.0)),), Unrolled())
    with pytest.raises(UserError, match="empty parts"):
        blended((Projection(STRAIGHT, empty), Projection(BENT)))


def test_a_seam_leaves_each_projection_whole_up_to_it():
    """Straight volumes need two triangles and those of the cuts; a bent one as many as its error asks for."""
    seam = BlendMap("RECTANGLE", centre=(0.4, 0.6), size=(0.4, 0.3), angle=0.4, border=0.0)
    x, y, t = np.random.default_rng(4).uniform(size=(3, 500))
    for second, most, share in ((CORNERED, 60, 1e-9), (BALLS, 10000, 1e-3)):
        ends = Projection(STRAIGHT, aspect=2.0), Projection(second, aspect=2.0)
        blend = blended(ends, seams=(seam,), aspect=2.0)
        chart = UVChart(blend.mesh.places[blend.mesh.triangles], blend.mesh.triangles)
        assert len(blend.mesh.triangles) <= most
        for half, projection in enumerate(ends):
            volume = ViewingVolume(tuple(UVMesh(each[half], chart) for each in blend.layers), blend.basis)
            wanted = projection.volume.evaluate(x, y, t).position
            off = np.linalg.norm(volume.evaluate(x, y, t).position - wanted, axis=0)
            # A vertex is looked up 2e-6 of the image inside its part.
            assert off.max() <= (share + 1e-5) * np.ptp(wanted, axis=1).max()
