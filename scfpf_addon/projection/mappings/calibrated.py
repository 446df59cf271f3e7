# SPDX-License-Identifier: GPL-3.0-or-later
"""The mapping of a calibrated lens: from its pixels to an undistorted frame, and back.

A direction is a pair of frame coordinates (a, b), to the right and down. In a flat frame they are tangents
of the angles from the axis, as on a plane at distance 1. In a round frame their length is the tangent of half
the angle, so that the frame reaches behind the camera. A profile leads from that length to the radius on the
lens's image plane. There OpenCV's distortions act, and a matrix leads to pixels. The distortions are those of
cv2.projectPoints: a rational radial one, tangential ones, a thin prism and a tilted sensor. OpenCV's fisheye
(Kannala and Brandt 2006), COLMAP's cameras and OCamCalib's polynomial (Scaramuzza, Martinelli and Siegwart
2006) differ in profile and numbers only.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..arrays import BLOCK
from ..file_limits import PresetError
from ..file_values import Limit, read_choice, read_number, read_object
from ..typing import Array, BoolArray
from ..volume.reparameterisation import ImageMap, ImagePoints, Reparameterisation
from .grids import inverse_jacobian
from .radial import CENTRE, Distortion, Profile, Radial

MODELS = ("PERSPECTIVE", "EQUIDISTANT", "FIELD_OF_VIEW", "OMNIDIRECTIONAL")
# Newton's method on the image plane: its steps at most, and the share of the radius below which a step is the
# last one: the next would be its square.
STEPS, STEP_ERROR = 30, 1e-9
# Places on the image plane are found to this share of its unit, the focal length.
FOUND = 1e-11
# The least angle of a lens with a field of view, radians: below it the lens is a pinhole to rounding errors.
LEAST_OMEGA = 1e-3
# Limits of numbers in files.
PIXELS, NUMBER = Limit(1.0, 1e6), Limit(-1e9, 1e9)
MOST_COEFFICIENTS = 32


class _Straight(Radial):
    """The profile of a flat frame: the image plane is the frame itself."""

    centre = (0.5, 0.5)

    def profile(self, r: Array) -> Profile:
        """See Radial.profile."""
        return Profile(np.ones_like(r), np.ones_like(r), np.ones(len(r), bool))

    def inverse_radius(self, wanted: Array) -> Array:
        """See Radial.inverse_radius."""
        return wanted


class _Equidistant(_Straight):
    """The radius is the angle from the axis, radians; of a round frame."""

    def profile(self, r: Array) -> Profile:
        """See Radial.profile."""
        angle = 2 * np.arctan(r)
        share = np.divide(angle, r, out=np.full_like(r, 2.0), where=r > CENTRE)
        return Profile(share, 2 / (1 + r * r), np.ones(len(r), bool))

    def inverse_radius(self, wanted: Array) -> Array:
        """See Radial.inverse_radius."""
        inside = wanted < np.pi
        return np.where(inside, np.tan(np.where(inside, wanted, 0.0) / 2), np.nan)


class _FieldOfView(_Straight):
    """The one-parameter lens of Devernay and Faugeras (2001) over a flat frame."""

    def __init__(self, omega: float) -> None:
        self.omega, self.steepness = omega, 2 * np.tan(omega / 2)

    def profile(self, r: Array) -> Profile:
        """See Radial.profile."""
        along = r * self.steepness
        radius, slope = np.arctan(along) / self.omega, self.steepness / self.omega / (1 + along * along)
        share = np.divide(radius, r, out=slope.copy(), where=r > CENTRE)
        return Profile(share, slope, np.ones(len(r), bool))

    def inverse_radius(self, wanted: Array) -> Array:
        """See Radial.inverse_radius."""
        inside = wanted * self.omega < np.pi / 2
        return np.where(inside, np.tan(np.where(inside, wanted, 0.0) * self.omega) / self.steepness, np.nan)


class _Rising(Radial):
    """From the radius r on the image plane to the frame: the depth along r is a polynomial, forwards."""

    centre = (0.5, 0.5)

    def __init__(self, polynomial: tuple[float, ...]) -> None:
        self.depth = np.polynomial.Polynomial(polynomial)

    @cached_property
    def limit(self) -> float:
        """See Radial.limit."""
        radius = np.polynomial.Polynomial((0.0, 1.0))
        # The angle from the axis rises while this is above 0.
        roots = (self.depth - radius * self.depth.deriv()).trim(0.0).roots()
        real = roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0.0)]
        return float(min([*real.tolist(), super().limit]))

    def profile(self, r: Array) -> Profile:
        """See Radial.profile."""
        depth, slope = self.depth(r), self.depth.deriv()(r)
        length = np.hypot(r, depth)
        share = 1 / (length + depth)
        rising = share - r * share * share * ((r + depth * slope) / np.maximum(length, CENTRE) + slope)
        return Profile(share, rising, r <= self.limit)


class _Omnidirectional(_Straight):
    """The inverse of ``_Rising``: OCamCalib's polynomial, of a round frame."""

    def __init__(self, polynomial: tuple[float, ...]) -> None:
        self.rising = _Rising(polynomial)

    def profile(self, r: Array) -> Profile:
        """See Radial.profile."""
        radius = self.rising.inverse_radius(r)
        found = np.isfinite(radius)
        _share, slope, inside = self.rising.profile(np.where(found, radius, 0.0))
        share = np.divide(radius, r, out=1 / slope, where=r > CENTRE)
        return Profile(np.where(found, share, 1.0), 1 / slope, found & inside)

    def inverse_radius(self, wanted: Array) -> Array:
        """See Radial.inverse_radius."""
        share, _slope, inside = self.rising.profile(wanted)
        return np.where(inside, wanted * share, np.nan)


