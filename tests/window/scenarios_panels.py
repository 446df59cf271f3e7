# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and menus, and the volume of each preset as drawn in the viewport."""

import json
import pathlib
import sys

import bpy
from driver import DRAW, IMAGE, build_scene, differing, surfaces

KINDS = ("PLANE", "CYLINDER", "SPHERE", "GRID", "NURBS", "LATTICE")
# A choice: each costs seconds.
PRESETS = (
    "angular_fisheye",
    "around_the_car",
    "cylindrical_panorama",
    "inverted_perspective",
    "nonlinear_twist",
    "orthographic",
    "perspective",
)


def panels_shown(driver):
    """The pixels of the sidebar and of the Camera Data tab."""
    return driver.region_pixels("VIEW_3D", "UI"), driver.region_pixels("PROPERTIES")


def assert_changed(driver, before):
    """Assert that both have changed; returns their pixels."""
    now = panels_shown(driver)
    for name, old, new in zip(("sidebar", "Camera Data tab"), before, now, strict=True):
        assert differing(old, new) > 1000, f"the {name} does not show the change"
    return now


def panels(driver):
    """The panels before there is a flexible camera, with one, and with one of each kind of surface."""
    build_scene()
    driver.show_data_tab()
    bpy.context.view_layer.objects.active = bpy.data.objects["Camera"]
    yield from driver.show_sidebar()
    driver.shot("ordinary-camera")
    shown = panels_shown(driver)
    driver.add_camera()
    yield DRAW
    driver.shot("new-camera")
    shown = assert_changed(driver, shown)
    for kind in KINDS:
        with driver.override():
            bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", kind=kind)
    settings = bpy.context.object.scfpf
    settings.active_surface = 2
    yield DRAW
    driver.shot("many-surfaces")
    shown = assert_changed(driver, shown)
    assert [slot.object.scfpf_surface.kind for slot in settings.surfaces][1:-1] == list(KINDS)
    bpy.data.objects.remove(bpy.data.objects["Near"])
    yield DRAW
    driver.shot("deleted-surface")
    assert_changed(driver, shown)
    ours = ("SCFPF_MT_surface_add", "SCFPF_MT_presets", "SCFPF_MT_presets_group_1", "SCFPF_MT_mapping_add")
    for menu in ("VIEW3D_MT_add", "VIEW3D_MT_camera_add", *ours):
        yield from driver.menu(menu)


def presets(driver):
    """Each preset's volume: as many surfaces as its file says, drawn from outside, rendered small."""
    module = next(name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf"))
    folder = pathlib.Path(sys.modules[module].__file__).parent / "presets"
    for path in (folder / f"{stem}.json" for stem in PRESETS):
        bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
        yield DRAW
        build_scene(percentage=10)
        driver.add_camera(path.stem)
        driver.look()
        yield 2 * DRAW
        driver.shot(path.stem)
        assert len(surfaces(bpy.context.scene.camera)) == len(json.loads(path.read_text("utf-8"))["surfaces"])
        assert driver.surface_lines().sum() > 1000, f"{path.stem} is not drawn"
        driver.start_render()
        yield from driver.finished()
        # Not every preset looks at this scene: what it shows is for the tests of the presets.
        assert tuple(bpy.data.images[IMAGE].size) == (192, 108) and driver.pixels().max() > 0


SCENARIOS = (panels, presets)
