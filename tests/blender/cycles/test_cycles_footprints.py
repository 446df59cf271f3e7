# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes that Cycles measures in pixels, through the rig: bump, texture levels, wires and subdivision."""

import math
import os

import bpy
import numpy as np
import pytest
from engine_images import load_pixels
from mathutils import Euler
from rig_scenes import keep_groups, make_volume, reference, start_anew, switch

# What a picture through the rig may differ from that of an ordinary camera by.
CONTRAST, ROOT_MEAN_SQUARE = 0.03, 0.012
# Heights of bump, as shares of the size of a thing.
STEEP = 0.03
SAMPLES = 16


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


def shot(path, engine="CYCLES", samples=SAMPLES):
    """The picture, (H, W, 3), row 0 at the bottom."""
    scene = bpy.context.scene
    scene.render.engine, scene.render.filepath = engine, str(path)
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.cycles.use_adaptive_sampling, scene.cycles.max_bounces = False, 0
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    bpy.ops.render.render(write_still=True)
    return load_pixels(path)[..., :3]


def compare(ours, theirs):
    """Assert that what is shown varies alike."""
    shown = theirs.max(axis=2) > 0
    assert shown.mean() > 0.1 and theirs[shown].std() > 0.08
    assert ours[shown].std() == pytest.approx(theirs[shown].std(), rel=CONTRAST)
    assert math.sqrt(((ours - theirs) ** 2).mean()) < ROOT_MEAN_SQUARE


def new_material(name):
    made = bpy.data.materials.new(name)
    if made.node_tree is None:
        made.use_nodes = True
    return made, made.node_tree


def rough_image():
    """A soft pattern of 256 × 256 pixels, packed."""
    levels = np.kron(np.random.default_rng(1).random((32, 32)), np.ones((8, 8)))
    for _ in range(3):
        levels = sum(np.roll(levels, step, axis) for step in (-3, 3) for axis in (0, 1)) / 4
    image = bpy.data.images.new("Heights", *levels.shape, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.repeat(levels.ravel(), 4).astype(np.float32))
    image.pack()
    return image


def noise(tree, size):
    place, made = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexNoise")
    made.inputs["Scale"].default_value = 12 / size
    tree.links.new(place.outputs["Object"], made.inputs["Vector"])
    return made.outputs[0]


def image(tree, _size):
    made = tree.nodes.new("ShaderNodeTexImage")
    made.image = rough_image()
    return made.outputs[0]


def waves(tree, _size):
    place, made = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeTexWave")
    made.inputs["Scale"].default_value = 4.0
    tree.links.new(place.outputs[0], made.inputs[0])
    return made.outputs[1]


# Heights, and how a material has them: the Bump node, or Displacement by this method.
RELIEFS = {
    "noise": (noise, ""),
    "image": (image, ""),
    "UV": (waves, ""),
    "Bump Only": (noise, "BUMP"),
    "Displacement and Bump": (noise, "BOTH"),
}


def relief(name, size, grain=None):
    """size: of the thing. grain: that of its noise, the same if not given."""
    height, method = RELIEFS[name]
    made, tree = new_material(name)
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.7
    socket = height(tree, grain or size)
    kind = "ShaderNodeDisplacement" if method else "ShaderNodeBump"
    bumps = tree.nodes.new(kind)
    bumps.inputs["Scale" if method else "Distance"].default_value = STEEP * size
    tree.links.new(socket, bumps.inputs["Height"])
    if method:
        made.displacement_method = method
        tree.links.new(bumps.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    else:
        tree.links.new(bumps.outputs[0], shader.inputs["Normal"])
    return made


def add_wall(material, place, size, cells=24):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=cells, y_subdivisions=cells)
    wall = bpy.context.object
    wall.scale, wall.location, wall.rotation_euler = (size,) * 3, place, Euler((math.pi / 2 - 0.4, 0, 0))
    wall.data.materials.append(material)
    return wall


def walls(size):
    """A wall of each relief, near and far: at 3, 3.5 … 40 sizes."""
    depths = np.geomspace(3.0, 40.0, len(RELIEFS))
    for number, (name, depth) in enumerate(zip(RELIEFS, depths, strict=True)):
        across = 0.22 * depth * (number - 2)
        add_wall(relief(name, size), (across * size, depth * size, 0), 0.1 * depth * size)
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle = 3.0, 0.0
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = 1.0, 0.3, -0.4
    bpy.context.scene.collection.objects.link(sun)


def add_camera(width, size):
    camera = reference.add_camera(
        width, width * 5 // 16, lens=30.0, clip_start=0.1 * size, clip_end=100.0 * size
    )
    camera.rotation_euler = math.pi / 2, 0, 0
    bpy.context.view_layer.update()
    return camera


