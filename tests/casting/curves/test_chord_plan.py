# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords that Cycles' rays follow keep the pixel error, as do the sheets between them."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.cycles.chords.chord_plan import FEWEST_CELLS, ROUND_CELLS, chord_error, plan_chords
from scfpf_addon.cycles.portals.paths import faces_of
from scfpf_addon.cycles.portals.sheets import (
    FAR_SLOT,
    JUMP_SLOT,
    PLAIN_SLOT,
    REPEATED,
    SHEET_SLOT,
    SURROUND_SLOT,
    first_sheet,
    grid,
    has_no_area,
    portals,
    sheet_shape,
    whole_vertices,
)
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.user_error import UserError
from scfpf_addon.projection.volume.inverse import invert
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

SIZE = (320, 200)
PRESETS = Path(__file__).parents[3] / "presets"


def plane(half_width, depth, x=0.0, turn=0.0):
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.array([[cosine, -sine, 0, x], [sine, cosine, 0, 0], [0, 0, 1, -depth], [0, 0, 0, 1.0]])
    return Plane(2 * half_width, 1.25 * half_width, matrix=matrix)


def bent(basis="BEZIER", weights=None, x=2.0):
    surfaces = (plane(1, 1), plane(3, 6, x), plane(5, 14, -3 * x, 0.6), plane(8, 24, 2 * x))
    return Projection(ViewingVolume(surfaces, basis, weights), aspect=1.6)


def chord_ends(projection, plan, x, y):
    """Ends of the chords of projectors through x, y (N,): (n+1, 3, N), by finite differences of Q."""
    points = projection.projectors(x, y).points
    step = 1e-4

    def at(t):
        weights, _ = projection.volume.spans.weights(np.atleast_1d(t))
        return np.einsum("kn,kcs->ncs", weights, points)

    ends = []
    for t, shift in zip(plan.breaks, plan.shifts, strict=True):
        bend = (at(t + step) - 2 * at(t) + at(t - step))[0] / step**2 if shift else 0.0
        ends.append(at(t)[0] - shift * bend)
    return np.array(ends)


@pytest.mark.parametrize("pixel_error", [0.05, 0.3, 1.0])
@pytest.mark.parametrize(
    ("basis", "weights"), [("BEZIER", None), ("B_SPLINE", None), ("NURBS", (1.0, 3.0, 0.5, 1.0))]
)
def test_points_of_chords_are_seen_where_their_pixel_is(basis, weights, pixel_error):
    """The inverse of the projection maps points of a chord to the chord's own image position."""
    projection = bent(basis, weights)
    plan = plan_chords([projection], SIZE, pixel_error)
    assert plan.error <= pixel_error
    x, y = np.random.default_rng(2).uniform(0.02, 0.98, (2, 40))
    ends = chord_ends(projection, plan, x, y)
    worst = 0.0
    for part in (0.1, 0.5, 0.9):
        points = ends[:-1] * (1 - part) + ends[1:] * part
        found = invert(projection.volume, points.transpose(1, 0, 2).reshape(3, -1))
        u, v = found.u.reshape(-1, 40), found.v.reshape(-1, 40)
        off = np.hypot((u - x) * SIZE[0], (v - y) * SIZE[1])
        worst = max(worst, np.nanmax(off))
    # An offset across the narrow side of a pixel moves the image by fewer pixels along the wide one.
    assert 0.2 * pixel_error < worst <= 1.1 * pixel_error


def test_fewer_chords_where_less_is_asked():
    counts = [plan_chords([bent()], SIZE, error).count for error in (0.05, 0.2, 0.8)]
    assert counts[0] > 1.8 * counts[1] > 3.2 * counts[2] > 3.2
    assert plan_chords([bent(x=0.0)], SIZE, 0.2).count < counts[1]


def test_straight_projectors_are_one_chord_and_polylines_their_own():
    straight = Projection(ViewingVolume((plane(1, 1), plane(8, 20))), aspect=1.6)
    assert plan_chords([straight], SIZE, 0.1).breaks.tolist() == [0.0, 1.0]
    line = Projection(ViewingVolume((plane(1, 1), plane(3, 6, 2), plane(8, 20)), "POLYLINE"), aspect=1.6)
    assert plan_chords([line], SIZE, 0.1).breaks.tolist() == [0.0, 0.5, 1.0]


def test_all_frames_count():
    frames = [bent(x=0.5), bent(x=4.0)]
    plan = plan_chords(frames, SIZE, 0.2)
    assert plan.count >= plan_chords(frames[1:], SIZE, 0.2).count
    assert max(chord_error(frame, SIZE, plan.breaks, plan.shifts) for frame in frames) <= 0.2


def test_a_volume_of_nothing_is_refused():
    lost = Projection(ViewingVolume((plane(1, 1), plane(np.inf, 20))))
    with pytest.raises(UserError, match="finite"):
        plan_chords([lost], SIZE, 0.1)


