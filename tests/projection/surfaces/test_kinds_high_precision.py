# SPDX-License-Identifier: GPL-3.0-or-later
"""Each parametric kind against its definition in 40 digits: positions, and derivatives by finite differences.

Patches of knots, lattices and weights are in tests of their own; UV meshes and grids are affine pieces.
"""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.kinds import PARAMETRIC_KINDS
from scfpf_addon.projection.surfaces.surface import (
    BilinearPatch,
    Cone,
    Cylinder,
    Disc,
    Paraboloid,
    Plane,
    Point,
    SphereSector,
)

HALF = mpmath.mpf("0.5")
# Central differences of this step are off by its square, far below float64.
STEP = mpmath.mpf(10) ** -14
# Of the largest number in the sum: rounding of a few operations.
ROUNDING = 1e-14

size = st.floats(0.05, 20.0)
angle = st.floats(0.1, 2 * np.pi)
latitude = st.floats(-np.pi / 2, np.pi / 2)
share = st.floats(0.0, 1.0)


def plane(s, u, v):
    return (u - HALF) * s.width, (v - HALF) * s.height, mpmath.mpf(0)


def patch(s, u, v):
    shares = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    return tuple(
        mpmath.fsum(a * mpmath.mpf(float(c[axis])) for a, c in zip(shares, s.corners, strict=True))
        for axis in range(3)
    )


def disc(s, u, v):
    return s.radius * v * mpmath.cos(s.arc * u), s.radius * v * mpmath.sin(s.arc * u), mpmath.mpf(0)


def paraboloid(s, u, v):
    return *disc(s, u, v)[:2], s.depth * v * v


def about_y(s, radius, y, u):
    turn = (u - HALF) * s.arc
    return radius * mpmath.sin(turn), y, -radius * mpmath.cos(turn)


def cone(s, u, v):
    radius = (1 - v) * s.radius_start + v * s.radius_end
    return about_y(s, radius, (v - HALF) * s.height, u)


def cylinder(s, u, v):
    return about_y(s, mpmath.mpf(s.radius), (v - HALF) * s.height, u)


def sphere(s, u, v):
    height = (1 - v) * s.latitude_start + v * s.latitude_end
    return about_y(s, s.radius * mpmath.cos(height), s.radius * mpmath.sin(height), u)


def point(_s, _u, _v):
    return (mpmath.mpf(0),) * 3


KINDS = {
    "point": (st.just(Point()), point),
    "plane": (st.builds(Plane, width=size, height=size), plane),
    "patch": (
        st.integers(0, 2**32 - 1).map(
            lambda seed: BilinearPatch(np.random.default_rng(seed).normal(size=(4, 3)))
        ),
        patch,
    ),
    "paraboloid": (st.builds(Paraboloid, radius=size, arc=angle, depth=size), paraboloid),
    "disc": (st.builds(Disc, radius=size, arc=angle), disc),
    "cone": (st.builds(Cone, radius_start=size, radius_end=size, arc=angle, height=size), cone),
    "cylinder": (st.builds(Cylinder, radius=size, arc=angle, height=size), cylinder),
    "sphere": (
        st.builds(SphereSector, radius=size, arc=angle, latitude_start=latitude, latitude_end=latitude),
        sphere,
    ),
}


def test_every_parametric_kind_has_a_definition():
    assert set(PARAMETRIC_KINDS) <= {name.upper() for name in KINDS}


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data(), u=share, v=share, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_positions_and_derivatives(kind, data, u, v, seed):
    surfaces, definition = KINDS[kind]
    surface = data.draw(surfaces)
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(seed).normal(size=(3, 4))
    sample = surface.transformed(matrix).evaluate(np.array([u]), np.array([v]))
    with mpmath.workdps(40):
        rows = [[mpmath.mpf(float(number)) for number in row] for row in matrix[:3]]

        def exact(a, b):
            place = definition(surface, a, b)
            return [mpmath.fdot(row[:3], place) + row[3] for row in rows]

        def difference(du, dv):
            ahead = exact(mpmath.mpf(u) + du, mpmath.mpf(v) + dv)
            behind = exact(mpmath.mpf(u) - du, mpmath.mpf(v) - dv)
            return [float((a - b) / (2 * STEP)) for a, b in zip(ahead, behind, strict=True)]

        position = [float(number) for number in exact(mpmath.mpf(u), mpmath.mpf(v))]
        du, dv = difference(STEP, 0), difference(0, STEP)
    largest = max((float(x) for x in vars(surface).values() if np.ndim(x) == 0), default=0.0)
    extent = max(1.0, largest, np.abs(getattr(surface, "corners", np.zeros(1))).max())
    # The derivative by an angle is the extent times the angle; matrices have elements of up to about 5.
    bound = ROUNDING * 100 * extent**2
    np.testing.assert_allclose(sample.position[:, 0], position, rtol=0, atol=bound)
    np.testing.assert_allclose(sample.du[:, 0], du, rtol=0, atol=bound)
    np.testing.assert_allclose(sample.dv[:, 0], dv, rtol=0, atol=bound)
