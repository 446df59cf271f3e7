# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers through Cycles, compared with Blender's own renders of the same things."""

import bpy
import numpy as np
import pytest
from engine_images import f12
from mathutils import Matrix, Vector
from rig_scenes import keep_groups

WIDTH, HEIGHT = 48, 32


def looking(place, at=(0, 0, 0)):
    way = Vector(at) - Vector(place)
    return Matrix.Translation(place) @ way.to_track_quat("-Z", "Y").to_matrix().to_4x4()


def new_camera(name, matrix):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    bpy.context.scene.collection.objects.link(camera)
    camera.matrix_world, camera.data.clip_end = matrix, 60.0
    return camera


def flexible(camera, preset="perspective"):
    master = bpy.context.scene.camera
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    bpy.context.scene.camera = master


def collected(name, *objects):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for each in objects:
        made.objects.link(bpy.data.objects[each])


def glowing(name, color):
    """An object that shines in one colour, and so has no noise."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (*color, 1)
    tree.links.new(emission.outputs[0], output.inputs[0])
    bpy.data.objects[name].data.materials.append(material)


@pytest.fixture
def scene(engine_scene):
    """A cube on a floor before a second one, seen by a flexible camera."""
    bpy.data.objects["Cube"].name = "Thing"
    collected("Things", "Thing")
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 3.0, 0.5), size=3.0)
    bpy.context.object.name = "Wall"
    bpy.ops.mesh.primitive_plane_add(location=(0, 0, -1), size=30)
    bpy.context.object.name = "Floor"
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = WIDTH, HEIGHT
    camera = engine_scene.camera
    camera.name = "Master"
    flexible(camera)
    camera.matrix_world = looking((0, -9, 2))
    cycles = engine_scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling, cycles.seed = 16, False, False, 7
    keep_groups()
    return engine_scene


def add(front="DEPTH", collection="Things", seen_by="Side"):
    bpy.context.view_layer.objects.active = bpy.data.objects["Master"]
    given = {"camera": "Master", "collection": collection, "seen_by": seen_by, "front": front}
    assert bpy.ops.scfpf.layer_add(**given) == {"FINISHED"}
    return bpy.data.objects["Master"].scfpf.layers[-1]


def result():
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def layered(**options):
    """The picture of the button, (H, W, 4)."""
    assert bpy.ops.scfpf.layers_render(camera="Master", **options) == {"FINISHED"}
    return result()


def things(scene):
    return [obj for obj in scene.objects if obj.type == "MESH" and obj.scfpf_surface.kind == "NONE"]


def alone(scene, names, camera="Master", transparent=False):
    """Blender's F12 of some objects by Cycles; the others are not seen, but cast shadows and light."""
    seer, before = bpy.data.objects[camera], (scene.camera, scene.render.engine)
    bpy.context.view_layer.objects.active = seer
    for obj in things(scene):
        obj.visible_camera = obj.name in names
    if seer.scfpf.enabled:
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    else:
        scene.camera, scene.render.engine = seer, "CYCLES"
    scene.render.film_transparent = transparent
    image = f12(scene)["ViewLayer.Combined"]
    scene.render.film_transparent = False
    if seer.scfpf.enabled:
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    scene.camera, scene.render.engine = before
    for obj in things(scene):
        obj.visible_camera = True
    return image


def test_a_layer_seen_by_the_cameras_own_twin_is_the_plain_render(scene):
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
@pytest.mark.parametrize(("size", "position"), [((1.0, 1.0), (0.5, 0.5)), ((0.75, 0.5), (0.625, 0.75))])
def test_the_picture_of_a_layers_camera_has_its_place(scene, kind, size, position):
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
    np.save("/tmp/lay/b.npy", np.stack([expected, rest, image]))
    assert 0.02 < covered.mean() < 0.6
    # The filter draws other places in the pixels of images of another size.
    around = np.pad(covered, 1)
    around = np.any([np.roll(around, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
    apart = ~around[1:-1, 1:-1]
    np.testing.assert_array_equal(image[apart], rest[apart])
    off = np.abs(image - expected).max(axis=2)
    assert off[covered].mean() < 0.03
    assert np.median(off[covered]) < 1e-5
