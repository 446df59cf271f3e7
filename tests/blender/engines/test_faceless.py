# SPDX-License-Identifier: GPL-3.0-or-later
"""Grease Pencil, hair and points through bent volumes, beside meshes of the same shape."""

import bpy
import numpy as np
import pytest
from layer_scenes import flexible

WIDTH, HEIGHT = 128, 72
ROWS, STEPS, RADIUS = 4, 24, 0.3


def lines():
    """Places (ROWS, STEPS, 3) of wavy lines before a wall, at several depths."""
    along = np.linspace(-4.0, 4.0, STEPS)
    return np.array(
        [
            [(x, 0.9 * (row - 2) + 0.3 * np.sin(x + row), -4.0 + 0.8 * row + 0.2 * x) for x in along]
            for row in range(ROWS)
        ]
    )


def hair():
    """Lines as hair curves."""
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([STEPS] * ROWS)
    curves.position_data.foreach_set("vector", lines().astype(np.float32).ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(ROWS * STEPS, RADIUS, np.float32))
    return linked(curves)


def strokes():
    """Lines as strokes of Grease Pencil."""
    kind = "grease_pencils" if bpy.app.version >= (5, 0, 0) else "grease_pencils_v3"
    pencil = getattr(bpy.data, kind).new("Lines")
    pencil.stroke_depth_order = "3D"
    drawing = pencil.layers.new("Lines").frames.new(1).drawing
    drawing.add_strokes([STEPS] * ROWS)
    for stroke, places in zip(drawing.strokes, lines(), strict=True):
        for point, place in zip(stroke.points, places, strict=True):
            point.position, point.radius, point.opacity = place, RADIUS, 1.0
    return linked(pencil)


def dots():
    """The places of lines as points."""
    places = lines().reshape(-1, 3).tolist()
    mesh = bpy.data.meshes.new("Dots")
    mesh.from_pydata(places, [], [])
    obj = linked(mesh)
    nodes = bpy.data.node_groups.new("Dots", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        nodes.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, points, end = (
        nodes.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeMeshToPoints", "NodeGroupOutput")
    )
    points.inputs["Radius"].default_value = RADIUS
    nodes.links.new(begin.outputs[0], points.inputs[0])
    nodes.links.new(points.outputs[0], end.inputs[0])
    obj.modifiers.new("Dots", "NODES").node_group = nodes
    return obj


def linked(data):
    obj = bpy.data.objects.new("Thing", data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


@pytest.mark.parametrize("make", [hair, strokes, dots])
def test_stand_ins_are_where_the_things_are(scene, addon, make):
    thing = make()
    thing.location = (1.0, 0.0, 0.0)
    reading = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    read = addon("engines.faceless").read_stand_ins
    found = reading(scene, bpy.context.view_layer, read)
    places = lines().reshape(-1, 3) + np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(found.vertices.min(axis=0), places.min(axis=0), atol=2.0 * RADIUS)
    np.testing.assert_allclose(found.vertices.max(axis=0), places.max(axis=0), atol=2.0 * RADIUS)
    away = np.linalg.norm(found.vertices[:, None] - places, axis=2).min(axis=1)
    assert away.max() < 2.0 * RADIUS
    thing.hide_render = True
    assert reading(scene, bpy.context.view_layer, read) is None


def test_particle_hair_has_stand_ins(scene, addon):
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(1.0, 0.0, -3.0))
    system = bpy.context.object.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system
    system.settings.type, system.settings.count, system.settings.hair_length = "HAIR", 40, 0.5
    reading = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    found = reading(scene, bpy.context.view_layer, addon("engines.faceless").read_stand_ins)
    low, high = found.vertices.min(axis=0), found.vertices.max(axis=0)
    np.testing.assert_allclose(low, (0.5, -0.5, -3.0), atol=0.1)
    np.testing.assert_allclose(high, (1.5, 0.5, -2.5), atol=0.1)


def emission(name, color):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    glow, output = (tree.nodes.new(kind) for kind in ("ShaderNodeEmission", "ShaderNodeOutputMaterial"))
    glow.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    return material


@pytest.fixture
def scene():
    """A green wall, and a blue pillar that hides a part of what is before the wall."""
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    for name, color, at, scale in (
        ("Wall", (0, 1, 0), (0, 0, -8), (60, 60, 0.1)),
        ("Pillar", (0, 0, 1), (1, 0, -2.6), (0.4, 20, 0.1)),
    ):
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=at)
        bpy.context.object.scale = scale
        bpy.context.object.data.materials.append(emission(name, color))
    bpy.ops.object.camera_add(location=(0, 0, 2.5))
    scene.camera = bpy.context.object
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 1, False, 0
    scene.cycles_curves.shape, scene.cycles_curves.subdivisions = "THICK", 3
    scene.eevee.taa_render_samples = 1
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("World")
    return scene


