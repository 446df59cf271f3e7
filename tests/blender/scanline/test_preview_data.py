# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview's data: what switching it on makes, what it follows, what switching it off leaves."""

import bpy
import pytest
from mathutils import Matrix


@pytest.fixture
def preview(addon):
    return addon("scanline.preview.preview")


@pytest.fixture
def data(addon):
    return addon("scanline.preview.preview_data")


@pytest.fixture
def camera(addon):
    """The scene's flexible camera, looking along -Z from 5 above at a cube."""
    return add_camera(addon)


def add_camera(addon, name="Camera", location=(0, 0, 5)):
    scene = bpy.context.scene
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    camera.location = location
    scene.collection.objects.link(camera)
    scene.camera = scene.camera or camera
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, scene)
    return camera


def add_cube(name="Cube", collection=None):
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    cube = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(cube)
    return cube


def copies(scene):
    """The shelves of previews in a scene."""
    return [c for c in scene.collection.children_recursive if c.scfpf_preview.source]


def toggle(camera):
    bpy.context.view_layer.objects.active = camera
    return bpy.ops.scfpf.preview_toggle()


def members(source):
    """Names of the objects that a preview shows, once the handlers have run."""
    source.scfpf_preview.scene.view_layers[0].update()
    return {member.name for member in source.all_objects}


def all_data():
    """The names of all datablocks, by type."""
    kinds = ("objects", "meshes", "cameras", "collections", "node_groups", "actions")
    return {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds}


def picture_points(source):
    """World positions of the preview's vertices as evaluated."""
    view_layer = source.scfpf_preview.scene.view_layers[0]
    view_layer.update()
    depsgraph, points = view_layer.depsgraph, []
    for part in source.scfpf_preview.parts:
        evaluated = part.picture.evaluated_get(depsgraph)
        points += [evaluated.matrix_world @ vertex.co for vertex in evaluated.data.vertices]
    return points


def test_on_and_off_leave_nothing(camera, data):
    add_cube()
    before = all_data()
    assert toggle(camera) == {"FINISHED"}
    source = data.preview_of(camera, bpy.context.scene)
    assert members(source) == {"Cube"}
    assert all_data() != before
    assert toggle(camera) == {"FINISHED"}
    assert data.preview_of(camera, bpy.context.scene) is None
    assert all_data() == before


@pytest.mark.usefixtures("light_nodes")
def test_the_preview_is_hidden_from_everything_else(camera, data):
    add_cube()
    toggle(camera)
    source = data.preview_of(camera, bpy.context.scene)
    settings = source.scfpf_preview
    layer = data.layer_of(bpy.context.view_layer, settings.shelf)
    assert layer.hide_viewport and not layer.exclude
    assert settings.shelf.hide_render and settings.shelf.hide_select
    for part in (settings.parts[0].picture, settings.view_camera):
        assert part.hide_render and not part.visible_get()
    assert source.name not in {c.name for c in bpy.context.scene.collection.children_recursive}


@pytest.mark.usefixtures("light_nodes")
def test_the_scene_reader_leaves_the_preview_out(camera, data, addon):
    add_cube()
    scene, view_layer = bpy.context.scene, bpy.context.view_layer
    before = addon("bridge.render.render_inputs").prepare(scene, view_layer, camera).scene.geometry
    toggle(camera)
    after = addon("bridge.render.render_inputs").prepare(scene, view_layer, camera).scene.geometry
    assert after.object_names == before.object_names
    assert len(after.triangles) == len(before.triangles)
    read_scene = addon("bridge.scene.read_scene").read_scene
    assert len(read_scene(bpy.context.evaluated_depsgraph_get()).geometry.triangles) == len(before.triangles)


