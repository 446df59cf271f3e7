# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera from Screen: its image on the screen looks from the eye as the scene does without the screen."""

import bpy
import numpy as np
import pytest
from engine_images import button, load_pixels
from mathutils import Vector

EYE = (0.4, -3.0, 1.2)
SIZE = (480, 240)


def glowing(name, image=None):
    """An emission material: an image by UVs, or colors that vary smoothly through space."""
    material = bpy.data.materials.new(name)
    if not material.use_nodes:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeEmission")
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    if image is not None:
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = image
        links.new(texture.outputs["Color"], shader.inputs["Color"])
        return material
    scaled = nodes.new("ShaderNodeVectorMath")
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.05, 0.04, 0.06), (0.5, 0.3, 0.4)
    links.new(nodes.new("ShaderNodeNewGeometry").outputs["Position"], scaled.inputs[0])
    links.new(scaled.outputs[0], shader.inputs["Color"])
    return material


def curved_screen():
    """A quarter of a cylinder and, beside it, a slanted wing: two islands of the UV map, 2 : 1."""
    turn = np.linspace(-0.8, 0.8, 41)
    arc = [(1.5 * np.sin(a), 1.5 * np.cos(a) - 1.5, z) for a in turn for z in (0.2, 2.2)]
    wing = [(1.5, -0.6, 0.2), (1.5, -0.6, 2.2), (2.6, -0.1, 0.2), (2.6, -0.1, 2.2)]
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in (*range(40), 41)]
    mesh = bpy.data.meshes.new("Screen")
    mesh.from_pydata([*arc, *wing], [], faces)
    u = [0.7 * i / 40 for i in range(41) for _ in range(2)] + [0.72, 0.72, 1.0, 1.0]
    layer = mesh.uv_layers.new(name="Panels")
    for loop in mesh.loops:
        layer.uv[loop.index].vector = (u[loop.vertex_index], loop.vertex_index % 2)
    screen = bpy.data.objects.new("Screen", mesh)
    bpy.context.scene.collection.objects.link(screen)
    return screen


@pytest.fixture
def stage():
    """A screen, an eye and a scene behind the screen of balls before a wall, all glowing."""
    scene = bpy.context.scene
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    material = glowing("Scene")
    for k, place in enumerate(((-1.5, 3.0, 1.0), (0.3, 4.0, 2.0), (2.5, 2.5, 0.8))):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=0.5 + 0.1 * k, location=place)
        bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_plane_add(size=30, location=(0, 6, 0), rotation=(np.pi / 2, 0, 0))
    bpy.context.object.data.materials.append(material)
    screen = curved_screen()
    bpy.ops.object.empty_add(location=EYE)
    eye = bpy.context.object
    screen.select_set(True)
    bpy.context.view_layer.objects.active = screen
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    bpy.context.view_layer.update()
    return screen, eye


