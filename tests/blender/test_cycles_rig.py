# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles sees through the rig: against our exact caster, pixel by pixel, and against its own cameras."""

import importlib.util
import math
import pathlib

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

spec = importlib.util.spec_from_file_location(
    "cycles_reference", pathlib.Path(__file__).with_name("test_cycles_reference.py")
)
reference = importlib.util.module_from_spec(spec)
spec.loader.exec_module(reference)
our_passes = reference.our_passes

WIDTH, HEIGHT = 72, 48
PRESETS = (
    "angular_fisheye",
    "around_the_car",
    "cylindrical_panorama",
    "inverted_perspective",
    "nonlinear_twist",
    "orthographic",
    "perspective",
    "polynomial_fisheye",
)
# The pixel error of the rig, and so its number of chords. Edges are given 1.5 pixels.
PIXEL_ERROR = 0.3


def rectangle(half_width, half_height, depth, x=0.0, turn=0.0):
    """A plane for VOLUMES, described as add_surface takes it."""
    matrix = Matrix.Translation((x, 0, -depth)) @ Euler((0, 0, turn)).to_matrix().to_4x4()
    return "PLANE", matrix, {"width": 2 * half_width, "height": 2 * half_height}, None


def grid(height, shift):
    """A wavy grid of 9 × 7 points, 12 wide."""
    x, y = np.meshgrid(np.linspace(-6, 6, 9), np.linspace(-4, 4, 7))
    points = np.stack([x + shift, y, height + 0.5 * np.sin(x) * np.cos(0.7 * y)], axis=-1)
    return "GRID", Matrix(), None, points


# Volumes made here, by basis and surfaces from near to far.
VOLUMES = {
    "curved convergence": ("BEZIER", [(1, 0.75, 1), (2, 7, 20), (10, 7.5, 40)]),
    "bent cubic": ("BEZIER", [(1, 0.7, 1), (3, 2, 6, 2.0), (5, 3, 14, -6.0, 0.6), (8, 5, 24, 4.0)]),
    "polyline": ("POLYLINE", [(1, 0.7, 1), (3, 2, 6, 2.0), (5, 3, 14, -4.0)]),
    "B-spline": ("B_SPLINE", [(1, 0.7, 1), (2, 1.4, 4), (4, 3, 9, 3.0), (5, 3, 15, -2.0), (8, 5, 24)]),
    "NURBS": ("NURBS", [(1, 0.7, 1), (3, 2, 6, 3.0), (5, 3, 14, -4.0, 0.4), (8, 5, 24, 2.0)]),
    "grids": ("BEZIER", [(1, 0.7, 1), grid(-10.0, 3.0), grid(-20.0, 0.0)]),
}


def make_volume(addon, camera, name):
    if name in PRESETS:
        reference.preset(addon, camera, name)
        return
    flexible = addon("scfpf_addon.bridge.flexible_camera")
    flexible.make_flexible(camera)
    flexible.clear_surfaces(camera)
    basis, surfaces = VOLUMES[name]
    for described in surfaces:
        kind, matrix, parameters, points = (
            rectangle(*described) if len(described) != 4 or not isinstance(described[0], str) else described
        )
        flexible.add_surface(camera, kind, matrix=matrix, parameters=parameters, points=points)
    camera.scfpf.basis = basis
    for number, slot in enumerate(camera.scfpf.surfaces):
        slot.weight = 1.0 + 2.0 * (number % 2)


def project(addon, camera):
    """The camera's projection as it is, world space."""
    render = bpy.context.scene.render
    return addon("scfpf_addon.bridge.read_projection").read_projection(
        camera, bpy.context.evaluated_depsgraph_get(), render.resolution_x / render.resolution_y
    )


def fill_volume(addon, camera, count=24):
    """Objects on projectors of the camera, as large as their place."""
    projection = project(addon, camera)
    sample = projection.volume.evaluate(np.full(9, 0.5), np.full(9, 0.5), np.linspace(0, 1, 9)).position
    size = np.ptp(sample, axis=1).max() / 20

    def place(generator):
        while True:
            x, y, t = generator.random((3, 1))
            image = projection.parameters(x, y)
            if image.mask[0]:
                return projection.volume.evaluate(image.u, image.v, 0.15 + 0.8 * t).position[:, 0]

    reference.populate(np.random.default_rng(5), count, place)
    bpy.data.objects.remove(bpy.data.objects["Ground"])
    for obj in bpy.context.scene.objects:
        if obj.pass_index:
            obj.scale *= size
    bpy.context.view_layer.update()