@pytest.mark.usefixtures("light_nodes")
def test_the_view_camera_frames_the_viewbox_in_the_camera_s_place(camera, data):
    camera.matrix_world = Matrix.Translation((3, 2, 1)) @ Matrix.Rotation(0.7, 4, "X")
    bpy.context.view_layer.update()
    toggle(camera)
    bpy.context.view_layer.update()
    settings = data.preview_of(camera, bpy.context.scene).scfpf_preview
    for part in (settings.parts[0].picture, settings.view_camera):
        assert (part.matrix_world.translation - camera.matrix_world.translation).length < 1e-6
    lens = settings.view_camera.data
    frame = lens.view_frame(scene=bpy.context.scene)
    render = bpy.context.scene.render
    assert lens.type == "ORTHO"
    assert frame[0].x == pytest.approx(0.5) and frame[2].x == pytest.approx(-0.5)
    assert frame[0].y == pytest.approx(0.5 * render.resolution_y / render.resolution_x)


@pytest.mark.usefixtures("light_nodes")
def test_members_follow_the_scene(camera, data):
    add_cube("First")
    toggle(camera)
    scene = bpy.context.scene
    source = data.preview_of(camera, scene)
    second = add_cube("Second")
    assert members(source) == {"First", "Second"}
    second.hide_render = True
    assert members(source) == {"First"}
    second.hide_render = False
    second.visible_camera = False
    assert members(source) == {"First"}
    second.visible_camera = True
    second.hide_viewport = True
    bpy.data.objects["First"].hide_set(True)
    assert members(source) == {"First", "Second"}
    second.name = "Renamed"
    assert members(source) == {"First", "Renamed"}
    bpy.data.objects.remove(bpy.data.objects["First"])
    assert members(source) == {"Renamed"}
    scene.collection.objects.unlink(second)
    assert members(source) == set()


@pytest.mark.usefixtures("light_nodes")
def test_surfaces_volumes_and_previews_are_no_members(camera, data, addon):
    other = add_camera(addon, "Other", (0, 0, 9))
    toggle(camera)
    toggle(other)
    scene = bpy.context.scene
    first, second = (data.preview_of(one, scene) for one in (camera, other))
    assert first != second
    assert members(first) == members(second) == set()
    cube = add_cube()
    assert members(first) == members(second) == {"Cube"}
    grid = bpy.data.objects.new("Sheet", bpy.data.meshes.new("Sheet"))
    grid.data.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    grid.data.uv_layers.new()
    scene.collection.objects.link(grid)
    assert members(first) == {"Cube", "Sheet"}
    addon("bridge.camera.flexible_camera").attach_surface(other, grid)
    assert members(first) == members(second) == {cube.name}
    toggle(camera)
    assert data.preview_of(camera, scene) is None
    assert members(second) == {"Cube"}


@pytest.mark.usefixtures("light_nodes")
def test_animated_visibility_is_followed(camera, data):
    cube = add_cube()
    for frame, hidden in ((1, False), (2, True), (3, False)):
        cube.hide_render = hidden
        cube.keyframe_insert("hide_render", frame=frame)
    scene = bpy.context.scene
    scene.frame_set(1)
    toggle(camera)
    source = data.preview_of(camera, scene)
    shown = []
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        shown.append(len(source.all_objects))
    assert shown == [1, 0, 1]


@pytest.mark.usefixtures("light_nodes")
def test_an_empty_scene(camera, data):
    toggle(camera)
    source = data.preview_of(camera, bpy.context.scene)
    assert members(source) == set()
    assert picture_points(source) == []


@pytest.mark.usefixtures("built_groups")
def test_the_picture_follows_edits(camera, data):
    cube = add_cube()
    toggle(camera)
    source = data.preview_of(camera, bpy.context.scene)
    before = picture_points(source)
    assert before
    cube.location.x += 0.5
    bpy.context.view_layer.update()
    moved = picture_points(source)
    assert moved != before
    near = camera.scfpf.surfaces[0].object
    near.location.x += 0.01
    bpy.context.view_layer.update()
    assert picture_points(source) != moved


@pytest.mark.usefixtures("built_groups")
def test_a_scaled_camera_makes_the_same_picture(camera, data):
    add_cube()
    toggle(camera)
    source = data.preview_of(camera, bpy.context.scene)
    before = picture_points(source)
    settings = source.scfpf_preview
    placed = {slot.object: slot.object.matrix_world.copy() for slot in camera.scfpf.surfaces}
    camera.scale = (2, 1, 0.5)
    bpy.context.view_layer.update()
    for surface, matrix in placed.items():
        surface.matrix_world = matrix
    after = picture_points(source)
    assert len(after) == len(before)
    assert max((a - b).length for a, b in zip(after, before, strict=True)) < 1e-5
    assert settings.view_camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.to_scale()[
        0
    ] == pytest.approx(1)


