# SPDX-License-Identifier: GPL-3.0-or-later
"""A file saved and opened again: volume, picture and drawn lines are what they were."""

import pathlib
import tempfile

import bpy
import numpy as np
from driver import DRAW, IMAGE, build_scene, surfaces, volume


def saves(driver):
    """Save, start afresh, open: the same volume, the same picture, the same lines, the same render."""
    build_scene(percentage=25)
    driver.add_camera("cylindrical_panorama")
    for kind in ("SPHERE", "NURBS"):
        with driver.override():
            bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind=kind)
    driver.look("FRONT")
    driver.start_render()
    yield from driver.finished()
    camera = bpy.context.scene.camera
    before, picture, lines = volume(camera), driver.pixels(), driver.surface_lines()
    assert len(surfaces(camera)) == 4 and lines.sum() > 1000
    driver.shot("before")
    with tempfile.TemporaryDirectory() as folder:
        path = str(pathlib.Path(folder, "saved.blend"))
        with driver.override():
            assert bpy.ops.wm.save_as_mainfile(filepath=path) == {"FINISHED"}
            bpy.ops.wm.read_homefile()
        yield DRAW
        assert IMAGE not in bpy.data.images and not bpy.context.scene.camera.scfpf.enabled
        driver.shot("fresh-file")
        with driver.override():
            bpy.ops.wm.open_mainfile(filepath=path)
        yield 2 * DRAW
    driver.shot("opened")
    camera = bpy.context.scene.camera
    assert volume(camera) == before
    assert np.array_equal(driver.pixels(), picture), "the picture did not outlive the file"
    changed = (driver.surface_lines() ^ lines).sum()
    assert changed < 0.02 * lines.sum(), f"{changed} of {lines.sum()} green pixels are others"
    driver.start_render()
    yield from driver.finished()
    assert np.array_equal(driver.pixels(), picture), "the file opened renders otherwise"


SCENARIOS = (saves,)
