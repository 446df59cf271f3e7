# SPDX-License-Identifier: GPL-3.0-or-later
"""The map of a view: the image of a thing from an eye, placed, sized and turned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection, image_derivatives
from .solver.vectors import rotation

# The cosine between an eye's axis and the vertical from which its own up is the axis of turns.
UPRIGHT = 0.999
# Of t, the step by which the growth of the image along a projector is measured.
STEP = 1e-4
# An eye whose rays meet farther off than so many widths of the image at the point has parallel rays.
PARALLEL_WIDTHS = 50.0


@dataclass(frozen=True)
class ViewMap:
    """A similarity from the image plane of an eye into an image.

    to_eye: (4, 4), rigid, world space to the eye's, which looks along -Z. is_parallel: whether the eye's
    rays are parallel. centre: (3,), radius: of a sphere around the thing, in world space. position: where the
    image shows the centre, shares of its width and height. width: the sphere's diameter in the image as a
    share of its width, measured in the plane of the centre. turn: radians, counterclockwise. aspect: of the
    image.
    """

    to_eye: Array
    is_parallel: bool
    centre: Array
    radius: float
    position: tuple[float, float]
    width: float
    turn: float
    aspect: float

    def _in_eye(self, points: Array) -> Array:
        found: Array = self.to_eye[:3, :3] @ points + self.to_eye[:3, 3:]
        return found

    @cached_property
    def _centre(self) -> Array:
        """The centre in the eye's space, (3,)."""
        return self._in_eye(self.centre[:, None])[:, 0]

    @property
    def is_visible(self) -> bool:
        """Return whether the centre is in front of the eye."""
        return self.is_parallel or bool(self._centre[2] < 0.0)

    @cached_property
    def _scale(self) -> float:
        """Widths of the image for a step of 1 in the plane at distance 1, or in any plane if parallel."""
        depth = 1.0 if self.is_parallel else -self._centre[2]
        return float(self.width * depth / (2.0 * self.radius))

    @cached_property
    def _turned(self) -> Array:
        """The rotation by ``turn``, (2, 2)."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s], [s, c]])

    def positions(self, points: Array) -> Array:
        """Image positions (2, N) of world points (3, N); NaN behind the eye."""
        own = np.concatenate([self._centre[:, None], self._in_eye(points)], axis=1)
        flat = own[:2]
        if not self.is_parallel:
            with np.errstate(divide="ignore", invalid="ignore"):
                flat = np.where(own[2] < 0.0, own[:2] / -own[2], np.nan)
        moved = self._turned @ (flat[:, 1:] - flat[:, :1]) * self._scale
        moved[1] *= self.aspect
        placed: Array = moved + np.array(self.position)[:, None]
        return placed

    def directions(self, points: Array) -> Array:
        """Unit directions of sight at world points, (3, N)."""
        back = self.to_eye[:3, :3].T
        if self.is_parallel:
            return np.repeat(-back[:, 2:], points.shape[1], axis=1)
        rays = points + back @ self.to_eye[:3, 3:]
        unit: Array = rays / np.linalg.norm(rays, axis=0)
        return unit

    def steps(self, points: Array) -> tuple[Array, Array]:
        """The world vectors (3, N) that steps of 1 along the image's x and y cover at points.

        They are perpendicular to the direction of sight.
        """
        depth = np.ones(points.shape[1]) if self.is_parallel else -self._in_eye(points)[2]
        back, sight = self.to_eye[:2, :3].T, self.directions(points)
        steps = []
        for column, length in ((0, 1.0), (1, 1.0 / self.aspect)):
            step = (back @ self._turned.T[:, column] * length / self._scale)[:, None] * depth
            steps.append(step - sight * np.einsum("cn,cn->n", step, sight))
        return steps[0], steps[1]


@dataclass(frozen=True)
class LocalEye:
    """A straight camera that sees as a projection does near one point of a projector.

    matrix: (4, 4), rigid, from the eye's space to that of the projection. is_parallel: whether its rays are
    parallel; it then stands a width of the image from the point. image_width: the length that the image's
    width covers in the plane of the point.
    """

    matrix: Array
    is_parallel: bool
    image_width: float


def local_eye(projection: Projection, x: float, y: float, t: float) -> LocalEye:
    """The straight camera nearest to a projection around Q at image position (x, y) and t.

    It is the camera itself for a projection with one centre. The plane of its image is that of Qx and Qy, and
    it stands on the tangent where Qx, continued at its present rate, shrinks to a point.
    """
    ends = np.clip([t - STEP, t, t + STEP], 0.0, 1.0)
    image = projection.parameters(np.full(3, x), np.full(3, y))
    sample = projection.volume.evaluate(image.u, image.v, ends)
    dx, dy = image_derivatives(sample.du, sample.dv, image.jacobian)
    widths = np.linalg.norm(dx, axis=0)
    right = dx[:, 1] / widths[1]
    up = dy[:, 1] - right * (right @ dy[:, 1])
    up /= np.linalg.norm(up)
    back, speed = np.cross(right, up), float(np.linalg.norm(sample.dt[:, 1]))
    sight = sample.dt[:, 1] / speed
    if back @ sight > 0.0:
        # A mirrored image has no such camera: this one sees it upside down.
        up, back = -up, -back
    growth = (widths[2] - widths[0]) / ((ends[2] - ends[0]) * speed)
    width = float(widths[1])
    is_parallel = growth * PARALLEL_WIDTHS < 1.0
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, up, back], axis=1)
    matrix[:3, 3] = sample.position[:, 1] - sight * (width if is_parallel else width / growth)
    return LocalEye(matrix, bool(is_parallel), width)


def orbit(eye: Array, centre: Array, left: float, up: float) -> Array:
    """The (4, 4) rotation of world space that leads an eye round a centre, to its own left and up (radians).

    eye: (4, 4), to world space. An eye that looks along the vertical turns about its own up axis.
    """
    right, back = (eye[:3, column] / np.linalg.norm(eye[:3, column]) for column in (0, 2))
    axis = np.array([0.0, 0.0, -1.0 if eye[2, 1] < 0.0 else 1.0])
    if abs(back @ axis) > UPRIGHT:
        axis = eye[:3, 1] / np.linalg.norm(eye[:3, 1])
    turn = rotation(axis, -left) @ rotation(right, -up)
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = centre - turn @ centre
    return matrix
