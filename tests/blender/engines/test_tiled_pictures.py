# SPDX-License-Identifier: GPL-3.0-or-later
"""Quilts and both eyes by other engines, beside the pictures of ordinary cameras by these engines."""

import math

import bpy
import numpy as np
import pytest
from engine_images import f12, passes, write_multilayer
from file_state import differences, file_state
from mathutils import Matrix

pytestmark = pytest.mark.usefixtures("built_groups")

WIDTH, HEIGHT = 48, 32


@pytest.fixture
def scene(tmp_path):
    """Cubes in a room. Colours are positions, in sixteenths round 0.5; each pixel shows one place."""
    scene = bpy.context.scene
    material = bpy.data.materials.new("Position")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    kinds = (
        "ShaderNodeNewGeometry",
        "ShaderNodeVectorMath",
        "ShaderNodeEmission",
        "ShaderNodeOutputMaterial",
    )
    place, scale, glow, output = (tree.nodes.new(kind) for kind in kinds)
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value, scale.inputs[2].default_value = (1 / 16,) * 3, (0.5,) * 3
    tree.links.new(place.outputs["Position"], scale.inputs[0])
    tree.links.new(scale.outputs[0], glow.inputs["Color"])
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    for size, at in ((14.0, (0, 0, 0)), (1.0, (-1.2, 0, 0)), (1.0, (0, 2, 0.4)), (1.0, (1.3, -1.5, -0.3))):
        bpy.ops.mesh.primitive_cube_add(size=size, location=at, rotation=(0.1, 0.2, 0.3))
        bpy.context.object.data.materials.append(material)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.max_bounces = 0
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.object.camera_add(location=(0, -5, 0), rotation=(math.pi / 2, 0, 0))
    scene.camera = bpy.context.object
    scene.camera.data.clip_start = 0.01
    write_multilayer(scene, tmp_path / "own")
    return scene


def picture():
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[..., :3]


def assert_alike(tile, own):
    """Positions are the same but beside edges, which may fall to the other side of a pixel's centre."""
    off = np.linalg.norm(tile - own, axis=-1) * 16
    assert np.median(off) < 0.01 and (off > 0.1).mean() < 0.06, np.sort(off.ravel())[::100]


QUILTS = [
    ("quilt", "SCENE", "own"),
    ("quilt_joined", "SCENE", "joined"),
    ("quilt", "RIG", "own"),
    ("quilt", "WORKBENCH", "own"),
    ("quilt", "WORKBENCH", "joined"),
]


@pytest.fixture
def rendered():
    """The sizes of the renders that engines have begun."""
    found = []

    def note(scene, *_):
        found.append((scene.render.resolution_x, scene.render.resolution_y))

    bpy.app.handlers.render_init.append(note)
    yield found
    bpy.app.handlers.render_init.remove(note)


@pytest.mark.parametrize(("press", "engine", "volume"), QUILTS)
def test_a_tile_is_the_view_of_an_ordinary_camera_by_its_engine(
    scene, rendered, press, engine, volume, tmp_path
):
    """Of cameras side by side whose lens is shifted so that the focus stays where it is.

    The volume is that of the lens, of which an engine makes a tile by one render, or of another one.
    """
    camera, lens = scene.camera, scene.camera.data
    columns, rows, focus, cone = 2, 2, 5.0, math.radians(30)
    bpy.ops.scfpf.camera_from_camera()
    camera.scfpf.samples, camera.scfpf.fit = 1, "NONE"
    angle = lens.angle
    lens.angle *= 1.0 if volume == "own" else 0.7
    render = getattr(bpy.ops.scfpf, press)
    path = {"filepath": str(tmp_path / "quilt.png")} if press == "quilt_joined" else {}
    show_objects(scene)
    before = [*bpy.data.cameras]
    assert render(columns=columns, rows=rows, cone=cone, focus=focus, engine=engine, **path) == {"FINISHED"}
    assert [*bpy.data.cameras] == before
    if engine != "RIG":
        assert (rendered == [(WIDTH, HEIGHT)] * columns * rows) == (volume == "own")
    if path:
        written = bpy.data.images.load(path["filepath"])
        assert tuple(written.size) == (columns * WIDTH, rows * HEIGHT)
    quilt = picture()
    assert quilt.shape == (rows * HEIGHT, columns * WIDTH, 3)
    camera.scfpf.enabled, lens.angle = False, angle
    scene.render.engine = "BLENDER_WORKBENCH" if engine == "WORKBENCH" else "CYCLES"
    reach = focus * math.tan(cone / 2)
    for number, offset in enumerate(np.linspace(-reach, reach, columns * rows)):
        camera.location.x, lens.shift_x = offset, -offset / focus * lens.lens / lens.sensor_width
        bpy.context.view_layer.update()
        own = combined(scene)
        row, column = divmod(number, columns)
        tile = quilt[row * HEIGHT : (row + 1) * HEIGHT, column * WIDTH : (column + 1) * WIDTH]
        assert_alike(tile, own)
    assert np.abs(quilt[:HEIGHT, :WIDTH] - quilt[HEIGHT:, -WIDTH:]).mean() > 0.01


