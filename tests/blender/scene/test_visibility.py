# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray visibility, holdouts and light linking, against Cycles' images."""

import bpy
import numpy as np
import pytest
from shown_materials import add, new_material, picture, scene_with_camera, show

SIZE = 64
# Edges: Cycles' samples lie within a hundredth of a pixel, which may decide at a shadow's.
STEP, MOST_EDGES = 0.01, 0.012
ALL_RAYS = ("camera", "shadow", "glossy", "transmission")


def matt(color):
    return shader("Diffuse", Color=color)


def shader(kind, **inputs):
    material = new_material(kind)
    show(material.node_tree, add(material.node_tree, f"ShaderNodeBsdf{kind}", **inputs).outputs[0])
    return material


def thing(name, material, location, size=0.3, hidden=()):
    """A cube that is invisible to some rays."""
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    made = bpy.context.object
    made.name = name
    made.data.materials.append(material)
    for ray in hidden:
        setattr(made, f"visible_{ray}", False)
    return made


def ground(material, size=4.0, location=(0, 0, -0.5), rotation=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=rotation)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def sun(name="Sun", rotation=(0.5, 0.6, 0), energy=3.0):
    bpy.ops.object.light_add(type="SUN", rotation=rotation)
    made = bpy.context.object
    made.name, made.data.energy, made.data.angle = name, energy, 0.0
    return made


@pytest.fixture
def stage():
    """A ground and a camera above; Cycles without indirect light."""
    scene = scene_with_camera(SIZE)
    scene.cycles.diffuse_bounces = 0
    for node in scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0.0
    ground(matt((0.8, 0.7, 0.6)))
    return scene


def assert_alike(scene, tmp_path):
    """Compare with the sum of Cycles' images of one lamp each: of several it picks one for each sample."""
    ours = picture(scene, "SCFPF", tmp_path)
    lamps = [each for each in bpy.data.objects if each.type == "LIGHT"]
    cycles = np.zeros_like(ours)
    for lamp in lamps:
        for other in lamps:
            other.hide_render = other is not lamp
        made = picture(scene, "CYCLES", tmp_path)
        cycles[..., :3] += made[..., :3]
        cycles[..., 3] = made[..., 3]
    for lamp in lamps:
        lamp.hide_render = False
    off = np.abs(ours - cycles).max(axis=2) > STEP
    assert off.mean() < MOST_EDGES, off.mean()
    return ours


def collection(name, included=(), left_out=(), children=()):
    made = bpy.data.collections.new(name)
    for each in (*included, *left_out):
        made.objects.link(each)
    for each in children:
        made.children.link(each)
    for state, each in zip(made.collection_objects, made.objects, strict=True):
        state.light_linking.link_state = "EXCLUDE" if each in left_out else "INCLUDE"
    return made


def test_each_ray_meets_objects_visible_to_it(stage, tmp_path):
    sun()
    red, green, blue = (matt(color) for color in ((0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)))
    thing("Casts only", red, (-0.6, -0.6, 0), hidden=("camera", "glossy"))
    thing("Casts none", green, (0, -0.6, 0), hidden=("shadow",))
    thing("Not mirrored", blue, (-0.5, 0.6, -0.2), hidden=("glossy",))
    thing("Only mirrored", green, (0.1, 0.6, -0.2), hidden=("camera", "shadow"))
    thing("Not through glass", red, (0.75, -0.55, -0.3), 0.2, hidden=("transmission",))
    thing("Through glass", green, (0.75, -0.1, -0.3), 0.2)
    ground(shader("Glossy", Roughness=0.0), 1.6, (0, 1.1, 0), (1.2, 0, 0))
    pane = shader("Refraction", IOR=1.0)
    ground(pane, 0.8, (0.75, -0.3, 0.1)).visible_shadow = False
    made = assert_alike(stage, tmp_path)
    for thing_ in bpy.data.objects:
        for ray in ALL_RAYS:
            setattr(thing_, f"visible_{ray}", True)
    plain = assert_alike(stage, tmp_path)
    assert (np.abs(plain - made).max(axis=2) > 0.05).mean() > 0.1


