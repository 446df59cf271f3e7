# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to see a picture and to render it: what their buttons change, when they are off, and why."""

import bpy
import pytest
from operator_steps import add_camera, add_cube, poll_message
from recorded_layout import drawn, read_words, texts


def viewport():
    """The 3D viewport of the startup file."""
    return next(area for area in window().screen.areas if area.type == "VIEW_3D")


def window():
    return bpy.context.window_manager.windows[0]


def there():
    """An override for that viewport."""
    area = viewport()
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window(), area=area, region=region)


@pytest.fixture
def space():
    """The viewport's space, which later tests find as it was."""
    found = viewport().spaces.active
    found.region_3d.view_perspective, found.shading.type = "PERSP", "SOLID"
    yield found
    found = viewport().spaces.active
    found.region_3d.view_perspective, found.shading.type = "PERSP", "SOLID"
    found.use_local_camera = False


@pytest.fixture
def camera(space):
    add_cube()
    return add_camera()


def shown(addon, camera):
    """Return whether the panel shows Live View and Rendered as on."""
    ways = addon("operators.camera.ways")
    with there():
        return tuple(ways.is_any(bpy.context, camera, way) for way in (ways.is_live, ways.is_rendered))


def press(name):
    with there():
        return getattr(bpy.ops.scfpf, name)()


def test_live_view_looks_through_the_camera_and_again_shows_blenders_view(addon, camera, space):
    assert shown(addon, camera) == (False, False)
    assert press("view_live") == {"FINISHED"}
    assert space.region_3d.view_perspective == "CAMERA" and camera.scfpf.show_live
    assert not space.use_local_camera, "the scene's camera is followed"
    assert shown(addon, camera) == (True, False)
    press("view_live")
    assert not camera.scfpf.show_live and space.region_3d.view_perspective == "CAMERA"
    assert shown(addon, camera) == (False, False)
    space.shading.type = "WIREFRAME"
    press("view_live")
    assert camera.scfpf.show_live and space.shading.type == "SOLID"


def test_the_message_does_not_ask_for_what_is_on(camera, space):
    bpy.context.scene.render.engine = "SCFPF"
    bpy.ops.scfpf.surface_add(kind="PLANE")
    with there():
        assert texts(drawn(bpy.types.SCFPF_PT_view)).count("Live View to see") == 1
    press("view_live")
    with there():
        said = texts(drawn(bpy.types.SCFPF_PT_view))
    assert "Ready: press Render" in said and "Live View to see" not in said


def test_a_second_camera_is_looked_through_beside_the_scenes(addon, camera, space):
    second = add_camera()
    assert bpy.context.scene.camera == camera and bpy.context.object == second
    press("view_live")
    assert space.use_local_camera and space.camera == second
    assert shown(addon, second) == (True, False) and shown(addon, camera) == (False, False)
    assert f"F12 shows {camera.name}" in texts(drawn(bpy.types.SCFPF_PT_view))
    bpy.context.view_layer.objects.active = camera
    assert "F12 shows" not in texts(drawn(bpy.types.SCFPF_PT_view))
    press("view_live")
    assert shown(addon, camera) == (True, False) and bpy.context.scene.camera == camera


def test_the_engines_button_makes_the_panels_camera_that_of_f12(camera):
    """The scene's camera of before gives way, as with the button Cycles."""
    second = add_camera()
    assert bpy.context.scene.camera == camera
    assert bpy.ops.scfpf.engine_use() == {"FINISHED"}
    assert bpy.context.scene.camera == second and "F12 shows" not in texts(drawn(bpy.types.SCFPF_PT_view))
    bpy.ops.object.camera_add()
    assert bpy.ops.scfpf.engine_use() == {"FINISHED"}
    assert bpy.context.scene.camera == second, "the active camera is an ordinary one"


def test_rendered_needs_the_engine_and_says_so(addon, camera, space):
    with there():
        assert "press Flexible Projection below With F12 first" in poll_message(bpy.ops.scfpf.view_rendered)
    bpy.ops.scfpf.engine_use()
    assert press("view_rendered") == {"FINISHED"}
    assert (space.shading.type, space.region_3d.view_perspective) == ("RENDERED", "CAMERA")
    assert shown(addon, camera) == (False, True)
    press("view_rendered")
    assert space.shading.type == "SOLID" and shown(addon, camera) == (True, False)
    press("view_rendered")
    press("view_live")
    assert shown(addon, camera) == (True, False), "Live View takes the place of Rendered"


def test_buttons_without_a_flexible_camera_or_a_viewport_say_what_to_do(space):
    add_cube()
    for name in ("view_live", "view_rendered", "cycles_use"):
        with there():
            assert "Select a camera" in poll_message(getattr(bpy.ops.scfpf, name))
    bpy.ops.object.camera_add()
    for name in ("view_live", "view_rendered", "cycles_use"):
        with there():
            assert "Switch on Flexible Projection" in poll_message(getattr(bpy.ops.scfpf, name))
    bpy.ops.scfpf.camera_from_camera()
    area = viewport()
    area.type = "IMAGE_EDITOR"
    try:
        with bpy.context.temp_override(window=window()):
            assert "no 3D viewport" in poll_message(bpy.ops.scfpf.view_live)
            assert "no 3D viewport" in poll_message(bpy.ops.scfpf.view_rendered)
    finally:
        area.type = "VIEW_3D"


