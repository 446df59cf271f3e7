# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras and volumes of a few surfaces, what the volume object takes, samples of projectors, and presets."""

import pathlib

import bpy
import numpy as np
from mathutils import Matrix

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "presets"
# For tests of which each costs seconds: those that the demo shows.
PRESETS = [
    FOLDER / f"{stem}.json"
    for stem in (
        "angular_fisheye",
        "around_the_car",
        "cylindrical_panorama",
        "inverted_perspective",
        "nonlinear_twist",
        "orthographic",
        "perspective",
    )
]
# Of the image of ``small_camera``.
ASPECT = 16 / 9


def new_camera(name="Camera", scene=None):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    (scene or bpy.context.scene).collection.objects.link(camera)
    return camera


def names(camera):
    return [slot.object.name if slot.object else None for slot in camera.scfpf.surfaces]


def taken(camera):
    """Names of what the volume object's modifier takes."""
    modifier = camera.scfpf.volume_object.modifiers[0]
    sockets = [i.identifier for i in modifier.node_group.interface.items_tree if i.in_out == "INPUT"]
    inputs = modifier.properties.inputs if bpy.app.version >= (5, 2, 0) else None
    values = [getattr(inputs, i).value if inputs else modifier[i] for i in sockets]
    return [value.name if value else None for value in values]


def read(reading, camera, scene=None, aspect=1.0):
    layer = (scene or bpy.context.scene).view_layers[0]
    with bpy.context.temp_override(scene=scene or bpy.context.scene, view_layer=layer):
        return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), aspect)


def three_surfaces(bridge, camera):
    bridge.make_flexible(camera)
    return [
        bridge.add_surface(camera, kind, name, Matrix.Translation((0, 0, -depth)))
        for kind, name, depth in (("PLANE", "A", 1), ("DISC", "B", 2), ("GRID", "C", 3))
    ]


def small_camera():
    """A flexible camera in a scene with a small image."""
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 90, 100
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    made = bpy.context.object
    made.location, made.rotation_euler = (1, -2, 3), (1.2, 0.1, 0.4)
    return made


def places(seed=5):
    """Random image positions and t, (3, 400)."""
    return np.random.default_rng(seed).uniform(0.02, 0.98, size=(3, 400))


def sampler(addon):
    """A function of a camera: Q at ``places``, (3, N) in world space, and which of them the image shows."""
    read = addon("bridge.camera.read_projection").read_projection

    def sample(camera, seed=5):
        x, y, t = places(seed)
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
        image = projection.parameters(x, y)
        return projection.volume.evaluate(image.u, image.v, t).position, image.mask

    return sample


def at(camera, factor):
    """Set the factor of a blend."""
    camera.scfpf.blend_factor = factor
    bpy.context.view_layer.update()
    return camera


def is_near(found, wanted, mask, share):
    """Whether points are within a share of the size of the wanted ones."""
    size = np.ptp(wanted[:, mask], axis=1).max()
    return np.linalg.norm(found - wanted, axis=0)[mask].max() <= share * size
