# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that Cycles sees through the rig is that of its own cameras: blurred, in motion, denoised too."""

import math

import bpy
import numpy as np
import pytest
from engine_images import f12, load_pixels, write_multilayer
from mathutils import Euler
from rig_scenes import keep_groups, reference, start_anew, switch

SIZE, SEEDS = 24, 3
SAMPLES = 32
# Two pictures whose pixels differ by noise alone differ by its mean square; so much more is allowed.
MORE_THAN_NOISE = 1.5
# Noise in the fog of a world is so much more, for a reason unknown; elsewhere it is the same.
FOG_NOISE, SAME_NOISE = 0.6, 0.3
# The mean of a picture is off by at most so many times what noise makes likely.
LIKELY = 5.0


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


def render_pixels(path, seed=0, samples=SAMPLES, denoise=False):
    """The picture that Cycles makes of the scene, (H, W, 4), row 0 at the bottom."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.seed = samples, seed
    scene.cycles.use_denoising = denoise
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return load_pixels(path)


def lit_scene():
    """Diffuse balls over a floor, a large lamp, a bright world: much indirect light, no fireflies."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 0, -2))
    for place in ((-1.5, 6, -0.5), (1.2, 7, -0.3), (0, 5, -1.2)):
        bpy.ops.mesh.primitive_uv_sphere_add(location=place)
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.size, lamp.energy = 4.0, 400.0
    placed = bpy.data.objects.new("Lamp", lamp)
    placed.location = (2, 3, 5)
    scene.collection.objects.link(placed)
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.4, 0.6, 1)


def add_camera(kind):
    """A camera of Blender's that lit_scene is seen well with."""
    camera = reference.add_camera(SIZE, SIZE, clip_start=0.5, clip_end=80.0, lens=30.0, ortho_scale=7.0)
    camera.location, camera.rotation_euler = (0, 0, 1), Euler((math.pi / 2 - 0.15, 0, 0))
    camera.data.type = kind if kind in {"PERSP", "ORTHO"} else "PERSP"
    bpy.context.scene.cycles.use_adaptive_sampling = False
    bpy.context.view_layer.update()
    return camera


def make_flexible(addon, camera, kind):
    """Give the camera the volume that sees what it sees, and if that is a panorama let it be one."""
    if kind in {"PERSP", "ORTHO"}:
        addon("bridge.camera.flexible_camera").volume_from_camera(camera, bpy.context.scene)
        return
    render, lens = bpy.context.scene.render, camera.data
    shapes = {"EQUIRECTANGULAR": (2, 1), "FISHEYE_LENS_POLYNOMIAL": (16, 9)}
    width, height = shapes.get(kind, (1, 1))
    render.resolution_x = SIZE * width // height
    names = {"FISHEYE_EQUIDISTANT": "angular_fisheye", "FISHEYE_LENS_POLYNOMIAL": "stereographic"}
    reference.preset(addon, camera, names.get(kind, "equirectangular"))
    lens.type, lens.panorama_type = "PANO", kind
    lens.lens, lens.fisheye_fov = 30.0, math.pi
    if kind == "FISHEYE_LENS_POLYNOMIAL":
        set_stereographic(lens)


def set_stereographic(lens):
    """θ = 2 arctan(r / 2), as the preset has it with 2 at the borders, as Cycles' polynomial in r."""
    lens.sensor_fit, lens.sensor_width, lens.sensor_height = "HORIZONTAL", 4.0, 2.25
    lens.fisheye_fov = 2.0 * math.pi
    radius = np.linspace(0.0, 2.3, 200)
    powers = np.stack([radius**power for power in range(1, 5)], axis=1)
    factors = np.linalg.lstsq(powers, 2.0 * np.arctan(radius / 2.0), rcond=None)[0]
    for power, factor in enumerate((0.0, *factors)):
        setattr(lens, f"fisheye_polynomial_k{power}", -factor)


