# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers through Cycles, compared with Blender's own renders of the same things."""

import bpy
import numpy as np
import pytest
from engine_images import passes
from layer_scenes import (
    HEIGHT,
    WIDTH,
    add,
    alone,
    collected,
    flexible,
    layered,
    looking,
    new_camera,
    passes_alone,
)
from rig_scenes import glowing

pytestmark = pytest.mark.usefixtures("built_groups")


def test_a_layer_seen_by_the_cameras_own_twin_is_the_plain_render(scene):
    flexible(bpy.data.objects["Master"])
    bpy.data.objects["Master"].matrix_world = looking((0, -9, 2))
    # Not on the floor: what a thing stands on and hides mixes with it at its outline.
    bpy.data.objects["Thing"].location.z = 0.6
    whole = alone(scene, {"Thing", "Wall", "Floor"})
    rest = alone(scene, {"Wall", "Floor"})
    own = alone(scene, {"Thing"}, transparent=True)[..., 3]
    flexible(new_camera("Side", bpy.data.objects["Master"].matrix_world))
    add("DEPTH")
    image = layered()
    off = np.abs(image - whole).max(axis=2)
    assert 0.05 < (own > 0).mean() < 0.5
    # The samples are the same, so that the noise is, too.
    np.testing.assert_array_equal(image[own == 0], rest[own == 0])
    assert (np.abs(rest - whole).max(axis=2) > 0.02)[own == 1].mean() > 0.3
    assert off[own == 1].max() < 1e-4
    assert off.mean() < 2e-3


