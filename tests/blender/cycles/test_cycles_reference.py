# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits of every pixel, compared with Cycles' passes and world_to_camera_view, and their light from lamps."""

import math
import struct

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Euler, Vector

# Cycles' filter as narrow as it goes: it then samples pixels within this of their centres.
JITTER = 0.01
# An object's outline may be off by what the jitter moves it and a neighbour pixel.
EDGE = 1.5


def read_exr(path):
    """The channels of an uncompressed scanline EXR of floats, {name: (H, W)}, row 0 at the bottom."""
    data = path.read_bytes()
    assert data[:4] == b"v/1\x01" and not data[5] & 0x12, "not a single-part scanline EXR"
    attributes, place = {}, 8
    while data[place]:
        name, place = data[place : data.index(0, place)].decode(), data.index(0, place) + 1
        place = data.index(0, place) + 1
        (size,) = struct.unpack_from("<i", data, place)
        attributes[name] = data[place + 4 : place + 4 + size]
        place += 4 + size
    left, low, right, high = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, high - low + 1
    assert attributes["compression"] == b"\0"
    names, listed, at = [], attributes["channels"], 0
    while listed[at]:
        end = listed.index(0, at)
        names.append(listed[at:end].decode())
        assert struct.unpack_from("<i", listed, end + 1) == (2,), "not 32-bit floats"
        at = end + 17
    lines = np.frombuffer(data, np.uint8, offset=place + 1 + 8 * height)
    lines = lines.reshape(height, 8 + 4 * width * len(names))[:, 8:]
    values = np.ascontiguousarray(lines).view("<f4").reshape(height, len(names), width)
    return {name: values[::-1, number] for number, name in enumerate(names)}


def cycles_passes(path):
    """Cycles' Object Index (H, W) int and Position (H, W, 3) of the present scene."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    layer.use_pass_position = layer.use_pass_object_index = True
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", JITTER
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    if hasattr(settings, "use_exr_interleave"):
        settings.use_exr_interleave = True
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    one = {name.split(".", 1)[1]: values for name, values in channels.items()}
    index = next(values for name, values in one.items() if name.endswith(".X") and "Index" in name)
    return index.astype(int), np.stack([one[f"Position.{axis}"] for axis in "XYZ"], -1).astype(np.float64)


def populate(generator, count, place):
    """``count`` objects of several kinds; place(generator) says where each stands. Indices from 1."""
    primitives = (
        lambda: bpy.ops.mesh.primitive_uv_sphere_add(),
        lambda: bpy.ops.mesh.primitive_cube_add(),
        lambda: bpy.ops.mesh.primitive_torus_add(),
        lambda: bpy.ops.mesh.primitive_cone_add(),
        lambda: bpy.ops.mesh.primitive_monkey_add(),
        lambda: bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3),
        lambda: bpy.ops.object.text_add(),
    )
    first = {}
    for number in range(1, count + 1):
        kind = number % len(primitives)
        if kind not in first:
            primitives[kind]()
            first[kind] = obj = bpy.context.object
        else:
            # Operators update the scene each time, and take ten times as long.
            obj = first[kind].copy()
            obj.data = first[kind].data.copy()
            bpy.context.scene.collection.objects.link(obj)
        obj.name, obj.pass_index = f"Object {number}", number
        obj.location = place(generator)
        obj.rotation_euler = generator.uniform(-math.pi, math.pi, 3)
        obj.scale = generator.uniform(0.4, 1.3, 3) * generator.choice([-1, 1], 3)
        if obj.type == "FONT":
            obj.data.body, obj.data.extrude = "SCFPF", 0.2
    bpy.ops.mesh.primitive_plane_add(size=400, location=(0, 0, -6))
    bpy.context.object.name, bpy.context.object.pass_index = "Ground", count + 1


def add_camera(width, height, **lens):
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    for name, value in lens.items():
        setattr(data, name, value)
    camera = scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    bpy.context.view_layer.update()
    return camera


@pytest.fixture
def our_passes(addon):
    """Our caster's hits through the scene's camera: object indices, positions, and the projection."""
    scenes = addon("casting.scene.cast_scene")
    frames = addon("casting.frame")

    def cast(pixel_error=0.1):
        scene = bpy.context.scene
        width, height = scene.render.resolution_x, scene.render.resolution_y

        def read(depsgraph):
            projection = addon("bridge.camera.read_projection").read_projection
            contents = addon("bridge.scene.read_scene").read_scene
            return projection(scene.camera, depsgraph, width / height), contents(depsgraph)

        projection, contents = addon("bridge.scene.render_depsgraph").with_render_depsgraph(
            scene, bpy.context.view_layer, read
        )
        geometry = contents.geometry
        cast_scene = scenes.CastScene(geometry.vertices, geometry.triangles)
        hits = frames.cast_frame(cast_scene, projection, width, height, pixel_error)
        numbers = np.array([bpy.data.objects[name].pass_index for name in geometry.object_names])
        hit = hits.triangle >= 0
        index = np.where(hit, numbers[geometry.object_index[hits.triangle]], 0)
        corners = geometry.vertices[geometry.triangles[hits.triangle]]
        second, third = hits.barycentric
        weights = np.stack([1 - second - third, second, third])
        position = np.where(hit[:, None], np.einsum("kn,nkc->nc", weights, corners), 0.0)
        return index.reshape(height, width), position.reshape(height, width, 3), projection

    return cast


def near_edges(index, radius=EDGE):
    """(H, W) bool: whether another index lies within ``radius`` pixels."""
    reach = math.floor(radius)
    height, width = index.shape
    padded = np.pad(index, reach, mode="edge")
    near = np.zeros(index.shape, bool)
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            if math.hypot(x, y) <= radius:
                shifted = padded[reach + y : reach + y + height, reach + x : reach + x + width]
                near |= shifted != index
    return near


def jitter_distance(position, shown):
    """(H, W): how far the jitter may move the point that a pixel sees, from its neighbours' points.

    The larger step to the left or right plus that to below or above, times the
    jitter; infinite beside what shows nothing.
    """
    steps = np.zeros(shown.shape)
    for axis in (0, 1):
        step = np.linalg.norm(np.diff(position, axis=axis), axis=2)
        both = np.minimum(*(np.delete(shown, end, axis=axis) for end in (0, -1)))
        step = np.where(both, step, np.inf)
        before, after = (np.insert(step, place, 0.0, axis=axis) for place in (0, step.shape[axis]))
        steps += np.maximum(before, after)
    return JITTER * steps


def compare(ours, theirs, size):
    """Assert that both see the same objects at the same places; ``size``: the scene's. Returns figures."""
    (index, position, _), (their_index, their_position) = ours, theirs
    edge = near_edges(their_index)
    wrong = index != their_index
    assert not (wrong & ~edge).any(), f"{(wrong & ~edge).sum()} wrong pixels away from edges"
    assert wrong.mean() < 1e-3
    assert len(np.unique(their_index)) > 15
    inside = ~edge & (index > 0)
    assert inside.mean() > 0.1
    off = np.linalg.norm(position - their_position, axis=2)[inside]
    allowed = jitter_distance(position, index > 0)[inside] + 1e-5 * size
    assert (off <= allowed).all(), f"positions off by up to {(off / allowed).max():.2f} of what is allowed"
    return wrong.sum(), np.median(off) / size, off.max() / size


