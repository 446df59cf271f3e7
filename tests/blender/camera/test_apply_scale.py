# SPDX-License-Identifier: GPL-3.0-or-later
"""A parametric surface's scale becomes its sizes, and nothing moves."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

U, V, T = np.random.default_rng(7).random((3, 100))
FLOAT32 = 3e-6


@pytest.fixture
def shown(addon):
    def positions(camera):
        read = addon("bridge.camera.read_projection").read_projection
        bpy.context.view_layer.update()
        return read(camera, bpy.context.evaluated_depsgraph_get(), 1.5).volume.evaluate(U, V, T).position

    return positions


@pytest.fixture
def camera_with(addon):
    def make(kind):
        """A flexible camera with a plane and a surface of ``kind``, the active one."""
        add = addon("bridge.camera.flexible_camera").add_surface
        bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
        camera = bpy.context.object
        camera.scfpf.enabled = True
        add(camera, "PLANE", "Near", Matrix.Translation((0, 0, -1)))
        add(camera, kind, "Far", Matrix.Translation((1, 0, -9)) @ Matrix.Rotation(0.5, 4, "Y"))
        camera.scfpf.active_surface = 1
        bpy.context.view_layer.update()
        return camera

    return make


@pytest.mark.parametrize(
    ("kind", "scale"),
    [
        ("POINT", (2, 3, -4)),
        ("PLANE", (2, -3, 4)),
        ("DISC", (-3, 3, 4)),
        ("CYLINDER", (2, 3, -2)),
        ("CONE", (-2, 0.5, 2)),
        ("SPHERE", (2, 2, -2)),
        ("PARABOLOID", (-2, 2, 3)),
    ],
)
def test_a_scale_becomes_sizes(camera_with, shown, kind, scale):
    camera = camera_with(kind)
    surface = camera.scfpf.surfaces[1].object
    surface.scale = scale
    surface.delta_scale = (1.5, 1.5, 1.5)
    child = bpy.data.objects.new("Child", None)
    bpy.context.scene.collection.objects.link(child)
    child.parent, child.location = surface, (1, 2, 3)
    bpy.context.view_layer.update()
    before, place = shown(camera), np.array(child.matrix_world)
    assert bpy.ops.scfpf.surface_apply_scale() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.abs(shown(camera) - before).max() < FLOAT32 * np.abs(before).max()
    assert tuple(surface.scale) == tuple(np.sign(scale)) and surface.scfpf_surface.kind == kind
    assert tuple(surface.delta_scale) == (1, 1, 1)
    # Between scale and location nothing is turned, so the child's own axes are stretched as they were.
    assert np.allclose(np.array(child.matrix_world), place, atol=1e-5)


def test_a_scale_that_no_size_can_have_is_refused_before_anything_changes(camera_with, shown):
    for kind, scale, message in (
        ("CYLINDER", (2, 1, 3), "unevenly"),
        ("PLANE", (0, 1, 1), "scale is 0"),
        ("POINT", (0, 1, 1), "scale of 0"),
        ("GRID", (2, 2, 2), "Apply > Scale"),
    ):
        camera = camera_with(kind)
        surface = camera.scfpf.surfaces[1].object
        surface.scale = scale
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.scfpf.surface_apply_scale()
        assert tuple(surface.scale) == scale
    camera = camera_with("SPHERE")
    camera.scfpf.surfaces[1].object.scale = 2, 2, 2
    camera.scfpf.surfaces[1].object.keyframe_insert("scale", frame=1)
    with pytest.raises(RuntimeError, match="animation"):
        bpy.ops.scfpf.surface_apply_scale()


def world_lengths(surface):
    """Half the extents of a surface's mesh about its middle along its own axes, as Blender shows it."""
    evaluated = surface.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.array([surface.matrix_world @ vertex.co for vertex in evaluated.to_mesh().vertices])
    evaluated.to_mesh_clear()
    axes = np.array(surface.matrix_world.to_3x3().normalized())
    return np.ptp(points @ axes, axis=0)


@pytest.mark.parametrize("kind", ["PLANE", "DISC", "SPHERE"])
def test_the_whole_scale_becomes_sizes(addon, camera_with, shown, kind):
    """The scales of the camera and of the parent inverse count too; Blender draws the resulting sizes."""
    scales = addon("bridge.camera.surface_scale")
    sizes = addon("bridge.surfaces.surface_object").surface_parameters
    camera = camera_with(kind)
    surface = camera.scfpf.surfaces[1].object
    camera.scale = 2, 2, -2
    surface.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "Z") @ Matrix.Scale(1.7, 4)
    surface.rotation_euler = 0.4, 0.1, -0.9
    bpy.context.view_layer.update()
    told = dict(scales.world_sizes(surface))
    before, lengths = shown(camera), world_lengths(surface)
    assert bpy.ops.scfpf.surface_apply_scale() == {"FINISHED"}
    assert np.abs(shown(camera) - before).max() < FLOAT32 * np.abs(before).max()
    assert np.allclose(world_lengths(surface), lengths, rtol=1e-5, atol=1e-4)
    now = sizes(surface)
    name = "width" if kind == "PLANE" else "radius"
    assert now[name] * (1 if kind == "PLANE" else 2) == pytest.approx(lengths[0], rel=1e-5)
    assert told[name.title()] == pytest.approx(now[name], rel=1e-6)
    assert not scales.is_scaled(surface) and not bpy.ops.scfpf.surface_apply_scale.poll()


def test_a_sheared_surface_is_refused(camera_with):
    camera = camera_with("PLANE")
    surface = camera.scfpf.surfaces[1].object
    surface.rotation_euler = 0, 0, 0.5
    surface.matrix_parent_inverse = Matrix.Diagonal((3, 1, 1, 1))
    with pytest.raises(RuntimeError, match="sheared"):
        bpy.ops.scfpf.surface_apply_scale()
    surface.matrix_parent_inverse = Matrix.Scale(3, 4)
    surface.constraints.new("LIMIT_SCALE")
    with pytest.raises(RuntimeError, match="constraints"):
        bpy.ops.scfpf.surface_apply_scale()


def test_rounding_is_no_scale(addon, camera_with):
    scales = addon("bridge.camera.surface_scale")
    camera = camera_with("SPHERE")
    surface = camera.scfpf.surfaces[1].object
    for scale, offered in ((1.0000002, False), (1.000005, False), (1.0001, True), (-1.0, False)):
        surface.scale = scale, scale, scale
        bpy.context.view_layer.update()
        assert scales.is_scaled(surface) == bpy.ops.scfpf.surface_apply_scale.poll() == offered, scale
