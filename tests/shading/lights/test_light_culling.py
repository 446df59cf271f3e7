# SPDX-License-Identifier: GPL-3.0-or-later
"""Light culling leaves out lights that reach nothing, and no light that reaches something."""

import numpy as np
import pytest

from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights import lighting
from scfpf_addon.shading.lights.light_culling import cull_lights
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings

WHITE = np.ones(3)


def random_lights(build, kind, count):
    """Lights around the scene that shine in random directions."""
    generator = np.random.default_rng(7)
    for _ in range(count):
        place, shines = generator.normal(size=(2, 3))
        angle = generator.uniform(0.05, np.pi)
        matrix = build.placed(place * generator.uniform(0.2, 6.0), shines)
        if kind == "SPOT":
            matrix[:3, :3] *= generator.uniform(0.3, 3.0, 3 if generator.random() < 0.3 else 1)
        yield Light(
            kind,
            100 * WHITE,
            matrix,
            radius=0.1,
            size=(0.4, 0.2),
            spread=angle,
            sphere=bool(generator.random() < 0.5),
            spot_angle=angle,
        )


@pytest.mark.parametrize("kind", ["AREA", "SPOT"])
def test_no_light_that_reaches_something_is_culled(build, monkeypatch, kind):
    lights = list(random_lights(build, kind, 60))
    scene = build.scene([build.sphere(8, (0.2, 0.1, 0.0), 0.6), build.square(1.0, -0.5)], lights, f0=0.04)
    view = build.looking_down(2, -1)
    settings = FrameSettings(16, 12, samples=4)
    made = []
    monkeypatch.setattr(lighting, "cull_lights", lambda *given: made.extend(cull_lights(*given)) or made)
    some = render_frame(view, scene, settings).pixels
    monkeypatch.setattr(lighting, "cull_lights", lambda lights, _vertices: list(lights))
    assert np.array_equal(render_frame(view, scene, settings).pixels, some)
    assert 0.3 * len(lights) < len(made) < 0.95 * len(lights)


def test_lights_that_reach_nothing_are_culled(build):
    corners = np.array([[-1, -1, -1], [1, 1, 1.0]])
    away, towards = (build.placed((0, 0, 5), (0, 0, way)) for way in (1, -1))
    dark = Light("SUN", 0 * WHITE, towards)
    for kind in ("AREA", "SPOT"):
        lights = (Light(kind, WHITE, away), Light(kind, WHITE, towards), dark)
        assert cull_lights(lights, corners) == [lights[1]]
    always = (Light("SUN", WHITE, away), Light("POINT", WHITE, away))
    assert cull_lights(always, corners) == list(always)
    assert cull_lights((Light("AREA", WHITE, away),), np.full((1, 3), np.nan))