def report(name, figures):
    """Shown by pytest -rP."""
    print("{}: {} wrong pixels, position median {:.1e}, largest {:.1e} of the scene".format(name, *figures))


def in_front(generator):
    """A place in the view of a camera at the origin that looks along +Y, to 30 units."""
    depth = generator.uniform(4, 30)
    return depth * generator.uniform(-0.7, 0.7), depth, depth * generator.uniform(-0.4, 0.4)


def all_around(generator):
    """A place all around the origin, 4 to 14 units away."""
    direction = generator.normal(size=3)
    return direction / np.linalg.norm(direction) * generator.uniform(4, 14)


ORDINARY = {
    "perspective": {"type": "PERSP", "lens": 28.0, "clip_start": 0.5, "clip_end": 60.0},
    "shifted": {
        "type": "PERSP",
        "lens": 40.0,
        "shift_x": 0.2,
        "shift_y": -0.1,
        "clip_start": 6.0,
        "clip_end": 25.0,
    },
    "orthographic": {
        "type": "ORTHO",
        "ortho_scale": 16.0,
        "shift_x": -0.1,
        "clip_start": 0.5,
        "clip_end": 60.0,
    },
}


@pytest.mark.parametrize("name", ORDINARY)
def test_an_ordinary_camera_sees_what_its_volume_sees(addon, our_passes, tmp_path, name):
    populate(np.random.default_rng(1), 34, in_front)
    camera = add_camera(320, 200, **ORDINARY[name])
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((math.pi / 2 - 0.03, 0.1, 0.05))
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, bpy.context.scene)
    figures = compare(our_passes(), cycles_passes(tmp_path / "passes.exr"), 60.0)
    report(name, figures)