@pytest.mark.usefixtures("built_groups")
def test_aspect_and_width_follow_the_resolution(camera, data, addon):
    versions = addon("bridge.blender.versions")
    add_cube()
    toggle(camera)
    scene = bpy.context.scene
    source = data.preview_of(camera, scene)

    def inputs():
        bpy.context.view_layer.update()
        evaluated = source.scfpf_preview.parts[0].picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
        modifier = evaluated.modifiers[0]
        group = source.scfpf_preview.parts[0].picture.modifiers[0].node_group
        sockets = {
            item.name: item.identifier for item in group.interface.items_tree if item.in_out == "INPUT"
        }
        return [versions.modifier_input(modifier, sockets[name]) for name in ("Aspect", "Picture Width")]

    assert inputs() == pytest.approx([1920 / 1080, 1920])
    scene.render.resolution_x, scene.render.resolution_percentage = 500, 50
    assert inputs() == pytest.approx([500 / 1080, 250])
    scene.render.pixel_aspect_x = 2
    assert inputs() == pytest.approx([1000 / 1080, 250])


@pytest.mark.usefixtures("light_nodes")
def test_a_deleted_camera_takes_its_preview_along(camera, data, addon):
    other = add_camera(addon, "Other")
    add_cube()
    before = all_data()
    toggle(camera)
    bpy.data.objects.remove(camera)
    bpy.context.view_layer.update()
    assert data.previews() == []
    left = all_data()
    assert not [name for names in left.values() for name in names if "Preview" in name]
    assert set(left["node_groups"]) <= set(before["node_groups"])
    assert other.name in left["objects"]


@pytest.mark.parametrize(
    "how", ["delete", "unlink", "ordinary", "picture", "members", "view_camera", "table", "shelf"]
)
@pytest.mark.usefixtures("light_nodes")
def test_a_lost_part_ends_the_preview(camera, data, how):
    add_cube()
    toggle(camera)
    settings = data.preview_of(camera, bpy.context.scene).scfpf_preview
    if how == "delete":
        with bpy.context.temp_override(selected_objects=[camera]):
            bpy.ops.object.delete()
    elif how == "unlink":
        for collection in camera.users_collection:
            collection.objects.unlink(camera)
    elif how == "ordinary":
        camera.scfpf.enabled = False
    else:
        owner = settings.parts[0] if how in {"picture", "members"} else settings
        bpy.data.batch_remove([getattr(owner, how)])
    bpy.context.view_layer.update()
    assert data.previews() == []
    assert not [obj.name for obj in bpy.data.objects if "Preview" in obj.name]
    assert not [c.name for c in bpy.data.collections if "Preview" in c.name]


@pytest.mark.usefixtures("light_nodes")
def test_other_view_layers_leave_the_preview_out(camera, data):
    scene = bpy.context.scene
    first = bpy.context.view_layer
    second = scene.view_layers.new("Second")
    add_cube()
    toggle(camera)
    source = data.preview_of(camera, scene)
    shelf = source.scfpf_preview.shelf
    third = scene.view_layers.new("Third")
    first.update()
    assert not data.layer_of(first, shelf).exclude
    for view_layer in (second, third):
        assert data.layer_of(view_layer, shelf).exclude
    first.name = "Renamed"
    first.update()
    assert data.preview_of(camera, scene) is not None


