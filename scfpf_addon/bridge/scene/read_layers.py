# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of meshes: texture coordinates, colours, attributes, generated coordinates and tangents.

A layer's name tells its kind: "UV:name", "COLOR:name" and "ATTRIBUTE:name", where an empty name means the one
for renders; "GENERATED"; "OBJECT", the position in the mesh's own space; "TANGENT:name", the direction in
which the first of the texture coordinates "UV:name" grows, see ``ShadingContext.tangent``.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Layer
from ...projection.colors import linear_from_srgb, srgb_from_linear
from ...shading.typing import Single
from .mesh_arrays import corner_vertices, foreach, triangle_corners, triangle_faces

# Channels, property and type in memory of an attribute's items, by data type.
ATTRIBUTE_TYPES = {
    "FLOAT": (1, "value", np.float32),
    "INT": (1, "value", np.int32),
    "INT8": (1, "value", np.int32),
    "BOOLEAN": (1, "value", bool),
    "FLOAT2": (2, "vector", np.float32),
    "FLOAT_VECTOR": (3, "vector", np.float32),
    "FLOAT_COLOR": (4, "color", np.float32),
    "BYTE_COLOR": (4, "color", np.float32),
    "QUATERNION": (4, "value", np.float32),
}


def read_layer(mesh, name: str) -> Single | None:
    """Read a layer of an evaluated bpy.types.Mesh at the corners of its triangles, (T, 3, C).

    None if the mesh has no such layer.
    """
    kind, _, rest = name.partition(":")
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):
        return None
    if kind == "OBJECT":
        return _of_points(mesh, foreach(mesh.vertices, "co", 3))
    if kind == "GENERATED":
        return _of_points(mesh, _generated(mesh))
    if kind in {"UV", "TANGENT"}:
        layer = next(
            (each for each in mesh.uv_layers if (each.name == rest if rest else each.active_render)), None
        )
        if layer is None:
            return None
        return _tangents(mesh, layer) if kind == "TANGENT" else _of_corners(mesh, _uv(layer))
    if kind == "COLOR" and not rest and len(mesh.color_attributes):
        rest = mesh.color_attributes[max(mesh.color_attributes.render_color_index, 0)].name
    return _attribute(mesh, rest)


def _uv(layer) -> Single:
    return foreach(layer.uv, "vector", 2)


def _attribute(mesh, name: str) -> Single | None:
    """An attribute as four channels: a number is grey, and a missing fourth channel is 1."""
    attribute = mesh.attributes.get(name) if name else None
    if attribute is None or attribute.data_type not in ATTRIBUTE_TYPES:
        return None
    channels, key, dtype = ATTRIBUTE_TYPES[attribute.data_type]
    values = foreach(attribute.data, key, channels, dtype)
    if channels == 1:
        values = np.repeat(values[:, None], 3, axis=1)
    rgba = np.zeros((len(values), 4), np.float32)
    rgba[:, 3] = 1.0
    rgba[:, : values.shape[1]] = values
    if attribute.domain == "POINT":
        return _of_points(mesh, rgba)
    if attribute.domain == "EDGE":
        return _of_points(mesh, _from_edges(mesh, rgba, attribute.data_type))
    if attribute.domain == "CORNER":
        return _of_corners(mesh, rgba)
    if attribute.domain == "FACE":
        return np.repeat(rgba.take(triangle_faces(mesh), axis=0)[:, None], 3, axis=1)
    return None


def _from_edges(mesh, values: Single, data_type: str) -> Single:
    """Convert values of edges (E, 4) to points (V, 4) as Blender does: the mean over the edges at each point.

    Whole numbers are rounded, byte colours are averaged in sRGB. A boolean is true if it is at any edge.
    """
    if data_type == "BYTE_COLOR":
        values[:, :3] = srgb_from_linear(values[:, :3])
    ends = foreach(mesh.edges, "vertices", 2, np.int32).reshape(-1)
    points = len(mesh.vertices)
    sums = [np.bincount(ends, channel.repeat(2), points) for channel in values.T]
    mean = np.stack(sums, axis=1) / np.bincount(ends, minlength=points).clip(1)[:, None]
    if data_type == "BOOLEAN":
        mean = np.ceil(mean)
    elif data_type == "BYTE_COLOR":
        # Blender truncates to bytes; rounding may have made a whole mean a little smaller.
        mean[:, :3] = linear_from_srgb(np.floor(mean[:, :3] * 255.0 + 1e-3) / 255.0)
    elif data_type.startswith("INT"):
        mean = np.trunc(mean + np.copysign(0.5, mean))
    return mean.astype(np.float32)