@pytest.mark.parametrize("name", ORDINARY)
def test_a_volume_of_a_camera_projects_as_world_to_camera_view(addon, our_passes, name):
    bpy.ops.mesh.primitive_cube_add()
    camera = add_camera(320, 200, **ORDINARY[name])
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.2, 0.4, -2.0))
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, bpy.context.scene)
    assert_projects_as_blender(our_passes()[2], camera)


def preset(addon, camera, name):
    module = addon("projection.presets.preset")
    text = (addon("bridge").__path__[0], "..", "..", "presets", f"{name}.json")
    with open("/".join(text), encoding="utf-8") as file:
        loaded = module.load_preset(file.read())
    render = bpy.context.scene.render
    addon("bridge.camera.flexible_camera").apply_preset(
        camera, loaded, render.resolution_x / render.resolution_y
    )


@pytest.mark.parametrize("name", ["perspective", "orthographic"])
def test_a_preset_projects_as_world_to_camera_view(addon, our_passes, name):
    """The preset sets the camera's ordinary lens to what the volume shows; here the two are the same."""
    bpy.ops.mesh.primitive_cube_add()
    camera = add_camera(320, 200)
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.2, 0.4, -2.0))
    preset(addon, camera, name)
    bpy.context.view_layer.update()
    assert_projects_as_blender(our_passes()[2], camera)


@pytest.mark.parametrize(
    ("name", "lens"), [("telephoto", {"lens": 300.0}), ("off_centre", {"lens": 25.0, "shift_y": 0.3 / 0.81})]
)
def test_narrow_and_shifted_presets_project_as_cameras_of_such_lenses(addon, our_passes, name, lens):
    """300 mm; 25 mm, where what is 0.3 of its distance above the axis comes to the middle of 0.81.

    Other aspects keep the height of 16:9.
    """
    bpy.ops.mesh.primitive_cube_add()
    for width in (320, 180):
        camera = add_camera(width, 180)
        camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.2, 0.4, -2.0))
        preset(addon, camera, name)
        camera.data.type, camera.data.sensor_fit = "PERSP", "VERTICAL"
        camera.data.sensor_height = 20.25
        for key, value in lens.items():
            setattr(camera.data, key, value)
        bpy.context.view_layer.update()
        assert_projects_as_blender(our_passes()[2], camera)


def assert_projects_as_blender(projection, camera):
    generator = np.random.default_rng(0)
    x, y, t = generator.random((3, 500))
    image = projection.parameters(x, y)
    points = projection.volume.evaluate(image.u, image.v, t).position
    seen = np.array([world_to_camera_view(bpy.context.scene, camera, Vector(point)) for point in points.T])
    assert seen[:, 0] == pytest.approx(x, abs=1e-6)
    assert seen[:, 1] == pytest.approx(y, abs=1e-6)


def test_fisheye_is_cycles_equidistant_fisheye(addon, our_passes, tmp_path):
    populate(np.random.default_rng(2), 40, all_around)
    camera = add_camera(240, 240)
    camera.location, camera.rotation_euler = (0.2, 0.1, 0.3), Euler((1.4, 0.3, 0.5))
    preset(addon, camera, "angular_fisheye")
    camera.data.type, camera.data.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
    camera.data.fisheye_fov = math.pi
    camera.data.clip_start, camera.data.clip_end = 0.1, 100.0
    bpy.context.view_layer.update()
    report("fisheye", compare(our_passes(), cycles_passes(tmp_path / "passes.exr"), 100.0))


def test_spheres_are_cycles_equirectangular_camera(addon, our_passes, tmp_path):
    populate(np.random.default_rng(4), 40, all_around)
    camera = add_camera(320, 160)
    camera.location, camera.rotation_euler = (0.2, 0.1, 0.3), Euler((1.4, 0.3, 0.5))
    preset(addon, camera, "equirectangular")
    camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    camera.data.clip_start, camera.data.clip_end = 0.1, 100.0
    bpy.context.view_layer.update()
    report("equirectangular", compare(our_passes(), cycles_passes(tmp_path / "passes.exr"), 100.0))