@pytest.mark.usefixtures("built_groups")
def test_the_engine_leaves_nothing_of_cycles(addon, camera):
    """After Cycles and the engine the scene has the objects of before, and the artist's camera is its own."""
    rig_data, choice = addon("cycles.rig_data"), addon("cycles.engine_choice")
    scene = bpy.context.scene
    objects, viewports = {obj.name for obj in bpy.data.objects}, viewport().spaces.active.use_local_camera
    for _ in range(2):
        assert bpy.ops.scfpf.cycles_use() == {"FINISHED"}
        assert rig_data.rig_of(scene).scfpf_rig.camera == camera and choice.renders_by_cycles(scene, camera)
        assert scene.camera != camera and len(bpy.data.objects) > len(objects)
        assert bpy.ops.scfpf.engine_use() == {"FINISHED"}
        assert scene.render.engine == "SCFPF" and not choice.renders_by_cycles(scene, camera)
        assert scene.camera == camera and rig_data.rig_of(scene) is None
        assert {obj.name for obj in bpy.data.objects} == objects
        assert viewport().spaces.active.use_local_camera == viewports


def test_the_line_of_f12_names_buttons_that_the_panel_has(addon, camera):
    """The second camera is the panel's, the first one the scene's."""
    other = add_camera()
    told = [str(one.text) for one in addon("panels.messages").messages(bpy.context, other)]
    assert f"F12 shows {camera.name}: press Flexible Projection or Cycles below With F12" in told
    assert {"Flexible Projection", "Cycles", "With F12"} <= read_words(addon, "Flexible Projection")


@pytest.mark.usefixtures("built_groups")
def test_the_price_of_cycles_is_told_before_and_is_the_rigs(addon, camera):
    bpy.ops.scfpf.preset_apply(preset="nonlinear_twist")
    bpy.context.view_layer.update()
    text = addon("operators.camera.ways").price_text(bpy.context, camera)
    bpy.ops.scfpf.cycles_use()
    price = addon("cycles.prices").price_of_rig(addon("cycles.rig_data").rig_of(bpy.context.scene))
    most = price._replace(passed=0.0).cost
    assert f"up to {most:.1f} times" in text and most >= price.cost > 1.0
    assert "switched on" in addon("operators.camera.ways").price_text(bpy.context, camera)


def test_the_tooltip_of_nodes_counts_the_faces_of_the_scene(addon, camera):
    add_cube((5, 0, 0)).modifiers.new("Three", "ARRAY").count = 3
    tooltip = addon("operators.camera.preview").SCFPF_OT_preview_toggle.description(bpy.context, None)
    faces = sum(
        len(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh().polygons)
        for obj in bpy.context.scene.objects
        if obj.type == "MESH" and not obj.hide_get() and obj.visible_get() and obj.parent != camera
    )
    assert faces == 6 + 3 * 6
    assert f"Price: {faces:,} faces" in tooltip and "  " not in tooltip


def test_a_refused_cycles_setup_is_one_message(camera):
    camera.scfpf.surfaces.clear()
    with pytest.raises(RuntimeError, match="control surface") as caught:
        bpy.ops.scfpf.cycles_use()
    assert str(caught.value).count("Error") == 1 and "Traceback" not in str(caught.value)


def test_the_messages_tell_the_plan_of_another_engines_renders(addon, camera):
    """How many renders, how much of the picture, and that another size or fineness needs another plan."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 36, 100

    def shown():
        told = [str(one.text) for one in addon("panels.messages").messages(bpy.context, camera)]
        return " ".join(text for text in told if text.startswith("Plan"))

    assert "Plan" not in shown()
    assert bpy.ops.scfpf.preset_apply(preset="inverted_perspective") == {"FINISHED"}
    assert bpy.ops.scfpf.joined_plan(camera=camera.name, engine="EEVEE") == {"FINISHED"}
    assert "Plan: " in shown() and " renders, " in shown()
    camera.scfpf.samples = 16
    assert shown() == "Plan for other samples: plan again"
    camera.scfpf.samples = 4
    assert "Plan: " in shown()
    scene.render.resolution_x = 70
    assert "Plan of 64 × 36 pixels: plan again" in shown() and "renders" not in shown()


def test_no_message_moves_the_panels_buttons(camera):
    """With and without a plan, a message of the engine and one of another camera, there are as many lines."""
    scene, view = bpy.context.scene, bpy.types.SCFPF_PT_view
    scene.render.engine = "SCFPF"

    def lines():
        return [entry[0] for entry in drawn(view) if entry[0] != "popover"].count("label")

    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 36, 100
    assert bpy.ops.scfpf.preset_apply(preset="inverted_perspective") == {"FINISHED"}
    before = lines()
    assert bpy.ops.scfpf.joined_plan(camera=camera.name, engine="EEVEE") == {"FINISHED"}
    assert lines() - before in (0, -1), "the popover takes the place of an empty line"
    scene.render.resolution_x = 70
    assert lines() - before in (0, -1)
