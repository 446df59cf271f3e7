# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes → arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

# Beyond this the square of a float32 coordinate overflows; Blender itself turns an infinite one into 3.4e38.
LARGEST_COORDINATE = 1e18


@dataclass(frozen=True)
class MeshArrays:
    """One mesh as evaluated, in its own space.

    vertices: (V, 3) float32. triangles: (T, 3) int32. normals: (T, 3, 3) float32,
    the shading normal at each corner, or (T, 1, 3) where a triangle's corners have the same; None where
    that is the triangle's own.
    slot: (T,) int32, material slot numbers.
    finite: False if triangles were left out because of non-finite vertices. uv: (T, 3, 2)
    float32 texture coordinates of the corners, None if there are none or they are not wanted.
    kept: of the mesh's triangles, None for all. layers: by name, what materials ask for.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float32] | None
    slot: NDArray[np.int32]
    finite: bool = True
    uv: NDArray[np.float32] | None = None
    kept: NDArray[np.bool_] | None = None
    layers: dict[str, NDArray[np.float32]] = field(default_factory=dict)


def of_mesh(thing, read):
    """read(mesh) of an evaluated object's mesh."""
    try:
        # The evaluated mesh of an object in Edit Mode has no arrays yet: to_mesh() makes them.
        return read(thing.to_mesh() if thing.data.is_editmode else thing.data)
    finally:
        if thing.data.is_editmode:
            thing.to_mesh_clear()


def read_mesh(mesh, with_uv: bool = False) -> MeshArrays:
    """The arrays of an evaluated bpy.types.Mesh. with_uv: the texture coordinates, too."""
    face, corners = _triangulation(mesh)
    count = len(mesh.polygons) if face is None else len(face)
    vertices = np.empty((len(mesh.vertices) if count else 0, 3), np.float32)
    slot = np.zeros(count, np.int32)
    if count == 0:
        return MeshArrays(vertices, np.empty((0, 3), np.int32), np.empty((0, 3, 3), np.float32), slot)
    # Attributes' memory is copied at once; vertices[].co and loops[].vertex_index go one by one.
    mesh.attributes["position"].data.foreach_get("vector", vertices.reshape(-1))
    corner_vertex = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", corner_vertex)
    if "material_index" in mesh.attributes:
        face_slot = np.empty(len(mesh.polygons), np.int32)
        mesh.attributes["material_index"].data.foreach_get("value", face_slot)
        slot = _taken(face_slot, face)
    uv = None
    layer = next((each for each in mesh.uv_layers if each.active_render), None) if with_uv else None
    if layer is not None:
        corner_uv = np.empty((len(mesh.loops), 2), np.float32)
        layer.uv.foreach_get("vector", corner_uv.reshape(-1))
        uv = _taken(corner_uv, corners).reshape(-1, 3, 2)
    triangles = _taken(corner_vertex, corners).reshape(-1, 3)
    normals = _read_normals(mesh, corners)
    return _finite(MeshArrays(vertices, triangles, normals, slot, uv=uv))


def _triangulation(mesh) -> tuple[NDArray[np.int32] | None, NDArray[np.int32] | None]:
    """The face of each triangle (T,), and their corners (3T,); None for as they come.

    Where all faces are triangles Blender need not cut them up, which takes longer than to read them.
    """
    # No face has fewer corners, or Blender's own Validate would take it away.
    if len(mesh.loops) == 3 * len(mesh.polygons):
        return None, None
    mesh.calc_loop_triangles()
    face = np.empty(len(mesh.loop_triangles), np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", face)
    corners = np.empty(3 * len(face), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    return face, corners


def _taken(values: NDArray, which: NDArray[np.int32] | None) -> NDArray:
    """The rows ``which`` of values, None for all."""
    return values if which is None else values.take(which, axis=0)


def _read_normals(mesh, corners: NDArray[np.int32] | None) -> NDArray[np.float32] | None:
    """Normals as in ``MeshArrays``. corners: of the triangles, see ``_triangulation``.

    Return None for flat shading: as in Cycles each triangle then has its own normal, not its polygon's.
    """
    if mesh.normals_domain == "FACE":
        return None
    normal = np.empty((len(mesh.loops), 3), np.float32)
    mesh.corner_normals.foreach_get("vector", normal.reshape(-1))
    return _taken(normal, corners).reshape(-1, 3, 3)


def own_normals(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Unit normals of triangles (T, 3) over vertices (V, 3), (T, 1, 3); 0 for a triangle without area."""
    corner = vertices.astype(np.float64)[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return (normal / np.where(length > 0.0, length, 1.0)).astype(np.float32)[:, None]


def _finite(mesh: MeshArrays) -> MeshArrays:
    """The mesh without the triangles that have a NaN, infinite or as good as infinite corner."""
    if max(mesh.vertices.max(), -mesh.vertices.min()) <= LARGEST_COORDINATE:
        return mesh
    good = (np.abs(mesh.vertices) <= LARGEST_COORDINATE).all(axis=1)
    keep = good[mesh.triangles].all(axis=1)
    return MeshArrays(
        # No triangle uses the bad ones any more; they must not stretch the scene's bounds.
        np.where(good[:, None], mesh.vertices, mesh.vertices[good][:1] if good.any() else 0.0),
        mesh.triangles[keep],
        None if mesh.normals is None else mesh.normals[keep],
        mesh.slot[keep],
        finite=False,
        uv=None if mesh.uv is None else mesh.uv[keep],
        kept=keep,
    )
