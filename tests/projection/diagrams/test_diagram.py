# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of a volume as data: where they run, how many there are, and when they are the same."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from scfpf_addon.projection.diagrams.diagram import DiagramOptions, diagram, volume_signature
from scfpf_addon.projection.diagrams.line_colors import BRIGHT
from scfpf_addon.projection.diagrams.marks import image_frame
from scfpf_addon.projection.diagrams.projector_lines import BEND_TOLERANCE, projector_lines
from scfpf_addon.projection.diagrams.surface_lines import surface_lines
from scfpf_addon.projection.surfaces.surface import ControlSurface, Disc, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume


def placed(z, turn=0.0):
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[2, 3] = z
    return matrix


def straight():
    return Projection(
        ViewingVolume((Plane(2.0, 1.0, matrix=placed(-1)), Plane(6.0, 3.0, matrix=placed(-5)))), aspect=2.0
    )


def twisted():
    surfaces = (Plane(4, 4, matrix=placed(-2)), Plane(4, 4, matrix=placed(-12, np.pi / 2)))
    return Projection(ViewingVolume((*surfaces, Plane(4, 4, matrix=placed(-22)))))


def fisheye(aspect=1.0):
    discs = (Disc(0.1, matrix=placed(-1)), Disc(2.0, matrix=placed(-4)))
    return Projection(ViewingVolume(discs), Polar(), aspect=aspect)


@dataclass(frozen=True)
class HoledPlane(ControlSurface):
    """A unit square with nothing at u > 0.6."""

    def local(self, u, v):
        return Plane().local(u, v)._replace(valid=u <= 0.6)


def test_every_role_has_a_colour_and_lines_are_float32_segments():
    lines = diagram(straight(), DiagramOptions(3, 3, iso=(0.5,), pick=(0.2, 0.4), safe_areas=((0.1, 0.1),)))
    assert list(lines) == list(BRIGHT)
    for role, segments in lines.items():
        assert segments.dtype == np.float32 and segments.shape[1:] == (2, 3)
        assert len(segments) or role in {"FOLD", "FOLDED"}
        # The GPU reads them as they lie in memory.
        assert segments.flags.c_contiguous


def test_surface_lines_are_the_lattice_of_u_and_v():
    lines = surface_lines(straight(), 1, lines=4, resolution=6)
    assert lines.shape == (2 * 5 * 6, 2, 3)
    assert (lines[..., 2] == -5).all()
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    # Five lines along u, each 6 long, five along v, each 3 long.
    assert lengths.sum() == pytest.approx(5 * 6 + 5 * 3)
    along_v = lines[:, 0, 0] == lines[:, 1, 0]
    assert set(lines[along_v][:, 0, 0]) == {-3, -1.5, 0, 1.5, 3}
    assert set(lines[~along_v][:, 0, 1]) == {-1.5, -0.75, 0, 0.75, 1.5}


def test_only_the_shown_part_is_drawn():
    part = replace(straight(), u_range=(0.5, 1.0), v_range=(0.0, 0.5))
    for segments in diagram(part, DiagramOptions(4, 4, iso=(0.3,), pick=(0.5, 0.5))).values():
        assert (segments[..., 0] >= 0).all() and (segments[..., 1] <= 0).all()
    assert image_frame(part)[..., 0].max() == 1 and image_frame(part)[..., 1].min() == -0.5


def test_straight_projectors_are_one_segment_from_near_to_far():
    lines = projector_lines(straight(), 3, 2)
    assert lines.shape == (6, 2, 3)
    near = {tuple(point) for point in lines[:, 0].tolist()}
    assert near == {(x, y, -1) for x in (-1, 0, 1) for y in (-0.5, 0.5)}
    assert np.array_equal(lines[:, 1], lines[:, 0] * [3, 3, 5])


def test_one_projector_is_the_middle_one():
    assert projector_lines(straight(), 1, 1).tolist() == [[[0, 0, -1], [0, 0, -5]]]


