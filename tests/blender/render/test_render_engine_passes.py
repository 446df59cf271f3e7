# SPDX-License-Identifier: GPL-3.0-or-later
"""Data passes of the engine, against Cycles, Blender's own matrices and the casting itself."""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from engine_images import f12
from mathutils import Vector
from shown_materials import add, new_material, show

FARTHEST = 1e10
FLOAT32 = 2e-6
STANDARD = ("z", "position", "normal", "uv", "object_index", "material_index")


def switch_on(view_layer):
    for name in STANDARD:
        setattr(view_layer, f"use_pass_{name}", True)
    for name in ("parameters", "perspective_depth", "tangent"):
        setattr(view_layer.scfpf, f"use_pass_{name}", True)


def index_names(addon):
    return addon("bridge.blender.versions").index_pass_names()


@pytest.fixture
def view(engine_scene):
    """The scene with every pass, a numbered ball before the numbered cube, and an ordinary camera."""
    bpy.data.objects["Cube"].pass_index = 7
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=(1.5, -1.5, 0.8))
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    ball.pass_index = 3
    material = bpy.data.materials.new("Numbered")
    material.pass_index = 11
    ball.data.materials.append(material)
    switch_on(engine_scene.view_layers[0])
    return engine_scene


@pytest.fixture
def ordinary(view):
    bpy.ops.object.camera_add(location=(4, -4, 3), rotation=(1.05, 0.1, 0.8))
    view.camera = bpy.context.object
    view.camera.data.clip_end = 30
    return view


def layer(made, name):
    return made[f"ViewLayer.{name}"]


def test_one_list_names_the_passes_of_the_file_and_of_the_compositor(addon, view):
    listed = list(addon("bridge.render.render_passes").list_render_passes(view.view_layers[0]))
    made = f12(view)
    assert {f"ViewLayer.{each.name}": len(each.channels) for each in listed} == {
        name: values.shape[2] for name, values in made.items()
    }
    assert len(listed) == 10


def test_passes_switched_off_are_not_there(engine_scene):
    view_layer = engine_scene.view_layers[0]
    for name in ("z", "position", "normal"):
        setattr(view_layer, f"use_pass_{name}", False)
    assert set(f12(engine_scene)) == {"ViewLayer.Combined"}


def test_data_passes_of_objects_that_are_seen_through_are_named(addon, view):
    prepare = addon("bridge.render.render_inputs").read_inputs
    material = new_material("Leaf")
    shader = add(material.node_tree, "ShaderNodeBsdfPrincipled", Alpha=0.5)
    show(material.node_tree, shader.outputs[0])
    bpy.data.objects["Cube"].data.materials.append(material)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for passes, count in ((("DIFFUSE",), 0), (("DIFFUSE", "DEPTH"), 1), (("CRYPTO_OBJECT_0",), 1)):
        warnings = prepare(depsgraph, view.camera, (16, 9), passes=passes).scene.warnings
        named = [line for line in warnings if line.startswith("Data passes") and line.endswith(": Leaf")]
        assert len(named) == count


def test_compositor_has_a_socket_for_each_pass(view):
    if hasattr(view, "compositing_node_group"):
        tree = view.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    else:
        view.use_nodes = True
        tree = view.node_tree
    node = tree.nodes.new("CompositorNodeRLayers")
    view.view_layers[0].update_render_passes()
    sockets = {socket.name for socket in node.outputs if socket.enabled}
    assert {"Depth", "Position", "Normal", "UV", "ProjectorParameters", "ProjectorTangent"} <= sockets
    assert "PerspectiveDepth" in sockets
    view.view_layers[0].scfpf.use_pass_tangent = False
    assert "ProjectorTangent" not in {socket.name for socket in node.outputs if socket.enabled}


def test_compositor_is_given_the_passes_themselves(view):
    if hasattr(view, "compositing_node_group"):
        tree = view.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        view.use_nodes = True
        tree = view.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    node = tree.nodes.new("CompositorNodeRLayers")
    view.view_layers[0].update_render_passes()
    tree.links.new(node.outputs["ProjectorParameters"], output.inputs["Image"])
    made = f12(view)
    assert np.ptp(layer(made, "ProjectorParameters")) > 0.1
    assert np.array_equal(made["Composite.Combined"][..., :3], layer(made, "ProjectorParameters"))


def test_passes_leave_the_image_alone(view):
    with_passes = layer(f12(view), "Combined")
    for name in STANDARD:
        setattr(view.view_layers[0], f"use_pass_{name}", False)
    assert np.array_equal(layer(f12(view), "Combined"), with_passes)


