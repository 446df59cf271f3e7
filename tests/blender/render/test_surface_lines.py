# SPDX-License-Identifier: GPL-3.0-or-later
"""From object to arrays to overlay lines, for each kind: the green lines lie on the evaluated mesh."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector
from mathutils.bvhtree import BVHTree

# A point has no lines.
KINDS = ("PLANE", "PATCH", "DISC", "CYLINDER", "CONE", "SPHERE", "GRID", "UV_MESH", "NURBS", "LATTICE")
# The lines are exact, Blender's mesh has facets: share of the size.
FACETS = 0.01
PLACE = Matrix.LocRotScale(Vector((1, -2, 3)), Euler((0.3, -0.7, 1.1)), Vector((1.5, 0.4, -2.0)))


@pytest.fixture
def lines(addon):
    """The overlay lines of a camera's control surfaces, a list of (S, 2, 3)."""
    read_projection = addon("bridge.camera.read_projection").read_projection
    surface_lines = addon("projection.diagrams.surface_lines").surface_lines

    def drawn(camera):
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        projection = read_projection(camera, depsgraph, 16 / 9)
        return [surface_lines(projection, index) for index in range(len(projection.volume.surfaces))]

    return drawn


def layer(lattice, number):
    """The points of a layer along W, and its cells, as ``evaluated_mesh``."""
    u, v = lattice.data.points_u, lattice.data.points_v
    points = [lattice.matrix_world @ p.co_deform for p in lattice.data.points]
    cells = [
        (row * u + c, row * u + c + 1, (row + 1) * u + c + 1, (row + 1) * u + c)
        for row in range(v - 1)
        for c in range(u - 1)
    ]
    return points[number * u * v : (number + 1) * u * v], cells


def evaluated_mesh(obj):
    """World positions and polygons of an object as evaluated."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    found = (
        [evaluated.matrix_world @ vertex.co for vertex in mesh.vertices],
        [tuple(p.vertices) for p in mesh.polygons],
    )
    evaluated.to_mesh_clear()
    return found


def assert_on(segments, vertices, polygons):
    """Assert that every end of the lines lies on the mesh, and that they reach as far."""
    tree = BVHTree.FromPolygons(vertices, polygons)
    corners = np.array(vertices)
    ends = segments.reshape(-1, 3)
    size = np.ptp(corners, axis=0).max()
    assert len(ends) > 100
    assert max(tree.find_nearest(Vector(end))[3] for end in ends[:: max(1, len(ends) // 400)]) < FACETS * size
    np.testing.assert_allclose(ends.min(axis=0), corners.min(axis=0), atol=FACETS * size)
    np.testing.assert_allclose(ends.max(axis=0), corners.max(axis=0), atol=FACETS * size)


@pytest.mark.parametrize("kind", KINDS)
def test_lines_lie_on_the_evaluated_object(lines, kind):
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    bpy.ops.scfpf.surface_add(kind=kind)
    index = camera.scfpf.active_surface
    surface = camera.scfpf.surfaces[index].object
    assert surface.scfpf_surface.kind == kind
    before = lines(camera)
    surface.matrix_world = PLACE @ surface.matrix_world
    if kind == "LATTICE":
        for axis in "uvw":
            setattr(surface.data, f"interpolation_type_{axis}", "KEY_LINEAR")
        surface.data.points[0].co_deform.x -= 0.2
    drawn = lines(camera)
    assert not np.array_equal(drawn[index], before[index])
    others = [number for number in range(len(drawn)) if number in (0, len(drawn) - 1)]
    assert all(np.array_equal(drawn[number], before[number]) for number in others)
    if kind == "LATTICE":
        count = surface.data.points_w
        assert len(drawn) == 2 + count
        for number in range(count):
            # The near side of a lattice is at +Z, its last layer.
            assert_on(drawn[index + number], *layer(surface, count - 1 - number))
    else:
        assert_on(drawn[index], *evaluated_mesh(surface))
