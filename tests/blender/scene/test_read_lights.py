# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps and the world: units, colours, extents and positions, some checked against Cycles."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix

SHAPES = ["POINT", "SPOT", "SUN", "SQUARE", "RECTANGLE", "DISK", "ELLIPSE"]


@pytest.fixture
def module(addon):
    return addon("bridge.scene.read_lights")


@pytest.fixture
def read(module):
    """Read a lamp object as evaluated."""

    def read_object(obj):
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return module.read_light(evaluated.data, np.array(evaluated.matrix_world, np.float64))

    return read_object


def new_lamp(shape):
    """A lamp of a type, or an area lamp of a shape."""
    area = shape not in {"POINT", "SPOT", "SUN"}
    lamp = bpy.data.lights.new(shape, "AREA" if area else shape)
    if area:
        lamp.shape, lamp.size, lamp.size_y = shape, 0.3, 0.5
    elif shape == "SUN":
        lamp.angle = 0.2
    else:
        lamp.shadow_soft_size = 0.2
    lamp.energy = 100.0
    obj = bpy.data.objects.new(shape, lamp)
    bpy.context.scene.collection.objects.link(obj)
    return obj


@pytest.mark.parametrize("shape", SHAPES)
def test_colour_is_energy_times_colour_times_exposure(read, shape):
    obj = new_lamp(shape)
    obj.data.color, obj.data.exposure = (1.0, 0.5, 0.25), 2.0
    light = read(obj)
    assert light.color == pytest.approx((400.0, 200.0, 100.0))
    assert light.kind == (shape if shape in {"POINT", "SPOT", "SUN"} else "AREA")
    assert light.angle == pytest.approx(0.2 if shape == "SUN" else 0.0)
    assert light.casts_shadow is True
    obj.data.use_shadow = False
    assert read(obj).casts_shadow is False


def test_extents(read):
    sizes = {"SQUARE": (0.3, 0.3), "RECTANGLE": (0.3, 0.5), "DISK": (0.3, 0.3), "ELLIPSE": (0.3, 0.5)}
    for shape, size in sizes.items():
        obj = new_lamp(shape)
        light = read(obj)
        assert light.size == pytest.approx(size)
        assert light.ellipse is (shape in {"DISK", "ELLIPSE"})
        obj.scale = (2, -3, 5)
        assert read(obj).size == pytest.approx((2 * size[0], 3 * size[1]))


def test_spot_cone_and_soft_size(read):
    obj = new_lamp("SPOT")
    obj.data.spot_size, obj.data.spot_blend = 1.2, 0.4
    light = read(obj)
    assert (light.spot_angle, light.spot_blend, light.radius) == pytest.approx((1.2, 0.4, 0.2))


@pytest.mark.parametrize("shape", SHAPES)
def test_the_matrix_is_a_rotation_and_a_place(read, shape):
    """The matrix of a spot has the object's scale, which makes its cone elliptic."""
    obj = new_lamp(shape)
    obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.3, -0.7, 2), (2, 0.1, 7)
    light = read(obj)
    axes = np.array(obj.rotation_euler.to_matrix()) * ((2, 0.1, 7) if shape == "SPOT" else 1.0)
    assert light.matrix[:3, :3] == pytest.approx(axes, abs=1e-6)
    assert light.matrix[:, 3] == pytest.approx((1, 2, 3, 1))


def test_a_point_needs_no_scale_and_a_sun_only_one(read):
    for shape, scale, expected in (
        ("POINT", (0, 0, 0), True),
        ("SUN", (0, 0, 1), True),
        ("SUN", (1, 1, 0), False),
        ("SPOT", (1, 0, 1), False),
    ):
        obj = new_lamp(shape)
        obj.rotation_euler, obj.scale = (0.3, -0.7, 2), scale
        light = read(obj)
        assert (light is not None) == expected
        if light is not None:
            axes = light.matrix[:3, :3]
            assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-6) and np.linalg.det(axes) > 0
            if shape == "SUN":
                assert axes[:, 2] == pytest.approx(np.array(obj.rotation_euler.to_matrix())[:, 2], abs=1e-6)


def test_temperature_tints(read):
    obj = new_lamp("POINT")
    obj.data.use_temperature, obj.data.temperature = True, 3000
    light = read(obj)
    assert light.color == pytest.approx(100 * np.array(obj.data.temperature_color))
    assert light.color[0] > light.color[1] > light.color[2] > 0