def switch(camera):
    bpy.context.view_layer.objects.active = camera
    return bpy.ops.scfpf.cycles_rig()


@pytest.fixture
def rig_of(addon):
    return lambda: addon("scfpf_addon.cycles.rig_data").rig_of(bpy.context.scene)


def clear_scene():
    """Remove all objects."""
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.cameras, *bpy.data.curves])
    bpy.context.view_layer.update()


def test_cycles_sees_what_the_exact_caster_sees(addon, our_passes, rig_of, tmp_path):
    """Every preset and some volumes more, at every angle and kind of projector that there is."""
    far_off = {}
    for name in (*PRESETS, *VOLUMES):
        clear_scene()
        camera = reference.add_camera(WIDTH, HEIGHT)
        camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.4, 0.1, 0.5))
        make_volume(addon, camera, name)
        camera.scfpf.pixel_error = PIXEL_ERROR
        bpy.context.view_layer.update()
        fill_volume(addon, camera)
        index, position, _ = our_passes(0.01)
        assert switch(camera) == {"FINISHED"}
        for group in bpy.data.node_groups:
            # For the next volume: building them takes longer than all the rest.
            group.use_fake_user = True
        settings = rig_of().scfpf_rig
        seen, their_position = reference.cycles_passes(tmp_path / "passes.exr")
        wrong = index != seen
        edge = reference.near_edges(index) | reference.near_edges(seen)
        print(f"{name}: {settings.chords} chords, {settings.error:.2f} px, {wrong.mean():.2%} wrong")
        assert settings.error <= PIXEL_ERROR
        assert len(np.unique(index)) > 8 and (index > 0).mean() > 0.02
        far_off[name] = (wrong & ~edge).sum()
        # Positions are points of the scene, not of the screen.
        inside = ~edge & (index > 0)
        off = np.linalg.norm(position - their_position, axis=2)[inside]
        step = reference.jitter_distance(position, index > 0)[inside] / reference.JITTER
        allowed = step * (PIXEL_ERROR + 0.05) + 1e-4 * np.abs(position).max()
        assert (off <= allowed).mean() > 0.99, name
        assert switch(camera) == {"FINISHED"} and rig_of() is None
    assert not any(far_off.values()), far_off


def render_pixels(path, seed=0, samples=64):
    """The picture that Cycles makes of the scene, (H, W, 4), row 0 at the bottom."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.seed = samples, seed
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return load_pixels(path)


def load_pixels(path):
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:], np.float64).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


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


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "FISHEYE"])
def test_the_light_is_that_of_cycles_own_cameras(addon, tmp_path, kind):
    """Neither darker nor brighter, and no noisier, than without portals."""
    lit_scene()
    ordinary = {"type": "PERSP" if kind == "FISHEYE" else kind, "lens": 30.0, "ortho_scale": 7.0}
    camera = reference.add_camera(32, 32, clip_start=0.5, clip_end=80.0, **ordinary)
    camera.location, camera.rotation_euler = (0, 0, 1), Euler((math.pi / 2 - 0.15, 0, 0))
    bpy.context.view_layer.update()
    if kind == "FISHEYE":
        reference.preset(addon, camera, "angular_fisheye")
        camera.data.type, camera.data.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
        camera.data.fisheye_fov = math.pi
    else:
        addon("scfpf_addon.bridge.flexible_camera").volume_from_camera(camera, bpy.context.scene)
    theirs = np.stack([render_pixels(tmp_path / "plain.exr", seed) for seed in range(4)])
    assert switch(camera) == {"FINISHED"}
    ours = np.stack([render_pixels(tmp_path / "rig.exr", seed) for seed in range(10, 14)])
    assert (ours[..., 3] == theirs[..., 3]).all()
    means = [pictures.mean(axis=(1, 2, 3)) for pictures in (theirs, ours)]
    uncertain = np.sqrt(sum(mean.var(ddof=1) / len(mean) for mean in means))
    noise = [np.sqrt(pictures.var(axis=0, ddof=1).mean()) for pictures in (theirs, ours)]
    print(f"{kind}: means {means[0].mean():.5f} {means[1].mean():.5f} ± {uncertain:.5f}, noise {noise}")
    assert means[1].mean() == pytest.approx(means[0].mean(), abs=5 * uncertain, rel=1e-4)
    assert noise[1] == pytest.approx(noise[0], rel=0.15)