@pytest.mark.parametrize("polar", [False, True])
def test_sheets_cover_the_image_once(polar):
    breaks = np.linspace(0, 1, 4)
    cells = (ROUND_CELLS, ROUND_CELLS)
    arrays = portals(breaks, np.zeros(4), cells, SIZE, polar)
    rows, columns = sheet_shape(cells, polar)
    assert arrays.places.shape[1] == first_sheet(3) + rows * columns
    assert whole_vertices(3, cells, polar) == first_sheet(3) + 4 * rows * columns
    triangles = arrays.triangles[arrays.slots != SURROUND_SLOT]
    assert (arrays.places[2][triangles] == REPEATED).all()
    x, y = arrays.places[0][triangles], arrays.places[1][triangles]
    area = 0.5 * ((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))
    assert area.min() > -1e-12
    padded = (1 + 4 / SIZE[0]) * (1 + 4 / SIZE[1])
    assert area.sum() == pytest.approx(np.pi / 4 if polar else padded, rel=1e-3)


@pytest.mark.parametrize("polar", [False, True])
def test_sheets_whose_rays_skip_chords_have_the_faces_that_they_meet(polar):
    """Each ray is followed from face to face by its cell, and travels the occupied chords in order."""
    count, cells = 9, (5, 4)
    rows, columns = (side - 1 for side in sheet_shape(cells, polar))
    occupied = np.random.default_rng(2).random((count, rows, columns)) < 0.3
    ends = np.random.default_rng(3).random((count + 1, 3, rows + 1, columns + 1))
    faces = faces_of(occupied, cells, ends)
    arrays = portals(np.linspace(0, 1, count + 1), np.zeros(count + 1), cells, SIZE, polar, faces)
    own = (arrays.places[2][arrays.triangles] >= 0).all(axis=1)
    triangles, slots = arrays.triangles[own], arrays.slots[own]
    sheet, onward = arrays.places[2][triangles], arrays.onward[triangles]
    assert (sheet == sheet[:, :1]).all() and (onward == onward[:, :1]).all()
    x, y, plain = grid(cells, SIZE, polar)
    # A face is known by the places of its corners.
    known = {}
    for face, slot, number in zip(triangles, slots, onward[:, 0], strict=True):
        place = arrays.places[:2, face].T.round(9)
        key = tuple(map(tuple, place)), int(arrays.places[2, face[0]])
        known[key] = slot, int(number), arrays.length[face]
    for cell in range(rows * columns):
        wanted = np.flatnonzero(occupied[:, cell // columns, cell % columns])
        for triangle in plain[2 * cell : 2 * cell + 2]:
            corners = tuple(map(tuple, np.stack([x, y])[:, triangle].T.round(9)))
            slot, chord, so_far = known[corners, 0]
            steps = [
                np.linalg.norm(np.diff(ends, axis=0).reshape(count, 3, -1)[:, :, corner], axis=1)
                for corner in triangle
            ]
            steps = np.stack(steps, axis=1)
            travelled = []
            assert slot == PLAIN_SLOT
            while chord < count:
                travelled.append(chord)
                assert so_far == pytest.approx(steps[:chord].sum(axis=0))
                at = chord + 1
                slot, chord, length = known[corners, at]
                so_far = so_far + length
                kind = SHEET_SLOT if chord == at else JUMP_SLOT
                assert slot == (FAR_SLOT if at == count else kind)
            assert so_far == pytest.approx(0.0, abs=1e-12)
            assert travelled == wanted.tolist()


def test_polar_images_have_round_sheets():
    disc = Projection(ViewingVolume((plane(1, 1), plane(8, 20))), Polar(), aspect=1.6)
    plan = plan_chords([disc], SIZE, 0.2)
    assert min(plan.cells) >= ROUND_CELLS


def test_sheets_without_area_are_noticed():
    line = np.linspace(0, 10, 6)[:, None, None, None] * np.array([0, 0, 1.0])[None, :, None, None]
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5))
    forward = line + np.stack([x, y, 0 * x])[None]
    assert not has_no_area(forward)
    lines = forward.copy()
    lines[0, 1] = 0.0
    assert not has_no_area(lines), "the screen is elsewhere"
    lines[-1, 1] = 0.0
    assert has_no_area(lines)


def test_sheets_of_a_volume_that_begins_in_a_point_are_as_fine_as_elsewhere():
    """The stereographic preset begins in its origin, where pixels have no size to measure by."""
    projection = read_preset(PRESETS / "stereographic.json").projection(1.6)
    moved = np.eye(4)
    moved[:3, 3] = 0.3, -0.2, 5.0
    here, there = (plan_chords([one], SIZE, 0.3) for one in (projection, projection.transformed(moved)))
    assert here.cells == there.cells and here.cells[0] > FEWEST_CELLS
    assert here.error == pytest.approx(there.error, rel=1e-3) and 0.0 < here.error <= 0.3
