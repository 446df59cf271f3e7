# SPDX-License-Identifier: GPL-3.0-or-later
"""The clear sky against known values of sunlight and air, in closed form where possible."""

import numpy as np
import pytest

from scfpf_addon.shading.nodes import sky, sky_model
from scfpf_addon.shading.nodes.sky_model import GROUND, TOP, Air, sky_table, sun_color
from scfpf_addon.shading.nodes.spectrum import XYZ_TO_RGB
from scfpf_addon.shading.scene.world import WorldContext
from scfpf_addon.shading.vectors import unit

USUAL = Air(0.6, 0.0, 1.0, 1.0, 1.0)
NOTHING = Air(0.6, 0.0, 0.0, 0.0, 0.0)


def direction(elevation, turn):
    """turn: about Z from +Y to +X."""
    return np.array(
        [[np.cos(elevation) * np.sin(turn), np.cos(elevation) * np.cos(turn), np.sin(elevation)]]
    ).T


def looked(way, air=USUAL, blur=0.0, **settings):
    settings = {"air": air, "rotation": 0.0, "size": 0.0, "scale": 1.0, "intensity": 1.0} | settings
    return sky.sky((way,), settings, WorldContext.of(unit(way), {}, blur))[0]


def test_sunlight_is_that_of_a_black_body():
    """Some 46 % of the sun's 1361 W/m² are between 380 and 780 nm; the peak is at 2898 µm K / 5778 K."""
    light = sky_model.sunlight()
    step = np.diff(sky_model.WAVELENGTHS)
    assert ((light[1:] + light[:-1]) / 2 * step).sum() == pytest.approx(0.46 * 1361, rel=0.05)
    assert abs(sky_model.WAVELENGTHS[light.argmax()] - 2.898e6 / 5778) <= 10


def test_equal_light_of_all_wavelengths_is_nearly_white():
    """The integral of the CIE's y is 106.9 nm, and those of x and z are the same."""
    matrix = np.linalg.inv(XYZ_TO_RGB)
    np.testing.assert_allclose(
        matrix @ sky_model.rgb_of(np.ones(len(sky_model.WAVELENGTHS))), 106.9, rtol=0.01
    )


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.0])
def test_rays_end_at_the_top_of_the_air(cosine):
    radius = np.array([GROUND + 3e3])
    length = sky_model._to_top(radius, np.array([cosine]))
    end = np.hypot(radius + length * cosine, length * np.sqrt(1 - cosine**2))
    assert end == pytest.approx(TOP)


def test_depths_straight_up_are_the_columns_of_air():
    """A density exp(-h / H) has the column H (1 - exp(-top / H)), a triangular one half its base."""
    depth = sky_model._depth_to_sun(np.array([GROUND]), np.ones(1), USUAL)[:, 0]
    top = TOP - GROUND
    for found, height in zip(depth[:2], (sky_model.AIR_HEIGHT, sky_model.DUST_HEIGHT), strict=True):
        assert found == pytest.approx(height * (1 - np.exp(-top / height)), rel=0.02)
    assert depth[2] == pytest.approx((sky_model.OZONE_HIGH - sky_model.OZONE_LOW) / 2, rel=0.02)


def test_without_air_the_sun_is_as_in_space_and_the_sky_black():
    space = sky_model.rgb_of(sky_model.sunlight())
    np.testing.assert_allclose(sun_color(NOTHING, 0.3), space)
    assert not sky_table(NOTHING).any()
    # Through air Beer's law holds, more of blue is lost, and a low sun is redder.
    high, low = sun_color(USUAL, 1.5), sun_color(USUAL, 0.1)
    assert (low < high).all() and (high < space).all()
    assert low[0] / low[2] > 2 * high[0] / high[2] > 1.2 * space[0] / space[2]