def test_a_moving_camera_blurs_its_tiles(scene):
    """As an ordinary camera does in Cycles, whose noise is that of the same seed."""
    camera, lens = scene.camera, scene.camera.data
    camera.scale = (1.5, 1.2, 1.0)
    bpy.ops.scfpf.camera_from_camera()
    for frame, place in ((0, -5.5), (2, -4.5)):
        camera.location.y = place
        camera.keyframe_insert("location", index=1, frame=frame)
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.cycles.samples = True, 4
    assert bpy.ops.scfpf.quilt(columns=2, rows=1, cone=0.5, focus=5.0, engine="SCENE") == {"FINISHED"}
    quilt = picture()
    camera.scfpf.enabled = False
    camera.location.x = 5.0 * math.tan(0.25)
    lens.shift_x = -math.tan(0.25) * lens.lens / lens.sensor_width
    blurred, scene.render.use_motion_blur = combined(scene), False
    assert np.allclose(quilt[:, WIDTH:], blurred, atol=1e-3)
    assert np.abs(blurred - combined(scene)).mean() > 1e-3


def combined(scene):
    """The picture of F12, (H, W, 3)."""
    return next(values for name, values in f12(scene).items() if name.endswith("Combined"))[..., :3]


def show_objects(scene):
    """Let Workbench show one place a pixel, by its object's colour."""
    scene.display.render_aa, shading = "OFF", scene.display.shading
    shading.light, shading.color_type = "FLAT", "OBJECT"
    shading.show_object_outline = shading.show_cavity = shading.show_shadows = False
    cubes = [obj for obj in scene.objects if obj.name.startswith("Cube")]
    for obj, color in zip(cubes, np.eye(4), strict=True):
        obj.color = *color[:3], 1.0


@pytest.mark.parametrize("engine", ("SCENE", "RIG"))
def test_both_eyes_of_a_panorama_are_those_of_cycles(scene, tmp_path, engine):
    """Spherical stereo, joined from ordinary renders or through the rig: the left eye is on top."""
    render, place = scene.render, Matrix.Rotation(math.pi / 2, 4, "X")
    render.resolution_x, render.resolution_y = 96, 48
    assert bpy.ops.scfpf.camera_add(preset="equirectangular") == {"FINISHED"}
    camera = scene.camera = bpy.context.object
    camera.matrix_world, camera.data.type = place, "PERSP"
    camera.scfpf.samples = 1
    with pytest.raises(RuntimeError, match="Stereo 3D"):
        bpy.ops.scfpf.eyes_joined()
    render.use_multiview, render.views_format = True, "STEREO_3D"
    bpy.ops.object.camera_add(rotation=(math.pi / 2, 0, 0))
    ordinary = bpy.context.object
    ordinary.data.type = "PANO"
    lens = ordinary.data
    (lens if hasattr(lens, "panorama_type") else lens.cycles).panorama_type = "EQUIRECTANGULAR"
    for each in (camera, ordinary):
        stereo = each.data.stereo
        stereo.use_spherical_stereo = stereo.use_pole_merge = True
        stereo.interocular_distance, stereo.convergence_distance = 0.6, 3.0
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.eyes_joined(camera=camera.name, layout_of_eyes="TOP", engine=engine) == {"FINISHED"}
    both = picture()
    assert both.shape == (96, 96, 3)
    scene.camera = ordinary
    render.image_settings.views_format = "INDIVIDUAL"
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    for number, view in enumerate(("right", "left")):
        found = passes(f"{render.filepath}{render.views[view].file_suffix}.exr")
        own = next(values for name, values in found.items() if name.endswith("Combined"))[..., :3]
        assert_alike(both[number * 48 : (number + 1) * 48], own)
        other = both[(1 - number) * 48 : (2 - number) * 48]
        assert np.median(np.linalg.norm(other - own, axis=-1)) * 16 > 0.05