class Moved(NamedTuple):
    """Places (2, N), their Jacobians (2, 2, N), and whether they exist, (N,)."""

    place: Array
    jacobian: Array
    mask: BoolArray


@dataclass(frozen=True, eq=False)
class CalibratedLens(Reparameterisation):
    """A calibrated lens.

    model: of MODELS, the profile. size: width and height, pixels. matrix: row by row, from the image plane
    to pixels. centre: the pixel of the axis, from the image's upper left corner, to the right and down; the
    first pixel's centre is (½, ½). numerator, denominator: OpenCV's k1, k2, k3 … and k4, k5, k6.
    tangential: p1, p2. prism: s1 to s4. tilt: of the sensor about x and y, radians. profile: (omega,) of
    FIELD_OF_VIEW, radians; for OMNIDIRECTIONAL the coefficients of the depth, forwards, by the radius.
    frame: centre, to the right and up, width and height of the frame, in frame coordinates.
    Raises ValueError for numbers that make no lens.
    """

    model: str
    size: tuple[float, float]
    matrix: tuple[float, float, float, float]
    centre: tuple[float, float]
    numerator: tuple[float, ...] = ()
    denominator: tuple[float, ...] = ()
    tangential: tuple[float, float] = (0.0, 0.0)
    prism: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    profile: tuple[float, ...] = ()
    frame: tuple[float, float, float, float] = (0.0, 0.0, 2.0, 2.0)

    def __post_init__(self) -> None:
        a, b, c, d = self.matrix
        # A mirrored matrix would exchange left and right, which no lens does.
        if not (a > 0 and d > 0 and a * d - b * c > 0):
            raise ValueError("the focal lengths of a calibrated lens must be above 0")
        if not min(self.size) >= 1 or not min(self.frame[2:]) > 0:
            raise ValueError("a calibrated lens needs an image size and a frame above 0")
        if self.model not in MODELS:
            raise ValueError(f"unknown lens model {self.model!r}")
        if self.model == "FIELD_OF_VIEW" and not (
            len(self.profile) == 1 and LEAST_OMEGA <= self.profile[0] < np.pi
        ):
            raise ValueError("a lens by its field of view needs one angle below 180°")
        if self.model == "OMNIDIRECTIONAL" and not (self.profile and self.profile[0] > 0):
            raise ValueError("an omnidirectional lens needs a polynomial that does not begin with 0")

    @property
    def is_round(self) -> bool:
        """Return whether the frame is a round one: see the module."""
        return self.model in ("EQUIDISTANT", "OMNIDIRECTIONAL")

    @cached_property
    def _profile(self) -> Radial:
        if self.model == "FIELD_OF_VIEW":
            return _FieldOfView(self.profile[0])
        if self.model == "OMNIDIRECTIONAL":
            return _Omnidirectional(self.profile)
        return _Equidistant() if self.model == "EQUIDISTANT" else _Straight()

    @cached_property
    def _radial(self) -> Distortion:
        return Distortion(self.numerator, self.denominator)

    @cached_property
    def _tilt(self) -> Array:
        """OpenCV's homography of a tilted sensor, (3, 3): turned about x, then y, and projected along z."""
        (sx, sy), (cx, cy) = np.sin(self.tilt), np.cos(self.tilt)
        turned = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array(
            [[1, 0, 0], [0, cx, sx], [0, -sx, cx]]
        )
        along = np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 1]])
        tilt: Array = along @ turned
        return tilt

    def pixels(self, a: Array, b: Array) -> Moved:
        """The pixels that see frame coordinates a to the right and b down, (N,) each."""
        base = _radially(self._profile, np.stack([a, b]))
        plane = self._distorted(base.place)
        tilted = _projected(self._tilt, plane.place)
        matrix = np.reshape(self.matrix, (2, 2))
        place = matrix @ tilted.place + np.array(self.centre)[:, None]
        jacobian = np.einsum(
            "ab,bcn,cdn,den->aen", matrix, tilted.jacobian, plane.jacobian, base.jacobian, optimize=True
        )
        return Moved(place, jacobian, base.mask & plane.mask & tilted.mask & np.isfinite(place).all(axis=0))

    def directions(self, px: Array, py: Array) -> tuple[Array, BoolArray]:
        """The frame coordinates (2, N), to the right and down, that pixels see, and whether they see any."""
        coordinates, found = np.empty((2, len(px))), np.empty(len(px), bool)
        for start in range(0, len(px), BLOCK):
            part = slice(start, start + BLOCK)
            coordinates[:, part], found[part] = self._directions(np.stack([px[part], py[part]]))
        return coordinates, found

    def _directions(self, pixels: Array) -> tuple[Array, BoolArray]:
        place = pixels - np.array(self.centre)[:, None]
        plane = np.linalg.solve(np.reshape(self.matrix, (2, 2)), place)
        plane = _projected(np.linalg.inv(self._tilt), plane).place
        base, found = self._undistorted(plane)
        radius = np.hypot(*base)
        frame = self._profile.inverse_radius(radius)
        found &= np.isfinite(frame)
        # At the middle both radii vanish: the share is that of a place beside it.
        beside = self._profile.inverse_radius(np.array([2 * CENTRE]))[0] / (2 * CENTRE)
        share = np.divide(frame, radius, out=np.full_like(frame, beside), where=radius > CENTRE)
        return np.where(found, base * share, 0.0), found

    def _distorted(self, place: Array) -> Moved:
        """OpenCV's distortions of places (2, N) on the image plane."""
        moved = _radially(self._radial, place)
        if not any((*self.tangential, *self.prism)):
            return moved
        (u, v), (p1, p2), (s1, s2, s3, s4) = place, self.tangential, self.prism
        q = u * u + v * v
        across = 2 * p1 * u * v + p2 * (q + 2 * u * u) + (s1 + s2 * q) * q
        down = p1 * (q + 2 * v * v) + 2 * p2 * u * v + (s3 + s4 * q) * q
        by_q = np.array([s1 + 2 * s2 * q, s3 + 2 * s4 * q])
        bend = np.array(
            [
                [2 * p1 * v + 6 * p2 * u, 2 * p1 * u + 2 * p2 * v],
                [2 * p1 * u + 2 * p2 * v, 6 * p1 * v + 2 * p2 * u],
            ]
        )
        bend += 2 * by_q[:, None] * place[None]
        return Moved(moved.place + np.stack([across, down]), moved.jacobian + bend, moved.mask)

    def _undistorted(self, wanted: Array) -> tuple[Array, BoolArray]:
        """The places (2, N) that ``_distorted`` moves to those wanted, and whether they were found."""
        length = np.hypot(*wanted)
        radius = self._radial.inverse_radius(length)
        found = np.isfinite(radius)
        share = np.divide(radius, length, out=np.ones_like(length), where=found & (length > CENTRE))
        place = wanted * share
        if not any((*self.tangential, *self.prism)):
            return place, found
        # Most are found in a few steps, after which only the others go on.
        left = np.flatnonzero(found)
        for _ in range(STEPS):
            moved = self._distorted(place[:, left])
            inverse, _regular = inverse_jacobian(moved.jacobian)
            step = np.einsum("abn,bn->an", inverse, wanted[:, left] - moved.place)
            place[:, left] += step
            left = left[(np.abs(step).max(axis=0) > STEP_ERROR * (1 + length[left])) & moved.mask]
            if not len(left):
                break
        moved = self._distorted(place)
        with np.errstate(invalid="ignore"):
            near = np.abs(wanted - moved.place).max(axis=0) <= FOUND * (1 + length)
        return place, found & moved.mask & near

    def map(self, x: Array, y: Array, aspect: float) -> ImageMap:
        """See Reparameterisation.map: from the image, which has the lens's own size, to the frame."""
        coordinates, found = self.directions(x * self.size[0], (1 - y) * self.size[1])
        pixels = self.pixels(*coordinates)
        inverse, regular = inverse_jacobian(pixels.jacobian)
        to_frame = np.array([1 / self.frame[2], -1 / self.frame[3]])
        from_image = np.array([self.size[0], -self.size[1]])
        jacobian = to_frame[:, None, None] * inverse * from_image[None, :, None]
        u, v = self._places(coordinates)
        return ImageMap(u, v, jacobian, found & pixels.mask & regular)

    def points(self, x: Array, y: Array, aspect: float) -> ImagePoints:
        """See Reparameterisation.points."""
        coordinates, found = self.directions(x * self.size[0], (1 - y) * self.size[1])
        return ImagePoints(*self._places(coordinates), found)

    def _places(self, coordinates: Array) -> tuple[Array, Array]:
        across, up, width, height = self.frame
        return (coordinates[0] - across) / width + 0.5, (-coordinates[1] - up) / height + 0.5

    def image_positions(self, u: Array, v: Array, aspect: float) -> tuple[Array, Array]:
        """See Reparameterisation.image_positions; NaN where the lens does not see a place of the frame."""
        across, up, width, height = self.frame
        pixels = self.pixels((u - 0.5) * width + across, -((v - 0.5) * height + up))
        x, y = pixels.place[0] / self.size[0], 1 - pixels.place[1] / self.size[1]
        return np.where(pixels.mask, x, np.nan), np.where(pixels.mask, y, np.nan)


