# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors: plans for volumes whose answer is known, and look-ups of positions, which the caster knows."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes, columns
from scfpf_addon.anchors.anchor import Anchor, Window
from scfpf_addon.anchors.anchor_view import AnchorView, traced_views
from scfpf_addon.anchors.completion import completed
from scfpf_addon.anchors.join import find_texels, join_sky
from scfpf_addon.anchors.plan import (
    Cover,
    PlanLimits,
    camera_matrix,
    common_eye,
    nearest_to_lines,
    plan_anchors,
    sky_anchors,
)
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.anchors.shown_points import shown_points
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.surfaces.surface import Cylinder, Plane, SphereSector
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.sampling.pixel_filter import PixelFilter
from scfpf_addon.shading.sampling.sample_positions import SamplePositions

SIZE = (96, 54)
PRESETS = Path(__file__).parents[2] / "presets"
AXES = np.eye(3)


def seen(vertices, triangles):
    """Faces that are seen from both sides."""
    return SeenScene(CastScene(vertices, triangles))


def at(surface, x=0.0, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return surface.transformed(matrix)


def room():
    """A closed box around the origin with boxes in it, and smaller ones near to the middle."""
    corners = np.array([[x, y, z] for x in (-9.0, 9.0) for y in (-9.0, 9.0) for z in (-9.0, 9.0)])
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    cube = np.array([face for a, b, c, d in faces for face in ((a, b, c), (a, c, d))], np.int32)
    generator = np.random.default_rng(3)
    vertices, triangles = [corners], [cube]
    for number in range(1, 40):
        middle = generator.normal(size=3)
        middle *= generator.uniform(3.0, 8.0) / np.linalg.norm(middle)
        vertices.append(corners / 9.0 * generator.uniform(0.2, 0.8) + middle)
        triangles.append(cube + 8 * number)
    return seen(np.concatenate(vertices), np.concatenate(triangles))


def frustum():
    return Projection(
        ViewingVolume(
            (at(Plane(width=0.16, height=0.09), z=-0.1), at(Plane(width=16.0, height=9.0), z=-10.0))
        ),
        aspect=16 / 9,
    )


def parallel():
    return Projection(
        ViewingVolume((at(Plane(width=8.0, height=4.5), z=2.5), at(Plane(width=8.0, height=4.5), z=-20.0))),
        aspect=16 / 9,
    )


def panorama():
    height = 1.2
    return Projection(
        ViewingVolume(
            (Cylinder(radius=0.01, height=0.01 * height), Cylinder(radius=30.0, height=30.0 * height))
        ),
        aspect=2 * math.pi / height,
    )


def fisheye():
    near, far = (
        SphereSector(radius=r, arc=math.radians(170), latitude_start=-1.4, latitude_end=1.4)
        for r in (0.01, 30.0)
    )
    return Projection(ViewingVolume((near, far)), aspect=1.0)


def pictures_of(views):
    """Pictures whose colours are the positions of what their pixels' centres show."""
    made = []
    for view in views:
        anchor, depth = view.anchor, view.depth
        height, width = depth.shape
        column, row = np.tile(np.arange(width), height), np.repeat(np.arange(height), width)
        begin, way = anchor.rays(column, row)
        far = np.where(np.isfinite(depth), depth, 0.0).ravel() - anchor.start
        made.append(np.ascontiguousarray((begin + way * far).T.reshape(height, width, 3), np.float32))
    return made


def joined(scene, projection, size=SIZE):
    """The plan, how far joined positions are off in pixels of the image, and the share of holes."""
    plan = plan_anchors([scene], [projection], size, AXES)
    return plan, *looked_up(scene, projection, size, traced_views(scene, plan.anchors))


def looked_up(scene, projection, size, views):
    """How far joined positions are off in pixels of the image, and the share of holes."""
    x, y = pixel_centres(*size, (0, size[1]))
    points = shown_points(scene, projection, x, y, (1 / size[0], 1 / size[1]))
    points = points.take(np.flatnonzero(points.is_hit))
    found = find_texels(points, views)
    off = found.colors(pictures_of(views)).T - points.position
    off -= points.direction * np.einsum("cn,cn->n", off, points.direction)
    shown = ~found.is_hole
    return np.linalg.norm(off, axis=0)[shown] / points.length[shown], found.is_hole.mean()


@pytest.mark.parametrize(
    ("projection", "most", "is_one_eye"),
    [(frustum, 1, True), (parallel, 1, False), (panorama, 6, True), (fisheye, 5, True)],
)
def test_the_anchors_of_known_cameras(projection, most, is_one_eye):
    """A pinhole and a parallel camera are one anchor; a panorama needs no more than the faces of a cube."""
    plan, off, holes = joined(room(), projection())
    assert len(plan.anchors) <= most and plan.is_one_eye == is_one_eye
    assert plan.covered > 0.99
    assert (off < 0.5).mean() > 0.98 and holes < 0.002


@pytest.mark.parametrize("build", [boxes, columns])
@pytest.mark.parametrize("angle", [10, 60])
def test_positions_of_bent_volumes(build, angle):
    scene = seen(*build(2000))
    plan, off, holes = joined(scene, bent_projection(2, math.radians(angle)))
    assert 1 < len(plan.anchors) <= 64 and not plan.is_one_eye
    assert (off < 0.5).mean() > 0.99 and holes < 0.03


@pytest.mark.parametrize(
    "name",
    [
        "angular_fisheye",
        "cavalier",
        "deep_curvy_volume",
        "inverted_perspective",
        "linear_twist",
        "perspective",
        "street_panorama_curved",
        "tiny_planet",
    ],
)
def test_positions_of_presets_after_completion(name):
    """At all pixels: holes are 0.05 % at most, and 99.5 % of positions are within half a pixel."""
    scene, size = room(), (240, 135)
    projection = read_preset(PRESETS / f"{name}.json").projection(size[0] / size[1])
    plan = plan_anchors([scene], [projection], size, AXES)
    done = completed(scene, projection, size, traced_views(scene, plan.anchors))
    off, holes = looked_up(scene, projection, size, done.views)
    assert len(off) > 1000 and holes <= 5e-4 and abs(1.0 - holes - done.shown) < 1e-9
    assert (off < 0.5).mean() >= 0.995


def test_a_picture_is_seen_by_its_own_pinhole():
    """The anchor of a pinhole stands in it and has its window, whatever the scene's size."""
    (anchor,) = plan_anchors([room()], [frustum()], SIZE, AXES).anchors
    np.testing.assert_allclose(anchor.eye, 0.0, atol=1e-9)
    left, bottom, right, top = anchor.window
    assert left < -0.8 < 0.8 < right and bottom < -0.45 < 0.45 < top
    assert right - left < 1.6 * 1.2 and top - bottom < 0.9 * 1.25
    assert anchor.start <= 0.1


def test_rays_and_places_are_inverse():
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    for is_parallel in (False, True):
        anchor = Anchor(matrix, Window(-1.0, -0.5, 3.0, 1.5), (40, 20), 0.5, 9.0, is_parallel)
        column, row = np.array([0, 7, 39]), np.array([19, 4, 0])
        begin, way = anchor.rays(column, row)
        places = anchor.places(begin + way * 2.25)
        np.testing.assert_allclose(places.across, column + 0.5)
        np.testing.assert_allclose(places.up, row + 0.5)
        np.testing.assert_allclose(places.depth, 2.75)


def test_lines_through_a_point_are_recognised():
    generator = np.random.default_rng(1)
    way = generator.normal(size=(3, 50))
    way /= np.linalg.norm(way, axis=0)
    eye = np.array([3.0, -2.0, 7.0])
    found = nearest_to_lines(eye[:, None] + way * generator.uniform(1, 9, 50), way)
    np.testing.assert_allclose(found, eye, atol=1e-9)
    assert nearest_to_lines(generator.normal(size=(3, 50)), np.tile([[0.0], [0.6], [0.8]], 50)) is None


def test_what_hides_a_point_is_not_taken_for_it():
    """A plate that stands between an anchor and a wall covers part of it; its colours are not the wall's."""
    vertices = np.array([[-9, -9, -5], [9, -9, -5], [0, 18, -5], [-1, -1, -2], [1, -1, -2], [0, 1, -2.0]])
    scene = seen(vertices, np.array([[0, 1, 2], [3, 4, 5]], np.int32))
    x, y = pixel_centres(48, 27, (0, 27))
    points = shown_points(scene, parallel(), x, y, (1 / 48, 1 / 27))
    wall = points.take(np.flatnonzero(points.triangle == 0))
    anchor = Anchor(np.eye(4), Window(-1.2, -1.2, 1.2, 1.2), (300, 300), 0.1, 9.0)
    views = traced_views(scene, [anchor])
    found = find_texels(wall._replace(angle=np.full(len(wall.number), 1.5)), views)
    hidden = found.is_hole & anchor.holds(anchor.places(wall.position))
    # By similar triangles the plate's shadow on the wall, seen from the origin, is 2.5 times the plate.
    a, b, c = (vertices[k, :2] * 2.5 for k in (3, 4, 5))
    px, py = wall.position[0], wall.position[1]

    def side(p, q):
        return (q[0] - p[0]) * (py - p[1]) - (q[1] - p[1]) * (px - p[0])

    within = np.minimum(np.minimum(side(a, b), side(b, c)), side(c, a))
    assert hidden[within > 0.3].all() and not hidden[within < -0.3].any()
    color = found.colors(pictures_of(views))
    np.testing.assert_allclose(color[~found.is_hole], wall.position.T[~found.is_hole], atol=0.05)


def test_near_planes_leave_out_what_hides_what_an_anchor_was_chosen_for():
    """A curtain hangs before the near surface, and before the near plane of the camera that looks over it."""
    curtain = [[-9, -9, -4.85], [9, -9, -4.85], [0, 18, -4.85]]
    # It is nearest along the middle.
    wall = [[0, -9, -5.05], [0, 9, -5.05], [9, 0, -6.0], [-9, 0, -6.0]]
    faces = np.array([[0, 1, 2], [3, 4, 5], [3, 6, 4]], np.int32)
    scene = seen(np.array(curtain + wall), faces)
    volume = ViewingVolume(tuple(at(Plane(width=8.0, height=4.5), z=z) for z in (-4.9, -20.0)))
    projection = Projection(volume, aspect=16 / 9)
    x, y = pixel_centres(*SIZE, (0, SIZE[1]))
    points = shown_points(scene, projection, x, y, (1 / SIZE[0], 1 / SIZE[1]))
    assert points.is_hit.all()
    # Planes are a hundredth of the distance before what is nearest of a part, here at a depth of 25.05 m, and
    # would be at 24.8 m for the middle as well.
    depth = 20.0 - points.position[2]
    camera = camera_matrix(AXES, np.array([0.0, 0.0, 20.0])), False
    cameras = [(np.flatnonzero(depth > 25.3), camera)]
    anchors = Cover([scene], SIZE, PlanLimits()).chosen([], points, cameras, 0, 1)
    found = find_texels(points.take(np.flatnonzero(depth > 25.06)), traced_views(scene, anchors))
    assert len(anchors) == 1 and not found.is_hole.any()


def test_the_sky_is_looked_up_by_direction():
    """A sky that is painted with its directions comes back as those of the projectors."""
    scene, projection = seen(*boxes(200)), panorama()
    size = (90, 40)
    anchors = sky_anchors(scene, projection, size, AXES, PlanLimits())
    assert 1 <= len(anchors) <= 6
    views, painted = [], []
    for anchor in anchors:
        width, height = anchor.size
        _, way = anchor.rays(np.tile(np.arange(width), height), np.repeat(np.arange(height), width))
        way = way / np.linalg.norm(way, axis=0)
        color = np.concatenate([way, np.ones((1, way.shape[1]))]).T.reshape(height, width, 4)
        painted.append(np.ascontiguousarray(color, np.float32))
        views.append(AnchorView(anchor, np.full((height, width), np.inf, np.float32)))
    x, y = pixel_centres(*size, (0, size[1]))
    points = shown_points(scene, projection, x, y, (1 / size[0], 1 / size[1]))
    points = points.take(np.flatnonzero(~points.is_hit))
    color, lacks = join_sky(points, views, painted)
    assert not lacks.any()
    np.testing.assert_allclose(color[:, :3].T, points.direction, atol=0.01)


def test_projectors_from_many_places_have_no_common_eye():
    scene = seen(*boxes(500))
    x, y = pixel_centres(24, 14, (0, 14))
    points = shown_points(scene, bent_projection(2, math.radians(60)), x, y, (1 / 24, 1 / 14))
    assert common_eye(points) is None


@pytest.mark.parametrize("width", [0.0, 1e-30])
def test_a_volume_that_is_a_single_projector_has_a_plan(width):
    """Its pixels have no size, so no anchor can be framed by them."""
    surfaces = (at(Plane(width=width, height=width), z=z) for z in (12.0, 30.0))
    beam = Projection(ViewingVolume(tuple(surfaces)), aspect=16 / 9)
    scene = room()
    assert len(sky_anchors(scene, beam, SIZE, AXES, PlanLimits())) <= 6
    assert plan_anchors([scene], [beam], SIZE, AXES).covered >= 0.0


def striped(position):
    """Colours (N,) of lines that are drawn on surfaces, three quarters of a pixel wide on the far wall."""
    return (np.sin(2.0 * np.pi * (position[0] + position[1] + position[2]) / 1.1) > 0.9).astype(np.float32)


def striped_image(scene, projection, samples, anchors=None):
    """An image (N,) of lines: as the caster meets them, or joined from anchors' pictures."""
    views = [] if anchors is None else traced_views(scene, anchors)
    shapes = [view.depth.shape for view in views]
    pictures = [
        striped(positions.reshape(-1, 3).T).reshape(*shape, 1)
        for positions, shape in zip(pictures_of(views), shapes, strict=True)
    ]
    samples_at, total = SamplePositions(*SIZE, samples, PixelFilter()), 0.0
    for sample in range(samples):
        x, y = samples_at.of_rows(slice(0, SIZE[1]), sample)
        points = shown_points(scene, projection, x, y, (1 / SIZE[0], 1 / SIZE[1]))
        assert points.is_hit.all()
        joined = striped(points.position)
        if views:
            joined = find_texels(points, views).colors(pictures)[:, 0]
        total = total + joined / samples
    return total


@pytest.mark.parametrize("projection", [frustum, panorama])
def test_more_hits_a_pixel_make_lines_on_surfaces_smooth(projection):
    """Anchors for 16 hits a pixel have finer pixels than those for 4, beside 400 hits by the caster."""
    scene, projection, off = room(), projection(), {}
    right = striped_image(scene, projection, 400)
    for samples in (4, 16):
        plan = plan_anchors([scene], [projection], SIZE, AXES, PlanLimits.of_samples(samples))
        off[samples] = np.abs(striped_image(scene, projection, 16, plan.anchors) - right)
    assert (off[16] > 0.2).mean() < 1e-3 and (off[4] > 0.2).mean() > 0.02
    assert off[16].mean() < 0.65 * off[4].mean()
