# SPDX-License-Identifier: GPL-3.0-or-later
"""Lenses from the numbers of OpenCV, COLMAP and OCamCalib, each in the order of its own documentation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..mappings.calibrated import LEAST_OMEGA, CalibratedLens
from ..typing import Array
from ..user_error import UserError

# OpenCV counts pixels from the centre of the first one, COLMAP from its corner, as we do.
CORNER = 0.5
# The numbers of distortion coefficients that OpenCV knows.
OPENCV_COUNTS = (0, 4, 5, 8, 12, 14)
# The largest side of Blender's pictures.
MOST_PIXELS = 65536

Numbers = Sequence[float]
Size = tuple[float, float]


def opencv_lens(matrix: Array, coefficients: Numbers, size: Size) -> CalibratedLens:
    """The lens of cv2.projectPoints. matrix: (3, 3). coefficients: k1, k2, p1, p2, k3, k4 … as OpenCV's."""
    if len(coefficients) not in OPENCV_COUNTS:
        raise UserError(
            "OpenCV's lens has {0} distortion coefficients, not {1}",
            ", ".join(map(str, OPENCV_COUNTS)),
            len(coefficients),
        )
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tilt_x, tilt_y = np.pad(
        np.asarray(coefficients, np.float64), (0, OPENCV_COUNTS[-1] - len(coefficients))
    ).tolist()
    return _lens(
        "PERSPECTIVE",
        size,
        *_of_matrix(matrix),
        numerator=(k1, k2, k3),
        denominator=(k4, k5, k6),
        tangential=(p1, p2),
        prism=(s1, s2, s3, s4),
        tilt=(tilt_x, tilt_y),
    )


def fisheye_lens(matrix: Array, coefficients: Numbers, size: Size) -> CalibratedLens:
    """The lens of cv2.fisheye (Kannala and Brandt). matrix: (3, 3) with the skew. coefficients: k1 to k4."""
    if len(coefficients) not in (0, 4):
        raise UserError("OpenCV's fisheye has 4 distortion coefficients, not {0}", len(coefficients))
    return _lens("EQUIDISTANT", size, *_of_matrix(matrix), numerator=tuple(coefficients))


def _of_matrix(matrix: Array) -> tuple[Numbers, Numbers]:
    """OpenCV's camera matrix as the four numbers and the centre of a lens."""
    given = np.asarray(matrix, np.float64).tolist()
    return [*given[0][:2], *given[1][:2]], (given[0][2] + CORNER, given[1][2] + CORNER)


# COLMAP's models by name: their parameters in order, each by its name in ``_colmap_lens``.
COLMAP_MODELS: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "d1", "d2", "d3"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
}


def colmap_lens(model: str, parameters: Numbers, size: Size) -> CalibratedLens:
    """The lens of a camera in COLMAP's cameras.txt. Raises UserError for other models and counts."""
    names = COLMAP_MODELS.get(model)
    if names is None:
        raise UserError(
            "COLMAP's camera model {0} is not supported, only {1}", model, ", ".join(COLMAP_MODELS)
        )
    if len(parameters) != len(names):
        raise UserError(
            "COLMAP's camera model {0} has {1} parameters, not {2}", model, len(names), len(parameters)
        )
    given = dict(zip(names, parameters, strict=True))
    focal = given.get("f", 0.0)
    kind = "EQUIDISTANT" if "FISHEYE" in model else "PERSPECTIVE"
    profile: tuple[float, ...] = ()
    if model == "FOV" and abs(given["omega"]) > LEAST_OMEGA:
        kind, profile = "FIELD_OF_VIEW", (abs(given["omega"]),)
    return _lens(
        kind,
        size,
        (given.get("fx", focal), 0.0, 0.0, given.get("fy", focal)),
        (given["cx"], given["cy"]),
        numerator=tuple(given.get(f"k{power}", 0.0) for power in range(1, 5)),
        denominator=tuple(given.get(f"d{power}", 0.0) for power in range(1, 4)),
        tangential=(given.get("p1", 0.0), given.get("p2", 0.0)),
        prism=(given.get("sx1", 0.0), 0.0, given.get("sy1", 0.0), 0.0),
        profile=profile,
    )


def omnidirectional_lens(polynomial: Numbers, centre: Numbers, affine: Numbers, size: Size) -> CalibratedLens:
    """The lens of OCamCalib.

    polynomial: of cam2world, constant first. centre: row and column, from the first pixel's centre. affine:
    c, d and e.
    """
    if not polynomial or polynomial[0] == 0:
        raise UserError("The polynomial of an OCamCalib file must not begin with 0")
    # The calibration's z points backwards, so that the first coefficient is negative; its mirror image is
    # written by some ports. Radii are measured in the first coefficient, which is a focal length.
    scale = abs(polynomial[0])
    depth = tuple(number / polynomial[0] * scale**power for power, number in enumerate(polynomial))
    row, column = centre
    c, d, e = affine
    # Its x is down the rows and its y along them.
    return _lens(
        "OMNIDIRECTIONAL",
        size,
        (scale, scale * e, scale * d, scale * c),
        (column + CORNER, row + CORNER),
        profile=depth,
    )


def _lens(
    model: str, size: Size, matrix: Numbers, centre: Numbers, **numbers: tuple[float, ...]
) -> CalibratedLens:
    """A lens. Raises UserError for numbers that make none."""
    every = [*size, *matrix, *centre, *(number for some in numbers.values() for number in some)]
    if not np.isfinite(every).all():
        raise UserError("The numbers of a lens must be finite")
    if not all(1 <= side <= MOST_PIXELS for side in size):
        raise UserError("The picture of a lens must have 1 to {0} pixels along each side", MOST_PIXELS)
    given: dict[str, object] = {
        "matrix": tuple(map(float, matrix)),
        "centre": tuple(map(float, centre)),
        **numbers,
    }
    try:
        return CalibratedLens(model, size, **given)  # type: ignore[arg-type]
    except ValueError as error:
        text = str(error)
        raise UserError(text[0].upper() + text[1:]) from error
