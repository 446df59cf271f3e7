# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers, against Cycles' images."""

import bpy
import numpy as np
import pytest
from engine_images import f12, passes, write_multilayer
from shown_materials import add, new_material, picture, scene_with_camera, show

SIZE = 48
# Colours in 1/255, and edges: Cycles' samples lie within a hundredth of a pixel, which may decide there.
STEP, MOST_EDGES = 1 / 255, 0.012
# Of soft shadows and the sky, by samples.
NOISE = 0.04


def plain(kind, **inputs):
    material = new_material(kind)
    show(material.node_tree, add(material.node_tree, f"ShaderNodeBsdf{kind}", **inputs).outputs[0])
    return material


def thing(location, material, size=0.5):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def lamp(kind, energy, color, **settings):
    bpy.ops.object.light_add(type=kind, rotation=settings.pop("rotation", (0, 0, 0)))
    made = bpy.context.object
    made.location = settings.pop("location", (0, 0, 4))
    made.data.energy, made.data.color = energy, color
    for name, value in settings.items():
        setattr(made.data, name, value)
    return made


def shine(scene, strength):
    for node in scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = strength


@pytest.fixture
def stage():
    """A catcher, a cube above it and one below; Cycles without indirect light."""
    scene = scene_with_camera(SIZE)
    scene.cycles.max_bounces = 0
    shine(scene, 0.0)
    bpy.ops.mesh.primitive_plane_add(size=2.4, location=(0, 0, -0.5))
    bpy.context.object.name = "Catcher"
    bpy.context.object.is_shadow_catcher = True
    bpy.context.object.data.materials.append(plain("Diffuse", Color=(0.8, 0.5, 0.3)))
    thing((0.1, 0.1, 0.3), plain("Diffuse", Color=(0.2, 0.6, 0.4)))
    thing((0.8, -0.6, -1.2), plain("Diffuse", Color=(0.9, 0.1, 0.1)))
    return scene


def assert_alike(ours, cycles, step=STEP, most=MOST_EDGES):
    off = np.abs(ours - cycles).max(axis=2) > step
    assert off.mean() < most, (off.mean(), np.abs(ours - cycles).mean())


def test_suns_and_points_leave_their_shadow_in_alpha(stage, tmp_path):
    """One lamp at a time, because of Cycles' light tree. A veil with nodes takes its share."""
    stage.render.film_transparent = True
    first = lamp("SUN", 3.0, (1.0, 0.5, 0.2), rotation=(-0.7, 0.6, 0), angle=0.0)
    sunny = picture(stage, "SCFPF", tmp_path)
    assert_alike(sunny, picture(stage, "CYCLES", tmp_path))
    alpha = sunny[..., 3]
    caught = (sunny[..., :3].max(axis=2) == 0.0) & (alpha > 0.0)
    # The ground itself is gone, and so is what stands below it.
    assert 0.05 < caught.mean() < 0.5 and (alpha == 0.0).mean() > 0.3
    assert not (sunny[..., 0] > sunny[..., 1]).any()
    bpy.ops.mesh.primitive_plane_add(size=1.2, location=(0, 0, 0.8))
    bpy.context.object.visible_shadow = False
    bpy.context.object.data.materials.append(plain("Transparent", Color=(0.5, 0.5, 0.5)))
    veiled = picture(stage, "SCFPF", tmp_path)[..., 3]
    # Where nothing is caught the veil is half there; Cycles' shadow would lose a share more behind it.
    assert set(np.unique(veiled)) == {0.0, 0.5, 1.0} and (veiled == 0.5).sum() > 200
    assert np.array_equal(veiled == 1.0, alpha == 1.0)
    bpy.data.objects.remove(bpy.context.object)
    bpy.data.objects.remove(first)
    lamp("POINT", 400.0, (1.0, 1.0, 1.0), location=(-1, 1, 3), shadow_soft_size=0.0)
    assert_alike(picture(stage, "SCFPF", tmp_path), picture(stage, "CYCLES", tmp_path))


