# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers in Blender: what they show against composited renders, and the list through a session."""

from itertools import pairwise

import bpy
import numpy as np
import pytest
from engine_images import button, f12
from mathutils import Matrix
from recorded_layout import drawn, texts

FRONTS = ("DEPTH", "ANCHOR", "ORDER")


def placed(obj, location, turn=(0, 0, 0)):
    obj.location, obj.rotation_euler = location, turn
    return obj


def new_camera(name, matrix, scene=None):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    (scene or bpy.context.scene).collection.objects.link(camera)
    camera.matrix_world = matrix
    camera.data.clip_end = 60.0
    return camera


def looking(place, at=(0, 0, 0)):
    from mathutils import Vector

    way = Vector(at) - Vector(place)
    return Matrix.Translation(place) @ way.to_track_quat("-Z", "Y").to_matrix().to_4x4()


@pytest.fixture
def scene(engine_scene):
    """A cube on a floor, a second one, a flexible camera before them and a layer's camera beside."""
    cube = bpy.data.objects["Cube"]
    cube.name = "Thing"
    things = bpy.data.collections.new("Things")
    engine_scene.collection.children.link(things)
    things.objects.link(cube)
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 3.0, 0), size=3.0)
    bpy.context.object.name = "Wall"
    bpy.ops.mesh.primitive_plane_add(location=(0, 0, -1), size=30)
    bpy.context.object.name = "Floor"
    camera = engine_scene.camera
    camera.name = "Master"
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset="perspective") == {"FINISHED"}
    camera.matrix_world = looking((0, -9, 2))
    camera.scfpf.samples, camera.scfpf.pixel_error = 1, 0.05
    engine_scene.render.filter_size = 0.0
    engine_scene.render.film_transparent = True
    new_camera("Side", looking((-6, -5, 5), (-0.8, 0, 0)))
    return engine_scene


def add(front="DEPTH", collection="Things", seen_by="Side", **more):
    given = {"camera": "Master", "collection": collection, "seen_by": seen_by, "front": front}
    assert bpy.ops.scfpf.layer_add(**given, **more) == {"FINISHED"}
    return bpy.data.objects["Master"].scfpf.layers[-1]


def seen_alone(names, camera=None):
    """The image of some objects; the others are hidden from the camera, but lit and shadowed as ever."""
    scene, kept = bpy.context.scene, bpy.context.scene.camera
    scene.camera = camera or kept
    meshes = [obj for obj in scene.objects if obj.type == "MESH" and obj.scfpf_surface.kind == "NONE"]
    for obj in meshes:
        obj.visible_camera = obj.name in names
    image = f12(scene)["ViewLayer.Combined"]
    for obj in meshes:
        obj.visible_camera = True
    scene.camera = kept
    return image


@pytest.mark.parametrize("is_flexible", [False, True])
def test_a_layer_on_top_is_its_cameras_image_over_the_rest(scene, is_flexible):
    side = bpy.data.objects["Side"]
    if is_flexible:
        bpy.context.view_layer.objects.active = side
        assert bpy.ops.scfpf.preset_apply(preset="curved_convergence") == {"FINISHED"}
        side.scfpf.samples, side.scfpf.pixel_error = 1, 0.05
        scene.camera = bpy.data.objects["Master"]
    else:
        # A frame's own samples are the camera's.
        side.scfpf.samples = 1
    thing, rest = seen_alone({"Thing"}, side), seen_alone({"Wall", "Floor"})
    layer = add("ORDER")
    image = f12(scene)["ViewLayer.Combined"]
    covered = thing[..., 3] > 0
    assert 0.02 < covered.mean() < 0.6
    expected = np.where(covered[..., None], thing, rest)
    off = np.abs(image - expected).max(axis=2) > 2e-3
    # Silhouettes and shadow borders may differ by a rounding, as parts have a tree of their own.
    assert off.mean() < (0.01 if is_flexible else 0.002)
    # Float32's last digit: the other image builds other triangles.
    near = np.isclose(image[~covered], rest[~covered], rtol=1e-6, atol=1e-6).all(axis=1)
    assert near.mean() > 0.999
    layer.mask = bpy.data.images.new("Black", 1, 1)
    layer.mask.pixels[:] = (0.0, 0.0, 0.0, 1.0)
    hidden = f12(scene)["ViewLayer.Combined"]
    shown = np.abs(image - hidden).max(axis=2) > 0
    assert (shown & ~covered).mean() < 0.001 and (shown & covered).mean() > 0.7 * covered.mean()


