# SPDX-License-Identifier: GPL-3.0-or-later
"""The instances of meshes joined into one ``Geometry`` in world space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...casting.common.memory import shortage
from ...casting.common.parallel import chunks, parallel_map
from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from .mesh_arrays import MeshArrays, own_normals
from .read_layers import join_layers

# Corner normals have nine numbers a triangle; with more triangles their flat index exceeds int32.
MAXIMUM_TRIANGLES = (2**31 - 1) // 9

# Memory of a triangle as arrays, in cast space and in Embree: measured, flat shading.
BYTES_PER_TRIANGLE = 200


@dataclass(frozen=True)
class Instances:
    """The instances of meshes, and the looks (object and materials) that they share.

    mesh: (N,) number of each instance's mesh. look: (N,) number of its look. matrix: (N, 4, 4) float64.
    look_object: (L,) object number of each look. slots: material numbers of all looks' slots in order;
    first_slot: (L + 1,) the index of each look's first one. visibility, linked, image_layer: (N,), see
    ``Geometry``.
    """

    mesh: NDArray[np.int32]
    look: NDArray[np.int32]
    matrix: Array
    look_object: NDArray[np.int32]
    slots: NDArray[np.int32]
    first_slot: NDArray[np.int32]
    visibility: NDArray[np.uint8] | None = None
    linked: NDArray[np.int32] | None = None
    image_layer: NDArray[np.uint8] | None = None


def join_meshes(
    meshes: list[MeshArrays], instances: Instances, object_names: tuple[str, ...], with_uv: bool = False
) -> Geometry:
    """One triangle soup of all instances in world space. Raises UserError if it is too large."""
    meshes = _with_normals(meshes)
    order = np.argsort(instances.mesh, kind="stable")
    counts = np.bincount(instances.mesh, minlength=len(meshes))
    triangles = sum(int(count) * len(mesh.triangles) for count, mesh in zip(counts, meshes, strict=True))
    vertices = sum(int(count) * len(mesh.vertices) for count, mesh in zip(counts, meshes, strict=True))
    _require_room(triangles, vertices)
    smooth = any(mesh.normals is not None for mesh in meshes if len(mesh.triangles))
    alone = len(order) == 1 and triangles > 0
    writer = _InstanceWriter(
        instances,
        Geometry(
            vertices=np.empty((vertices, 3)),
            # One mesh with one instance keeps its own numbers.
            triangles=meshes[instances.mesh[0]].triangles if alone else np.empty((triangles, 3), np.int32),
            corner_normals=np.empty((triangles, 3, 3), np.float32) if smooth else None,
            material=_per_triangle(instances.slots, triangles),
            object_index=_per_triangle(instances.look_object, triangles),
            object_names=object_names,
            uv=np.full((triangles, 3, 2), np.nan, np.float32) if with_uv else None,
        ),
    )
    blocks = []
    done = 0
    for mesh, count in zip(meshes, counts, strict=True):
        mine = order[done : done + count]
        done += count
        if len(mine) and len(mesh.triangles):
            writer.write(mesh, mine)
            blocks.append((len(mesh.triangles), mesh.layers, writer.mirrored[mine]))
    result = writer.into
    if result.corner_normals is not None:
        normalize(result.corner_normals)
    many = [len(meshes[number].triangles) for number in instances.mesh[order]]
    own = {name: getattr(instances, name) for name in ("visibility", "linked", "image_layer")}
    return replace(
        result,
        layers=join_layers(blocks, triangles),
        **{name: None if each is None else np.repeat(each[order], many) for name, each in own.items()},
    )


def _with_normals(meshes: list[MeshArrays]) -> list[MeshArrays]:
    """The meshes with the triangles' own normals written out, if any mesh has others."""
    if all(mesh.normals is None or not len(mesh.triangles) for mesh in meshes):
        return meshes
    return [
        replace(mesh, normals=own_normals(mesh.vertices, mesh.triangles)) if mesh.normals is None else mesh
        for mesh in meshes
    ]


def _require_room(triangles: int, vertices: int) -> None:
    """Raise UserError if no index reaches all triangles, or memory cannot hold them."""
    scene = Message("The scene has {0} triangles once every instance is counted", f"{triangles:,}")
    if max(triangles, vertices) > MAXIMUM_TRIANGLES:
        raise UserError(
            "{0}, more than {1:,}: hide instances or lower the subdivision", scene, MAXIMUM_TRIANGLES
        )
    short = shortage(triangles * BYTES_PER_TRIANGLE)
    if short:
        raise UserError(
            "{0}, which need about {1} of memory, and {2} are free: hide instances or lower the subdivision",
            scene,
            short[0],
            short[1],
        )


def _per_triangle(numbers: NDArray[np.int32], triangles: int) -> NDArray[np.int32]:
    """Room for a number of each triangle. If all numbers are the same, it is that one, read-only."""
    alike = len(numbers) and (numbers == numbers[0]).all()
    return np.broadcast_to(numbers[:1], triangles) if alike else np.empty(triangles, np.int32)


