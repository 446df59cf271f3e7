# SPDX-License-Identifier: GPL-3.0-or-later
"""The records of the kinds of control surface: complete, told apart, numbered as in files, of one formula."""

import bpy
import numpy as np
import pytest

# The drawn mesh is float32.
DRAWN = 1e-6
# How files store the property ``kind``, and meshes the kind that made them.
NUMBERS = {"NONE": 0, "POINT": 1, "PLANE": 2, "PATCH": 3, "DISC": 4, "CYLINDER": 5, "CONE": 6, "SPHERE": 7}
NUMBERS |= {"GRID": 8, "UV_MESH": 9, "NURBS": 10, "LATTICE": 11, "PARABOLOID": 12}
MESH_NUMBERS = {"POINT": 1, "PLANE": 2, "DISC": 3, "CYLINDER": 4, "CONE": 5, "SPHERE": 6, "PARABOLOID": 7}


@pytest.fixture
def kinds(addon):
    return addon("bridge.surfaces.kinds")


def test_every_record_has_its_part_in_blender(addon, kinds):
    assert list(kinds.BLENDER_KINDS) == list(addon("projection.surfaces.kinds").SURFACE_KINDS)
    icons = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items
    for kind in kinds.BLENDER_KINDS.values():
        assert kind.icon in icons.keys()
        assert bool(kind.formula) == bool(kind.handles) == bool(kind.parameters)
    labels = [{one.label for one in kind.inputs} for kind in kinds.PARAMETRIC_KINDS.values()]
    assert all(labels.count(one) == 1 for one in labels), "a surface's kind is found by its inputs"


def test_files_store_the_same_numbers(addon):
    items = bpy.types.Object.bl_rna.properties["scfpf_surface"].fixed_type.properties["kind"].enum_items
    assert {item.identifier: item.value for item in items} == NUMBERS
    assert addon("bridge.surfaces.surface_groups").KIND_NUMBERS == MESH_NUMBERS


def test_node_formulas_are_those_of_the_classes(addon, kinds):
    new_surface = addon("bridge.surfaces.surface_object").new_surface
    generator = np.random.default_rng(3)
    for key, kind in kinds.PARAMETRIC_KINDS.items():
        for _ in range(3 * bool(kind.formula)):
            parameters = {
                one.key: np.float32(generator.uniform(max(one.minimum, -5.0), min(one.maximum, 5.0))).item()
                for one in kind.parameters
            }
            surface = new_surface(None, key, parameters | {"resolution_u": 5, "resolution_v": 3})
            bpy.context.scene.collection.objects.link(surface)
            mesh = surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            points = np.array([mesh.vertices[loop.vertex_index].co for loop in mesh.loops]).T
            uv = np.array([corner.vector for corner in mesh.uv_layers["UVMap"].uv]).T
            exact = kind.record.surface(**parameters).evaluate(*uv).position
            assert np.abs(points - exact).max() < DRAWN * max(1.0, np.abs(exact).max()), key
            assert surface.name.startswith(kind.title)