@pytest.mark.parametrize("front", FRONTS)
def test_the_button_the_engine_and_their_passes_agree(scene, front):
    bpy.context.view_layer.use_pass_object_index = True
    bpy.data.objects["Thing"].pass_index = 7
    add(front)
    made = f12(scene)
    assert np.array_equal(made["ViewLayer.Combined"], button())
    index = made["ViewLayer.Object Index" if bpy.app.version >= (5, 0, 0) else "ViewLayer.IndexOB"][..., 0]
    assert 0.01 < (index == 7).mean() < 0.5


def test_who_is_in_front_follows_the_master(scene):
    # The thing stands behind the wall as the master sees it; its layer's image lies over the wall's.
    bpy.context.view_layer.use_pass_object_index = True
    bpy.data.objects["Thing"].pass_index = 7
    placed(bpy.data.objects["Thing"], (1.5, 9, 0))
    bpy.data.objects["Side"].matrix_world = looking((1.5, 3, 8), (1.5, 9, 0))
    shares = {}
    for front in FRONTS:
        layer = add(front)
        bpy.ops.scfpf.layer_check(camera="Master")
        shares[front] = layer.share
        assert bpy.ops.scfpf.layer_remove(camera="Master") == {"FINISHED"}
    assert shares["ORDER"] > shares["DEPTH"] and shares["ORDER"] > 0.02
    assert shares["DEPTH"] == pytest.approx(shares["ANCHOR"], abs=0.02)


def test_instances_are_in_the_layer_of_their_instancer(scene):
    bpy.ops.object.collection_instance_add(collection="Things", location=(-3, 0, 0))
    empty = bpy.context.object
    group = bpy.data.collections.new("Group")
    scene.collection.children.link(group)
    group.objects.link(empty)
    layer = add("ORDER", collection="Group")
    bpy.data.objects["Side"].matrix_world = looking((-9, -5, 5), (-3, 0, 0))
    bpy.ops.scfpf.layer_check(camera="Master")
    assert layer.share > 0.01


def test_a_mask_and_a_switch_hide_a_layer(scene):
    layer, camera = add("ORDER"), scene.camera
    full = f12(scene)["ViewLayer.Combined"]
    mask = bpy.data.images.new("Mask", 4, 2)
    mask.pixels[:] = [0.0] * 32
    layer.mask = mask
    hidden = f12(scene)["ViewLayer.Combined"]
    np.testing.assert_allclose(hidden, seen_alone({"Wall", "Floor"}), rtol=1e-6)
    assert (hidden != full).any()
    mask.pixels[:] = [1.0] * 32
    np.testing.assert_array_equal(f12(scene)["ViewLayer.Combined"], full)
    layer.is_on = False
    plain = f12(scene)["ViewLayer.Combined"]
    camera.scfpf.layers.clear()
    np.testing.assert_array_equal(f12(scene)["ViewLayer.Combined"], plain)


@pytest.mark.parametrize(("size", "position"), [((0.5, 0.5), (0.5, 0.5)), ((0.5, 1.0), (0.75, 0.5))])
def test_a_layers_picture_has_a_place_and_a_size(scene, size, position):
    bpy.context.view_layer.use_pass_position = True
    camera, side = scene.camera, bpy.data.objects["Side"]
    layer = add("ORDER")
    layer.size, layer.position = size, position
    found = f12(scene)["ViewLayer.Position"]
    # The side camera's own image, as large as the layer's.
    scene.camera, side.data.sensor_fit = side, "HORIZONTAL"
    scene.render.resolution_x, scene.render.resolution_y = round(64 * size[0]), round(36 * size[1])
    alone = f12(scene)["ViewLayer.Position"]
    centre = bpy.data.objects["Thing"].matrix_world.translation
    thing = (np.abs(alone - centre).max(axis=2) <= 1.0 + 1e-5) & alone.any(axis=2)
    top, left = (round(n * (p - s / 2)) for n, p, s in zip((36, 64), position[::-1], size[::-1], strict=True))
    part = found[top : top + alone.shape[0], left : left + alone.shape[1]]
    assert thing.mean() > 0.1
    np.testing.assert_allclose(part[thing], alone[thing], atol=1e-4)
    assert scene.camera != camera