def test_cylinder_is_cycles_central_cylinder(addon, our_passes, tmp_path):
    populate(np.random.default_rng(3), 40, all_around)
    camera = add_camera(320, 180)
    camera.location, camera.rotation_euler = (0.2, 0.1, 0.3), Euler((1.4, 0.3, 0.5))
    preset(addon, camera, "cylindrical_panorama")
    near = camera.scfpf.surfaces[0].object
    parameters = addon("bridge.surfaces.surface_object").surface_parameters(near)
    reach = parameters["height"] / parameters["radius"] / 2
    lens = camera.data
    lens.type, lens.panorama_type = "PANO", "CENTRAL_CYLINDRICAL"
    lens.central_cylindrical_radius = 1.0
    lens.central_cylindrical_range_u_min, lens.central_cylindrical_range_u_max = -math.pi, math.pi
    lens.central_cylindrical_range_v_min, lens.central_cylindrical_range_v_max = -reach, reach
    # Cycles clips by distance, the preset by cylinders: nothing may stand between.
    lens.clip_start, lens.clip_end = 0.05, 1000.0
    bpy.data.objects["Ground"].scale = (0.2, 0.2, 1)
    bpy.context.view_layer.update()
    report("cylinder", compare(our_passes(), cycles_passes(tmp_path / "passes.exr"), 100.0))


@pytest.mark.parametrize("distance", [3, 10])
@pytest.mark.parametrize("shape", ["POINT", "SPOT", "SUN", "SQUARE", "RECTANGLE", "DISK", "ELLIPSE"])
def test_a_lamp_lights_a_diffuse_plane_as_in_cycles(addon, tmp_path, shape, distance):
    """From reading lamp and material to the finished pixels, with the lamp off to a side."""
    scene = bpy.context.scene
    scene.world = None
    bpy.ops.mesh.primitive_plane_add(size=4)
    material = bpy.data.materials.new("Paint")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.8, 0.4, 0.2, 1)
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    bpy.context.object.data.materials.append(material)
    camera = add_camera(8, 8, type="ORTHO", ortho_scale=1.0, clip_start=0.1, clip_end=5.0)
    camera.location.z = 1
    area = shape not in {"POINT", "SPOT", "SUN"}
    lamp = bpy.data.lights.new("Lamp", "AREA" if area else shape)
    if area:
        lamp.shape, lamp.size, lamp.size_y = shape, 0.6, 1.0
    lamp.energy, lamp.color = 100.0, (1.0, 0.9, 0.8)
    placed = bpy.data.objects.new("Lamp", lamp)
    scene.collection.objects.link(placed)
    placed.location, placed.rotation_euler = (0.3, 0.2, distance), (0.1, 0.05, 0.3)
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, scene)
    camera.scfpf.samples = 16
    jobs = addon("bridge.render.render_job")
    job = jobs.RenderJob(addon("bridge.render.render_inputs").prepare(scene, bpy.context.view_layer, camera))
    job.start()
    ours = job.result().pixels
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 128, False
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(tmp_path / "lit.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    theirs = np.array(image.pixels[:]).reshape(8, 8, 4)
    assert theirs[..., :3].min() > 0
    # Cycles' own noise at 128 samples; a near area lamp of ours is a few points.
    assert ours == pytest.approx(theirs, rel=0.005 if distance == 10 else 0.03)


def test_fisheyes_by_image_mappings_are_cycles_own(addon, our_passes, tmp_path):
    """Equisolid, Cycles' lens polynomial and its mirror ball, through the curve widget and the distortion."""
    populate(np.random.default_rng(2), 40, all_around)
    rig = Euler((1.4, 0.3, 0.5)).to_matrix()
    quarter = math.pi / 2
    # Cycles takes millimetres: the disc's radius is 18 of 36.
    lenses = {
        "equisolid_fisheye": {
            "panorama_type": "FISHEYE_EQUISOLID",
            "fisheye_lens": 9 / math.sin(math.pi / 4),
        },
        "polynomial_fisheye": {
            "panorama_type": "FISHEYE_LENS_POLYNOMIAL",
            "fisheye_polynomial_k0": 0.0,
            "fisheye_polynomial_k1": -quarter * 2 / 3 / 18,
            "fisheye_polynomial_k2": 0.0,
            "fisheye_polynomial_k3": -quarter / 3 / 18**3,
            "fisheye_polynomial_k4": 0.0,
        },
        "mirror_ball": {"panorama_type": "MIRRORBALL"},
    }
    for name, values in lenses.items():
        camera = add_camera(200, 200)
        camera.matrix_world = rig.to_4x4()
        preset(addon, camera, name)
        lens = camera.data
        lens.type, lens.sensor_width, lens.fisheye_fov = "PANO", 36.0, math.pi
        for key, value in values.items():
            setattr(lens, key, value)
        lens.clip_start, lens.clip_end = 0.1, 100.0
        bpy.context.view_layer.update()
        report(name, compare(our_passes(), cycles_passes(tmp_path / "passes.exr"), 100.0))
