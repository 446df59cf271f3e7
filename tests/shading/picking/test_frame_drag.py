# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags by mouse, keys and numbers, against sums and products by hand."""

import math

import numpy as np
import pytest

from scfpf_addon.shading.picking.frame_drag import FrameDrag
from scfpf_addon.shading.picking.frame_handles import (
    BODY,
    LEAST_FACTOR,
    ORBIT,
    SIZE,
    TURN,
    FrameChange,
    HandledFrame,
)

ORIGIN = np.array([100.0, 100.0])


def drag(part, mouse=(200.0, 100.0), **more):
    frame = HandledFrame(ORIGIN, (-60.0, -40.0, 60.0, 40.0), 0.0)
    return FrameDrag(frame, part, np.array(mouse), unit=2.0, **more)


def test_the_mouse_and_the_arrows_add_up():
    one = drag(BODY)
    one.move(30.0, -10.0)
    one.move(50.0, 20.0, is_precise=True)
    for across, up in ((1, 0), (1, 0), (0, -1)):
        one.nudge(across, up)
    # 30 + 5 and two arrows of two pixels each; -10 + 2 and one arrow.
    assert one.change == FrameChange((39.0, -10.0), 1.0, 0.0)


def test_an_axis_keeps_the_other_and_is_freed_by_its_key():
    one = drag(BODY)
    one.move(30.0, 7.0)
    for key, expected in (("X", (30.0, 0.0)), ("Y", (0.0, 7.0)), ("Y", (30.0, 7.0))):
        one.constrain(key)
        assert one.change.shift == expected


def test_turns_and_sizes_snap():
    turn = drag(TURN)
    turn.move(100 * math.cos(math.radians(33)) - 100, 100 * math.sin(math.radians(33)))
    assert turn.change.turn == pytest.approx(math.radians(33))
    turn.is_snapped = True
    assert turn.change.turn == pytest.approx(math.radians(35))
    size = drag(SIZE)
    size.move(37.0, 0.0)
    assert size.change.factor == pytest.approx(1.37)
    size.is_snapped = True
    assert size.change.factor == pytest.approx(1.4)


@pytest.mark.parametrize(
    ("part", "axis", "typed", "expected"),
    [
        (BODY, "", "-12.5", FrameChange((-25.0, 0.0), 1.0, 0.0)),
        (BODY, "Y", "3", FrameChange((0.0, 6.0), 1.0, 0.0)),
        (TURN, "", "90", FrameChange((0.0, 0.0), 1.0, math.pi / 2)),
        (SIZE, "", "1,5", FrameChange((0.0, 0.0), 1.5, 0.0)),
        (SIZE, "", "0", FrameChange((0.0, 0.0), LEAST_FACTOR, 0.0)),
        (ORBIT, "", "90", FrameChange(orbit=(math.pi / 2, 0.0))),
        (ORBIT, "Y", "-45", FrameChange(orbit=(0.0, -math.pi / 4))),
    ],
)
def test_a_typed_number_counts_instead_of_the_mouse(part, axis, typed, expected):
    one = drag(part)
    one.move(40.0, 40.0)
    before = one.change
    if axis:
        one.constrain(axis)
    for character in typed:
        one.type(character)
    for found, wanted in zip(one.change, expected, strict=True):
        assert found == pytest.approx(wanted)
    for _ in typed:
        one.type("\b")
    one.axis = ""
    assert one.change == before


def test_half_a_number_and_no_number_leave_the_mouse():
    one = drag(BODY)
    one.move(5.0, 0.0)
    for text in ("-", ".", "1-2", "1e999"):
        one.typed = text
        assert one.change.shift == (5.0, 0.0)


def test_arrows_turn_by_a_degree_and_scale_by_a_hundredth():
    turn, size = drag(TURN), drag(SIZE)
    for _ in range(3):
        turn.nudge(-1, 0)
        size.nudge(0, 1)
    assert turn.change.turn == pytest.approx(math.radians(3))
    assert size.change.factor == pytest.approx(math.exp(0.03))


def test_a_view_turns_in_space_by_arrows_steps_and_along_an_axis():
    """The frame's half diagonal is 72.1 pixels: as many pixels are a radian."""
    one = drag(ORBIT)
    one.move(math.hypot(60.0, 40.0) * math.radians(33), math.hypot(60.0, 40.0) * math.radians(12))
    assert one.change.orbit == pytest.approx((math.radians(33), -math.radians(12)))
    one.nudge(1, -1)
    assert one.change.orbit == pytest.approx((math.radians(34), -math.radians(11)))
    one.constrain("X")
    assert one.change.orbit == pytest.approx((math.radians(34), 0.0))
    one.constrain("X")
    one.is_snapped = True
    assert one.change.orbit == pytest.approx((math.radians(35 + 1), -math.radians(10 - 1)))


def test_another_part_begins_anew_where_the_mouse_is_and_a_pin_has_no_other():
    one = drag(BODY)
    one.move(0.0, 100.0)
    one.choose(TURN)
    assert one.change == FrameChange()
    one.move(-100.0, 0.0)
    assert one.change.turn == pytest.approx(math.pi / 4)
    pin = drag(BODY, is_point=True)
    pin.choose(SIZE)
    assert pin.part == BODY


def test_a_frame_with_a_grip_is_moved_and_scaled_but_not_turned():
    frame = HandledFrame(ORIGIN, (-60.0, -40.0, 60.0, 40.0), 0.0, has_grip=True)
    one = FrameDrag(frame, BODY, np.array([200.0, 100.0]), unit=2.0)
    for part, expected in ((TURN, BODY), (ORBIT, BODY), (SIZE, SIZE), (TURN, SIZE), (BODY, BODY)):
        one.choose(part)
        assert one.part == expected
