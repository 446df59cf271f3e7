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


def assert_changed(driver, before, least=1000):
    """Assert that so many pixels of both have changed; returns their pixels."""
    now = panels_shown(driver)
    for name, old, new in zip(("sidebar", "Camera Data tab"), before, now, strict=True):
        assert differing(old, new) > least, f"the {name} does not show the change"
    return now


def panels(driver):
    """The panels before there is a flexible camera, with one, and with one of each kind of surface."""
    build_scene()
    driver.show_data_tab()
    bpy.context.view_layer.objects.active = bpy.data.objects["Camera"]
    yield from driver.show_sidebar()
    yield from scrolled(driver)
    driver.shot("ordinary-camera")
    shown = panels_shown(driver)
    driver.add_camera()
    yield DRAW
    yield from scrolled(driver)
    driver.shot("new-camera")
    assert_changed(driver, shown)
    # To the list of control surfaces.
    yield from scrolled(driver, 8)
    shown = panels_shown(driver)
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
    # The row of the list, in which the narrow tab has room for a sign alone.
    assert_changed(driver, shown, least=100)
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


def collected(name: str, *objects) -> None:
    """A collection with some objects of the scene."""
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for each in objects:
        made.objects.link(bpy.data.objects[each])


def opened(panel: str) -> None:
    """Let a panel be open that is closed at first."""
    kind = getattr(bpy.types, panel)
    bpy.utils.unregister_class(kind)
    kind.bl_options = set()
    bpy.utils.register_class(kind)


def scrolled(driver, steps=13):
    """Generator: scroll the Data tab, by default past Blender's own panels."""
    for _ in range(steps):
        with driver.override("PROPERTIES"):
            bpy.ops.view2d.scroll_down()
    yield DRAW


def lists(driver):
    """The further cameras of a blend and the layers, in a Data tab that has room for both."""
    build_scene(percentage=20)
    cameras = []
    for turn in (0.0, 0.1, -0.1):
        driver.add_camera("perspective")
        cameras.append(bpy.context.object)
        cameras[-1].rotation_euler.z += turn
    for camera in cameras:
        camera.select_set(True)
    with driver.override():
        bpy.context.view_layer.objects.active = cameras[1]
        assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    assert [end.camera for end in blend.scfpf.blend_more] == cameras[2:]
    with driver.override():
        bpy.ops.scfpf.blend_map(kind="LINEAR")
        bpy.ops.scfpf.blend_map(kind="RADIAL", number=3)
    opened("SCFPF_PT_data_layers")
    large, small = driver.area("VIEW_3D"), driver.area("PROPERTIES")
    large.type, small.type = "PROPERTIES", "VIEW_3D"
    yield DRAW
    large.spaces.active.context = "DATA"
    yield DRAW
    yield from scrolled(driver)
    yield from scrolled(driver, 8)
    driver.shot("blend")
    before = driver.region_pixels("PROPERTIES")
    with driver.override():
        assert bpy.ops.scfpf.blend_camera_remove() == {"FINISHED"}
    yield DRAW
    now = driver.region_pixels("PROPERTIES")
    assert differing(before, now) > 1000, "the list does not show that a camera is gone"
    collected("Monkeys", "Suzanne", "Suzanne.001", "Suzanne.002")
    collected("Box", "Cube")
    bpy.context.scene.camera = cameras[0]
    bpy.context.view_layer.objects.active = cameras[0]
    for name in ("Monkeys", "Box"):
        with driver.override():
            bpy.ops.scfpf.layer_add(camera=cameras[0].name, collection=name, front="ORDER")
    yield DRAW
    yield from scrolled(driver)
    driver.shot("unchecked")
    before = driver.region_pixels("PROPERTIES")
    with driver.override():
        assert bpy.ops.scfpf.layer_check(camera=cameras[0].name) == {"FINISHED"}
    # The picture is made small in a thread, and the panel grows.
    yield 4 * DRAW
    driver.area("PROPERTIES").tag_redraw()
    yield DRAW
    driver.shot("layers")
    assert differing(before, driver.region_pixels("PROPERTIES")) > 10_000, "no picture of the layers"


SCENARIOS = (panels, presets, lists)
