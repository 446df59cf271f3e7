# SPDX-License-Identifier: GPL-3.0-or-later
"""What is painted on meshes → ``Layer``: texture coordinates, colours, attributes, generated coordinates.

A layer's name says what it is: "UV:name", "COLOR:name" and "ATTRIBUTE:name", of which no name means
the one for renders; "GENERATED"; "OBJECT", the place in the mesh's own space; "TANGENT:name", where the
first of the texture coordinates "UV:name" grows, see ``Place.tangent``.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Layer
from ...shading.nodes.image import linear_from_srgb, srgb_from_linear

Single = NDArray[np.float32]

# Channels and the property of an attribute's items, by data type.
ATTRIBUTE_TYPES = {
    "FLOAT": (1, "value"),
    "INT": (1, "value"),
    "INT8": (1, "value"),
    "BOOLEAN": (1, "value"),
    "FLOAT2": (2, "vector"),
    "FLOAT_VECTOR": (3, "vector"),
    "FLOAT_COLOR": (4, "color"),
    "BYTE_COLOR": (4, "color"),
    "QUATERNION": (4, "value"),
}


def read_layer(mesh, name: str) -> Single | None:
    """A layer of an evaluated bpy.types.Mesh at the corners of its triangles, (T, 3, C).

    None if the mesh has none of the name.
    """
    kind, _, rest = name.partition(":")
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):
        return None
    if kind == "OBJECT":
        return _of_points(mesh, _numbers(mesh.vertices, "co", 3))
    if kind == "GENERATED":
        return _of_points(mesh, _generated(mesh))
    if kind in {"UV", "TANGENT"}:
        layer = next(
            (each for each in mesh.uv_layers if (each.name == rest if rest else each.active_render)), None
        )
        if layer is None:
            return None
        return (
            _tangents(mesh, layer)
            if kind == "TANGENT"
            else _of_corners(mesh, _numbers(layer.uv, "vector", 2))
        )
    if kind == "COLOR" and not rest and len(mesh.color_attributes):
        rest = mesh.color_attributes[max(mesh.color_attributes.render_color_index, 0)].name
    return _attribute(mesh, rest)


def _numbers(items, name: str, channels: int) -> Single:
    values = np.empty((len(items), channels), np.float32)
    items.foreach_get(name, values.reshape(-1))
    return values


def _attribute(mesh, name: str) -> Single | None:
    """An attribute as four channels: a number is grey, what has no fourth has 1."""
    attribute = mesh.attributes.get(name) if name else None
    if attribute is None or attribute.data_type not in ATTRIBUTE_TYPES:
        return None
    channels, key = ATTRIBUTE_TYPES[attribute.data_type]
    values = _numbers(attribute.data, key, channels) if channels > 1 else _values(attribute)
    if channels == 1:
        values = np.repeat(values, 3, axis=1)
    whole = np.zeros((len(values), 4), np.float32)
    whole[:, 3] = 1.0
    whole[:, : values.shape[1]] = values
    if attribute.domain == "POINT":
        return _of_points(mesh, whole)
    if attribute.domain == "EDGE":
        return _of_points(mesh, _from_edges(mesh, whole, attribute.data_type))
    if attribute.domain == "CORNER":
        return _of_corners(mesh, whole)
    if attribute.domain == "FACE":
        face = np.empty(len(mesh.loop_triangles), np.int32)
        mesh.loop_triangle_polygons.foreach_get("value", face)
        return np.repeat(whole.take(face, axis=0)[:, None], 3, axis=1)
    return None


def _from_edges(mesh, values: Single, data_type: str) -> Single:
    """Values of edges (E, 4) at the points (V, 4), as Blender converts them: the mean of the edges there.

    Whole numbers are rounded, colours of bytes mixed as sRGB has them. A boolean is true where one of the
    edges has it.
    """
    if data_type == "BYTE_COLOR":
        values[:, :3] = srgb_from_linear(values[:, :3])
    ends = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", ends)
    points = len(mesh.vertices)
    sums = [np.bincount(ends, channel.repeat(2), points) for channel in values.T]
    mean = np.stack(sums, axis=1) / np.bincount(ends, minlength=points).clip(1)[:, None]
    if data_type == "BOOLEAN":
        mean = np.ceil(mean)
    elif data_type == "BYTE_COLOR":
        # Blender cuts the bytes off; a mean that is whole may be a little less in floats.
        mean[:, :3] = linear_from_srgb(np.floor(mean[:, :3] * 255.0 + 1e-3) / 255.0)
    elif data_type.startswith("INT"):
        mean = np.trunc(mean + np.copysign(0.5, mean))
    return mean.astype(np.float32)


def _values(attribute) -> Single:
    kinds = {"FLOAT": np.float32, "BOOLEAN": bool}
    values = np.empty(len(attribute.data), kinds.get(attribute.data_type, np.int32))
    attribute.data.foreach_get("value", values)
    return values.astype(np.float32)[:, None]


def _generated(mesh) -> Single:
    """Texture space of undeformed vertices: 0 to 1 over the mesh's box."""
    place = _numbers(mesh.vertices, "undeformed_co", 3)
    middle = np.array(mesh.texspace_location, np.float32)
    size = np.array(mesh.texspace_size, np.float32)
    size = np.where(size == 0.0, np.float32(0.5), size)
    return (place - middle) / (2 * size) + np.float32(0.5)


