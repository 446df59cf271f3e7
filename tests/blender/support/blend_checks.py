# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras that are blended, and samples of their projectors."""

import bpy
import numpy as np

ASPECT = 16 / 9


def new_camera():
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