def test_curved_projectors_keep_the_tolerance_with_no_more_chords_than_needed():
    projection = twisted()
    lines = projector_lines(projection, 5, 5).astype(np.float64)
    middle = projector_lines(projection, 1, 1)
    assert len(middle) == 1
    # Every vertex and every middle of a chord is on or near the volume's own curve at its depth.
    t = (-2 - lines[..., 2]) / 20
    half = lines.mean(axis=1)
    start = projector_lines(projection, 5, 5, chords=1).astype(np.float64)
    corner = start[np.argmax(np.abs(start[:, 0, :2]).sum(axis=1)), 0]
    own = np.flatnonzero((lines[:, 0] == corner).all(axis=1))[0]
    count = int(np.argmax(lines[own:, 1, 2] == -22)) + 1
    curve = lines[own : own + count]
    z = corner[0] + 1j * corner[1]

    def exact(t):
        return z * ((1 - t) ** 2 + t**2 + 2 * t * (1 - t) * 1j)

    at = t[own : own + count]
    assert np.allclose(curve[..., 0] + 1j * curve[..., 1], exact(at), atol=1e-5)
    sag = np.abs(half[own : own + count, 0] + 1j * half[own : own + count, 1] - exact(at.mean(axis=1)))
    polygon = 2 * np.hypot(10, np.abs(z - z * 1j))
    assert sag.max() <= BEND_TOLERANCE * polygon * (1 + 1e-4)
    assert sag.max() * (count / (count - 1)) ** 2 > BEND_TOLERANCE * polygon
    # The axis does not bend; a chord count given by hand holds for all.
    assert len(projector_lines(projection, 5, 5, chords=7)) == 25 * 7


def test_polyline_projectors_bend_at_their_middle_surface_only():
    volume = replace(twisted().volume, basis="POLYLINE")
    lines = projector_lines(replace(twisted(), volume=volume), 2, 2)
    assert lines.shape == (8, 2, 3)
    assert {tuple(pair) for pair in lines[..., 2].tolist()} == {(-2, -12), (-12, -22)}


def test_a_point_surface_has_no_lines_and_the_projectors_start_there():
    projection = Projection(ViewingVolume((Point(matrix=placed(-1)), Plane(matrix=placed(-2)))))
    assert surface_lines(projection, 0).shape == (0, 2, 3)
    assert image_frame(projection).shape == (0, 2, 3)
    lines = projector_lines(projection, 2, 2)
    assert len(lines) == 4 and (lines[:, 0] == [0, 0, -1]).all()
    coincident = Projection(ViewingVolume((Point(), Point())))
    assert projector_lines(coincident, 3, 3).shape == (0, 2, 3)


def test_holes_are_left_out():
    projection = Projection(ViewingVolume((Plane(), HoledPlane(matrix=placed(-2)))))
    assert surface_lines(projection, 1)[..., 0].max() <= 0.1 + 1e-6
    assert projector_lines(projection, 5, 1)[:, 0, 0].tolist() == [-0.5, -0.25, 0.0]
    assert surface_lines(projection, 0)[..., 0].max() == 0.5


def test_frame_of_a_rectangle_is_its_closed_border():
    frame = image_frame(straight(), resolution=4)
    assert len(frame) == 16
    assert np.array_equal(frame[1:, 0], frame[:-1, 1]) and np.array_equal(frame[0, 0], frame[-1, 1])
    corners = {(x, y, -1) for x in (-1, 1) for y in (-0.5, 0.5)}
    assert {tuple(point) for point in frame[:, 0].tolist()} >= corners
    on_border = (np.abs(frame[..., 0]) == 1) | (np.abs(frame[..., 1]) == 0.5)
    assert on_border.all()


@pytest.mark.parametrize("aspect", [1.0, 1.7778, 0.4])
def test_frame_of_a_polar_image_is_its_rim(aspect):
    frame = image_frame(fisheye(aspect))
    assert np.allclose(np.hypot(frame[..., 0], frame[..., 1]), 0.1, atol=1e-7)
    assert np.array_equal(frame[1:, 0], frame[:-1, 1]) and np.allclose(frame[0, 0], frame[-1, 1], atol=1e-7)
    # It goes round once, counter-clockwise, in steps that leave no gap.
    angle = np.unwrap(np.arctan2(frame[:, 0, 1], frame[:, 0, 0]))
    assert angle[-1] - angle[0] == pytest.approx(2 * np.pi, abs=0.2)
    assert np.linalg.norm(frame[:, 1] - frame[:, 0], axis=1).max() < 0.02


