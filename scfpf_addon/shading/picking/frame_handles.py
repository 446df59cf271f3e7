# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame of a view or a layer in an image: corners, handle and ring, and what dragging them does.

Places are pixels of a region, x to the right and y up. A view lies in the image by a similarity, so that a
drag changes its origin, its size by a factor, and its turn. A drag of the ring leads the view's eye round
its thing. A layer's picture stays upright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array

# Parts of a frame: its corners have the numbers 0 to 3, counterclockwise from the lower left. A key chooses
# SIZE, which scales about the origin.
TURN, BODY, SIZE, ORBIT = 4, 5, 6, 7
# Pixels at a display scale of 1: how near a handle and the ring a press may be, how far the turning handle
# stands off the frame, and the ring off the corners.
REACH, RING_REACH, STALK, RING_GAP = 10.0, 6.0, 26.0, 14.0
# Sides of the ring as it is drawn.
RING_SIDES = 64
# A drag makes nothing smaller than this share of its size.
LEAST_FACTOR = 0.05


class FrameChange(NamedTuple):
    """The change of a view by a drag: the shift of its origin in pixels, the factor of its size, its turn.

    orbit: radians by which its eye moves round the thing, to its own left and up.
    """

    shift: tuple[float, float] = (0.0, 0.0)
    factor: float = 1.0
    turn: float = 0.0
    orbit: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class HandledFrame:
    """A frame in a region.

    origin: (2,), the pixel of the view's position. box: left, lower, right and upper border as seen from the
    origin, in pixels and before turning. turn: radians, counterclockwise. has_grip: a dot at the origin alone
    moves the frame, so that other presses inside of it select what is seen, and the frame cannot be turned.
    """

    origin: Array
    box: tuple[float, float, float, float]
    turn: float
    has_grip: bool = False

    @classmethod
    def around(cls, points: Array, origin: Array, turn: float, has_grip: bool = False) -> HandledFrame:
        """The smallest frame of a turn around pixels (2, N), N > 0."""
        flat = _turned(points - origin[:, None], -turn)
        low, high = flat.min(axis=1), flat.max(axis=1)
        return cls(origin, (float(low[0]), float(low[1]), float(high[0]), float(high[1])), turn, has_grip)

    def _placed(self, flat: Array) -> Array:
        """Pixels (2, N) of places as seen from the origin before turning."""
        return self.origin[:, None] + _turned(flat, self.turn)

    @property
    def corners(self) -> Array:
        """The pixels of the corners, (2, 4)."""
        left, low, right, high = self.box
        return self._placed(np.array([[left, right, right, left], [low, low, high, high]]))

    def stalk(self, scale: float) -> Array:
        """The middle of the upper side and the turning handle above it, (2, 2). scale: of the display."""
        left, _low, right, high = self.box
        middle = (left + right) / 2
        return self._placed(np.array([[middle, middle], [high, high + STALK * scale]]))

    def handles(self, scale: float) -> Array:
        """The pixels of the corners, and of the grip or the turning handle, (2, 5). scale: of the display."""
        fifth = self.origin[:, None] if self.has_grip else self.stalk(scale)[:, 1:]
        return np.concatenate([self.corners, fifth], axis=1)

    @property
    def _middle(self) -> Array:
        """The pixel of the middle of the frame, (2,)."""
        middle: Array = self.corners.mean(axis=1)
        return middle

    @property
    def _radius(self) -> float:
        """Half of the frame's diagonal, in pixels."""
        left, low, right, high = self.box
        return math.hypot(right - left, high - low) / 2

    def ring(self, scale: float) -> Array:
        """The pixels of the ring around the frame, (2, RING_SIDES). scale: of the display."""
        angles = np.arange(RING_SIDES) * (math.tau / RING_SIDES)
        around: Array = np.stack([np.cos(angles), np.sin(angles)])
        return self._middle[:, None] + (self._radius + RING_GAP * scale) * around

    def part_at(self, x: float, y: float, scale: float) -> int | None:
        """The part of the frame at a pixel: handles come before the ring and the body.

        scale: of the display.
        """
        place = np.array([x, y])
        away = np.linalg.norm(self.handles(scale) - place[:, None], axis=0)
        nearest = int(np.argmin(away))
        if away[nearest] <= REACH * scale:
            return BODY if self.has_grip and nearest == TURN else nearest
        if self.has_grip:
            return None
        off = float(np.linalg.norm(place - self._middle)) - self._radius - RING_GAP * scale
        if abs(off) <= RING_REACH * scale:
            return ORBIT
        across, up = _turned((place - self.origin)[:, None], -self.turn)[:, 0]
        left, low, right, high = self.box
        return BODY if left <= across <= right and low <= up <= high else None

    def dragged(self, part: int, start: Array, end: Array) -> FrameChange:
        """The change when a part is dragged from one pixel to another, (2,) each.

        The corner opposite to a dragged one stays where it is; the frame turns about its origin. On the ring
        the front of the thing follows the mouse, as that of a ball of the frame's radius.
        """
        if part == BODY:
            return FrameChange(shift=(float(end[0] - start[0]), float(end[1] - start[1])))
        if part == ORBIT:
            across, up = _turned((end - start)[:, None], -self.turn)[:, 0]
            reach = max(self._radius, 1.0)
            return FrameChange(orbit=(float(across) / reach, -float(up) / reach))
        then, now = start - self.origin, end - self.origin
        if part == TURN:
            angle = math.atan2(now[1], now[0]) - math.atan2(then[1], then[0])
            return FrameChange(turn=math.remainder(angle, math.tau))
        if part == SIZE:
            reach = float(np.linalg.norm(then))
            return FrameChange(factor=max(float(np.linalg.norm(now)) / reach, LEAST_FACTOR) if reach else 1.0)
        corners = self.corners
        fixed = corners[:, (part + 2) % 4]
        diagonal = corners[:, part] - fixed
        length = float(diagonal @ diagonal)
        factor = max(1.0 + float((end - start) @ diagonal) / length, LEAST_FACTOR) if length else 1.0
        shift = (factor - 1.0) * (self.origin - fixed)
        return FrameChange(shift=(float(shift[0]), float(shift[1])), factor=factor)


def _turned(flat: Array, angle: float) -> Array:
    """Vectors (2, N) turned counterclockwise."""
    cos, sin = math.cos(angle), math.sin(angle)
    turned: Array = np.array([[cos, -sin], [sin, cos]]) @ flat
    return turned
