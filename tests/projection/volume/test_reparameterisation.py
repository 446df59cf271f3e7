# SPDX-License-Identifier: GPL-3.0-or-later
"""Re-parameterisation: values, masks, Jacobians."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.surface import Disc, Plane
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled, reparameterisation
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume, image_derivatives

place = st.floats(0.0, 1.0)
aspects = st.floats(0.25, 4.0)


@given(place, place, aspects)
def test_rectangle_is_the_identity(x, y, aspect):
    image = Unrolled().map(np.array([x]), np.array([y]), aspect)
    assert (image.u[0], image.v[0], image.mask[0]) == (x, y, True)
    np.testing.assert_array_equal(image.jacobian[:, :, 0], np.eye(2))


@given(place, place, aspects)
def test_polar_against_mpmath(x, y, aspect):
    image = Polar().map(np.array([x]), np.array([y]), aspect)
    with mpmath.workdps(40):
        a = (mpmath.mpf(x) - 0.5) * 2 * max(mpmath.mpf(aspect), 1)
        b = (mpmath.mpf(y) - 0.5) * 2 * max(1 / mpmath.mpf(aspect), 1)
        radius = mpmath.sqrt(a * a + b * b)
        turn = mpmath.atan2(b, a) / (2 * mpmath.pi) % 1
    assert image.v[0] == pytest.approx(float(radius), rel=1e-12, abs=2e-12)
    if radius > 1e-9:
        # The angle may come out on either side of 0 = 1.
        assert (image.u[0] - float(turn) + 0.5) % 1.0 - 0.5 == pytest.approx(0.0, abs=1e-12 / float(radius))
    if abs(radius - 1) > 1e-12:
        assert image.mask[0] == (radius <= 1)


@given(place, place, aspects)
def test_the_polar_jacobian_is_the_derivative(x, y, aspect):
    a, b = (x - 0.5) * 2 * max(aspect, 1.0), (y - 0.5) * 2 * max(1 / aspect, 1.0)
    if np.hypot(a, b) < 0.05 or (a > 0 and abs(b) < 1e-3):
        return  # next to the centre and to the seam differences say nothing
    image = Polar().map(np.array([x]), np.array([y]), aspect)
    step = 1e-6
    for axis, (dx, dy) in enumerate(((step, 0.0), (0.0, step))):
        more = Polar().map(np.array([x + dx]), np.array([y + dy]), aspect)
        less = Polar().map(np.array([x - dx]), np.array([y - dy]), aspect)
        assert image.jacobian[0, axis, 0] == pytest.approx((more.u - less.u)[0] / (2 * step), abs=1e-5)
        assert image.jacobian[1, axis, 0] == pytest.approx((more.v - less.v)[0] / (2 * step), abs=1e-7)


@pytest.mark.parametrize("offset", [0.0, 1e-13, 1e-9, 1e-4, 0.2])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.0])
def test_qx_and_qy_stay_regular_at_a_polar_centre(offset, aspect):
    # A disc seen through the polar map is the flat image itself: Qx and Qy are constant.
    volume = ViewingVolume((Disc(radius=3.0), Disc(radius=3.0)))
    projection = Projection(volume, Polar(), aspect=aspect)
    x, y = np.array([0.5 + offset]), np.array([0.5 + 0.3 * offset])
    image = projection.parameters(x, y)
    controls = volume.controls(image.u, image.v)
    dx, dy = image_derivatives(controls.du[0], controls.dv[0], image.jacobian)
    np.testing.assert_allclose(dx[:, 0], [6.0 * max(aspect, 1.0), 0, 0], atol=1e-9)
    np.testing.assert_allclose(dy[:, 0], [0, 6.0 * max(1 / aspect, 1.0), 0], atol=1e-9)


@pytest.mark.parametrize("kind", [Unrolled(), Polar()])
def test_points_are_those_of_the_map(kind):
    x, y = np.random.default_rng(3).uniform(size=(2, 50))
    image, points = kind.map(x, y, 1.5), kind.points(x, y, 1.5)
    for name in ("u", "v", "mask"):
        np.testing.assert_array_equal(getattr(image, name), getattr(points, name))


@given(place, place, st.floats(0, 0.4), st.floats(0.6, 1))
def test_ranges_scale_parameters_and_jacobian(x, y, low, high):
    volume = ViewingVolume((Plane(), Plane()))
    image = Projection(volume, u_range=(low, high), v_range=(0.25, 0.5)).parameters(
        np.array([x]), np.array([y])
    )
    assert image.u[0] == pytest.approx(low + x * (high - low))
    assert image.v[0] == pytest.approx(0.25 + y * 0.25)
    np.testing.assert_allclose(image.jacobian[:, :, 0], [[high - low, 0], [0, 0.25]], atol=1e-15)


def test_names():
    assert isinstance(reparameterisation("POLAR"), Polar)
    assert isinstance(reparameterisation("RECTANGLE"), Unrolled)
    with pytest.raises(ValueError, match="unknown"):
        reparameterisation("SPIRAL")