def test_passes_of_an_ordinary_camera_are_those_of_cycles(addon, ordinary):
    # A mirrored instance of a mesh with another map for renders, and a mesh without any.
    cube = bpy.data.objects["Cube"]
    cube.scale.x = -1
    chosen = cube.data.uv_layers.new(name="Chosen")
    chosen.uv.foreach_set("vector", np.linspace(-1, 2, 48, dtype=np.float32))
    chosen.active_render = True
    bpy.ops.mesh.primitive_plane_add(location=(0, 0, -1), size=4, calc_uvs=False)
    bpy.context.object.pass_index = 5
    made = f12(ordinary)
    ordinary.render.engine = "CYCLES"
    ordinary.cycles.samples, ordinary.cycles.use_denoising = 1, False
    # One sample, at the pixel's centre.
    ordinary.cycles.pixel_filter_type, ordinary.cycles.filter_width = "BOX", 0.01
    theirs = f12(ordinary)
    # At silhouettes the filter's last hundredth of a pixel may decide.
    number, material = index_names(addon)
    same = (layer(made, number) == layer(theirs, number))[..., 0]
    hit = same & (layer(made, number) > 0)[..., 0]
    assert same.mean() > 0.998 and 200 < hit.sum() < same.size - 200
    assert set(np.unique(layer(made, number))) == {0, 3, 5, 7}
    assert np.array_equal(layer(made, material)[same], layer(theirs, material)[same])
    assert set(np.unique(layer(made, material))) == {0, 11}
    # A hundredth of a pixel on a surface seen aslant.
    for name in ("Position", "Depth"):
        off = np.abs(layer(made, name) - layer(theirs, name))[hit].max(axis=1)
        assert np.quantile(off, 0.99) < 3e-3 and np.median(off) < 5e-4, name
    off = np.abs(layer(made, "Normal") - layer(theirs, "Normal"))[hit].max(axis=1)
    assert np.quantile(off, 0.99) < 5e-3
    assert layer(made, "UV").shape[2] == 3
    off = np.abs(layer(made, "UV") - layer(theirs, "UV"))[hit].max(axis=1)
    assert np.quantile(off, 0.98) < 5e-3 and np.median(off) < 5e-4
    assert not layer(made, "UV")[layer(made, number)[..., 0] == 5].any(), "a mesh without a map has none"
    missed = same & (layer(made, number) == 0)[..., 0]
    for name in ("Position", "Normal", "UV", "Depth"):
        assert np.array_equal(layer(made, name)[missed], layer(theirs, name)[missed]), name


def test_depth_of_an_ordinary_camera_is_blenders_z(ordinary):
    made = f12(ordinary)
    position, depth = layer(made, "Position"), layer(made, "Depth")[..., 0]
    camera = ordinary.camera
    for j, i in np.argwhere(depth < FARTHEST)[::37]:
        seen = world_to_camera_view(ordinary, camera, Vector(position[j, i].tolist()))
        assert seen.z == pytest.approx(depth[j, i], rel=FLOAT32)
        assert abs(seen.x - (i + 0.5) / 64) < 1e-5 and abs(seen.y - (j + 0.5) / 36) < 1e-5


@pytest.mark.parametrize("lens", ["PERSP", "ORTHO"])
def test_perspective_depth_is_that_of_a_perspective(ordinary, lens):
    ordinary.camera.data.type = lens
    made = f12(ordinary)
    z, depth = (layer(made, name)[..., 0].astype(np.float64) for name in ("Depth", "PerspectiveDepth"))
    hit = z < FARTHEST
    assert hit.sum() > 200 and (depth[~hit] == 1).all()
    near, far = ordinary.camera.data.clip_start, ordinary.camera.data.clip_end
    linear = (z[hit] - near) / (far - near)
    expected = far * (1 - near / z[hit]) / (far - near) if lens == "PERSP" else linear
    assert np.allclose(depth[hit], expected, atol=1e-6)


@pytest.mark.parametrize("preset", ["perspective", "nonlinear_twist", "around_the_car"])
def test_passes_of_a_volume_agree_with_its_mathematics(addon, view, preset):
    bpy.context.view_layer.objects.active = view.camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    made = f12(view)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_projection(view.camera, depsgraph, 64 / 36)
    depth = layer(made, "Depth")[..., 0]
    hit = depth < FARTHEST
    assert hit.sum() > 20
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(36) + 0.5) / 36)
    u, v, t = layer(made, "ProjectorParameters")[hit].T.astype(np.float64)
    image = projection.parameters(x[hit], y[hit])
    assert np.allclose(u, image.u, atol=1e-6) and np.allclose(v, image.v, atol=1e-6)
    assert t.min() > 0 and t.max() < 1
    exact = projection.volume.evaluate(image.u, image.v, t)
    perspective = layer(made, "PerspectiveDepth")[hit]
    assert perspective.min() > 0 and perspective.max() < 1
    position = layer(made, "Position")[hit].T
    reach = np.abs(exact.position).max()
    assert np.abs(exact.position - position).max() < 1e-4 * reach
    tangent = exact.dt / np.linalg.norm(exact.dt, axis=0)
    assert np.abs(layer(made, "ProjectorTangent")[hit].T - tangent).max() < 1e-4
    # The length of a projector, by 4,000 straight pieces.
    steps = np.linspace(0, 1, 4001)
    for place in np.flatnonzero(hit.ravel())[::97]:
        number = np.searchsorted(np.flatnonzero(hit.ravel()), place)
        times = steps * t[number]
        curve = projection.volume.evaluate(
            np.full(4001, image.u[number]), np.full(4001, image.v[number]), times
        ).position
        length = np.linalg.norm(np.diff(curve, axis=1), axis=0).sum()
        if preset == "perspective":
            # The camera's own view: what Blender calls a depth.
            length = -(view.camera.matrix_world.inverted() @ Vector(curve[:, -1])).z
        assert depth.ravel()[place] == pytest.approx(length, rel=1e-4)
    normal = layer(made, "Normal")[hit].T
    assert np.allclose(np.linalg.norm(normal, axis=0), 1, atol=1e-5)
    assert ((normal * tangent).sum(axis=0) < 0.2).all(), "normals face the viewer"
    for name, miss in (("Depth", FARTHEST), ("Position", 0), ("Normal", 0), ("ProjectorParameters", 0)):
        assert (layer(made, name)[~hit] == miss).all()


def test_passes_in_a_border_are_those_of_the_whole(view):
    bpy.context.view_layer.objects.active = view.camera
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist") == {"FINISHED"}
    whole = f12(view)
    render = view.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.6, 0.3, 0.7
    part = f12(view)
    assert set(part) == set(whole)
    for name, values in part.items():
        assert np.array_equal(values, whole[name][10:25, 16:38]), name