def select_eye_and_screen():
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.data.objects["Empty"].select_set(True)
    bpy.data.objects["Screen"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Screen"]


def photograph(path):
    """Cycles' image through an ordinary camera at the eye, (H, W, 3)."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Photographer", bpy.data.cameras.new("Photographer"))
    scene.collection.objects.link(camera)
    camera.location = EYE
    camera.rotation_euler = (Vector((0.6, 0.0, 1.2)) - Vector(EYE)).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = 28
    before, scene.camera = scene.camera, camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 4, False, False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    bpy.data.objects.remove(camera)
    scene.camera = before
    return load_pixels(path)[..., :3]


@pytest.mark.parametrize("pop_out", [False, True])
def test_image_on_its_screen_is_what_a_camera_at_the_eye_sees(stage, tmp_path, pop_out):
    """With Pop Out a ball between the eye and the screen is in it."""
    screen, _eye = stage
    if pop_out:
        bpy.ops.mesh.primitive_uv_sphere_add(
            segments=96, ring_count=48, radius=0.2, location=(0.3, -1.2, 1.2)
        )
        bpy.context.object.data.materials.append(bpy.data.materials["Scene"])
        select_eye_and_screen()
    assert bpy.ops.scfpf.camera_from_screen(pop_out=pop_out) == {"FINISHED"}
    button()
    screen.hide_render = True
    wanted = photograph(tmp_path / "scene.exr")
    screen.hide_render = False
    screen.data.materials.append(glowing("Screen", bpy.data.images["SCFPF Render"]))
    for obj in bpy.context.scene.objects:
        obj.hide_render = obj.hide_render or (obj.type == "MESH" and obj != screen)
    shown = photograph(tmp_path / "screen.exr")
    on_screen = shown.max(axis=2) > 0.0
    # Edges: borders of the screen and of its panels, and the outlines of balls.
    steps = [np.abs(np.diff(wanted, axis=k)).max(axis=2) for k in (0, 1)]
    edges = ~on_screen
    edges[1:] |= steps[0] > 0.01
    edges[:, 1:] |= steps[1] > 0.01
    padded = np.pad(edges, 3)
    near = np.max([padded[a : a + SIZE[1], b : b + SIZE[0]] for a in range(7) for b in range(7)], axis=0)
    inside = on_screen & ~near
    assert inside.mean() > 0.2
    assert np.ptp(wanted[inside], axis=0).min() > 0.05
    assert np.abs(shown - wanted)[inside].max() <= 1 / 255


def test_volume_follows_the_screen_and_the_eye(stage, addon):
    screen, eye = stage
    assert bpy.ops.scfpf.camera_from_screen(pop_out=False) == {"FINISHED"}
    camera = bpy.context.scene.camera
    eye.location = (-0.5, -2.0, 1.0)
    screen.location = (0.2, 0.5, 0.1)
    bpy.context.view_layer.update()
    reading = addon("bridge.camera.read_projection").read_projection
    volume = reading(camera, bpy.context.evaluated_depsgraph_get(), 2.0).volume
    u, v = np.random.default_rng(3).uniform(0.02, 0.68, (2, 50))
    near, far = (volume.evaluate(u, v, np.full(50, t)).position for t in (0.0, 1.0))
    from_eye = near - np.array(eye.location)[:, None]
    along = far - near
    sine = np.linalg.norm(np.cross(from_eye.T, along.T), axis=1)
    assert np.abs(sine / np.linalg.norm(from_eye, axis=0) / np.linalg.norm(along, axis=0)).max() < 1e-5
    # On the arc: u is its angle, v its height.
    turn = (u / 0.7 * 40 - np.floor(u / 0.7 * 40)) * 0.04 + np.floor(u / 0.7 * 40) * 0.04 - 0.8
    x, y, z = near - np.array(screen.location)[:, None]
    assert np.abs(np.arctan2(x, y + 1.5) - turn).max() < 2e-3
    assert np.abs(z - (0.2 + 2 * v)).max() < 1e-3


@pytest.mark.usefixtures("stage")
def test_with_pop_out_projectors_begin_near_the_eye_and_end_where_they_end_without(addon):
    u, v = np.random.default_rng(4).uniform(0.02, 0.68, (2, 50))
    ends = []
    for pop_out in (False, True):
        select_eye_and_screen()
        assert bpy.ops.scfpf.camera_from_screen(pop_out=pop_out) == {"FINISHED"}
        depsgraph = bpy.context.evaluated_depsgraph_get()
        volume = (
            addon("bridge.camera.read_projection").read_projection(bpy.context.object, depsgraph, 2).volume
        )
        ends += [volume.evaluate(u, v, np.full(50, t)).position - np.array([EYE]).T for t in (0.0, 1.0)]
    on_screen, far, near, same_far = ends
    assert np.abs(same_far - far).max() < 1e-4
    assert np.abs(near / 0.01 - on_screen).max() < 1e-3


def test_a_screen_that_things_pop_out_of_is_shown_by_ordinary_cameras_alone(stage, addon):
    """Without Pop Out the screen is in other flexible cameras' images as any thing is."""
    screen, _eye = stage
    left_out = addon("bridge.camera.flexible_camera").control_objects
    assert bpy.ops.scfpf.camera_from_screen(pop_out=False) == {"FINISHED"}
    assert screen.name_full not in left_out()
    select_eye_and_screen()
    assert bpy.ops.scfpf.camera_from_screen() == {"FINISHED"}
    assert screen.name_full in left_out() and not screen.hide_render and screen.visible_camera
    for is_seen in (False, True):
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
        bpy.context.view_layer.update()
        assert screen.visible_camera == is_seen and screen.visible_shadow == is_seen


def test_an_eye_on_the_screen_and_a_mesh_without_uvs_are_refused(stage):
    screen, eye = stage
    eye.location = screen.data.vertices[0].co
    bpy.context.view_layer.update()
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="The eye is on 'Screen'"):
        bpy.ops.scfpf.camera_from_screen()
    screen.data.uv_layers.remove(screen.data.uv_layers[0])
    screen.data.update_tag()
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="unwrap it"):
        bpy.ops.scfpf.camera_from_screen()
    assert len(bpy.data.objects) == count


def test_without_an_eye_the_cursor_is_the_eye(stage):
    _screen, eye = stage
    eye.select_set(False)
    bpy.context.scene.cursor.location = (0.1, -4.0, 1.5)
    assert bpy.ops.scfpf.camera_from_screen() == {"FINISHED"}
    assert (bpy.context.scene.camera.location - Vector((0.1, -4.0, 1.5))).length < 1e-6