def test_an_animated_layer(scene):
    layer = add("ORDER")
    side = bpy.data.objects["Side"]
    for frame, is_on, height in ((1, True, 5.0), (3, True, 7.0), (4, False, 7.0)):
        layer.is_on, side.location.z = is_on, height
        layer.keyframe_insert("is_on", frame=frame)
        side.keyframe_insert("location", index=2, frame=frame)
    images = []
    for frame in (1, 2, 3, 4):
        scene.frame_set(frame)
        images.append(f12(scene)["ViewLayer.Combined"])
    assert all((a != b).any() for a, b in pairwise(images))
    # The second keyframes' switch follows its layer when another comes on top.
    add("ORDER", collection=_new_collection("Walls", "Wall"))
    assert bpy.ops.scfpf.layer_move(camera="Master", index=1, direction="UP") == {"FINISHED"}
    scene.frame_set(4)
    assert [each.is_on for each in scene.camera.scfpf.layers] == [True, False]
    assert bpy.ops.scfpf.layer_remove(camera="Master", index=0) == {"FINISHED"}
    assert not scene.camera.scfpf.layers[0].is_on
    scene.frame_set(1)
    assert scene.camera.scfpf.layers[0].is_on


def _new_collection(name, *objects):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for each in objects:
        made.objects.link(bpy.data.objects[each])
    return name


def test_motion_blur_and_vectors_follow_a_layers_camera(scene):
    add("ORDER")
    side = bpy.data.objects["Side"]
    for frame, height in ((0, 4.0), (2, 6.0)):
        side.location.z = height
        side.keyframe_insert("location", index=2, frame=frame)
    scene.frame_set(1)
    scene.camera.scfpf.samples = 4
    bpy.context.view_layer.use_pass_vector = True
    still = f12(scene)
    vector = still["ViewLayer.Vector"]
    thing = seen_alone({"Thing"}, side)[..., 3] == 1
    moving = np.abs(vector).max(axis=2) > 0.5
    assert moving[thing].mean() > 0.9 and moving[~thing].mean() < 0.1
    bpy.context.view_layer.use_pass_vector = False
    scene.render.use_motion_blur = True
    blurred = f12(scene)["ViewLayer.Combined"]
    assert (np.abs(blurred - still["ViewLayer.Combined"]).max(axis=2) > 0.01)[thing].any()