@pytest.mark.parametrize("how", ["FULL_COPY", "LINK_COPY"])
@pytest.mark.usefixtures("light_nodes")
def test_a_copied_scene_starts_without_a_preview(camera, data, how):
    add_cube()
    toggle(camera)
    original = bpy.context.scene
    source = data.preview_of(camera, original)
    bpy.ops.scene.new(type=how)
    copy = next(scene for scene in bpy.data.scenes if scene != original)
    for scene in bpy.data.scenes:
        for view_layer in scene.view_layers:
            view_layer.update()
    assert not copies(copy)
    assert data.previews() == [source]
    assert members(source) == {"Cube"}
    assert picture_points(source)
    if how == "FULL_COPY":
        copied = next(obj for obj in copy.objects if obj.type == "CAMERA" and obj.scfpf.enabled)
        with bpy.context.temp_override(scene=copy, view_layer=copy.view_layers[0], object=copied):
            bpy.ops.scfpf.preview_toggle()
        assert len(members(data.preview_of(copied, copy))) == 1
        assert len(picture_points(data.preview_of(copied, copy))) == len(picture_points(source))
        return
    bpy.data.scenes.remove(original)
    copy.view_layers[0].update()
    assert not copies(copy)
    assert not [c.name for c in bpy.data.collections if "Preview" in c.name]


@pytest.mark.usefixtures("built_groups")
def test_a_duplicated_camera_has_no_preview(camera, data):
    add_cube()
    toggle(camera)
    bpy.ops.object.select_all(action="DESELECT")
    camera.select_set(True)
    for slot in camera.scfpf.surfaces:
        slot.object.select_set(True)
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    assert copy != camera and copy.type == "CAMERA"
    scene = bpy.context.scene
    assert data.preview_of(copy, scene) is None
    assert members(data.preview_of(camera, scene)) == {"Cube"}
    toggle(copy)
    toggle(camera)
    assert data.preview_of(camera, scene) is None
    assert picture_points(data.preview_of(copy, scene))


@pytest.mark.usefixtures("light_nodes")
def test_undo_and_redo(camera, data):
    add_cube()
    bpy.ops.ed.undo_push(message="before")
    toggle(camera)
    bpy.ops.ed.undo_push(message="on")
    add_cube("Second")
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="second")

    def state():
        bpy.context.view_layer.update()
        return [members(source) for source in data.previews()]

    def step(operator):
        operator()
        return state()

    assert state() == [{"Cube", "Second"}]
    assert step(bpy.ops.ed.undo) == [{"Cube"}]
    assert step(bpy.ops.ed.undo) == []
    assert step(bpy.ops.ed.redo) == [{"Cube"}]
    assert step(bpy.ops.ed.redo) == [{"Cube", "Second"}]
    toggle(bpy.data.objects["Camera"])
    bpy.ops.ed.undo_push(message="off")
    assert state() == []
    assert step(bpy.ops.ed.undo) == [{"Cube", "Second"}]
    assert step(bpy.ops.ed.redo) == []


@pytest.mark.usefixtures("light_nodes")
def test_what_cannot_be_previewed_is_refused(camera):
    camera.scfpf.surfaces.clear()
    bpy.context.view_layer.update()
    before = all_data()
    with pytest.raises(RuntimeError, match="at least two control surfaces"):
        toggle(camera)
    assert all_data() == before


@pytest.mark.usefixtures("light_nodes")
def test_what_the_artist_puts_into_the_preview_stays(camera, data):
    toggle(camera)
    source = data.preview_of(camera, bpy.context.scene)
    add_cube("Guest", source.scfpf_preview.shelf)
    assert members(source) == set()
    toggle(camera)
    assert bpy.context.scene.collection.objects.get("Guest") is not None


@pytest.mark.usefixtures("light_nodes")
def test_a_broken_volume_is_said_by_the_preview_and_the_rig(camera, data, capfd):
    """The preview stays, and follows once the volume is mended; the rig is refused."""
    add_cube()
    slots = camera.scfpf.surfaces
    far = slots[1].object
    slots[1].object = slots[0].object
    assert toggle(camera) == {"FINISHED"}
    assert "lie in one place" in capfd.readouterr().out
    assert data.preview_of(camera, bpy.context.scene) is not None
    with pytest.raises(RuntimeError, match=r"lie in one place.*is on the list twice"):
        bpy.ops.scfpf.cycles_rig()
    assert "lie in one place" in capfd.readouterr().out
    slots[1].object = far
    toggle(camera)
    assert toggle(camera) == {"FINISHED"}
    assert "lie in one place" not in capfd.readouterr().out