def test_polar_projectors_reach_the_rim_and_the_centre():
    lines = projector_lines(fisheye(), 9, 3)
    radius = np.hypot(lines[:, 1, 0], lines[:, 1, 1])
    assert set(np.round(radius, 5)) == {0.0, 1.0, 2.0}


def test_signature_names_what_the_lines_depend_on():
    base = straight()
    assert volume_signature(base, 5, 3) == volume_signature(straight(), 5, 3)
    moved = base.transformed(placed(1e-9))
    near, far = base.volume.surfaces
    bigger = replace(base, volume=ViewingVolume((replace(near, height=1.1), far)))
    other = [
        volume_signature(base, 5, 4),
        volume_signature(moved, 5, 3),
        volume_signature(bigger, 5, 3),
        volume_signature(replace(base, aspect=1.0), 5, 3),
        volume_signature(replace(base, u_range=(0.0, 0.5)), 5, 3),
        volume_signature(replace(base, reparameterisation=Polar()), 5, 3),
        volume_signature(replace(base, volume=replace(base.volume, basis="POLYLINE")), 5, 3),
        volume_signature(replace(base, volume=ViewingVolume(base.volume.surfaces[::-1])), 5, 3),
        volume_signature(replace(base, volume=ViewingVolume((*base.volume.surfaces, Point()))), 5, 3),
    ]
    own = volume_signature(base, 5, 3)
    assert len({own, *other}) == len(other) + 1
    assert volume_signature(replace(base, reparameterisation=Unrolled()), 5, 3) == own


def test_signature_sees_every_point_of_a_grid():
    points = np.random.default_rng(1).random((40, 40, 3))
    changed = points.copy()
    changed[20, 20, 1] += 1e-12
    signatures = [
        volume_signature(Projection(ViewingVolume((Plane(), Grid(p)))))
        for p in (points, points.copy(), changed)
    ]
    assert signatures[0] == signatures[1] != signatures[2]


def test_lines_lie_on_a_sphere():
    sphere = SphereSector(3.0, matrix=placed(-1))
    projection = Projection(ViewingVolume((Point(matrix=placed(-1)), sphere)))
    lines = surface_lines(projection, 1, lines=6, resolution=40)
    assert np.allclose(np.linalg.norm(lines - [0, 0, -1], axis=2), 3.0, atol=1e-5)
    ends = projector_lines(projection, 4, 4)[:, 1]
    assert np.allclose(np.linalg.norm(ends - [0, 0, -1], axis=1), 3.0, atol=1e-5)


def bumpy(height, *places):
    """A flat grid of 64 × 64 cells with bumps as wide as an eighth of it at (u, v), before a plane."""
    u, v = np.meshgrid(*[np.linspace(0.0, 1.0, 65)] * 2)
    z = sum(height * np.exp(-((u - a) ** 2 + (v - b) ** 2) / 0.04**2) for a, b in places)
    far = Grid(np.stack([u - 0.5, v - 0.5, z], axis=-1), matrix=placed(-5))
    return Projection(ViewingVolume((Plane(matrix=placed(-1)), far)))


def test_bends_between_the_drawn_projectors_are_drawn():
    """A bump that none of 5 × 5 projectors and 8 × 8 lines meets gets one of each; symmetric ones alike."""
    flat = bumpy(0.0, (0.5, 0.5))
    assert len(projector_lines(flat, 5, 5)) == 25
    for places in (((0.375, 0.625),), ((0.1875, 0.4375), (0.8125, 0.4375))):
        bent = bumpy(0.6, *places)
        ends = projector_lines(bent, 5, 5)[:, 1].astype(np.float64)
        assert len(ends) == 25 + len(places)
        assert np.allclose(ends[:25], projector_lines(flat, 5, 5)[:, 1], atol=0.02)
        assert ends[25:, 2].min() > -5 + 0.5
        assert sorted(map(tuple, (ends[25:, :2] + 0.5).round(4))) == sorted(places)
        assert len(surface_lines(bent, 1)) > 1.5 * len(surface_lines(flat, 1))