def _radially(radial: Radial, place: Array) -> Moved:
    """Places (2, N) moved along lines through the origin."""
    r = np.hypot(*place)
    share, slope, mask = radial.profile(r)
    along = place / np.maximum(r, CENTRE)
    jacobian = (slope - share) * along[:, None] * along[None]
    jacobian[0, 0] += share
    jacobian[1, 1] += share
    return Moved(place * share, jacobian, mask)


def _projected(homography: Array, place: Array) -> Moved:
    """Places (2, N) moved by a homography (3, 3)."""
    if np.array_equal(homography, np.eye(3)):
        unit = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, place.shape[1]))
        return Moved(place, unit, np.ones(place.shape[1], bool))
    linear = homography[:, :2] @ place + homography[:, 2:]
    moved = linear[:2] / linear[2]
    jacobian = (homography[:2, :2, None] - moved[:, None] * homography[2, :2][None, :, None]) / linear[2]
    return Moved(moved, jacobian, linear[2] > 0)


# The numbers of each key in a file: how many at least and at most.
_COUNTS = {
    "size": (2, 2),
    "matrix": (4, 4),
    "centre": (2, 2),
    "numerator": (0, MOST_COEFFICIENTS),
    "denominator": (0, MOST_COEFFICIENTS),
    "tangential": (2, 2),
    "prism": (4, 4),
    "tilt": (2, 2),
    "profile": (0, MOST_COEFFICIENTS),
    "frame": (4, 4),
}
_REQUIRED = ("model", "size", "matrix", "centre")