def make_own(addon, camera):
    """Give the camera the volume that sees what it sees, and a rig."""
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, bpy.context.scene)
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}


@pytest.mark.parametrize(("size", "width"), [(0.01, 200), (1.0, 320), (1000.0, 96)])
def test_relief_is_as_through_an_ordinary_camera(addon, tmp_path, size, width):
    """Of small scenes and large ones, near and far in one picture."""
    walls(size)
    camera = add_camera(width, size)
    theirs = shot(tmp_path / "theirs.exr")
    make_own(addon, camera)
    compare(shot(tmp_path / "ours.exr"), theirs)


def test_relief_of_a_bent_volume_is_the_engine_s(addon, tmp_path):
    """The engine takes slopes over its own pixels."""
    camera = reference.add_camera(96, 60)
    make_volume(addon, camera, "bent cubic")
    add_wall(relief("noise", 10.0, 0.5), (0, 0, -12), 12.0).rotation_euler = 0, 0, 0
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle = 3.0, 0.0
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = 0.9, 0.3, -0.4
    bpy.context.scene.collection.objects.link(sun)
    camera.scfpf.samples = 48
    bpy.context.view_layer.update()
    theirs = shot(tmp_path / "theirs.exr", addon("bridge.render.render_engine").ENGINE)
    assert switch(camera) == {"FINISHED"}
    compare(shot(tmp_path / "ours.exr", samples=48), theirs)


def write_png(path, values):
    """A grey image of values (1024, 1024)."""
    pixels = np.ones((1024, 1024, 4), np.float32)
    pixels[..., :3] = values[..., None]
    made = bpy.data.images.new("Made", 1024, 1024)
    made.pixels.foreach_set(pixels.ravel())
    made.filepath_raw, made.file_format = str(path), "PNG"
    made.save()
    bpy.data.images.remove(made)


def checked(tmp_path, side):
    """A glowing material with a check of an image, whose squares have a side in its pixels; and its node."""
    rows, columns = np.mgrid[:1024, :1024]
    write_png(tmp_path / "check.png", (rows // side + columns // side) % 2)
    material, tree = new_material("Check")
    tree.nodes.clear()
    texture, glow, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "Emission", "OutputMaterial")
    )
    texture.image = bpy.data.images.load(str(tmp_path / "check.png"))
    tree.links.new(texture.outputs[0], glow.inputs[0])
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    return material, texture


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="Blender has no texture cache")
def test_levels_of_the_texture_cache_are_as_through_an_ordinary_camera(addon, tmp_path):
    """A fine check, whose coarse levels are grey: in files that Blender makes, then in ready-made ones."""
    scene = bpy.context.scene
    scene.render.use_texture_cache = scene.render.use_auto_generate_texture_cache = True
    material, texture = checked(tmp_path, 32)
    for across, depth, size in ((-0.7, 3.0, 0.5), (0.9, 6.0, 1.0), (0.0, 40.0, 9.0)):
        add_wall(material, (across, depth, 0), size, cells=6)
    camera = add_camera(200, 1.0)
    theirs = shot(tmp_path / "theirs.exr")
    make_own(addon, camera)
    compare(shot(tmp_path / "ours.exr"), theirs)
    assert list(tmp_path.rglob("*.tx")), "Blender has made no levels"
    # Only the files with levels still have the check.
    written = (tmp_path / "check.png").stat().st_mtime
    write_png(tmp_path / "check.png", np.zeros((1024, 1024)))
    os.utime(tmp_path / "check.png", (written, written))
    texture.image.reload()
    scene.render.use_auto_generate_texture_cache = False
    compare(shot(tmp_path / "ours.exr"), theirs)


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="Blender has no texture cache")
def test_levels_are_named_where_pixels_differ_in_size(addon, tmp_path):
    """Beside a panorama of Cycles' own, whose levels are others."""
    scene = bpy.context.scene
    scene.render.use_texture_cache = scene.render.use_auto_generate_texture_cache = True
    material, _ = checked(tmp_path, 16)
    bpy.ops.mesh.primitive_cube_add(size=8)
    bpy.context.object.data.materials.append(material)
    camera = reference.add_camera(96, 48)
    camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    theirs = shot(tmp_path / "theirs.exr")
    camera.data.type = "PERSP"
    make_volume(addon, camera, "equirectangular")
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    ours = shot(tmp_path / "ours.exr")
    assert math.sqrt(((ours - theirs) ** 2).mean()) > 3 * ROOT_MEAN_SQUARE
    settings = addon("cycles.rig_data").rig_of(scene).scfpf_rig
    (caution,) = addon("cycles.cautions").pixel_cautions(settings)
    assert "'Check'" in caution and "Texture Cache" in caution
    scene.render.use_texture_cache = False
    assert addon("cycles.cautions").pixel_cautions(settings) == []


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="Blender has no texture cache")
@pytest.mark.parametrize("field", [60, 90, 120, 180])
def test_levels_of_a_fisheye_are_right_or_named(addon, tmp_path, field):
    """Beside Cycles' own fisheye."""
    scene = bpy.context.scene
    scene.render.use_texture_cache = scene.render.use_auto_generate_texture_cache = True
    material, _ = checked(tmp_path, 16)
    bpy.ops.mesh.primitive_cube_add(size=8)
    bpy.context.object.data.materials.append(material)
    camera = reference.add_camera(128, 128)
    camera.data.type, camera.data.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
    camera.data.fisheye_fov = math.radians(field)
    theirs = shot(tmp_path / "theirs.exr")
    camera.data.type = "PERSP"
    make_volume(addon, camera, "angular_fisheye")
    for slot in camera.scfpf.surfaces:
        edge = {"latitude_end": math.pi / 2 - math.radians(field) / 2}
        addon("bridge.surfaces.surface_object").set_surface_parameters(slot.object, edge)
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    error = math.sqrt(((shot(tmp_path / "ours.exr") - theirs) ** 2).mean())
    settings = addon("cycles.rig_data").rig_of(scene).scfpf_rig
    assert bool(addon("cycles.cautions").pixel_cautions(settings)) == (error > ROOT_MEAN_SQUARE)


