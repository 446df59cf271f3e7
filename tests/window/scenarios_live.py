# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View: a viewport that looks through a flexible camera follows surfaces, objects, edits and undo."""

import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE, build_scene


def live_module():
    """The module that draws live images."""
    import importlib
    import sys

    name = next(name for name in sys.modules if name.endswith("scfpf_addon.bridge.live.live_drawing"))
    return importlib.import_module(name)


def viewport():
    """The one live viewport."""
    (found,) = live_module()._viewports.values()
    return found


def look_through(driver, preset="nonlinear_twist"):
    """Generator: a scene, a flexible camera, and a viewport that looks through it, in Solid shading."""
    build_scene()
    driver.add_camera(preset)
    space = driver.area("VIEW_3D").spaces.active
    space.region_3d.view_perspective = "CAMERA"
    yield from settled()


def settled():
    """Generator: wait for the final image."""
    end = time.monotonic() + PATIENCE
    yield 0.2
    while True:
        found = list(live_module()._viewports.values())
        if found and found[0].view.painter.image is not None and found[0].view.painter.image.step == 1.0:
            break
        assert time.monotonic() < end, "no final image comes"
        yield 0.1
    yield DRAW


def follows(driver):
    """Moving a surface changes the image."""
    yield from look_through(driver)
    driver.shot("first")
    before = driver.region_pixels()
    camera = bpy.context.scene.camera
    camera.scfpf.surfaces[1].object.location.x += 1.0
    yield from settled()
    driver.shot("moved")
    assert np.abs(before - driver.region_pixels()).mean() > 1


SCENARIOS = (follows,)
