# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts of the nodes preview: when parts show one, when they are whole, what renders and files have."""

import bpy
import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("built_groups")


@pytest.fixture
def data(addon):
    return addon("scanline.preview.preview_data")


@pytest.fixture
def drafts(addon, monkeypatch):
    """The drafts' module, as if a window were there to watch them."""
    module = addon("scanline.preview.preview_drafts")
    monkeypatch.setattr(module, "is_live", lambda: True)
    yield module
    module.stop()


@pytest.fixture
def camera(addon):
    """The scene's flexible camera, looking along -Z from 5 above the origin."""
    scene = bpy.context.scene
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.location.z = 5
    scene.collection.objects.link(made)
    scene.camera = made
    addon("bridge.camera.flexible_camera").volume_from_camera(made, scene)
    bpy.context.view_layer.objects.active = made
    return made


@pytest.fixture
def source(camera, data, drafts):
    """The camera's preview of a plane, whole."""
    bpy.ops.mesh.primitive_plane_add(size=1.0)
    bpy.context.object.name = "Plane"
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    drafts.finish()
    bpy.context.view_layer.update()
    return data.preview_of(camera, bpy.context.scene)


def flags(source, data, addon):
    """Return whether each part shows a draft."""
    inputs, versions = addon("bridge.blender.modifier_inputs"), addon("bridge.blender.versions")
    modifiers = [picture.modifiers[data.MODIFIER] for picture in data.pictures_of(source)]
    return [
        bool(versions.modifier_input(one, inputs.input_identifiers(one.node_group)["Draft"]))
        for one in modifiers
    ]