def test_wires_in_pixels_are_as_wide_as_through_an_ordinary_camera(addon, tmp_path):
    material, tree = new_material("Wires")
    tree.nodes.clear()
    wires, glow, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Wireframe", "Emission", "OutputMaterial")
    )
    wires.use_pixel_size, wires.inputs["Size"].default_value = True, 2.0
    tree.links.new(wires.outputs[0], glow.inputs[0])
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    for across, depth, size in ((-0.8, 3.0, 0.7), (0.9, 12.0, 3.0)):
        add_wall(material, (across, depth, 0), size, cells=6)
    camera = add_camera(200, 1.0)
    theirs = shot(tmp_path / "theirs.exr")
    make_own(addon, camera)
    compare(shot(tmp_path / "ours.exr"), theirs)


def add_ball(place):
    """A coarse ball that Cycles subdivides as finely as pixels ask for; it shows its facets."""
    material, tree = new_material("Facets")
    tree.nodes.clear()
    facing, glow, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("NewGeometry", "Emission", "OutputMaterial")
    )
    tree.links.new(facing.outputs["True Normal"], glow.inputs[0])
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=place)
    ball = bpy.context.object
    ball.data.materials.append(material)
    modifier = ball.modifiers.new("Subdivision", "SUBSURF")
    if hasattr(modifier, "use_adaptive_subdivision"):
        modifier.use_adaptive_subdivision = True
    else:
        bpy.context.scene.cycles.feature_set = "EXPERIMENTAL"
        ball.cycles.use_adaptive_subdivision = True


def facets(picture):
    """The number of different normals."""
    return len(np.unique(picture.reshape(-1, 3).round(4), axis=0))


def test_subdivision_is_as_fine_outside_the_lens(addon, tmp_path):
    """Before a camera that sees all around, and behind it; the scene's own settings come back."""
    scene = bpy.context.scene
    scene.cycles.dicing_rate, scene.cycles.offscreen_dicing_scale = 4.0, 6.0
    camera = reference.add_camera(160, 80)
    make_volume(addon, camera, "equirectangular")
    add_ball((0, 0, -4))
    add_ball((0, 0, 4))
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    picture = shot(tmp_path / "picture.exr", samples=1)
    inside, outside = facets(picture[:, 40:120]), facets(np.roll(picture, 80, axis=1)[:, 40:120])
    assert inside > 30 and outside == pytest.approx(inside, rel=0.25)
    assert scene.cycles.dicing_camera is not None and scene.cycles.dicing_camera != camera
    assert switch(camera) == {"FINISHED"}
    assert scene.cycles.dicing_camera is None and scene.cycles.offscreen_dicing_scale == 6.0
    scene.cycles.dicing_camera = camera
    for _ in range(2):
        assert switch(camera) == {"FINISHED"}
        assert scene.cycles.dicing_camera == camera and scene.cycles.offscreen_dicing_scale == 6.0
