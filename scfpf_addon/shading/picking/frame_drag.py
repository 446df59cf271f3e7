# SPDX-License-Identifier: GPL-3.0-or-later
"""A drag in progress: the mouse, the arrow keys and typed numbers, as one change of a frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...projection.typing import Array
from .frame_handles import BODY, LEAST_FACTOR, ORBIT, SIZE, TURN, FrameChange, HandledFrame

# With Shift the mouse moves by this share; with Ctrl sizes and turns snap to these steps.
PRECISE, SIZE_STEP, TURN_STEP = 0.1, 0.1, math.radians(5)
# One press of an arrow key: pixels of the image, the logarithm of a factor, radians.
NUDGE, NUDGE_SIZE, NUDGE_TURN = 1.0, 0.01, math.radians(1)
# Characters of a typed number; a point may come as a comma.
DIGITS = "0123456789.-"


@dataclass
class FrameDrag:
    """The drag of a part of a frame, from its first pixel on.

    mouse: (2,), the pixel where it began. unit: pixels of the region for a pixel of the image. is_point:
    whether the frame is that of a pin, which can only be moved.
    """

    frame: HandledFrame
    part: int
    mouse: Array
    unit: float
    is_point: bool = False
    axis: str = ""
    typed: str = ""
    is_snapped: bool = False
    _start: Array = field(init=False)
    _keys: FrameChange = field(init=False, default_factory=FrameChange)

    def __post_init__(self) -> None:
        self._start = self.mouse

    def move(self, across: float, up: float, is_precise: bool = False) -> None:
        """Let the mouse move by so many pixels."""
        share = PRECISE if is_precise else 1.0
        self.mouse = self.mouse + share * np.array([across, up])

    def nudge(self, across: int, up: int) -> None:
        """Press an arrow key: -1, 0 or 1 to the right and up."""
        (x, y), factor, turn, (left, rise) = self._keys
        if self.part == TURN:
            turn -= NUDGE_TURN * (across - up)
        elif self.part == ORBIT:
            left, rise = left + NUDGE_TURN * across, rise - NUDGE_TURN * up
        elif self.part == BODY:
            x, y = x + NUDGE * self.unit * across, y + NUDGE * self.unit * up
        else:
            factor *= math.exp(NUDGE_SIZE * (across + up))
        self._keys = FrameChange((x, y), factor, turn, (left, rise))

    def choose(self, part: int) -> None:
        """Begin anew with another part: BODY, SIZE, TURN or ORBIT. The frame is as at first."""
        if part != BODY and (self.is_point or (self.frame.has_grip and part != SIZE)):
            return
        self.part, self._start, self._keys, self.typed, self.axis = part, self.mouse, FrameChange(), "", ""

    def constrain(self, axis: str) -> None:
        """Move, or lead the eye, along "X" or "Y" only; the same axis again frees both."""
        self.axis = "" if axis == self.axis or self.part not in (BODY, ORBIT) else axis

    def type(self, character: str) -> None:
        """Append a character of a number, or remove the last one for "\\b"."""
        self.typed = self.typed[:-1] if character == "\b" else self.typed + character.replace(",", ".")

    @property
    def number(self) -> float | None:
        """The typed number: pixels of the image, a factor or degrees; None if there is none."""
        try:
            value = float(self.typed)
        except ValueError:
            return None
        return value if math.isfinite(value) else None

    @property
    def change(self) -> FrameChange:
        """The change of the frame since the beginning."""
        value = self.number
        if value is not None:
            return self._of_number(value)
        (x, y), factor, turn, orbit = self.frame.dragged(self.part, self._start, self.mouse)
        if self.is_snapped and self.part == TURN:
            turn = TURN_STEP * round(turn / TURN_STEP)
        if self.is_snapped and self.part == SIZE:
            factor = max(SIZE_STEP * round(factor / SIZE_STEP), LEAST_FACTOR)
        if self.is_snapped:
            orbit = TURN_STEP * round(orbit[0] / TURN_STEP), TURN_STEP * round(orbit[1] / TURN_STEP)
        (dx, dy), times, more, (left, rise) = self._keys
        free = self.axis != "Y", self.axis != "X"
        return FrameChange(
            ((x + dx) * free[0], (y + dy) * free[1]),
            factor * times,
            turn + more,
            ((orbit[0] + left) * free[0], (orbit[1] + rise) * free[1]),
        )

    def _of_number(self, value: float) -> FrameChange:
        if self.part == BODY:
            length = value * self.unit
            return FrameChange(shift=(0.0, length) if self.axis == "Y" else (length, 0.0))
        if self.part == TURN:
            return FrameChange(turn=math.radians(value))
        if self.part == ORBIT:
            angle = math.radians(value)
            return FrameChange(orbit=(0.0, angle) if self.axis == "Y" else (angle, 0.0))
        return FrameChange(factor=max(abs(value), LEAST_FACTOR))