@pytest.mark.parametrize("kind", ["ordinary", "orthographic", "flexible"])
def test_the_picture_of_a_layers_camera_has_its_place(scene, kind):
    size, position = (0.75, 0.5), (0.625, 0.75)
    side = new_camera("Side", looking((-6, -5, 5), (-0.5, 0, 0)))
    side.data.shift_x = 0.1
    if kind == "orthographic":
        side.data.type, side.data.ortho_scale = "ORTHO", 6.0
    render = scene.render
    render.resolution_x, render.resolution_y = round(WIDTH * size[0]), round(HEIGHT * size[1])
    if kind == "flexible":
        flexible(side, "curved_convergence")
    side.data.sensor_fit = "HORIZONTAL"
    glowing("Thing", (1, 0.5, 0.25))
    own = alone(scene, {"Thing"}, "Side", transparent=True)
    render.resolution_x, render.resolution_y = WIDTH, HEIGHT
    rest = alone(scene, {"Wall", "Floor"})
    layer = add("ORDER")
    layer.size, layer.position = size, position
    image = layered()
    left, bottom = (round(n * (p - s / 2)) for n, p, s in zip((WIDTH, HEIGHT), position, size, strict=True))
    expected = rest.copy()
    part = expected[bottom : bottom + own.shape[0], left : left + own.shape[1]]
    part[:] = own + part * (1 - own[..., 3:])
    covered = np.zeros(rest.shape[:2], bool)
    covered[bottom : bottom + own.shape[0], left : left + own.shape[1]] = own[..., 3] > 0
    assert 0.02 < covered.mean() < 0.6
    # The filter draws other places in the pixels of images of another size.
    around = np.pad(covered, 1)
    around = np.any([np.roll(around, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
    apart = ~around[1:-1, 1:-1]
    np.testing.assert_array_equal(image[apart], rest[apart])
    off = np.abs(image - expected).max(axis=2)
    assert off[covered].mean() < 0.03
    assert np.median(off[covered]) < 1e-5


@pytest.mark.parametrize("fronts", [("DEPTH", "DEPTH"), ("ORDER", "ANCHOR")])
def test_who_is_in_front_follows_a_list_of_keys(scene, fronts):
    collected("Walls", "Wall")
    for name, color in (("Thing", (1, 0, 0)), ("Wall", (0, 1, 0)), ("Floor", (0, 0, 1))):
        glowing(name, color)
    bpy.ops.mesh.primitive_cube_add(location=(0, -3, 0))
    bpy.context.object.name = "Post"
    bpy.context.object.scale = 0.15, 0.15, 3.0
    glowing("Post", (1, 1, 0))
    new_camera("Side", looking((-3, -8, 4), (0.2, 0, 0)))
    new_camera("Above", looking((2, -6, 5), (1.5, 3, 0)))
    bpy.context.view_layer.use_pass_position = True
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.cycles.samples = 1
    eye = np.array(bpy.data.objects["Master"].matrix_world.translation)
    sources, keys = [], []
    views = (("Floor", "Post"), "Master"), (("Thing",), "Side"), (("Wall",), "Above")
    for number, (names, camera) in enumerate(views):
        found = passes_alone(scene, names, camera, transparent=number > 0)
        place, color = found["ViewLayer.Position"], found["ViewLayer.Combined"]
        middle = np.array(bpy.data.objects[names[0]].matrix_world.translation)
        front = fronts[number - 1] if number else "DEPTH"
        key = np.linalg.norm((0.0 * place + middle if front == "ANCHOR" else place) - eye, axis=2)
        key = np.full_like(key, number - 3) if front == "ORDER" else key
        sources.append(color)
        keys.append(np.where(place.any(axis=2), key, np.inf))
    winner = np.argmin(keys, axis=0)
    expected = np.take_along_axis(np.stack(sources), winner[None, ..., None], axis=0)[0]
    assert np.bincount(winner.ravel()).min() > 20
    add(fronts[0])
    add(fronts[1], "Walls", "Above")
    image = layered()
    # A pixel that more than one of its places decides is a mix.
    mixed = np.abs(image - expected).max(axis=2) > 1e-5
    edges = np.zeros_like(mixed)
    for other in (sources, [winner[..., None]]):
        for each in other:
            for axis in (0, 1):
                step = np.abs(np.diff(each, axis=axis)).max(axis=2) > 1e-5
                pad = [(1, 0) if axis == 0 else (0, 0), (0, 0) if axis == 0 else (1, 0)]
                edges |= np.pad(step, pad) | np.pad(step, [side[::-1] for side in pad])
    assert edges.mean() < 0.5
    assert not (mixed & ~edges).any()


def test_a_halo_shows_the_ground_around_as_the_layers_camera_does(scene):
    side = new_camera("Side", looking((-5, -6, 5), (-0.8, 0, 0)))
    layer = add("ORDER")
    layer.halo = 1.0
    image = layered()
    rest = alone(scene, {"Wall", "Floor"})
    bpy.context.view_layer.use_pass_position = True
    both = passes_alone(scene, {"Thing", "Wall", "Floor"}, side.name, transparent=True)
    place, color = both["ViewLayer.Position"].astype(float), both["ViewLayer.Combined"]
    away = np.linalg.norm(np.maximum(np.abs(place) - 1.0, 0.0), axis=2)
    # The thing's shadow is on the ground beside it.
    inside, outside = away < 0.8, away > 1.2
    ground = inside & (np.abs(place[..., 2] + 1.0) < 1e-3)
    assert ground.mean() > 0.02 and np.ptp(color[ground][:, 0]) > 0.2
    own = alone(scene, {"Thing"}, side.name, transparent=True)[..., 3]
    assert np.abs(image - color)[inside & ((own == 1) | (own == 0))].max() < 1e-4
    np.testing.assert_array_equal(image[outside & (own == 0)], rest[outside & (own == 0)])
    layer.mask = bpy.data.images.new("Mask", 2, 1)
    layer.mask.pixels[:] = (1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    masked = layered()
    np.testing.assert_array_equal(masked[:, WIDTH // 2 :], rest[:, WIDTH // 2 :])
    np.testing.assert_allclose(masked[:, : WIDTH // 2], image[:, : WIDTH // 2], atol=1e-6)
    layer.mask, layer.feather = None, 1.0
    left = np.clip(1.0 - away, 0.0, 1.0)[..., None]
    faded = rest + (color - rest) * left**2 * (3.0 - 2.0 * left)
    # One place tells the distance here, nine there.
    assert np.abs(layered() - faded)[ground & (own == 0)].max() < 0.05


def test_shadows_of_a_layers_things_fall_on_the_rest(scene):
    new_camera("Side", looking((-6, -5, 5), (40, 0, 0)))
    add("ORDER")
    # The layer's camera looks away, so that only the shadow is left.
    image = layered()
    np.testing.assert_array_equal(image, alone(scene, {"Wall", "Floor"}))
    bpy.data.objects["Thing"].visible_shadow = False
    assert (layered() - image).max() > 0.2


def test_an_own_frustum_alone_needs_no_rig(scene, addon):
    cycles = addon("cycles.layers")

    def is_ordinary():
        passing = cycles.temporary_scene.TemporaryScene(scene, scene.view_layers[0])
        try:
            return cycles.layer_views.read_views(passing, master).views[0].place is not None
        finally:
            passing.remove()

    master = bpy.data.objects["Master"]
    assert is_ordinary()
    far = master.scfpf.surfaces[-1].object
    for owner, name, value in (
        (far, "location", (0.05, 0.0, 0.0)),
        (master.scfpf, "u_range", (0.0, 0.9)),
        (master.data, "lens", 51.0),
        (scene.render, "resolution_x", 2 * WIDTH),
    ):
        before = getattr(owner, name)
        before = tuple(before) if isinstance(value, tuple) else before
        setattr(owner, name, value)
        assert not is_ordinary()
        setattr(owner, name, before)
        assert is_ordinary()
    # A surface that other renders show is hidden from the rays of rigs alone.
    far.hide_render = False
    assert not is_ordinary()
    far.hide_render = True
    passing = cycles.temporary_scene.TemporaryScene(scene, scene.view_layers[0])
    try:
        views = cycles.layer_views.read_views(passing, master).views
        volume, before = master.scfpf.volume_object, set(bpy.data.objects)
        with cycles.layer_eyes.seen_through(passing, views[0]):
            assert addon("cycles.engine_choice").f12_warning(passing.scene) == ""
            addon("bridge.sync.camera_sync").sync()
            assert len(bpy.data.objects) == len(before) + 1
            assert master.scfpf.volume_object == volume
        assert set(bpy.data.objects) == before
        assert master.scfpf.volume_object == volume and volume.parent == master
    finally:
        passing.remove()


def composed(scene):
    """The nodes of a scene's compositor, and their links."""
    tree = scene.compositing_node_group if bpy.app.version >= (5, 0, 0) else scene.node_tree
    if tree is None:
        return None
    return [node.name for node in tree.nodes], [
        (link.from_socket.identifier, link.to_node.name, link.to_socket.identifier) for link in tree.links
    ]


def state(scene):
    """The RNA properties of a scene and its objects, what is in the file, and where objects are linked."""

    def values(owner, depth=0):
        found = {}
        for prop in owner.bl_rna.properties:
            name = prop.identifier
            if name in ("rna_type", "report", "bl_rna") or (prop.is_readonly and prop.type != "POINTER"):
                continue
            value = getattr(owner, name)
            if prop.type == "POINTER":
                is_own = value is not None and not isinstance(value, bpy.types.ID)
                if not is_own:
                    found[name] = repr(value)
                elif depth < 2:
                    found[name] = values(value, depth + 1)
            elif prop.type != "COLLECTION":
                found[name] = tuple(value) if getattr(prop, "is_array", False) else value
        return found

    def layers(layer):
        return values(layer), [layers(child) for child in layer.children]

    return {
        "data": {
            prop.identifier: sorted(each.name_full for each in getattr(bpy.data, prop.identifier))
            for prop in bpy.data.bl_rna.properties
            if prop.type == "COLLECTION" and prop.identifier not in ("all_ids", "images", "node_groups")
        },
        "render": values(scene.render),
        "cycles": values(scene.cycles),
        "scene": [repr(scene.camera), scene.frame_current, repr(scene.world), [*scene.keys()]],
        "layers": [(values(each), layers(each.layer_collection)) for each in scene.view_layers],
        "objects": {
            obj.name: (values(obj), sorted(obj.keys()), [c.name for c in obj.users_collection])
            for obj in bpy.data.objects
        },
        "compositor": composed(scene),
        "drivers": {obj.name: obj.animation_data is None for obj in bpy.data.objects},
    }


@pytest.mark.parametrize("end", ["all", "Esc", "error"])
def test_the_scene_is_as_before(scene, addon, end, monkeypatch):
    side = new_camera("Side", looking((-6, -5, 5), (-0.5, 0, 0)))
    if end != "Esc":
        flexible(side)
    add("DEPTH").size = 0.8, 0.7
    if end == "all":
        # A rig of the artist's own stays, and goes on skipping.
        bpy.context.view_layer.objects.active = bpy.data.objects["Master"]
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
        assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    bpy.context.view_layer.update()
    before = state(scene)
    jobs = addon("cycles.layers.layers_job")
    if end == "all":
        layered()
    elif end == "Esc":
        job = jobs.LayersJob(bpy.context, bpy.data.objects["Master"])
        for _ in range(3):
            assert job.step()
            job.render(in_window=False)
        job.close()
    else:
        render = jobs.LayersJob.render

        def fail(job, in_window):
            if "Things" not in job.progress:
                return render(job, in_window)
            raise addon("projection.user_error").UserError("No more")

        monkeypatch.setattr(jobs.LayersJob, "render", fail)
        with pytest.raises(RuntimeError, match="No more"):
            layered()
    bpy.context.view_layer.update()
    after = state(scene)
    for name, values in before.items():
        assert after[name] == values, name


def test_an_animation_writes_frames(scene, tmp_path):
    side = new_camera("Side", looking((-6, -5, 5), (-0.5, 0, 0)))
    thing = bpy.data.objects["Thing"]
    for frame, height in ((1, 0.0), (2, 1.5)):
        thing.location.z = height
        thing.keyframe_insert("location", index=2, frame=frame)
        side.keyframe_insert("location", index=2, frame=frame)
    add("ORDER")
    scene.frame_set(1)
    scene.frame_start, scene.frame_end = 1, 2
    first = layered()
    folder = tmp_path / "frames"
    folder.mkdir()
    last = layered(animation=True, filepath=f"{folder}/at_##.exr")
    assert sorted(path.name for path in folder.iterdir()) == ["at_01.exr", "at_02.exr"]
    for name, image in (("at_01.exr", first), ("at_02.exr", last)):
        np.testing.assert_array_equal(passes(folder / name)["ViewLayer.Combined"], image)
    assert scene.frame_current == 1 and thing.location.z == 0.0
    scene.frame_set(2)
    np.testing.assert_array_equal(layered(), last)
    assert np.abs(first - last).max() > 0.1
    with pytest.raises(RuntimeError, match="there is no folder"):
        layered(filepath=str(tmp_path / "nowhere" / "a.png"))


REST = {"Thing", "Wall", "Floor"}


def over(rest, *own):
    """Images (H, W, 4) with alpha over another one, the first on top; and where none has an outline."""
    found, solid = rest, np.ones(rest.shape[:2], bool)
    for image in reversed(own):
        found = image + found * (1 - image[..., 3:])
        solid &= (image[..., 3] == 0) | (image[..., 3] == 1)
    return found, solid


def test_eight_layers_lie_over_one_another_in_the_order_of_the_list(scene):
    scene.cycles.samples = 2
    for k in range(8):
        place = np.array((-4.0 + k, 1.0, 0.5))
        bpy.ops.mesh.primitive_cube_add(location=place, size=1.4)
        bpy.context.object.name = f"Cube {k}"
        glowing(f"Cube {k}", (0.1 + k / 8, 1 - k / 8, 0.2 + k % 3 / 4))
        collected(f"Layer {k}", f"Cube {k}")
        beside = place + np.array(((k % 4 - 1.5) * 0.9, 0.0, (k // 4 - 0.5) * 1.1))
        new_camera(f"Eye {k}", looking(beside + np.array((0.5, -6.0, 1.0)), beside))
    own = [alone(scene, {f"Cube {k}"}, f"Eye {k}", transparent=True) for k in range(8)]
    wanted, solid = over(alone(scene, REST), *own)
    for k in range(8):
        add("ORDER", f"Layer {k}", f"Eye {k}")
    off = np.abs(layered() - wanted).max(axis=2)
    # Each is seen somewhere, and some lie over others.
    depth = np.cumsum([each[..., 3] > 0 for each in own], axis=0)
    for each, count in zip(own, depth, strict=True):
        assert ((each[..., 3] == 1) & (count == 1)).sum() > 10
    assert (depth[-1] > 1).sum() > 50
    assert solid.mean() > 0.6 and off[solid].max() < 1e-4
    assert off.mean() < 0.02


def test_a_layer_shows_a_collection_of_a_library(scene, tmp_path):
    scene.cycles.samples = 2
    bpy.ops.mesh.primitive_cube_add(location=(-2, 0, 0.5))
    bpy.context.object.name = "Guest"
    glowing("Guest", (0.2, 0.9, 0.4))
    collected("Guests", "Guest")
    new_camera("Side", looking((-7, -5, 4), (-2.3, 0, 0.2)))
    own = alone(scene, {"Guest"}, "Side", transparent=True)
    wanted, solid = over(alone(scene, REST), own)
    path = str(tmp_path / "guests.blend")
    bpy.data.libraries.write(path, {bpy.data.collections["Guests"]})
    bpy.data.batch_remove([bpy.data.collections["Guests"], bpy.data.objects["Guest"]])
    with bpy.data.libraries.load(path, link=True) as (_, here):
        here.collections = ["Guests"]
    scene.collection.children.link(here.collections[0])
    assert add("ORDER", "Guests").collection.library is not None
    off = np.abs(layered() - wanted).max(axis=2)
    assert (own[..., 3] == 1).mean() > 0.03 and off[solid].max() < 1e-4


@pytest.mark.parametrize("halo", [0.0, 1.0])
@pytest.mark.parametrize("front", ["DEPTH", "ANCHOR"])
def test_distances_without_materials_are_those_with_them(scene, addon, monkeypatch, front, halo):
    new_camera("Side", looking((-5, -6, 5), (-0.8, 0, 0)))
    bpy.data.objects["Thing"].location.z = 0.4
    add(front).halo = halo
    passing, located = addon("cycles.layers.temporary_scene").TemporaryScene, []
    original = passing.located

    def noted(self, window, size, is_plain):
        located.append(is_plain)
        return original(self, window, size, is_plain)

    monkeypatch.setattr(passing, "located", noted)
    plain = layered()
    assert located and all(located)
    monkeypatch.setattr(addon("cycles.layers.layer_views"), "is_all_opaque", lambda depsgraph: False)
    located.clear()
    np.testing.assert_array_equal(layered(), plain)
    assert located and not any(located)


def principled(material):
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def lead(material, kind, socket="Surface"):
    """Lead a new node to the output of a material."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    links.new(nodes.new(f"ShaderNode{kind}").outputs[0], output.inputs[socket])


def group(material):
    """Mix a transparent shader in a group into the material."""
    tree = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    through = tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(through.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    nodes = material.node_tree.nodes
    node = nodes.new("ShaderNodeGroup")
    node.node_tree = tree
    output = next(each for each in nodes if each.type == "OUTPUT_MATERIAL")
    material.node_tree.links.new(node.outputs[0], output.inputs["Surface"])


def displace(material):
    material.displacement_method = "DISPLACEMENT"
    lead(material, "Displacement", "Displacement")


def unlink(material):
    material.node_tree.links.clear()


OPAQUE = {
    "as it is": lambda material: None,
    "diffuse": lambda material: lead(material, "BsdfDiffuse"),
    "glass": lambda material: lead(material, "BsdfGlass"),
    "a bump": lambda material: lead(material, "Displacement", "Displacement"),
}
OPEN = {
    "alpha": lambda material: setattr(principled(material).inputs["Alpha"], "default_value", 0.5),
    "linked alpha": lambda material: material.node_tree.links.new(
        material.node_tree.nodes.new("ShaderNodeTexNoise").outputs[0], principled(material).inputs["Alpha"]
    ),
    "transparent": lambda material: lead(material, "BsdfTransparent"),
    "hole": lambda material: lead(material, "Holdout"),
    "group": group,
    "volume": lambda material: lead(material, "VolumeScatter", "Volume"),
    "displaced": displace,
    "no surface": unlink,
    "catcher": lambda material: setattr(bpy.data.objects["Floor"], "is_shadow_catcher", True),
    "clear glass": lambda material: setattr(bpy.context.scene.cycles, "film_transparent_glass", True),
}


@pytest.mark.parametrize(("change", "is_opaque"), [*((c, True) for c in OPAQUE), *((c, False) for c in OPEN)])
def test_what_lets_rays_through(scene, addon, change, is_opaque):
    material = bpy.data.materials.new("Coat")
    material.use_nodes = True
    bpy.data.objects["Thing"].data.materials.append(material)
    (OPAQUE | OPEN)[change](material)
    find = addon("cycles.layers.layer_views").is_all_opaque
    render = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    assert render(scene, scene.view_layers[0], find) is is_opaque


def test_a_pane_is_seen_through_where_distances_count(scene):
    for name, color in (("Thing", (1, 0, 0)), ("Wall", (0, 1, 0)), ("Floor", (0, 0, 1))):
        glowing(name, color)
    new_camera("Side", looking((-5, -6, 5), (-0.8, 0, 0)))
    add("DEPTH")
    wanted = layered()
    bpy.ops.mesh.primitive_plane_add(location=(0, -7, 0), size=20, rotation=(np.pi / 2, 0, 0))
    bpy.context.object.name = "Pane"
    assert np.abs(layered() - wanted).mean() > 0.05
    pane = bpy.data.materials.new("Pane")
    pane.use_nodes = True
    lead(pane, "BsdfTransparent")
    bpy.data.objects["Pane"].data.materials.append(pane)
    assert np.abs(layered() - wanted).max() < 1e-5