def solid(kind):
    """A mesh of the same shape as hair, strokes or dots."""
    if kind is dots:
        for place in lines().reshape(-1, 3):
            bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=RADIUS, location=place)
        return
    curve = bpy.data.curves.new("Solid", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution, curve.use_fill_caps = "3D", RADIUS, 6, True
    for line in lines():
        spline = curve.splines.new("POLY")
        spline.points.add(STEPS - 1)
        for point, place in zip(spline.points, line, strict=True):
            point.co = (*place, 1.0)
    linked(curve)


def rendered(addon, scene, renderer=""):
    """The picture (H, W, 4) by another engine."""
    addon("engines.anchors_job").render_anchors(bpy.context, scene.camera, renderer=renderer)
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(HEIGHT, WIDTH, 4)


def edges(image):
    """Pixels beside others of other colours, (H, W)."""
    grown = np.pad(image, [(1, 1), (1, 1), (0, 0)], mode="edge")
    beside = [grown[i : i + HEIGHT, j : j + WIDTH] for i in range(3) for j in range(3)]
    return (np.max(beside, axis=0) - np.min(beside, axis=0)).max(axis=2) > 0.1


@pytest.mark.parametrize(
    ("make", "preset", "engine"),
    [
        (hair, "deep_curvy_volume", "cycles"),
        (strokes, "deep_curvy_volume", "cycles"),
        (dots, "inverted_perspective", "cycles"),
        pytest.param(strokes, "cylindrical_panorama", "eevee", marks=pytest.mark.once),
    ],
)
def test_things_without_faces_are_where_meshes_are(scene, addon, make, preset, engine):
    """Beside pictures of meshes of the same shape, whose hits are the caster's."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 4
    thing = make()
    renderer = addon("bridge.blender.versions").EEVEE if engine == "eevee" else "CYCLES"
    image = rendered(addon, scene, renderer)
    bpy.data.objects.remove(thing)
    without = rendered(addon, scene)
    solid(make)
    wanted = rendered(addon, scene)
    off, inner = np.abs(image - wanted).max(axis=2) > 0.25, ~edges(wanted)
    is_thing = np.abs(wanted - without).max(axis=2) > 0.25
    assert is_thing.sum() > 100
    # Strokes are flat with round ends, and the solids round with flat ones.
    assert off[inner].mean() <= (0.004 if make is strokes else 0.001)
    shown = np.abs(image - without).max(axis=2) > 0.25
    assert abs(shown.sum() / is_thing.sum() - 1.0) < (0.08 if make is strokes else 0.05)


@pytest.mark.once
def test_a_scene_of_strokes_alone(scene, addon):
    """It needs no mesh: the strokes are where they are before a wall, and the world is around them."""
    wall, pillar = (obj for obj in scene.objects if obj.type == "MESH")
    flexible(scene.camera, "deep_curvy_volume")
    scene.camera.scfpf.samples = 4
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 1.0, 0.0, 1.0)
    bpy.data.objects.remove(pillar)
    strokes()
    wanted = rendered(addon, scene)
    bpy.data.objects.remove(wall)
    image = rendered(addon, scene)
    assert (wanted[..., 1] < 0.5).mean() > 0.02
    off = np.abs(image - wanted)[..., :3].max(axis=2) > 0.25
    assert off[~edges(wanted)].mean() <= 0.002 and off.mean() <= 0.03