def set_up(name, camera):
    """The peculiarity of a case."""
    scene, dof = bpy.context.scene, camera.data.dof
    if "depth of field" in name:
        dof.use_dof, dof.focus_distance = True, 5.0
        dof.aperture_fstop = 0.7 if camera.data.type == "ORTHO" else 0.02
        dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 5, 0.3, 1.5
    if "focus object" in name:
        dof.focus_object = bpy.data.objects["Sphere"]
    if "motion" in name:
        ball = bpy.data.objects["Sphere"]
        for frame, height in ((0, -3.0), (2, 2.0)):
            ball.location.z = height
            ball.keyframe_insert("location", frame=frame)
        scene.render.use_motion_blur = True
    if "adaptive" in name:
        scene.cycles.use_adaptive_sampling, scene.cycles.adaptive_threshold = True, 0.3
        scene.cycles.adaptive_min_samples = 8
    if "fog" in name:
        tree = scene.world.node_tree
        fog = tree.nodes.new("ShaderNodeVolumeScatter")
        fog.inputs["Density"].default_value = 0.1
        tree.links.new(fog.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    if "mirror" in name:
        bpy.data.objects["Sphere"].data.materials.append(mirror())
    if "smoke" in name:
        bpy.ops.mesh.primitive_cube_add(size=3, location=(0.5, 4, 0))
        bpy.context.object.data.materials.append(smoke())


def smoke():
    """A material that is a volume."""
    material = bpy.data.materials.new("Smoke")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    scatter, output = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes.new("ShaderNodeOutputMaterial")
    scatter.inputs["Density"].default_value = 0.6
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    return material


def mirror():
    """A rough one: sharp, it would show the lamp as fireflies."""
    material = bpy.data.materials.new("Mirror")
    if material.node_tree is None:
        material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = 1.0, 0.6
    return material


CASES = {
    "perspective, adaptive sampling, mirror": ("PERSP", 1),
    "eight chords, smoke, mirror": ("PERSP", 8),
    "eight chords, motion": ("PERSP", 8),
    "fog": ("PERSP", 1),
    "eight chords, fog": ("PERSP", 8),
    "perspective, depth of field, focus object": ("PERSP", 1),
    "orthographic, depth of field": ("ORTHO", 1),
    "fisheye, depth of field": ("FISHEYE_EQUIDISTANT", 1),
    "fisheye": ("FISHEYE_EQUIDISTANT", 1),
    "equirectangular": ("EQUIRECTANGULAR", 1),
    "stereographic": ("FISHEYE_LENS_POLYNOMIAL", 1),
}


@pytest.mark.parametrize("name", CASES)
def test_the_light_is_that_of_cycles_own_cameras(addon, tmp_path, name):
    """Neither darker nor brighter nor elsewhere, and no noisier, than without portals."""
    kind, chords = CASES[name]
    lit_scene()
    camera = add_camera(kind)
    make_flexible(addon, camera, kind)
    set_up(name, camera)
    theirs = np.stack([render_pixels(tmp_path / "plain.exr", seed) for seed in range(SEEDS)])
    assert switch(camera) == {"FINISHED"}
    data, plans = addon("cycles.rig_data"), addon("cycles.chords.chord_plan")
    if chords > 1:
        breaks = np.linspace(0.0, 1.0, chords + 1)
        plan = plans.ChordPlan(breaks, np.zeros(chords + 1), (8, 8), 0.0, 0.0)
        data.write_sheets(data.rig_of(bpy.context.scene), plan)
    ours = np.stack([render_pixels(tmp_path / "rig.exr", 10 + seed) for seed in range(SEEDS)])
    assert data.rig_of(bpy.context.scene).scfpf_rig.chords == chords
    assert np.abs(ours[..., 3] - theirs[..., 3]).max() < 1e-6
    noise = [pictures.var(axis=0, ddof=1)[..., :3].mean() for pictures in (theirs, ours)]
    means = [pictures.mean(axis=0)[..., :3] for pictures in (theirs, ours)]
    apart = ((means[0] - means[1]) ** 2).mean()
    print(f"{name}: noise {noise}, apart {apart / (sum(noise) / SEEDS):.2f} of noise")
    assert apart < MORE_THAN_NOISE * sum(noise) / SEEDS
    assert noise[1] == pytest.approx(noise[0], rel=FOG_NOISE if "fog" in name else SAME_NOISE)
    bias = abs(means[1].mean() - means[0].mean())
    assert bias < LIKELY * math.sqrt(sum(noise) / SEEDS / (ours[0].size / 4))


def test_denoising_sees_what_it_sees_without_portals(addon, tmp_path):
    """Albedo and normals come from real surfaces; the denoised picture is as near to the clean one."""
    lit_scene()
    scene, layer = bpy.context.scene, bpy.context.view_layer
    for number, ball in enumerate(o for o in bpy.data.objects if o.type == "MESH"):
        material = bpy.data.materials.new("Paint")
        if material.node_tree is None:
            material.use_nodes = True
        color = (0.8, 0.2 + 0.2 * number, 0.1, 1.0)
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        ball.data.materials.append(material)
    camera = add_camera("PERSP")
    make_flexible(addon, camera, "PERSP")
    turn = np.array(camera.matrix_world.to_3x3())
    clean = render_pixels(tmp_path / "clean.exr", 3, 256)[..., :3]
    pictures, data = [], []
    for through_rig in (False, True):
        if through_rig:
            switch(camera)
            rig = addon("cycles.rig_data")
            breaks = np.linspace(0.0, 1.0, 5)
            plan = addon("cycles.chords.chord_plan").ChordPlan(breaks, 0 * breaks, (8, 8), 0.0, 0.0)
            rig.write_sheets(rig.rig_of(scene), plan)
        pictures.append([render_pixels(tmp_path / "noisy.exr", 1, 2, denoise) for denoise in (False, True)])
        layer.cycles.denoising_store_passes = True
        write_multilayer(scene, tmp_path / "passes")
        data.append({name.split(".", 1)[1]: values for name, values in f12(scene).items()})
    apart = [[np.sqrt(((one[..., :3] - clean) ** 2).mean()) for one in pair] for pair in pictures]
    print("noisy and denoised, from the clean picture:", apart)
    for noisy, denoised in apart:
        assert denoised < 0.9 * noisy
    assert apart[1][1] == pytest.approx(apart[0][1], rel=0.3)
    theirs, ours = data
    assert np.abs(ours["Denoising Albedo"] - theirs["Denoising Albedo"]).mean() < 0.02
    # Cycles has these normals in the space of its camera, which up to 4.5 looks along its +z; the rig's has
    # the world's axes.
    off = []
    for flip in (np.diag([1.0, 1.0, 1.0]), np.diag([1.0, 1.0, -1.0])):
        turned = theirs["Denoising Normal"] @ (flip @ turn @ flip).T
        off.append(np.abs(ours["Denoising Normal"] - turned).mean())
    assert min(off) < 0.03


@pytest.mark.parametrize("surfaces", [2, 3])
def test_smoke_that_holds_the_far_surface_takes_the_light_of_its_depth(surfaces, tmp_path):
    """A white world behind smoke that absorbs: exp(-density · depth), the depth up to the far surface."""
    scene, density, begins, ends = bpy.context.scene, 0.05, 2.0, 10.0
    bpy.ops.mesh.primitive_cube_add(size=40.0, location=(0, 0, -20.0 - begins))
    material = smoke()
    tree = material.node_tree
    absorption = tree.nodes.new("ShaderNodeVolumeAbsorption")
    absorption.inputs["Color"].default_value, absorption.inputs["Density"].default_value = 4 * (0,), density
    tree.links.new(absorption.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    bpy.context.object.data.materials.append(material)
    world = scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = 4 * (1,)
    camera = scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.data.clip_start, camera.data.clip_end, camera.data.lens = 1.0, ends, 400.0
    scene.render.resolution_x, scene.render.resolution_y = 8, 8
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    if surfaces == 3:
        assert bpy.ops.scfpf.surface_add(kind="PLANE") == {"FINISHED"}
    assert switch(camera) == {"FINISHED"}
    light = render_pixels(tmp_path / "smoke.exr", samples=16)[..., :3].mean()
    assert abs(-math.log(light) / density - (ends - begins)) < 0.1
