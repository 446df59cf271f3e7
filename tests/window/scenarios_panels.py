# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and menus, and the volume of each preset as drawn in the viewport."""

import bpy
from driver import DRAW, build_scene


def panels(driver):
    """The panels before there is a flexible camera, with one, and with one of each kind of surface."""
    build_scene()
    driver.show_data_tab()
    bpy.context.view_layer.objects.active = bpy.data.objects["Camera"]
    yield from driver.show_sidebar()
    driver.shot("ordinary-camera")
    driver.add_camera()
    yield DRAW
    driver.shot("new-camera")
    for kind in ("PLANE", "CYLINDER", "SPHERE", "GRID", "NURBS"):
        with driver.override():
            bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", kind=kind)
    bpy.context.object.scfpf.active_surface = 2
    yield DRAW
    driver.shot("many-surfaces")
    bpy.data.objects.remove(bpy.data.objects["Near"])
    yield DRAW
    driver.shot("deleted-surface")
    for menu in ("VIEW3D_MT_add", "VIEW3D_MT_camera_add", "SCFPF_MT_surface_add", "SCFPF_MT_presets"):
        yield from driver.menu(menu)


def presets(driver):
    """Each preset's volume, drawn in the viewport from outside."""
    for identifier in ("cylindrical_panorama", "angular_fisheye", "nonlinear_twist", "around_the_car"):
        driver.add_camera(identifier)
        with driver.override():
            bpy.ops.view3d.view_selected("EXEC_DEFAULT")
            bpy.context.region_data.view_distance = 30.0
        yield 2 * DRAW
        driver.shot(f"{identifier}")
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW


SCENARIOS = (panels, presets)