def test_the_list_through_save_undo_and_append(scene, tmp_path):
    bpy.ops.ed.undo_push(message="Before")
    add("ANCHOR")
    bpy.ops.ed.undo_push(message="Added")
    bpy.ops.ed.undo()
    assert not len(bpy.data.objects["Master"].scfpf.layers)
    bpy.ops.ed.redo()
    assert bpy.data.objects["Master"].scfpf.layers[0].camera == bpy.data.objects["Side"]
    expected = button()
    path = str(tmp_path / "layers.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    np.testing.assert_array_equal(button(), expected)
    for link in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(path, link=link) as (_there, here):
            here.objects = ["Master"]
        camera = bpy.data.objects["Master"]
        layer = camera.scfpf.layers[0]
        assert (layer.collection.name, layer.camera.name, layer.front) == ("Things", "Side", "ANCHOR")


def test_layers_that_cannot_be_shown_are_told(scene, addon):
    read = addon("bridge.layers.read_image_layers").read_image_layers
    layer = add("ORDER")

    def warnings():
        bpy.context.view_layer.update()
        return " ".join(read(scene.camera, bpy.context.evaluated_depsgraph_get(), 16 / 9).warnings)

    assert warnings() == ""
    layer.camera = None
    assert "has no camera: choose one under Seen By" in warnings()
    layer.camera, layer.collection = bpy.data.objects["Side"], None
    assert "has no collection: choose one" in warnings()
    layer.collection = bpy.data.collections["Things"]
    add("ORDER", collection="Things")
    assert "'Things' and 'Things 2', of which the first alone shows them: Thing" in warnings()
    assert bpy.ops.scfpf.layer_check(camera="Master") == {"FINISHED"}
    assert scene.camera.scfpf.layers[0].share > 0.01 and scene.camera.scfpf.layers[1].share == 0.0
    assert scene.camera.scfpf.layers[1].message.startswith("Layers before it show all its things")
    bpy.data.objects["Thing"].hide_render = True
    inputs = addon("bridge.render.render_inputs").prepare(scene, bpy.context.view_layer, scene.camera)
    assert any("show nothing" in line and line.endswith("Things") for line in inputs.scene.warnings)
    bpy.data.objects["Thing"].hide_render = False
    bpy.data.objects["Side"].matrix_world = looking((50, 0, 0), (60, 0, 0))
    bpy.ops.scfpf.layer_check(camera="Master")
    assert "sees none of it" in scene.camera.scfpf.layers[0].message
    layer = scene.camera.scfpf.layers[0]
    layer.camera.data.clip_start, layer.camera.data.clip_end = 5.0, 1.0
    with pytest.raises(RuntimeError, match="Layer 'Things': 'Side' ends where it starts"):
        bpy.ops.scfpf.render()


@pytest.mark.usefixtures("built_groups")
def test_the_panel_says_what_a_layer_lacks(scene):
    layer = add()
    layer.camera = None
    scene.camera.select_set(True)
    text = texts(drawn(bpy.types.SCFPF_PT_view))
    assert f"Layer '{layer.name}': it has no camera: choose one under Seen By" in text


def test_other_ways_to_see_the_volume_say_that_layers_are_missing(scene, addon):
    add("ORDER")
    layers = addon("bridge.layers.read_image_layers")
    assert layers.not_here(scene.camera).endswith("Things")
    bpy.context.view_layer.objects.active = scene.camera
    bpy.ops.scfpf.cycles_rig()
    rig = addon("cycles.rig_data").rig_of(scene)
    assert layers.NOT_BY_F12 in addon("cycles.cautions").cautions(scene, bpy.context.view_layer, rig)


@pytest.mark.parametrize("halo", [0.0, 1.5])
def test_live_view_shows_what_the_engine_does(scene, addon, halo):
    views, casting = addon("bridge.live.live_view"), addon("shading.live.cast_live")
    bpy.context.view_layer.use_pass_position = True
    side, thing = bpy.data.objects["Side"], bpy.data.objects["Thing"]
    bpy.context.view_layer.objects.active = side
    assert bpy.ops.scfpf.preset_apply(preset="curved_convergence") == {"FINISHED"}
    scene.camera = bpy.data.objects["Master"]
    layer = add("DEPTH")
    layer.halo, layer.size, layer.position = halo, (0.8, 0.8), (0.45, 0.5)
    live = views.LiveView()

    def compare():
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        source = live.source = views.source_of(depsgraph)
        source.mark_edited()
        window = casting.LiveWindow(0.0, 0.0, 1.0, 1.0, 64, 36)
        whole = addon("bridge.render.view_painter").Rectangle(0.0, 0.0, 64.0, 36.0)
        placements, look = views.read_scene(source, depsgraph, scene.camera, 64.0)
        asked = views._request(source, depsgraph, scene.camera, 64 / 36, window, whole, "", placements, look)
        view = casting.LiveProjection.of(asked.projection, asked.members)
        hits = casting.cast_live(source.kept.updated(asked.placements), view, window)
        expected = f12(scene)["ViewLayer.Position"].reshape(-1, 3)
        off = np.linalg.norm(hits.position.T - expected, axis=1)
        # Live View follows curved projectors to a pixel, the engine finer: silhouettes may differ.
        assert np.mean(off > 0.1) < 0.02
        # The axes are perpendicular, of length 1, and face the surfaces' normals.
        hit = hits.look >= 0
        axes = np.stack([hits.forward, hits.right, hits.up])[:, :, hit]
        products = np.einsum("acn,bcn->nab", axes, axes)
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-4)
        assert (np.einsum("cn,cn->n", hits.normal, hits.forward)[hit] <= 1e-4).all()
        return hits

    before = compare()
    # The thing moves and is built apart from the rest.
    thing.location.x -= 1.0
    after = compare()
    assert (before.position != after.position).any()
    side.location.z += 1.0
    assert (compare().position != after.position).any()


def test_a_click_selects_what_the_picture_shows(scene, addon):
    seen = addon("bridge.live.seen_object")
    bpy.context.view_layer.use_pass_object_index = True
    for number, name in enumerate(("Thing", "Wall", "Floor"), 1):
        bpy.data.objects[name].pass_index = number
    layer = add("DEPTH")
    layer.size = (0.7, 0.7)
    made = f12(scene)
    index = made["ViewLayer.Object Index" if bpy.app.version >= (5, 0, 0) else "ViewLayer.IndexOB"][..., 0]
    frame = addon("bridge.render.view_painter").Rectangle(0.0, 0.0, 64.0, 36.0)
    found = set()
    for column, row in np.random.default_rng(2).integers((0, 0), (64, 36), (60, 2)):
        place = seen.Place(scene.camera, (column + 0.5) / 64, (row + 0.5) / 36, frame)
        obj = seen.seen_object(bpy.context, place)
        assert (obj.pass_index if obj else 0) == index[row, column]
        found.add(obj and obj.name)
    assert {"Thing", "Floor"} <= found


def test_wrong_arguments_are_refused(scene):
    for given, message in (
        ({"collection": "Nothing"}, "There is no collection 'Nothing'"),
        ({"collection": "Things", "seen_by": "Wall"}, "'Wall' cannot see a layer"),
        ({}, "Select the objects that the layer is to show"),
    ):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.scfpf.layer_add(camera="Master", **given)
    with pytest.raises(RuntimeError, match="has no layer at place 1"):
        bpy.ops.scfpf.layer_remove(camera="Master")
    assert not len(scene.camera.scfpf.layers)