def test_nodes_tint(read):
    obj = new_lamp("POINT")
    lamp = obj.data
    if lamp.node_tree is None:
        lamp.use_nodes = True
    emission = next(node for node in lamp.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Color"].default_value = (0.5, 1, 0, 1)
    emission.inputs["Strength"].default_value = 3
    assert read(obj).color == pytest.approx((150, 300, 0))


def test_lamps_without_light_or_place_are_dropped(module, read):
    for change in ({"energy": 0.0}, {"color": (0, 0, 0)}):
        obj = new_lamp("POINT")
        for name, value in change.items():
            setattr(obj.data, name, value)
        assert read(obj) is None
    lamp = new_lamp("SQUARE")
    for matrix in (np.zeros((4, 4)), np.diag([1, 0, 1, 1.0]), np.full((4, 4), np.nan)):
        assert module.read_light(lamp.data, matrix) is None


def test_animated_energy_is_read_as_evaluated(read):
    obj = new_lamp("POINT")
    for frame, energy in ((1, 10.0), (11, 20.0)):
        obj.data.energy = energy
        obj.data.keyframe_insert("energy", frame=frame)
    bpy.context.scene.frame_set(6)
    assert read(obj).color == pytest.approx((15, 15, 15))


def cycles_brightness(path):
    """Mean of a 4 × 4 image by Cycles."""
    scene = bpy.context.scene
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(4 * 4 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return float(pixels.reshape(-1, 4)[:, :3].mean())


@pytest.fixture
def lit_plane():
    """A small white diffuse plane at the origin, seen from above in raw float values by Cycles."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.mesh.primitive_plane_add(size=0.2)
    material = bpy.data.materials.new("White")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    diffuse = material.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    output = material.node_tree.nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs[0], output.inputs[0])
    bpy.context.object.data.materials.append(material)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 0.1
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.location.z = 1
    return scene


@pytest.mark.parametrize("shape", SHAPES)
def test_brightness_is_that_of_cycles(lit_plane, read, tmp_path, shape):
    """Ten units above a white diffuse plane, normalized or not, scaled, bright and tinted."""
    obj = new_lamp(shape)
    obj.location.z = 10
    obj.data.exposure = 0.5
    obj.data.use_temperature, obj.data.temperature = True, 4000
    for normalize, scale in ((True, 1.0), (False, 2.0)):
        obj.data.normalize, obj.scale = normalize, (scale, scale, scale)
        light = read(obj)
        # Irradiance on the axis: I/d², with I = W/4π for POINT and SPOT and W/π for a small AREA.
        per_watt = {"SUN": 1.0, "AREA": 1 / (math.pi * 100)}.get(light.kind, 1 / (4 * math.pi * 100))
        exitant = light.color.mean() * per_watt / math.pi
        assert cycles_brightness(tmp_path / "lit.exr") == pytest.approx(exitant, rel=0.02)


def test_world_colour(addon):
    scene = bpy.context.scene
    scene.world = None

    def read_world():
        depsgraph = bpy.context.evaluated_depsgraph_get()
        module = addon("bridge.scene.read_world")
        found = module.read_world(depsgraph.scene_eval, depsgraph.view_layer_eval)
        assert found[1] is None and found[2] == ()
        return found[0]

    assert not read_world().any()
    world = scene.world = bpy.data.worlds.new("World")
    world.color = (0.1, 0.2, 0.3)
    if world.node_tree is None:
        assert read_world() == pytest.approx((0.1, 0.2, 0.3))
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.5, 0.25, 1, 1)
    background.inputs["Strength"].default_value = 2
    assert read_world() == pytest.approx((1, 0.5, 2))


def test_instanced_lamps_stand_where_their_instances_do(addon):
    inside = bpy.data.collections.new("Inside")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    inside.objects.link(lamp)
    for x in (3, 5):
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", inside
        empty.matrix_world = Matrix.Translation((x, 0, 0)) @ Matrix.Scale(x, 4)
        bpy.context.scene.collection.objects.link(empty)
    bpy.ops.mesh.primitive_plane_add()
    lights = addon("bridge.scene.read_scene").read_scene(bpy.context.evaluated_depsgraph_get()).lights
    assert sorted(light.matrix[0, 3] for light in lights) == pytest.approx([3, 5])
    size = lamp.data.size
    assert sorted(light.size[0] for light in lights) == pytest.approx([3 * size, 5 * size])