@pytest.mark.parametrize(
    ("mode", "pivot", "engine", "volume"),
    [
        ("OFFAXIS", "CENTER", "SCENE", "own"),
        ("OFFAXIS", "LEFT", "SCENE", "joined"),
        ("OFFAXIS", "RIGHT", "RIG", "own"),
        ("PARALLEL", "LEFT", "SCENE", "own"),
        ("TOE", "CENTER", "SCENE", "joined"),
        ("TOE", "LEFT", "RIG", "own"),
        ("TOE", "RIGHT", "SCENE", "own"),
    ],
)
def test_both_eyes_are_those_of_the_cameras_own_stereo_by_cycles(scene, mode, pivot, engine, volume):
    """For a camera that is turned, scaled and shifted: Blender's own eyes, and those of its volume."""
    camera, render = scene.camera, scene.render
    camera.rotation_euler, camera.scale = (1.5, 0.1, 0.05), (1.5, 1.5, 1.5)
    camera.data.shift_x = 0.1
    stereo = camera.data.stereo
    stereo.convergence_mode, stereo.pivot = mode, pivot
    stereo.interocular_distance, stereo.convergence_distance = 0.7, 4.0
    render.use_multiview, render.views_format = True, "STEREO_3D"
    render.image_settings.views_format = "INDIVIDUAL"
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    own = []
    for view in ("left", "right"):
        found = passes(f"{render.filepath}{render.views[view].file_suffix}.exr")
        own.append(next(values for name, values in found.items() if name.endswith("Combined"))[..., :3])
    bpy.context.view_layer.objects.active = camera
    bpy.ops.scfpf.camera_from_camera()
    camera.scfpf.samples, camera.scfpf.fit = 1, "NONE"
    camera.data.angle *= 1.0 if volume == "own" else 0.7
    assert bpy.ops.scfpf.eyes_joined(engine=engine) == {"FINISHED"}
    both = picture()
    assert both.shape == (HEIGHT, 2 * WIDTH, 3)
    for number, eye in enumerate(own):
        assert_alike(both[:, number * WIDTH : (number + 1) * WIDTH], eye)
    assert np.median(np.linalg.norm(own[0] - own[1], axis=-1)) * 16 > 0.05


def test_the_rig_of_each_eye_leaves_nothing(scene):
    bpy.ops.scfpf.camera_add(preset="cylindrical_panorama")
    camera = scene.camera = bpy.context.object
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    # Node groups that nothing uses, as a test before has made them, may go.
    groups, before = set(bpy.data.node_groups), file_state()
    assert bpy.ops.scfpf.quilt(columns=1, rows=1, engine="RIG") == {"FINISHED"}
    assert set(bpy.data.node_groups) <= groups
    found = [text for text in differences(before, file_state()) if "SCFPF Render" not in text]
    assert [text for text in found if not text.startswith("node_groups: ")] == []
    assert bpy.ops.scfpf.camera_add(preset="angular_fisheye") == {"FINISHED"}
    scene.camera = bpy.context.object
    with pytest.raises(RuntimeError, match="places without projectors"):
        bpy.ops.scfpf.quilt(columns=1, rows=1, engine="RIG")
    assert not [obj.name for obj in bpy.data.objects if obj.name.startswith("SCFPF Eye")]
    assert camera.name in bpy.data.objects


@pytest.mark.parametrize("engine", ("SCENE", "RIG"))
def test_tiles_of_a_view_layer_with_passes(scene, engine):
    """A quilt has colors only, whatever passes the view layer has on."""
    bpy.ops.scfpf.camera_add(preset="cylindrical_panorama")
    scene.camera = bpy.context.object
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.quilt(columns=1, rows=1, engine=engine) == {"FINISHED"}
    plain = picture()
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_mist = layer.use_pass_normal = layer.use_pass_object_index = True
    layer.use_pass_diffuse_color = True
    assert bpy.ops.scfpf.quilt(columns=1, rows=1, engine=engine) == {"FINISHED"}
    np.testing.assert_allclose(picture(), plain, atol=1e-3)
