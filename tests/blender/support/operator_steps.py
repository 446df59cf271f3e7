# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of tests of operators: add objects and cameras, read a volume, ask why an operator cannot run."""

import bpy
import pytest


def add_cube(location=(0, 0, 0)):
    bpy.ops.mesh.primitive_cube_add(location=location)
    return bpy.context.object


def add_camera(**options):
    assert bpy.ops.scfpf.camera_add(**options) == {"FINISHED"}
    return bpy.context.object


def surface_names(camera):
    return [slot.object.name for slot in camera.scfpf.surfaces]


def projection_of(addon, camera):
    read = addon("bridge.camera.read_projection").read_projection
    return read(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9)


def poll_message(operator, **override):
    """Blender's message when an operator cannot run."""
    with bpy.context.temp_override(**override), pytest.raises(RuntimeError) as caught:
        operator()
    return str(caught.value)
