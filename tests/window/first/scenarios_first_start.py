# SPDX-License-Identifier: GPL-3.0-or-later
"""The first five minutes: from the installed zip to a first bent picture of a scene of one's own."""

import bpy
from driver import DRAW, build_scene, differing, surfaces

# The size of the scene, in those of Blender's default one: some centimeters.
TINY = 0.01
# Pixels of the viewport that change at least if its picture is bent.
MANY = 5000
DRAG = 160


def _own_camera():
    """Objects, and an ordinary camera that is the scene's, selected; return the camera."""
    build_scene()
    for obj in bpy.context.scene.objects:
        obj.location *= TINY
        if obj.type == "MESH":
            obj.scale *= TINY
        obj.select_set(False)
    camera = bpy.context.scene.camera
    camera.data.clip_start *= TINY
    camera.data.clip_end *= TINY
    bpy.context.view_layer.objects.active = camera
    camera.select_set(True)
    return camera


def _drag(driver):
    """Generator: G, the mouse to the right, and a click."""
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 3, region.y + region.height // 2
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    yield 0.3
    driver.window.event_simulate("G", "PRESS", x=x, y=y)
    driver.window.event_simulate("G", "RELEASE", x=x, y=y)
    yield 0.5
    for step in range(1, 5):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x + DRAG * step // 4, y=y)
        yield 0.3
    driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x + DRAG, y=y)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x + DRAG, y=y)


def own_scene(driver):
    """The own camera made flexible, which is live at once; a plane added and dragged; a preset; a render."""
    camera = _own_camera()
    with driver.override():
        bpy.ops.view3d.view_camera()
    yield from driver.show_sidebar()
    with driver.override():
        assert bpy.ops.scfpf.camera_toggle("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield DRAW
    driver.shot("flexible")
    place = camera.matrix_world.copy()
    with driver.override():
        done = bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind="PLANE", select=True)
    assert done == {"FINISHED"} and bpy.context.object == surfaces(camera)[1]
    # Without the wires of the surfaces.
    driver.area("VIEW_3D").spaces.active.overlay.show_overlays = False
    yield 2 * DRAW
    straight = driver.region_pixels()
    yield from _drag(driver)
    yield 2 * DRAW
    driver.shot("bent")
    assert camera.matrix_world == place, "G moves the new surface, and not the camera"
    bent = driver.region_pixels()
    assert differing(straight, bent) > MANY, "the picture is not bent"
    with driver.override():
        done = bpy.ops.scfpf.preset_apply("INVOKE_DEFAULT", True, preset="nonlinear_twist")
    assert done == {"FINISHED"}
    yield 2 * DRAW
    driver.shot("preset")
    assert differing(bent, driver.region_pixels()) > MANY
    bpy.context.scene.render.resolution_percentage = 10
    driver.start_render()
    yield from driver.finished()
    colors = driver.pixels().reshape(-1, 4)[:, :3]
    assert camera.scfpf.report and colors.std(axis=0).max() > 0.05, "the picture is empty"


def _german() -> str:
    """The code of German among Blender's languages."""
    view = bpy.context.preferences.view
    codes = {item.identifier for item in view.bl_rna.properties["language"].enum_items}
    known = codes | set(bpy.app.translations.locales)
    return next(code for code in ("de_DE", "de") if code in known)


def german_presets(driver):
    """The menu of presets in German: Blender finds its entries, and the menu is shown."""
    view, translations = bpy.context.preferences.view, bpy.app.translations
    driver.add_camera()
    try:
        view.language, view.use_translate_interface = _german(), True
        yield DRAW
        for context in ("*", "Operator"):
            shown = translations.pgettext_iface("Inverted Perspective", context)
            assert shown == "Umgekehrte Perspektive", "an entry of the menu of presets is English"
        yield from driver.menu("SCFPF_MT_presets_group_0")
    finally:
        view.language = "en_US"


def german(driver):
    """The language switched to German and back: panels and operators follow, and English is as it was."""
    view, translations = bpy.context.preferences.view, bpy.app.translations
    driver.add_camera()
    yield from driver.show_sidebar()
    english = driver.region_pixels("VIEW_3D", "UI")
    try:
        view.language = _german()
        view.use_translate_interface = view.use_translate_tooltips = view.use_translate_reports = True
        yield 2 * DRAW
        driver.shot("panel")
        assert differing(english, driver.region_pixels("VIEW_3D", "UI")) > MANY / 2, "the panel is English"
        assert translations.pgettext_iface("Control Surfaces") == "Steuerflächen"
        assert translations.pgettext_iface("Edit Volume", "Operator") == "Sehvolumen bearbeiten"
        assert translations.pgettext_tip("Render through a viewing volume modeled with control surfaces") == (
            "Durch ein Sehvolumen rendern, das mit Steuerflächen modelliert ist"
        )
    finally:
        view.language = "en_US"
    yield 2 * DRAW
    assert differing(english, driver.region_pixels("VIEW_3D", "UI")) < MANY / 50


SCENARIOS = (own_scene, german_presets, german)