def _tangents(mesh, layer) -> Single:
    """Tangents of texture coordinates as shares of the triangles' edges and normals: any copy of the
    mesh has them.

    MikkTSpace's, which are smooth where normals are; of meshes with larger faces than quads, for which
    Blender has none, the triangles' own.
    """
    corner = _of_points(mesh, _numbers(mesh.vertices, "co", 3)).astype(np.float64)
    along, across = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(along, across)
    area = np.einsum("tc,tc->t", normal, normal)
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0.0)
    if _most_corners(mesh) <= 4:
        mesh.calc_tangents(uvmap=layer.name)
        tangent = _of_corners(mesh, _numbers(mesh.loops, "tangent", 3)).astype(np.float64)
        side = _of_corners(mesh, _loop_numbers(mesh, "bitangent_sign"))[:, :, 0]
        mesh.free_tangents()
    else:
        (u1, v1), (u2, v2) = (
            np.moveaxis(np.diff(uv, axis=1)[:, 0], 1, 0)
            for uv in (_of_corners(mesh, _numbers(layer.uv, "vector", 2))[:, [0, k]] for k in (1, 2))
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


def _most_corners(mesh) -> int:
    """The largest number of corners that a face has."""
    sizes = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    return int(sizes.max(initial=0))


def _loop_numbers(mesh, name: str) -> Single:
    values = np.empty(len(mesh.loops), np.float32)
    mesh.loops.foreach_get(name, values)
    return values[:, None]


def _corners(mesh) -> NDArray[np.int32]:
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    return corners


def _of_corners(mesh, values: Single) -> Single:
    return values.take(_corners(mesh), axis=0).reshape(-1, 3, values.shape[1])


def _of_points(mesh, values: Single) -> Single:
    vertex = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", vertex)
    return _of_corners(mesh, values.take(vertex, axis=0))


def _turned_over(name: str, layer: Single) -> Single:
    """A layer of triangles whose second and third corners have changed places."""
    turned = layer[:, [0, 2, 1]]
    if name.startswith("TANGENT"):
        turned = turned[:, :, [1, 0, 2, 3]] * np.array([1, 1, 1, -1], np.float32)
    return turned


def join_layers(
    blocks: Iterable[tuple[int, dict[str, Single], NDArray[np.bool_]]], total: int
) -> dict[str, Layer]:
    """The layers of a joined geometry of ``total`` triangles.

    blocks: in the geometry's order, for each mesh its number of triangles, its layers and which of its
    copies are mirrored, whose corners are reversed. Copies share the values.
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
                    values[name].append(_turned_over(name, layer) if is_mirrored else layer)
        first += many * len(mirrored)
    return {name: Layer(row, np.concatenate(values[name])) for name, row in rows.items() if values[name]}