def test_soft_and_coloured_shadows_of_several_lamps_and_the_sky(stage, tmp_path):
    """The pass by colour, and the image without it; a wall that catches shadows casts none."""
    stage.camera.scfpf.samples, stage.cycles.samples = 16, 64
    stage.render.resolution_percentage = 67
    shine(stage, 1.0)
    lamp("SUN", 1.5, (1.0, 0.5, 0.2), rotation=(-0.7, 0.6, 0), angle=0.1)
    lamp("AREA", 60.0, (0.2, 0.5, 1.0), location=(-0.6, 0.6, 1.2), size=1.5)
    bpy.ops.mesh.primitive_plane_add(size=2, location=(-1.1, 0, 0), rotation=(0, 1.3, 0))
    bpy.context.object.is_shadow_catcher = True
    bpy.context.object.data.materials.append(bpy.data.objects["Catcher"].data.materials[0])
    stage.render.film_transparent = True
    ours, cycles = picture(stage, "SCFPF", tmp_path), picture(stage, "CYCLES", tmp_path)
    mine, its = ours[..., 3], cycles[..., 3]
    assert np.abs(mine - its).mean() < NOISE / 2 and abs(mine.mean() / its.mean() - 1.0) < NOISE
    layer = stage.view_layers[0]
    layer.scfpf.use_pass_shadow_catcher = layer.cycles.use_pass_shadow_catcher = True
    stage.render.engine = "SCFPF"
    write_multilayer(stage, tmp_path / "ours")
    made = f12(stage)
    stage.render.engine = "CYCLES"
    write_multilayer(stage, tmp_path / "theirs")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    theirs = passes(tmp_path / "theirs.exr")
    mine, its = (each["ViewLayer.Shadow Catcher"] for each in (made, theirs))
    assert np.abs(mine - its).mean() < NOISE / 2 and np.ptp(its.mean(axis=(0, 1))) > 0.01
    assert abs(mine.mean() / its.mean() - 1.0) < 0.01
    whole = np.isin(ours[..., 3], 1.0)
    assert np.array_equal(made["ViewLayer.Combined"][whole], ours[whole])
    assert made["ViewLayer.Combined"][~whole].sum() < ours[~whole].sum()


def test_an_opaque_film_shows_the_world_in_shadow(stage, tmp_path):
    """Only the shadow is visible where projectors leave the volume; the passes add up to it."""
    shine(stage, 1.0)
    stage.cycles.samples, stage.render.resolution_percentage = 32, 50
    lamp("SUN", 3.0, (1.0, 1.0, 1.0), rotation=(-0.7, 0.6, 0), angle=0.0)
    ours, cycles = picture(stage, "SCFPF", tmp_path), picture(stage, "CYCLES", tmp_path)
    assert np.abs(ours - cycles).mean() < NOISE / 3 and ours[..., 3].min() == 1.0
    tree = stage.world.node_tree
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(add(tree, "ShaderNodeTexCoord").outputs["Generated"], background.inputs["Color"])
    layer = stage.view_layers[0]
    layer.scfpf.use_pass_diffuse = layer.use_pass_environment = layer.scfpf.use_pass_specular = True
    stage.render.engine = "SCFPF"
    write_multilayer(stage, tmp_path / "parts")
    made = f12(stage)
    total = sum(each for name, each in made.items() if each.shape[2] == 3 and "Normal" not in name)
    assert np.abs(total - made["ViewLayer.Combined"][..., :3]).max() < 1e-5
    for cube in [each for each in bpy.data.objects if each.name.startswith("Cube")]:
        bpy.data.objects.remove(cube)
    alone = picture(stage, "SCFPF", tmp_path)
    # Cycles shows what is darker than black.
    assert_alike(alone, np.maximum(picture(stage, "CYCLES", tmp_path), 0.0))
    assert np.ptp(alone[..., 0]) > 0.1