def test_a_new_layer_of_the_selection_starts_where_the_picture_shows_it(scene):
    bpy.data.objects["Thing"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Thing"]
    assert bpy.ops.scfpf.layer_add() == {"FINISHED"}
    layer = scene.camera.scfpf.layers[0]
    assert layer.collection == bpy.data.collections["Things"] and layer.camera.type == "CAMERA"
    np.testing.assert_allclose(layer.camera.matrix_world, scene.camera.matrix_world, atol=1e-6)
    # Its camera stands for the one with the layers.
    bpy.context.view_layer.objects.active = layer.camera
    bpy.ops.scfpf.layer_check()
    assert layer.share > 0.0


def test_pick_and_find_see_layers(scene):
    add("ORDER")
    assert bpy.ops.scfpf.layer_check(camera="Master") == {"FINISHED"}
    bpy.ops.object.select_all(action="DESELECT")
    bpy.data.objects["Thing"].select_set(True)
    assert bpy.ops.scfpf.find_in_image() == {"FINISHED"}
    settings = scene.camera.scfpf
    assert settings.pick_object == "Thing" and "Hidden" not in settings.found_object
    left, low, right, high = settings.found_box
    image = np.abs(f12(scene)["ViewLayer.Combined"] - seen_alone({"Wall", "Floor"})).max(axis=2) > 1e-3
    rows, columns = np.nonzero(image)
    size = image.shape[1], image.shape[0]
    box = columns.min() / size[0], rows.min() / size[1], columns.max() / size[0], rows.max() / size[1]
    np.testing.assert_allclose((left, low, right, high), box, atol=0.05)


def test_a_picture_shows_which_layer_each_pixel_belongs_to(scene, tmp_path):
    """Colors of the list where the engine's Object Index has the layer's thing; files keep them."""
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    bpy.context.view_layer.use_pass_object_index = True
    layers = scene.camera.scfpf.layers
    for name, number in (("Thing", 1), ("Wall", 2)):
        bpy.data.objects[name].pass_index = number
    add("DEPTH")
    walls = bpy.data.collections.new("Walls")
    scene.collection.children.link(walls)
    walls.objects.link(bpy.data.objects["Wall"])
    add("DEPTH", collection="Walls")
    layers[1].color = 0.0, 0.0, 1.0
    assert not bpy.ops.scfpf.layer_image_show.poll()
    assert bpy.ops.scfpf.layer_check(camera="Master") == {"FINISHED"}
    passes = f12(scene)
    index = passes["ViewLayer.Object Index" if bpy.app.version >= (5, 0, 0) else "ViewLayer.IndexOB"][..., 0]

    def check():
        settings = bpy.data.objects["Master"].scfpf
        image = settings.layer_image
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(180, 320, 4)[..., :3]
        off = 0
        for number, color in enumerate(((0.5, 0.5, 0.5), *(layer.color for layer in settings.layers))):
            there = pixels[index == number]
            assert len(there) > 1000
            # The light varies, the color's direction does not.
            along = (there @ np.array(color)) / np.linalg.norm(there, axis=1) / np.linalg.norm(color)
            off += (along < 0.999).sum()
        assert off < 0.01 * index.size

    check()
    assert tuple(layers[1].color) == (0.0, 0.0, 1.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "picture.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "picture.blend"))
    check()
    before = {image.name for image in bpy.data.images}
    assert bpy.ops.scfpf.layer_check(camera="Master") == {"FINISHED"}
    assert {image.name for image in bpy.data.images} == before
    check()
    assert bpy.ops.scfpf.layer_image_show.poll()


@pytest.mark.parametrize(("width", "height", "size"), [(800, 400, (0.5, 1.0)), (400, 800, (1.0, 0.5))])
def test_a_new_layer_has_the_shape_that_its_cameras_preset_was_made_for(scene, width, height, size):
    """A square preset is half as wide as a picture of two squares side by side, or half as high."""
    render = scene.render
    side = bpy.data.objects["Side"]
    bpy.context.view_layer.objects.active = side
    render.resolution_x = render.resolution_y = 400
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert side.scfpf.fitted_aspect == pytest.approx(1.0) and side.scfpf.fit != "NONE"
    render.resolution_x, render.resolution_y = width, height
    assert bpy.ops.scfpf.layer_add(camera="Master", collection="Things", seen_by="Side") == {"FINISHED"}
    assert tuple(bpy.data.objects["Master"].scfpf.layers[0].size) == pytest.approx(size)
