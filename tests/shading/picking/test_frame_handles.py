# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of views against complex numbers: a similarity of the plane is z -> a z + b."""

import cmath
import math

import numpy as np
import pytest

from scfpf_addon.shading.picking.frame_handles import (
    BODY,
    LEAST_FACTOR,
    ORBIT,
    REACH,
    RING_GAP,
    RING_REACH,
    SIZE,
    STALK,
    TURN,
    HandledFrame,
)

ORIGIN, TURNED = 310.0 + 220.0j, 0.4
BOX = (-80.0, -30.0, 120.0, 50.0)


def plane(z):
    return np.array([z.real, z.imag])


def at(across, up, turn=TURNED):
    """The pixel of a place in the frame, by complex numbers."""
    return ORIGIN + complex(across, up) * cmath.exp(1j * turn)


@pytest.fixture
def frame():
    return HandledFrame(plane(ORIGIN), BOX, TURNED)


def apply(change, z):
    """The pixel to which a change of the frame moves a pixel."""
    origin = ORIGIN + complex(*change.shift)
    return origin + (z - ORIGIN) * change.factor * cmath.exp(1j * change.turn)


def test_corners_and_handle_lie_where_complex_numbers_say(frame):
    left, low, right, high = BOX
    expected = [at(left, low), at(right, low), at(right, high), at(left, high)]
    assert np.allclose(frame.corners, np.stack([plane(z) for z in expected], axis=1))
    handle = at((left + right) / 2, high + 2 * STALK)
    assert np.allclose(frame.stalk(2.0)[:, 1], plane(handle))


def test_a_frame_around_points_touches_them_on_all_sides():
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 500, (2, 60))
    frame = HandledFrame.around(points, np.array([250.0, 100.0]), 0.9)
    flat = (points[0] + 1j * points[1] - complex(250, 100)) * cmath.exp(-0.9j)
    assert frame.box == pytest.approx((flat.real.min(), flat.imag.min(), flat.real.max(), flat.imag.max()))


@pytest.mark.parametrize("part", range(4))
def test_a_dragged_corner_comes_along_and_the_opposite_one_stays(frame, part):
    corner, opposite = frame.corners[:, part], frame.corners[:, (part + 2) % 4]
    for share in (0.4, 1.7):
        end = opposite + share * (corner - opposite)
        change = frame.dragged(part, corner, end)
        assert change.factor == pytest.approx(share) and change.turn == 0.0
        assert np.allclose(plane(apply(change, complex(*corner))), end)
        assert np.allclose(plane(apply(change, complex(*opposite))), opposite)


def test_a_corner_dragged_beyond_its_opposite_stops_before_it(frame):
    corner, opposite = frame.corners[:, 1], frame.corners[:, 3]
    assert frame.dragged(1, corner, 2 * opposite - corner).factor == LEAST_FACTOR


def test_the_turning_handle_turns_about_the_origin_also_across_the_half_turn(frame):
    for angle in (0.3, -2.0, math.pi - 0.01):
        start = ORIGIN + 90 * cmath.exp(3.0j)
        end = ORIGIN + 40 * cmath.exp(1j * (3.0 + angle))
        change = frame.dragged(TURN, plane(start), plane(end))
        assert change.turn == pytest.approx(angle) and change.factor == 1.0
        assert change.shift == (0.0, 0.0)


def test_the_body_follows_the_mouse(frame):
    change = frame.dragged(BODY, np.array([300.0, 200.0]), np.array([290.0, 260.0]))
    assert (change.shift, change.factor, change.turn) == ((-10.0, 60.0), 1.0, 0.0)


def test_parts_are_hit_within_their_reach_and_the_body_inside_its_sides(frame):
    scale = 1.5
    for part in range(4):
        corner = complex(*frame.corners[:, part])
        inwards = at(20.0, 10.0) - corner
        inwards /= abs(inwards)
        near, far = corner + 0.9 * REACH * scale * inwards, corner + 1.2 * REACH * scale * inwards
        assert frame.part_at(near.real, near.imag, scale) == part
        assert frame.part_at(far.real, far.imag, scale) == BODY
        out = corner - (RING_GAP + 1.5 * RING_REACH) * scale * inwards
        assert frame.part_at(out.real, out.imag, scale) is None
    handle = frame.stalk(scale)[:, 1]
    assert frame.part_at(*handle, scale) == TURN
    beside = at(120.0 + 1.0, 10.0)
    assert frame.part_at(beside.real, beside.imag, 0.1) is None


def test_the_ring_is_a_circle_around_the_corners(frame):
    scale, middle, radius = 1.5, at(20.0, 10.0), math.hypot(100.0, 40.0)
    ring = np.array([complex(*place) for place in frame.ring(scale).T])
    assert np.abs(ring - middle) == pytest.approx(radius + RING_GAP * scale)
    assert abs(ring.mean() - middle) < 1e-9
    for off, part in ((0.0, ORBIT), (0.9, ORBIT), (-0.9, ORBIT), (1.1, None)):
        place = middle + (radius + (RING_GAP + off * RING_REACH) * scale) * cmath.exp(0.1j)
        assert frame.part_at(place.real, place.imag, scale) == part


def test_on_the_ring_the_front_of_the_thing_follows_the_mouse(frame):
    """Along the frame's own axes: to the right its eye goes left, and upwards its eye goes down."""
    radius = math.hypot(100.0, 40.0)
    start = at(130.0, 0.0)
    end = start + complex(30.0, 12.0) * cmath.exp(1j * TURNED)
    change = frame.dragged(ORBIT, plane(start), plane(end))
    assert change.orbit == pytest.approx((30.0 / radius, -12.0 / radius))
    assert (change.shift, change.factor, change.turn) == ((0.0, 0.0), 1.0, 0.0)


def test_a_point_has_a_frame_that_cannot_be_scaled(frame):
    point = HandledFrame(plane(ORIGIN), (0.0, 0.0, 0.0, 0.0), 0.0)
    assert point.dragged(0, plane(ORIGIN), plane(ORIGIN + 5)).factor == 1.0


def test_the_size_is_the_ratio_of_the_distances_from_the_origin(frame):
    start, end = ORIGIN + 60j, ORIGIN + 25 * cmath.exp(2j)
    change = frame.dragged(SIZE, plane(start), plane(end))
    assert change.factor == pytest.approx(25 / 60)
    assert (change.shift, change.turn) == ((0.0, 0.0), 0.0)
    assert frame.dragged(SIZE, plane(ORIGIN), plane(end)).factor == 1.0


def test_a_frame_with_a_grip_is_moved_by_it_alone_and_is_not_turned():
    """Presses inside of it are for what is seen there."""
    frame = HandledFrame(plane(ORIGIN), BOX, 0.0, has_grip=True)
    left, low, right, high = BOX
    for part, corner in enumerate(((left, low), (right, low), (right, high), (left, high))):
        place = ORIGIN + complex(*corner)
        assert frame.part_at(place.real, place.imag, 1.0) == part
    assert frame.part_at(ORIGIN.real + 0.9 * REACH, ORIGIN.imag, 1.0) == BODY
    assert frame.part_at(ORIGIN.real + 1.1 * REACH, ORIGIN.imag, 1.0) is None
    handle = frame.stalk(1.0)[:, 1]
    assert frame.part_at(*handle, 1.0) is None
    middle = ORIGIN + complex((left + right) / 2, (low + high) / 2)
    on_the_ring = middle + math.hypot(right - left, high - low) / 2 + RING_GAP
    assert frame.part_at(on_the_ring.real, on_the_ring.imag, 1.0) is None