def _generated(mesh) -> Single:
    """Positions of undeformed vertices in texture space: 0 to 1 over the mesh's box."""
    position = foreach(mesh.vertices, "undeformed_co", 3)
    middle = np.array(mesh.texspace_location, np.float32)
    size = np.array(mesh.texspace_size, np.float32)
    size = np.where(size == 0.0, np.float32(0.5), size)
    return (position - middle) / (2 * size) + np.float32(0.5)


def _tangents(mesh, layer) -> Single:
    """Tangents of texture coordinates, (T, 3, 4): shares of two edges and the normal, and the bitangent sign.

    Shares are valid for every instance of the mesh. The tangents are MikkTSpace's, smooth where normals are.
    Blender has none for meshes with faces larger than quads; there they are the triangles' own.
    """
    corner = _of_points(mesh, foreach(mesh.vertices, "co", 3)).astype(np.float64)
    along, across = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(along, across)
    area = np.einsum("tc,tc->t", normal, normal)
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0.0)
    if foreach(mesh.polygons, "loop_total", dtype=np.int32).max(initial=0) <= 4:
        mesh.calc_tangents(uvmap=layer.name)
        tangent = _of_corners(mesh, foreach(mesh.loops, "tangent", 3)).astype(np.float64)
        side = _of_corners(mesh, foreach(mesh.loops, "bitangent_sign")[:, None])[:, :, 0]
        mesh.free_tangents()
    else:
        (u1, v1), (u2, v2) = (
            np.moveaxis(np.diff(uv, axis=1)[:, 0], 1, 0)
            for uv in (_of_corners(mesh, _uv(layer))[:, [0, k]] for k in (1, 2))
        )
        turned = np.where(u1 * v2 - u2 * v1 < 0.0, -1.0, 1.0)
        tangent = (along * v2[:, None] - across * v1[:, None]) * turned[:, None]
        tangent = np.repeat(tangent[:, None], 3, axis=1)
        side = np.repeat(turned[:, None], 3, axis=1)
    shares = np.empty((len(corner), 3, 4), np.float32)
    # The dual vectors of the two edges in the triangle's plane.
    shares[:, :, 0] = np.einsum("tkc,tc->tk", tangent, np.cross(across, normal) * inverse[:, None])
    shares[:, :, 1] = np.einsum("tkc,tc->tk", tangent, np.cross(normal, along) * inverse[:, None])
    shares[:, :, 2] = np.einsum("tkc,tc->tk", tangent, normal) * inverse[:, None] ** 0.75
    shares[:, :, 3] = side
    return shares


def _of_corners(mesh, values: Single) -> Single:
    return values.take(triangle_corners(mesh), axis=0).reshape(-1, 3, values.shape[1])


def _of_points(mesh, values: Single) -> Single:
    return _of_corners(mesh, values.take(corner_vertices(mesh), axis=0))


def _reversed(name: str, layer: Single) -> Single:
    """A layer of triangles with the second and third corners exchanged."""
    turned = layer[:, [0, 2, 1]]
    if name.startswith("TANGENT"):
        turned = turned[:, :, [1, 0, 2, 3]] * np.array([1, 1, 1, -1], np.float32)
    return turned


def join_layers(
    blocks: Iterable[tuple[int, dict[str, Single], NDArray[np.bool_]]], total: int
) -> dict[str, Layer]:
    """The layers of a joined geometry of ``total`` triangles.

    blocks: for each mesh, in the geometry's order, its number of triangles, its layers and which of its
    instances are mirrored, so that their corners are reversed. Instances share the values.
    """
    rows: dict[str, NDArray[np.int32]] = {}
    values: dict[str, list[Single]] = {}
    first = 0
    for many, layers, mirrored in blocks:
        for name, layer in layers.items():
            if name not in rows:
                rows[name], values[name] = np.full(total, -1, np.int32), []
            own = rows[name][first : first + many * len(mirrored)].reshape(len(mirrored), many)
            for which, is_mirrored in ((~mirrored, False), (mirrored, True)):
                if which.any():
                    used = sum(len(each) for each in values[name])
                    own[which] = used + np.arange(many, dtype=np.int32)
                    values[name].append(_reversed(name, layer) if is_mirrored else layer)
        first += many * len(mirrored)
    return {name: Layer(row, np.concatenate(values[name])) for name, row in rows.items() if values[name]}
