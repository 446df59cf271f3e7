# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview in parts: what is made anew after an edit, and what is not."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def parts(addon):
    return addon("scanline.preview.preview_parts")


@pytest.fixture
def data(addon):
    return addon("scanline.preview.preview_data")


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
def preview(camera, data):
    """Switches the camera's preview on; returns its source."""

    def switch_on():
        bpy.context.view_layer.objects.active = camera
        assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
        return data.preview_of(camera, bpy.context.scene)

    return switch_on


def add_grid(name, side, location=(0, 0, 0)):
    """A sheet of side × side small faces."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, size=0.5, location=location)
    bpy.context.object.name = name
    return bpy.context.object


@pytest.fixture
def edits():
    """Call it with an edit: the names of the objects whose geometry is made anew by it."""
    made_anew = set()

    def note(_scene, depsgraph):
        made_anew.update(
            update.id.name
            for update in depsgraph.updates
            if update.is_updated_geometry and isinstance(update.id, bpy.types.Object)
        )

    def edit(change):
        bpy.context.view_layer.update()
        bpy.context.view_layer.update()
        made_anew.clear()
        change()
        bpy.context.view_layer.update()
        return set(made_anew)

    bpy.app.handlers.depsgraph_update_post.append(note)
    yield edit
    bpy.app.handlers.depsgraph_update_post.remove(note)


def shown_by(source):
    """The name of the picture by the name of what it shows."""
    return {
        one.name: part.picture.name for part in source.scfpf_preview.parts for one in part.members.objects
    }


def test_few_light_objects_share_a_part(parts):
    assert set(parts.share_out(dict.fromkeys(range(100), 400), {}).values()) == {0}


def test_heavy_objects_have_a_part_each(parts):
    weights = {1: 1_000_000, 2: 900_000, 3: 30, 4: 500, 5: 200_000}
    places = parts.share_out(weights, {})
    assert places[3] == places[4]
    assert len({places[1], places[2], places[3]}) == 3


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_few_and_none_that_is_shared_is_heavy(parts, seed):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(1, 400))
    faces = 10 ** generator.uniform(0, generator.uniform(1, 6.5), count)
    weights = dict(enumerate(faces.astype(int).tolist()))
    places = parts.share_out(weights, {})
    assert places.keys() == weights.keys()
    assert set(places.values()) == set(range(max(places.values()) + 1))
    assert len(set(places.values())) <= parts.MOST_PARTS
    most = max(parts.SHARED_FACES, 2 * sum(weights.values()) / (parts.MOST_PARTS - 1) + 1)
    for part in set(places.values()):
        members = [weights[uid] for uid in places if places[uid] == part]
        assert len(members) == 1 or sum(members) <= most


def test_objects_stay_where_they_are(parts):
    weights = {1: 1_000_000, 2: 60_000, 3: 10, 4: 10}
    present = parts.share_out(weights, {})
    later = parts.share_out({2: 60_000, 3: 10, 4: 30_000, 5: 40}, present)
    assert all(later[uid] == present[uid] for uid in (2, 3, 4))
    # The part that the first has left is used again.
    assert later[5] == present[1] or later[5] in present.values()
    grown = parts.share_out(weights | {3: 2_000_000}, present)
    assert grown[3] != grown[4]


@pytest.mark.usefixtures("built_groups")
def test_an_edit_makes_only_the_picture_anew_that_shows_it(preview, edits, parts, monkeypatch):
    monkeypatch.setattr(parts, "SHARED_FACES", 100)
    heavy, light = add_grid("Heavy", 12), add_grid("Light", 3, (1, 0, 0))
    other = add_grid("Other", 2, (-1, 0, 0))
    source = preview()
    pictures = shown_by(source)
    assert pictures["Heavy"] != pictures["Light"] == pictures["Other"]
    every = {part.picture.name for part in source.scfpf_preview.parts}
    table = source.scfpf_preview.table.name

    def move(thing):
        return lambda: setattr(thing.location, "z", thing.location.z + 0.1)

    assert edits(move(light)) & (every | {table}) == {pictures["Light"]}
    assert edits(move(other)) & (every | {table}) == {pictures["Light"]}
    assert edits(move(heavy)) & (every | {table}) == {pictures["Heavy"]}
    surface = source.scfpf_preview.camera.scfpf.surfaces[1].object
    assert edits(move(surface)) & (every | {table}) == every | {table}


@pytest.mark.usefixtures("light_nodes")
def test_unrelated_edits_make_nothing_anew(preview, edits):
    add_grid("Grid", 3)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    hidden = add_grid("Hidden", 3)
    hidden.hide_render = True
    bpy.context.scene.collection.objects.link(lamp)
    material = bpy.data.materials.new("Red")
    bpy.data.objects["Grid"].data.materials.append(material)
    ordinary = bpy.data.objects.new("Ordinary", bpy.data.cameras.new("Ordinary"))
    bpy.context.scene.collection.objects.link(ordinary)
    source = preview()
    own = {part.picture.name for part in source.scfpf_preview.parts} | {source.scfpf_preview.table.name}
    assert not own & edits(lambda: setattr(lamp.location, "x", 3.0))
    assert not own & edits(lambda: setattr(hidden.location, "x", 3.0))
    assert not own & edits(lambda: setattr(ordinary.location, "x", 3.0))
    assert not own & edits(lambda: setattr(lamp.data, "energy", 7.0))
    assert not own & edits(lambda: setattr(material, "diffuse_color", (1, 0, 0, 1)))
    assert not own & edits(lambda: bpy.data.objects["Grid"].select_set(True))
    assert own & edits(lambda: setattr(bpy.data.objects["Grid"].location, "x", 3.0))


@pytest.mark.usefixtures("light_nodes")
def test_what_is_left_out_is_summed_over_the_pictures(preview, data, monkeypatch):
    source = preview()
    data.add_parts(source, 3)
    counts = {"unreachable": 5, "folded": 7}
    monkeypatch.setattr(data.remap_nodes, "remap_counts", lambda _evaluated: counts, raising=False)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    # Faces are each picture's own, the folds of the volume are the same in all.
    assert data.left_out(source, depsgraph) == {"unreachable": 15, "folded": 7}


@pytest.mark.usefixtures("light_nodes")
def test_what_becomes_heavy_gets_a_picture_of_its_own(preview, data):
    grid, _ = add_grid("Grid", 100), add_grid("Light", 3, (1, 0, 0))
    source = preview()
    assert len(source.scfpf_preview.parts) == 1
    grid.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.context.view_layer.update()
    pictures = shown_by(source)
    assert pictures["Grid"] != pictures["Light"]
    assert len(data.pictures_of(source)) == 2
    bpy.context.view_layer.update()
    counts = {
        picture.name: len(picture.evaluated_get(bpy.context.view_layer.depsgraph).data.polygons)
        for picture in data.pictures_of(source)
    }
    assert counts[pictures["Grid"]] >= 160_000 > counts[pictures["Light"]] > 0
    before = {kind: len(getattr(bpy.data, kind)) for kind in ("collections", "objects", "node_groups")}
    bpy.ops.scfpf.preview_toggle()
    preview()
    bpy.context.view_layer.update()
    assert {kind: len(getattr(bpy.data, kind)) for kind in before} == before


@pytest.mark.parametrize("how", ["collection", "nodes"])
def test_faces_of_instances_are_counted(parts, how):
    grid = add_grid("Grid", 10)
    scene = bpy.context.scene
    if how == "collection":
        held = bpy.data.collections.new("Held")
        held.objects.link(grid)
        carrier = bpy.data.objects.new("Carrier", None)
        carrier.instance_type, carrier.instance_collection = "COLLECTION", held
        expected = 100
    else:
        carrier = bpy.data.objects.new("Carrier", bpy.data.meshes.new("Carrier"))
        carrier.data.from_pydata([(x, 0, 0) for x in range(7)], [], [])
        tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        start, info, instance, end = (
            tree.nodes.new(kind)
            for kind in (
                "NodeGroupInput",
                "GeometryNodeObjectInfo",
                "GeometryNodeInstanceOnPoints",
                "NodeGroupOutput",
            )
        )
        info.inputs["Object"].default_value = grid
        info.inputs["As Instance"].default_value = True
        tree.links.new(start.outputs[0], instance.inputs["Points"])
        tree.links.new(info.outputs["Geometry"], instance.inputs["Instance"])
        tree.links.new(instance.outputs[0], end.inputs[0])
        carrier.modifiers.new("Instances", "NODES").node_group = tree
        expected = 700
    scene.collection.objects.link(carrier)
    bpy.context.view_layer.update()
    assert parts.face_count(carrier, bpy.context.view_layer.depsgraph) == expected


@pytest.mark.usefixtures("light_nodes")
def test_a_preview_asleep_computes_nothing_and_wakes_as_it_was(preview, data):
    grid = add_grid("Grid", 20)
    source = preview()

    def count():
        bpy.context.view_layer.update()
        depsgraph = bpy.context.view_layer.depsgraph
        pictures = [picture.evaluated_get(depsgraph) for picture in data.pictures_of(source)]
        return [len(one.data.vertices) for one in pictures]

    awake = count()
    assert all(awake) and not data.is_asleep(source)
    data.set_asleep(source, True)
    assert data.is_asleep(source)
    assert not any(count())
    grid.location.x += 0.1
    assert not any(count())
    data.set_asleep(source, False)
    assert count() == awake and not data.is_asleep(source)


@pytest.mark.usefixtures("built_groups")
def test_a_table_that_others_use_stays_awake(preview, data, addon):
    add_grid("Grid", 20)
    source = preview()
    versions = addon("bridge.blender.versions")
    group = addon("scanline.remap.remap_nodes").remap_group()
    own = add_grid("By Hand", 3)
    modifier = own.modifiers.new("Remap", "NODES")
    modifier.node_group = group
    for item in group.interface.items_tree:
        if item.name == "Table":
            versions.set_modifier_input(modifier, item.identifier, source.scfpf_preview.table)
    modifier.node_group = group
    data.set_asleep(source, True)
    assert data.is_asleep(source)
    bpy.context.view_layer.update()
    assert len(own.evaluated_get(bpy.context.view_layer.depsgraph).data.vertices)


@pytest.mark.usefixtures("light_nodes")
def test_a_saved_file_is_awake(preview, data, tmp_path):
    add_grid("Grid", 20)
    source = preview()
    data.set_asleep(source, True)
    path = str(tmp_path / "asleep.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not data.is_asleep(data.previews()[0])


@pytest.mark.usefixtures("built_groups")
def test_weights_and_lists_reach_the_table(preview, camera, addon, data):
    bpy.data.batch_remove([g for g in bpy.data.node_groups if g.name.startswith("SCFPF Table")])
    addon("bridge.camera.flexible_camera").add_surface(camera, "PLANE", index=1)
    camera.scfpf.surfaces[1].object.location.z = -3
    camera.scfpf.basis = "NURBS"
    add_grid("Grid", 20)
    source = preview()

    def points():
        bpy.context.view_layer.update()
        bpy.context.view_layer.update()
        mesh = data.pictures_of(source)[0].evaluated_get(bpy.context.view_layer.depsgraph).data
        return [tuple(vertex.co) for vertex in mesh.vertices]

    seen = [points()]
    camera.scfpf.surfaces[1].weight = 4.0
    seen.append(points())
    camera.scfpf.surfaces[1].weight = 0.3
    seen.append(points())
    assert seen[0] and seen[0] != seen[1] and seen[1] != seen[2]
    # The groups of weights that were are not left behind.
    assert len([g for g in bpy.data.node_groups if g.name.startswith("SCFPF Table")]) == 1
    remove = addon("bridge.camera.flexible_camera").remove_surface
    remove(camera, 1)
    assert points() not in seen
    remove(camera, 1)
    points()
    assert "two control surfaces" in source.scfpf_preview.problem