def read_lens(data: object, where: str) -> CalibratedLens:
    """The lens of an object in a file, as ``lens_data`` writes it. Raises PresetError for anything else."""
    optional = tuple(name for name in _COUNTS if name not in _REQUIRED)
    values = read_object(data, where, _REQUIRED, optional)
    numbers: dict[str, Any] = {
        name: _numbers(values[name], f"{where}: {name}", *limits)
        for name, limits in _COUNTS.items()
        if name in values
    }
    if not all(PIXELS.low <= number <= PIXELS.high for number in numbers["size"]):
        raise PresetError("{0}: size must be two numbers of pixels from 1 to {1:g}", where, PIXELS.high)
    try:
        return CalibratedLens(read_choice(values["model"], f"{where}: model", MODELS), **numbers)
    except ValueError as error:
        raise PresetError("{0}: {1}", where, error) from error


def _numbers(value: object, where: str, least: int, most: int) -> tuple[float, ...]:
    if not isinstance(value, list) or not least <= len(value) <= most:
        raise PresetError("{0} must be a list of {1} to {2} numbers", where, least, most)
    return tuple(read_number(item, where, NUMBER) for item in value)


def lens_data(lens: CalibratedLens) -> dict[str, object]:
    """A lens as ``read_lens`` reads it; what has its default value is left out."""
    values = {field.name: (getattr(lens, field.name), field.default) for field in fields(lens)}
    return {
        name: value if name == "model" else list(value)
        for name, (value, default) in values.items()
        if value != default
    }
