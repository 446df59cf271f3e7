# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

# The square of a larger float32 coordinate overflows; Blender itself turns an infinite one into 3.4e38.
LARGEST_COORDINATE = 1e18


@dataclass(frozen=True)
class MeshArrays:
    """One mesh as evaluated, in its own space.

    vertices: (V, 3) float32. triangles: (T, 3) int32. normals: (T, 3, 3) float32, the shading normal at each
    corner; (T, 1, 3) if a triangle's corners share one; None if that is the triangle's own. slot: (T,) int32,
    material slot numbers. finite: False if triangles with non-finite vertices were left out. uv: (T, 3, 2)
    float32, texture coordinates of the corners; None if the mesh has none or they are not wanted. kept: which
    triangles of the mesh these are, None for all. layers: those that materials use, by name.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float32] | None
    slot: NDArray[np.int32]
    finite: bool = True
    uv: NDArray[np.float32] | None = None
    kept: NDArray[np.bool_] | None = None
    layers: dict[str, NDArray[np.float32]] = field(default_factory=dict)


def of_mesh(obj, read):
    """Return read(mesh) of an evaluated object's mesh."""
    try:
        # In Edit Mode the evaluated mesh has no arrays yet: to_mesh() makes them.
        return read(obj.to_mesh() if obj.data.is_editmode else obj.data)
    finally:
        if obj.data.is_editmode:
            obj.to_mesh_clear()


def read_mesh(mesh, with_uv: bool = False) -> MeshArrays:
    """Read the arrays of an evaluated bpy.types.Mesh. with_uv: the texture coordinates, too."""
    face, corners = _triangulation(mesh)
    count = len(mesh.polygons) if face is None else len(face)
    slot = np.zeros(count, np.int32)
    if count == 0:
        no_corners = np.empty((0, 3, 3), np.float32)
        return MeshArrays(no_corners[:, 0], np.empty((0, 3), np.int32), no_corners, slot)
    # Attributes' memory is copied at once; vertices[].co and loops[].vertex_index go one by one.
    vertices = foreach(mesh.attributes["position"].data, "vector", 3)
    triangles = _taken(corner_vertices(mesh), corners).reshape(-1, 3)
    if "material_index" in mesh.attributes:
        slot = _taken(foreach(mesh.attributes["material_index"].data, "value", dtype=np.int32), face)
    uv = None
    layer = next((each for each in mesh.uv_layers if each.active_render), None) if with_uv else None
    if layer is not None:
        uv = _taken(foreach(layer.uv, "vector", 2), corners).reshape(-1, 3, 2)
    return _finite(MeshArrays(vertices, triangles, _read_normals(mesh, corners), slot, uv=uv))


def foreach(items, name: str, channels: int = 1, dtype: type = np.float32) -> NDArray:
    """The values of a property of all items, (n,) or (n, channels)."""
    values = np.empty(len(items) * channels, dtype)
    items.foreach_get(name, values)
    return values if channels == 1 else values.reshape(-1, channels)


def corner_vertices(mesh) -> NDArray[np.int32]:
    """The vertex of each face corner."""
    return foreach(mesh.attributes[".corner_vert"].data, "value", dtype=np.int32)


def triangle_corners(mesh) -> NDArray[np.int32]:
    """The face corners of the triangles, (3T,); call ``calc_loop_triangles`` before."""
    return foreach(mesh.loop_triangles, "loops", 3, np.int32).reshape(-1)


def triangle_faces(mesh) -> NDArray[np.int32]:
    """The face of each triangle, (T,); call ``calc_loop_triangles`` before."""
    return foreach(mesh.loop_triangle_polygons, "value", dtype=np.int32)


def _triangulation(mesh) -> tuple[NDArray[np.int32] | None, NDArray[np.int32] | None]:
    """The face of each triangle (T,), and their corners (3T,); None if all faces are triangles in order.

    In that case Blender need not triangulate, which takes longer than reading.
    """
    # No face has fewer than three corners: Blender's own Validate would remove it.
    if len(mesh.loops) == 3 * len(mesh.polygons):
        return None, None
    mesh.calc_loop_triangles()
    return triangle_faces(mesh), triangle_corners(mesh)


def _taken(values: NDArray, which: NDArray[np.int32] | None) -> NDArray:
    """The rows ``which`` of values, None for all."""
    return values if which is None else values.take(which, axis=0)


def _read_normals(mesh, corners: NDArray[np.int32] | None) -> NDArray[np.float32] | None:
    """The normals of ``MeshArrays``. corners: of the triangles, see ``_triangulation``.

    None for flat shading: as in Cycles each triangle then has its own normal, not its polygon's.
    """
    if mesh.normals_domain == "FACE":
        return None
    return _taken(foreach(mesh.corner_normals, "vector", 3), corners).reshape(-1, 3, 3)


def own_normals(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Unit normals of triangles (T, 3) over vertices (V, 3), (T, 1, 3); 0 for a triangle without area."""
    corner = vertices.astype(np.float64)[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return (normal / np.where(length > 0.0, length, 1.0)).astype(np.float32)[:, None]


def without_slots(mesh: MeshArrays, hidden: frozenset[int], slots: int) -> MeshArrays:
    """The mesh without the triangles of the material slots ``hidden``, of an object that has ``slots``."""
    # A face's slot that the object lacks is its last one.
    keep = ~np.isin(mesh.slot.clip(0, slots - 1), list(hidden))
    return mesh if keep.all() else _part(mesh, keep)


def _finite(mesh: MeshArrays) -> MeshArrays:
    """The mesh without triangles whose corners are NaN or exceed LARGEST_COORDINATE."""
    if max(mesh.vertices.max(), -mesh.vertices.min()) <= LARGEST_COORDINATE:
        return mesh
    good = (np.abs(mesh.vertices) <= LARGEST_COORDINATE).all(axis=1)
    # Unused vertices would extend the scene's bounds.
    vertices = np.where(good[:, None], mesh.vertices, mesh.vertices[good][:1] if good.any() else 0.0)
    keep = good[mesh.triangles].all(axis=1)
    return replace(_part(mesh, keep), vertices=vertices, finite=False)


def _part(mesh: MeshArrays, keep: NDArray[np.bool_]) -> MeshArrays:
    """The mesh with only the triangles ``keep`` (T,)."""
    kept = keep
    if mesh.kept is not None:
        kept = mesh.kept.copy()
        kept[mesh.kept] = keep
    return replace(
        mesh,
        triangles=mesh.triangles[keep],
        normals=None if mesh.normals is None else mesh.normals[keep],
        slot=mesh.slot[keep],
        uv=None if mesh.uv is None else mesh.uv[keep],
        kept=kept,
        layers={name: values[keep] for name, values in mesh.layers.items()},
    )