def shape(source, data):
    """The vertices of the first picture, (N, 3)."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = data.pictures_of(source)[0].evaluated_get(depsgraph).data
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3)


def still(drafts):
    """Let the time go by in which nothing changes."""
    drafts._Clock.last -= 1.0
    rest = drafts._tick()
    bpy.context.view_layer.update()
    return rest


@pytest.mark.parametrize("moved", ["surface", "vertex", "setting", "object", "camera", "parent"])
def test_what_moves_is_a_draft_at_its_first_evaluation(source, camera, data, drafts, addon, moved):
    surface = camera.scfpf.surfaces[1].object
    if moved == "parent":
        parent = bpy.data.objects.new("Parent", None)
        bpy.context.scene.collection.objects.link(parent)
        bpy.data.objects["Plane"].parent = parent
        bpy.context.view_layer.update()
        still(drafts)
    evaluated = []

    def note(_scene, depsgraph):
        names = {update.id.name for update in depsgraph.updates if update.is_updated_geometry}
        if data.pictures_of(source)[0].name in names:
            evaluated.append(flags(source, data, addon))

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        if moved == "surface":
            surface.location.x += 0.1
        elif moved == "vertex":
            plane = bpy.data.objects["Plane"].data
            plane.vertices[0].co.x += 0.1
            plane.update()
        elif moved == "setting":
            camera.scfpf.u_range[1] = 0.9
            camera.update_tag()
        elif moved == "object":
            bpy.data.objects["Plane"].location.x += 0.1
        elif moved == "camera":
            camera.location.x += 0.1
        else:
            parent.location.x += 0.1
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    assert evaluated == [[True]]
    assert still(drafts) is None
    assert flags(source, data, addon) == [False]


def test_pictures_wait_until_nothing_has_changed_for_a_moment(source, camera, data, drafts, addon):
    camera.scfpf.surfaces[1].object.location.x += 0.1
    bpy.context.view_layer.update()
    assert 0.0 < drafts._tick() <= drafts.WAIT
    assert flags(source, data, addon) == [True]


def test_other_edits_leave_pictures_whole(source, data, drafts, addon):
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
    bpy.context.scene.collection.objects.link(lamp)
    bpy.context.view_layer.update()
    still(drafts)
    lamp.location.x += 1.0
    bpy.data.objects["Plane"].select_set(True)
    bpy.context.view_layer.update()
    assert flags(source, data, addon) == [False]
    # The timer's own change of the pictures is no edit: it would never end.
    bpy.data.objects["Plane"].location.x += 0.1
    bpy.context.view_layer.update()
    assert still(drafts) is None
    bpy.context.view_layer.update()
    assert flags(source, data, addon) == [False]


def test_what_reaches_a_picture_by_a_driver_is_learnt(source, camera, data, drafts, addon):
    slider = bpy.data.objects.new("Slider", None)
    slider.empty_display_size = 0.5
    bpy.context.scene.collection.objects.link(slider)
    driver = camera.scfpf.surfaces[1].object.driver_add("location", 0).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = slider, "LOC_X"
    bpy.context.view_layer.update()
    still(drafts)
    slider.location.x = 0.1
    bpy.context.view_layer.update()
    still(drafts)
    slider.location.x = 0.2
    bpy.context.view_layer.update()
    assert flags(source, data, addon) == [True]


def test_a_draft_of_small_faces_is_the_picture(source, data, drafts, addon):
    """Places are solved alike. A plane across a straight volume has nothing that is divided or left out."""
    plane = bpy.data.objects["Plane"]
    plane.scale = 3 * (0.001,)
    bpy.context.view_layer.update()
    draft, drafted = shape(source, data), flags(source, data, addon)
    still(drafts)
    whole = shape(source, data)
    assert drafted == [True] and flags(source, data, addon) == [False]
    assert draft.shape == whole.shape == (4, 3)
    assert np.abs(draft - whole).max() < 1e-6


def test_drafts_cut_large_faces_evenly_and_place_them_as_a_pinhole_does(source, data, drafts, camera):
    """The draft of a plane of 60 m, 50 m away: lines through the image meet it in a regular grid."""
    plane = bpy.data.objects["Plane"]
    plane.scale = 3 * (60.0,)
    plane.location = 3.0, -2.0, -45.0
    bpy.context.view_layer.update()
    found = shape(source, data).astype(float)
    assert len(found) > 4
    depth = camera.location.z - plane.location.z
    across = depth * camera.data.sensor_width / camera.data.lens
    place = found[:, :2] * across - np.array(plane.location.xy)
    # Cut into quarters of edges five times at most; a quarter of an edge is a face here at most.
    steps = (place / 60.0 + 0.5) * 4**5
    assert np.abs(steps - steps.round()).max() < 0.02
    assert steps.min() > -0.5 and steps.max() < 4**5 + 0.5
    assert np.diff(np.unique(steps[:, 0].round())).max() <= 256


def test_renders_and_files_are_whole(source, camera, data, drafts, addon, tmp_path):
    picture = data.pictures_of(source)[0]
    plane = bpy.data.objects["Plane"]
    plane.scale = 3 * (60.0,)
    plane.location.z = -45.0
    bpy.context.view_layer.update()
    drafted = len(shape(source, data))
    assert flags(source, data, addon) == [True]
    read = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    source.scfpf_preview.shelf.hide_render = picture.hide_render = False
    in_render = read(
        bpy.context.scene,
        bpy.context.view_layer,
        lambda depsgraph: len(picture.evaluated_get(depsgraph).data.vertices),
    )
    plane.location.x += 0.01
    bpy.context.view_layer.update()
    assert flags(source, data, addon) == [True]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "drafted.blend"))
    assert flags(source, data, addon) == [False]
    bpy.context.view_layer.update()
    whole = len(shape(source, data))
    assert in_render == whole != drafted
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "drafted.blend"))
    (loaded,) = data.previews()
    assert flags(loaded, data, addon) == [False]


def test_nothing_is_a_draft_in_the_background(source, camera, data, drafts, addon, monkeypatch):
    monkeypatch.setattr(drafts, "is_live", lambda: not bpy.app.background)
    camera.scfpf.surfaces[1].object.location.x += 0.1
    bpy.context.view_layer.update()
    assert flags(source, data, addon) == [False]