def test_a_sky_is_blue_above_bright_below_and_thin_air_shines_by_its_amount():
    table = sky_table(USUAL)
    zenith, horizon = table[:, -1, 0], table[:, 0, -1]
    assert zenith[2] > 2 * zenith[0] and horizon.sum() > 2 * zenith.sum()
    # The zenith is the same point for all azimuths.
    np.testing.assert_allclose(table[:, -1], np.repeat(zenith[:, None], sky_model.COLUMNS, axis=1), rtol=1e-6)
    # Single scattering by thin air is in proportion to its amount.
    little, less = (sky_table(Air(0.6, 0.0, amount, 0.0, 0.0))[:, -1, 0] for amount in (2e-3, 1e-3))
    np.testing.assert_allclose(little, 2 * less, rtol=2e-3)
    # By Rayleigh's phase function, 1 + cos² of the angle to the sun: at the zenith, for two suns.
    high, low = (sky_table(Air(e, 0.0, 1e-3, 0.0, 0.0))[:, -1, 0] for e in (np.pi / 2, np.pi / 6))
    np.testing.assert_allclose(high / low, (1 + 1.0) / (1 + 0.25), rtol=0.01)


def test_ozone_absorbs_and_multiple_scattering_adds():
    bare, ozone = sky_table(USUAL._replace(ozone=0.0)), sky_table(USUAL)
    luminance, less = (np.tensordot((0.2126, 0.7152, 0.0722), each, 1) for each in (bare, ozone))
    assert (less < luminance).all()
    once = sky_table(USUAL)
    again = sky_table(USUAL._replace(multiscatter=True)) / sky_model.MULTISCATTER_TINT[:, :, None]
    assert (again > once).all() and again.mean() < 2.5 * once.mean()
    # After sunset low air scatters no light in one step, and high air some.
    night = sky_table(USUAL._replace(elevation=-0.1))
    assert 0.0 < night.max() < 0.05 * once.max()


def test_the_node_turns_the_sky_with_its_sun():
    for rotation in (0.0, 1.0, 5.0):
        for turn in (0.0, 0.7, 3.0):
            seen = looked(direction(0.4, rotation + turn), rotation=rotation, scale=2.0)
            np.testing.assert_allclose(seen, 2.0 * looked(direction(0.4, turn)), rtol=1e-9)
            np.testing.assert_allclose(
                seen, looked(direction(0.4, rotation - turn), rotation=rotation, scale=2.0)
            )
    # At the table's entries the node returns the table.
    row, column = 20, 30
    elevation, turn = (row / (sky_model.ROWS - 1)) ** 2 * np.pi / 2, column / (sky_model.COLUMNS - 1) * np.pi
    np.testing.assert_allclose(
        looked(direction(elevation, turn))[:, 0], sky_table(USUAL)[:, row, column], rtol=1e-6
    )


def test_below_the_horizon_light_fades():
    horizon, under, deep = (looked(direction(e, 1.0))[:, 0] for e in (0.0, -0.1, -0.6))
    np.testing.assert_allclose(under, horizon * (1 - 2.5 * np.sin(0.1)) ** 3, rtol=1e-9)
    assert not deep.any()
    high = USUAL._replace(multiscatter=True, altitude=2000.0)
    horizon, under = (looked(direction(e, 1.0), high)[:, 0] for e in (0.0, -0.5))
    np.testing.assert_allclose(under, horizon * 2e-5 * 2000.0 / np.sin(0.5), rtol=1e-9)


@pytest.mark.parametrize("blur", [0.0, 0.02])
def test_the_suns_disc_holds_the_suns_light(blur):
    """All of the disc together is the sun's irradiance times its intensity, less the limb darkening."""
    size, intensity = 0.03, 3.0
    line = (np.arange(161) + 0.5) / 161 - 0.5
    reach = 0.12
    x, y = (a.ravel() * reach for a in np.meshgrid(line, line))
    middle, right = direction(0.6, 0.0)[:, 0], np.array([1.0, 0.0, 0.0])
    ways = unit(middle[:, None] + right[:, None] * x + np.cross(right, middle)[:, None] * y)
    without = looked(ways, blur=blur)
    disc = looked(ways, blur=blur, size=size, intensity=intensity)
    # A sharp disc replaces the sky, a blurred one is added to it.
    sky_behind = np.where(disc > 2 * without, 0.0, disc) if blur == 0.0 else without
    whole = (disc - sky_behind).sum(axis=1) * (reach / 161) ** 2
    np.testing.assert_allclose(whole, sky.LIMB_MEAN * intensity * sun_color(USUAL, 0.6), rtol=0.05)


def test_a_sun_that_has_set_has_no_disc():
    air = USUAL._replace(elevation=-0.1)
    way = direction(-0.1, 0.0)
    np.testing.assert_array_equal(looked(way, air, size=0.03), looked(way, air))