class _InstanceWriter:
    """Writes the instances of one mesh after another into a geometry."""

    def __init__(self, instances: Instances, into: Geometry) -> None:
        self._instances, self.into = instances, into
        self._normal_matrix, self.mirrored = normal_transforms(instances.matrix[:, :3, :3])
        self._triangle = self._vertex = 0

    def write(self, mesh: MeshArrays, mine: NDArray[np.int64]) -> None:
        """Write the instances ``mine`` of a mesh."""
        into, count, many, each = self.into, len(mine), len(mesh.triangles), len(mesh.vertices)
        own = slice(self._triangle, self._triangle + count * many)
        matrix = self._instances.matrix[mine]
        vertices = into.vertices[self._vertex : self._vertex + count * each].reshape(count, each, 3)
        turn(mesh.vertices, matrix[:, :3, :3], vertices, matrix[:, :3, 3])
        if into.triangles is not mesh.triangles:
            first = self._vertex + each * np.arange(count, dtype=np.int32)
            np.add(mesh.triangles, first[:, None, None], out=into.triangles[own].reshape(count, many, 3))
        if into.corner_normals is not None and mesh.normals is not None:
            normals = into.corner_normals[own].reshape(count, many, -1, 3)
            self._write_normals(mesh.normals, self._normal_matrix[mine], normals)
        self._write_looks(mesh, self._instances.look[mine], own)
        if into.uv is not None and mesh.uv is not None:
            into.uv[own].reshape(count, many, 3, 2)[:] = mesh.uv
        self._reverse_mirrored(mine, many)
        self._triangle += count * many
        self._vertex += count * each

    def _write_normals(self, normals: NDArray, matrix: NDArray, room: NDArray) -> None:
        """Write normals (T, 3 or 1, 3), turned by matrices (N, 3, 3), into ``room`` (N, T, 3, 3)."""
        if normals.shape[1] == room.shape[2]:
            turn(normals.reshape(-1, 3), matrix, room.reshape(len(matrix), -1, 3))
        else:
            turn(normals[:, 0], matrix, room[:, :, 0])
            room[:, :, 1:] = room[:, :, :1]

    def _write_looks(self, mesh: MeshArrays, look: NDArray[np.int32], own: slice) -> None:
        """Write materials and objects of the triangles ``own`` of instances with these looks, (N,)."""
        into, instances, shape = self.into, self._instances, (len(look), len(mesh.triangles))
        if into.material.flags.writeable:
            first, last = instances.first_slot[look], instances.first_slot[look + 1] - 1
            # A face's slot that the object lacks is its last one.
            slot = np.minimum(first[:, None] + mesh.slot.clip(0), last[:, None])
            into.material[own].reshape(shape)[:] = instances.slots[slot]
        if into.object_index.flags.writeable:
            into.object_index[own].reshape(shape)[:] = instances.look_object[look][:, None]

    def _reverse_mirrored(self, mine: NDArray[np.int64], many: int) -> None:
        """Reverse the corners of mirrored instances, so that geometric normals stay outside."""
        corners = (self.into.triangles, self.into.corner_normals, self.into.uv)
        for start in self._triangle + many * np.flatnonzero(self.mirrored[mine]):
            own = slice(start, start + many)
            for values in corners:
                if values is not None:
                    values[own] = values[own][:, [0, 2, 1]]


def turn(vectors: NDArray[np.float32], matrix: NDArray, into: NDArray, shift: NDArray | None = None) -> None:
    """Write each of the matrices (N, 3, 3) times each of the vectors (P, 3) into ``into`` (N, P, 3).

    shift: (N, 3), added to the products. Without matmul: for so slim a product waking its threads costs most.
    """

    def turn_some(some: slice) -> None:
        x, y, z = vectors[some].T
        # Files may hold normals that are NaN or infinite.
        with np.errstate(invalid="ignore", over="ignore"):
            for row in range(3):
                sums = matrix[:, row, 0, None] * x
                sums += matrix[:, row, 1, None] * y
                sums += matrix[:, row, 2, None] * z
                if shift is not None:
                    sums += shift[:, row, None]
                into[:, some, row] = sums

    parallel_map(turn_some, chunks(len(vectors)))


def normal_transforms(linear: Array) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The matrices (N, 3, 3) float32 of normals for those of points, and which of these mirror, (N,).

    linear: (N, 3, 3), of points. The result is the inverse transpose up to a positive factor. Cofactors give
    it for a flattened object, too.
    """
    x, y, z = linear.swapaxes(0, 1)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    mirrored = np.einsum("nc,nc->n", cofactors[:, 0], x) < 0
    size = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    cofactors /= np.where(size == 0, 1.0, size)
    return np.where(mirrored[:, None, None], -cofactors, cofactors).astype(np.float32), mirrored


def normalize(normals: NDArray[np.float32]) -> None:
    """Make vectors (..., 3) unit in place; those without a direction point along +Z."""
    length = np.sqrt(np.einsum("...c,...c->...", normals, normals))[..., None]
    none = ~(length[..., 0] > 0)
    if none.any():
        normals[none] = (0.0, 0.0, 1.0)
        length[none] = 1.0
    normals /= length