@pytest.mark.parametrize("transparent", [False, True])
def test_holdouts_leave_a_hole(stage, tmp_path, transparent):
    stage.render.film_transparent = transparent
    # No lots are drawn for what is seen through the veil.
    stage.cycles.min_transparent_bounces = 8
    sun()
    thing("Hole", matt((1, 1, 1)), (-0.4, 0, 0)).is_holdout = True
    veil = thing("Veil", shader("Transparent", Color=(0.5, 0.7, 0.6)), (-0.3, 0.1, 0.5))
    veil.visible_shadow = False
    behind = bpy.data.collections.new("Holes")
    stage.collection.children.link(behind)
    other = thing("Another", matt((1, 1, 1)), (0.5, 0, 0))
    behind.objects.link(other)
    stage.collection.objects.unlink(other)
    bpy.context.view_layer.layer_collection.children["Holes"].holdout = True
    made = assert_alike(stage, tmp_path)
    alpha = made[..., 3]
    assert alpha.max() == 1.0 and alpha.min() == 0.0 and (alpha[-1, 0] == 0.0) == transparent


def test_lamps_light_their_receivers_and_blockers_cast_their_shadows(stage, tmp_path):
    cubes = [thing(f"Cube {n}", matt((0.7, 0.7, 0.7)), (-0.9 + 0.6 * n, 0.2 * n, 0)) for n in range(4)]
    inner = bpy.data.collections.new("Instanced")
    inner.objects.link(cubes[3])
    stage.collection.objects.unlink(cubes[3])
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", inner
    stage.collection.objects.link(empty)
    floor = bpy.data.objects["Plane"]
    first, second, third = (
        sun(name, turn, energy)
        for name, turn, energy in (
            ("First", (0.5, 0.6, 0), 2.0),
            ("Second", (-0.5, 0.5, 0), 1.0),
            ("Third", (0.2, -0.6, 0), 1.5),
        )
    )
    first.light_linking.receiver_collection = collection("Lit", [floor, cubes[0]])
    first.light_linking.blocker_collection = collection("Before it", left_out=[cubes[1]])
    nested = collection("Nested", [cubes[2], cubes[1]])
    second.light_linking.receiver_collection = collection("Nearly all", [floor, empty], [cubes[1]], [nested])
    second.light_linking.blocker_collection = collection("One", [cubes[2]])
    third.light_linking.blocker_collection = collection("Instance", [empty])
    made = assert_alike(stage, tmp_path)
    for lamp in (first, second, third):
        lamp.light_linking.receiver_collection = lamp.light_linking.blocker_collection = None
    plain = assert_alike(stage, tmp_path)
    assert (np.abs(plain - made).max(axis=2) > 0.05).mean() > 0.1


def test_lamps_without_diffuse_light_or_highlights(stage, tmp_path):
    """A ground of a matte and a metal half, the latter by Cycles' own share of it."""
    sun("Dull").visible_glossy = False
    sun("Shiny", (-0.2, 0.1, 0)).visible_diffuse = False
    matt_part = assert_alike(stage, tmp_path)
    assert matt_part.max() == pytest.approx(1.0)
    bpy.data.objects["Plane"].data.materials[0] = shader("Glossy", Roughness=0.5)
    shiny = picture(stage, "SCFPF", tmp_path)
    bpy.data.objects["Dull"].hide_render = True
    assert np.array_equal(picture(stage, "SCFPF", tmp_path), shiny) and shiny[..., :3].max() > 0.3


def test_scenes_without_visibility_store_no_more(stage, read_render):
    thing("Cube", matt((1, 1, 1)), (0, 0, 0))
    sun()
    scene = read_render()
    assert scene.geometry.visibility is None and scene.geometry.linked is None
    assert len(scene.geometry.triangles) == 14
