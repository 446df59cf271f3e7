# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimate of light that images lack, against closed forms."""

import numpy as np
import pytest

from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.missing_light import missing_light
from scfpf_addon.shading.scene.shading_scene import Light

# Rays are few: the estimates have noise.
NOISE = 0.02
# The floor that is seen, so small that it is one place.
SEEN = 0.02


def from_above(floor=0.0, height=0.5):
    """A view of the middle of a floor, straight down from a height."""
    ends = [np.diag([1.0, 1.0, 1.0, 1.0]) for _ in range(2)]
    for end, z in zip(ends, (floor + height, floor - 0.1), strict=True):
        end[2, 3] = z
    planes = tuple(Plane(2 * SEEN, 2 * SEEN).transformed(end) for end in ends)
    return Projection(ViewingVolume(planes))


def disc(radius, height, count=64):
    """A disc about the z axis."""
    angle = np.arange(count) * 2 * np.pi / count
    # Of the circle's own area.
    radius *= np.sqrt(2 * np.pi / count / np.sin(2 * np.pi / count))
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)], 1)
    faces = [[count, n, (n + 1) % count] for n in range(count)]
    return np.concatenate([rim, [[0.0, 0.0, height]]]), faces, None


def lit(build, *parts, glow=0.0, lights=(), world=(0, 0, 0)):
    """Parts of which the last one glows, or none."""
    scene = build.scene(parts, lights, world)
    scene.materials.emission[-1] = glow
    return scene


@pytest.mark.parametrize("radius", [0.3, 1.0, 3.0])
def test_a_disc_overhead_hides_its_share_of_the_sky(build, radius):
    """R² / (R² + h²) of the cosine-weighted hemisphere."""
    found = missing_light(lit(build, build.square(10.0), disc(radius, 1.0)), from_above())
    assert found.enclosed == pytest.approx(radius**2 / (radius**2 + 1.0), abs=NOISE)
    assert found.glow == 0.0 and not found.is_lit


def test_a_closed_room_is_enclosed_unless_its_walls_glow(build):
    room = build.sphere(12, (0, 0, 2.0), 3.0)
    floor = build.square(2.0)
    assert missing_light(lit(build, floor, room), from_above()).enclosed == 1.0
    shining = missing_light(lit(build, floor, room, glow=1.0), from_above())
    assert shining == (1.0, 0.0, True)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_the_share_of_a_glowing_disc_in_the_light_of_a_sky(build, share):
    """A small disc of area A and radiance L at a height h gives L A / h²; the sky of radiance 1 gives π."""
    radius, height = 0.05, 1.0
    area = np.pi * radius**2
    glow = share / (1.0 - share) * np.pi * height**2 / area
    found = missing_light(
        lit(build, build.square(10.0), disc(radius, height), glow=glow, world=(1, 1, 1)), from_above()
    )
    assert found.glow == pytest.approx(share, rel=0.02) and found.is_lit


def beside(part, *offset):
    """A part that is moved."""
    return part[0] + np.array(offset), *part[1:]


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_of_a_closed_lamp_the_side_that_is_seen_counts(build, share):
    """A sphere of radius r and radiance L at a height h gives π L r² / h²; the sky of radiance 1 gives π."""
    radius, height = 0.05, 1.0
    glow = share / (1.0 - share) * height**2 / radius**2
    ball = build.sphere(12, (0, 0, height), radius)
    scene = lit(build, build.square(10.0), ball, glow=glow, world=(1, 1, 1))
    assert missing_light(scene, from_above()).glow == pytest.approx(share, abs=NOISE)


def test_what_shades_hide_lights_nothing(build):
    """A shade far smaller than the largest triangles, and a wall."""
    floor, ball = build.square(10.0), build.sphere(6, (0.4, 0, 1.0), 0.05)
    parts = {
        "bare": (),
        "in a shade": (build.sphere(40, (0.4, 0, 1.0), 0.08),),
        "behind a wall": (build.square(0.5, 0.8),),
        "beside a wall": (beside(build.square(0.1, 0.8), -1.0, 0.0, 0.0),),
    }
    found = {
        name: missing_light(lit(build, floor, *more, ball, glow=900.0, world=(1, 1, 1)), from_above()).glow
        for name, more in parts.items()
    }
    assert found["bare"] > 0.5 and found["beside a wall"] == pytest.approx(found["bare"], abs=NOISE)
    assert found["in a shade"] == found["behind a wall"] == 0.0


def test_shades_are_found_among_many_triangles(build, monkeypatch):
    """The largest triangles are the floor's: those of a shade are cast at as they are near to the lamp."""
    monkeypatch.setattr("scfpf_addon.shading.missing_light.LARGEST", 2)
    shade, ball = build.sphere(20, (0, 0, 1.0), 0.08), build.sphere(6, (0, 0, 1.0), 0.05)
    parts = build.square(10.0), shade, ball
    assert missing_light(lit(build, *parts, glow=900.0, world=(1, 1, 1)), from_above()).glow == 0.0


# The power of a lamp that gives an irradiance of 1 from 1 above.
LAMPS = {"POINT": 4 * np.pi, "SPOT": 4 * np.pi, "AREA": np.pi, "SUN": 1.0}


@pytest.mark.parametrize("kind", LAMPS)
def test_lamps_count_as_much_as_they_light(build, kind):
    """Each gives an irradiance of 1 from 2 above, as the glow does; a roof takes all of it."""
    power = LAMPS[kind] * (1.0 if kind == "SUN" else 4.0)
    lamp = Light(kind, np.full(3, power), build.placed((0, 0, 2)), size=(0.01, 0.01))
    glow = 4.0 / (np.pi * 0.05**2)
    parts = build.square(10.0), disc(0.05, 2.5)
    parts[1][0][:, :2] += (0.5, 0.0)
    scene = lit(build, *parts, glow=glow, lights=[lamp])
    own = glow * np.pi * 0.05**2 * 2.5**2 / (2.5**2 + 0.25) ** 2
    found = missing_light(scene, from_above())
    assert found.glow == pytest.approx(own / (own + 1.0), rel=0.02)
    roofed = lit(build, parts[0], build.square(0.3, 1.5), parts[1], glow=glow, lights=[lamp])
    assert missing_light(roofed, from_above()).glow == 1.0


def test_a_black_or_empty_scene_lacks_nothing(build):
    assert missing_light(lit(build, build.square()), from_above()) == (0.0, 0.0, False)
    away = from_above(floor=50.0)
    assert missing_light(lit(build, build.square(), world=(1, 1, 1)), away) == (0.0, 0.0, False)


def test_the_largest_of_many_triangles_are_met(build, monkeypatch):
    """A roof counts, however many small things there are."""
    crumbs = build.sphere(60, (0, 0, 0.2), 0.001)
    monkeypatch.setattr("scfpf_addon.shading.missing_light.LARGEST", 8)
    monkeypatch.setattr("scfpf_addon.shading.missing_light.AT_ONCE", 100)
    found = missing_light(lit(build, build.square(10.0), build.square(50.0, 1.0), crumbs), from_above())
    assert found.enclosed == pytest.approx(1.0, abs=NOISE)
