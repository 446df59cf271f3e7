# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera between others: its surfaces are grids of two shapes, mixed by one animatable factor.

The shapes are shape keys that drivers mix: files need no Python to play the animation. The first shape is
that of the first camera. With maps over the image the second shape is the mean of the cameras by
their weights. Further shapes, which nothing mixes, then keep each of the other cameras whole. A map without
a border has a seam: the surfaces are then UV meshes that are cut along it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import bpy
import numpy as np

from ...projection.editing.blend_map import BlendMap, normalised
from ...projection.editing.blending import Blend
from ...projection.editing.seam_mesh import SeamMesh
from ...projection.editing.volume_edits import lattice
from ...projection.surfaces.uv_chart import UVChart
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.typing import Array
from ...projection.user_error import Message
from ...projection.volume.reparameterisation import Polar
from ..blender.scene_objects import link_beside
from ..camera.flexible_camera import NewSurface, replace_surfaces
from .blend_ends import BlendEnd, ends_of, is_map_animated, least_faces, own_seams, read_map

# Range of the factor: 0 is the first camera, 1 the second one.
SMALLEST_BLEND, LARGEST_BLEND = -2.0, 3.0
FIRST_KEY, SECOND_KEY = "First Camera", "Second Camera"
WHOLE_KEY = "Second Camera, Everywhere"
# Of the shape that keeps a further camera: number and all.
FURTHER_KEY = re.compile(r"Camera \d+, Everywhere")
# The attribute of vertices within the map along whose border a mesh is cut, and the custom property with
# that map's numbers; of further cameras their number follows.
WITHIN, SEAM = "SCFPF Within", "scfpf_seam"
# The first words of the shapes that Bake Map makes.
BAKED = "Baked Map"
FACTOR_PATH = "scfpf.blend_factor"


def is_blend(camera) -> bool:
    """Return whether a camera's near surface has the two shapes of a blend."""
    slots = camera.scfpf.surfaces
    near = slots[0].object if len(slots) else None
    keys = near.data.shape_keys if near is not None and near.type == "MESH" else None
    return keys is not None and SECOND_KEY in keys.key_blocks


def new_blend_camera(first, name: str):
    """A camera without surfaces, at the place and in the collections of another one."""
    camera = bpy.data.objects.new(name, first.data.copy())
    camera.matrix_world = first.matrix_world
    link_beside(camera, first)
    bpy.context.view_layer.update()
    if camera.name not in bpy.context.view_layer.objects:
        # The scene's camera may be in an excluded collection, but the blend should be visible.
        bpy.context.scene.collection.objects.link(camera)
    return camera


def set_blend(camera, blend: Blend, aspect: float) -> None:
    """Make a camera's volume a blend: on its present surfaces if these have as many points, else on new ones.

    aspect: width / height of the image that the blend was made for.
    """
    if _has_room(camera, blend):
        _write_shapes(camera, blend)
    else:
        last = len(blend.layers) - 1
        names = ["Near" if k == 0 else "Far" if k == last else f"Surface {k + 1}" for k in range(last + 1)]
        chart = None if blend.mesh is None else _chart(blend.mesh)
        replace_surfaces(
            camera,
            [
                NewSurface(name, "GRID", np.eye(4), points=layer[0])
                if chart is None
                else NewSurface(name, "UV_MESH", np.eye(4), points=UVMesh(layer[0], chart))
                for name, layer in zip(names, blend.layers, strict=True)
            ],
        )
        _add_shapes(camera, blend)
    camera.scfpf.basis = blend.basis
    camera.scfpf.reparameterisation = "POLAR" if blend.polar else "RECTANGLE"
    camera.scfpf.fitted_aspect = aspect
    if blend.mesh is not None:
        _note_seams(camera, blend.mesh)
    write_map(camera)


def is_baked(camera) -> bool:
    """Return whether a blend camera's surfaces have the shapes of Bake Map."""
    return any(
        key.name.startswith(BAKED)
        for surface in blend_surfaces(camera)
        for key in surface.data.shape_keys.key_blocks
    )


def unbaked(camera) -> str:
    """The warning about keyframes of a blend's map that pictures do not follow; empty without any."""
    if not blend_surfaces(camera) or not is_map_animated(camera) or is_baked(camera):
        return ""
    return Message("Pictures do not follow the keyframes of the map of '{0}': press Bake Map", camera.name)


def blend_surfaces(camera) -> list:
    """The surfaces of a camera that are a blend's own and can be edited."""
    found = []
    for slot in camera.scfpf.surfaces:
        surface = slot.object
        if surface is None or surface.type != "MESH" or not surface.data.is_editable:
            continue
        keys = surface.data.shape_keys
        if keys is not None and {FIRST_KEY, SECOND_KEY} <= set(keys.key_blocks.keys()):
            found.append(surface)
    return found


def is_too_coarse(camera) -> bool:
    """Return whether a blend camera's surfaces do not fit its maps: Update Blend makes others."""
    meshes = [
        slot.object.data
        for slot in camera.scfpf.surfaces
        if slot.object is not None and slot.object.type == "MESH"
    ]
    seams = [] if camera.scfpf.reparameterisation == "POLAR" else own_seams(camera, with_pixels=False)
    if any(not _is_cut(mesh, end, blend_map, camera) for mesh in meshes for end, blend_map in seams):
        return True
    wanted = least_faces(camera)
    return any(wanted > 1 and len(mesh.vertices) < (wanted + 1) ** 2 for mesh in meshes)


def write_map(camera) -> None:
    """Write the second shape of a blend camera's surfaces: the mean of its cameras by their weights.

    Surfaces that are not the blend's own, or have lost their order of rows, stay as they are. Baked shapes,
    which hold earlier maps, are removed.
    """
    maps = read_maps(camera)
    (second, blend_map), *further = maps
    is_whole = blend_map is None and not further and second.settings.weight == 1.0
    is_whole = is_whole and not is_map_animated(camera)
    for surface in blend_surfaces(camera):
        keys = surface.data.shape_keys.key_blocks
        _drop_baked(surface)
        if is_whole:
            if WHOLE_KEY not in keys:
                continue
            points = points_of(keys[WHOLE_KEY])
        else:
            weights = end_weights(camera, surface, maps)
            if weights is None:
                continue
            if WHOLE_KEY not in keys:
                _keep_whole(surface, WHOLE_KEY, points_of(keys[SECOND_KEY]))
            points = mixed(surface, weights)
        keys[SECOND_KEY].data.foreach_set("co", np.ascontiguousarray(points).ravel())
        surface.data.update()


def read_maps(camera) -> list[tuple[BlendEnd, BlendMap | None]]:
    """The ends of a blend camera other than the first one, with their maps."""
    return [(end, read_map(end)) for end in ends_of(camera)]


def end_weights(camera, surface, maps: Sequence[tuple[BlendEnd, BlendMap | None]]) -> Array | None:
    """The weights (K, N) of a blend's K ends other than the first one at the N vertices of a surface.

    The first camera has the rest. maps: see ``read_maps``. Ends that are newer than the surface are
    left out. Returns None for a grid out of order.
    """
    places = _places(camera, surface)
    if places is None:
        return None
    keys = surface.data.shape_keys.key_blocks
    weights = [
        end.settings.weight * _map_values(camera, surface, end, blend_map, places)
        for end, blend_map in maps
        if end.number == 2 or further_key(end.number) in keys
    ]
    return normalised(np.stack(weights))


def mixed(surface, weights: Array) -> Array:
    """The mean (N, 3) of the shapes of a blend's surface. weights: see ``end_weights``. float32."""
    keys = surface.data.shape_keys.key_blocks
    first = points_of(keys[FIRST_KEY])
    found = first
    names = [WHOLE_KEY, *(key.name for key in keys if FURTHER_KEY.fullmatch(key.name))]
    # A camera that a script has removed from the list has a shape until Update Blend.
    for name, share in zip(names, weights, strict=False):
        found = found + share.astype(np.float32)[:, None] * (points_of(keys[name]) - first)
    return found


def further_key(number: int) -> str:
    """The name of the shape that keeps the whole of a further camera. number: of the end, from 3 on."""
    return f"Camera {number}, Everywhere"


def _keep_whole(surface, name: str, points: Array) -> None:
    """Add a shape that nothing mixes."""
    whole = surface.shape_key_add(name=name, from_mix=False)
    whole.mute = True
    whole.data.foreach_set("co", points.ravel())


def _map_values(camera, surface, end: BlendEnd, blend_map: BlendMap | None, places: Array) -> Array:
    """The values (N,) of an end's map at the vertices of a surface."""
    if blend_map is None:
        return np.ones(len(places))
    if surface.scfpf_surface.kind == "UV_MESH" and blend_map.has_seam:
        mesh = surface.data
        if _is_cut(mesh, end, blend_map, camera):
            within = np.empty(len(mesh.vertices), bool)
            mesh.attributes[_numbered(WITHIN, end)].data.foreach_get("value", within)
            return np.where(within != blend_map.is_inverted, 1.0, 0.0)
    return blend_map.values(*places.T, camera.scfpf.fitted_aspect or 1.0)


def _places(camera, surface) -> Array | None:
    """The image positions (N, 2) of the vertices of a blend's surface; None for a grid out of order."""
    mesh = surface.data
    if surface.scfpf_surface.kind == "UV_MESH":
        return _mesh_places(mesh)
    rows = math.isqrt(len(mesh.vertices))
    if rows**2 != len(mesh.vertices):
        return None
    return np.stack(_image_places(camera, rows), axis=1)


def _mesh_places(mesh) -> Array:
    """The image positions (V, 2) of the vertices of a UV mesh that a blend has made."""
    corners, uv = np.empty(len(mesh.loops), np.int32), np.empty(2 * len(mesh.loops), np.float32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.uv_layers.active.uv.foreach_get("vector", uv)
    places = np.zeros((len(mesh.vertices), 2))
    places[corners] = uv.reshape(-1, 2)
    return places


def _chart(mesh: SeamMesh) -> UVChart:
    return UVChart(mesh.places[mesh.triangles], mesh.triangles)


def _seam_numbers(blend_map: BlendMap, aspect: float) -> list[float]:
    """The settings that place a map's seam; of a painted one Update Blend alone follows the image."""
    kind = ("LINEAR", "RADIAL", "RECTANGLE", "VIEWS", "IMAGE").index(blend_map.kind)
    if blend_map.kind == "IMAGE":
        return [float(kind), aspect]
    if blend_map.kind == "VIEWS":
        return [float(kind), aspect, *(value for circle in blend_map.circles for value in circle)]
    return [float(kind), aspect, *blend_map.centre, *blend_map.size, blend_map.angle]


def _numbered(name: str, end: BlendEnd) -> str:
    """The name of an attribute or a custom property for an end's map."""
    return name if end.number == 2 else f"{name} {end.number}"


def _is_cut(mesh, end: BlendEnd, blend_map: BlendMap, camera) -> bool:
    """Return whether a mesh is cut along the seam of an end's map."""
    numbers = mesh.get(_numbered(SEAM, end))
    if numbers is None or _numbered(WITHIN, end) not in mesh.attributes:
        return False
    return list(numbers) == _seam_numbers(blend_map, camera.scfpf.fitted_aspect or 1.0)


def has_cuts(camera) -> bool:
    """Return whether surfaces of a camera are cut along seams of maps."""
    surfaces = (slot.object for slot in camera.scfpf.surfaces)
    meshes = (each.data for each in surfaces if each is not None and each.type == "MESH")
    return any(name.startswith(SEAM) for mesh in meshes for name in mesh.keys())


def _note_seams(camera, mesh: SeamMesh) -> None:
    """Write which vertices are within each of the camera's own maps that have a seam."""
    seams = own_seams(camera)
    for slot in camera.scfpf.surfaces:
        data = slot.object.data
        for name in [name for name in data.keys() if name.startswith(SEAM)]:
            del data[name]
        # A mesh has first the sides of the camera's own seams, then those of the blends at its ends.
        for (end, blend_map), sides in zip(seams, mesh.sides, strict=False):
            name = _numbered(WITHIN, end)
            within = data.attributes.get(name) or data.attributes.new(name, "BOOLEAN", "POINT")
            within.data.foreach_set("value", np.ascontiguousarray(sides))
            data[_numbered(SEAM, end)] = _seam_numbers(blend_map, camera.scfpf.fitted_aspect)


def _drop_baked(surface) -> None:
    """Remove the shapes of Bake Map, and mix the second shape again."""
    blocks = surface.data.shape_keys.key_blocks
    baked = [key for key in blocks if key.name.startswith(BAKED)]
    for key in baked:
        key.driver_remove("value")
        surface.shape_key_remove(key)
    if baked:
        blocks[SECOND_KEY].mute = False


def points_of(key) -> Array:
    """The points of a shape key, (N, 3) float32."""
    points = np.empty(3 * len(key.data), np.float32)
    key.data.foreach_get("co", points)
    return points.reshape(-1, 3)


def _image_places(camera, rows: int) -> tuple[Array, Array]:
    """The image positions of the points of a blend camera's grid with so many rows and columns."""
    u, v = lattice(rows, rows)
    if camera.scfpf.reparameterisation == "POLAR":
        return Polar().image_positions(u, v, camera.scfpf.fitted_aspect or 1.0)
    return u, v


def _add_shapes(camera, blend: Blend) -> None:
    """Add both shape keys to the surfaces of a camera, which are grids in the order of a blend's layers."""
    for slot in camera.scfpf.surfaces:
        surface = slot.object
        surface.shape_key_add(name=FIRST_KEY, from_mix=False)
        drive(surface.shape_key_add(name=SECOND_KEY, from_mix=False), camera)
    _write_shapes(camera, blend)


def _has_room(camera, blend: Blend) -> bool:
    """Return whether the surfaces of a blend camera have the points of another blend's layers.

    Without seams layers are square grids, so that equal numbers of points mean equal numbers of rows.
    """
    slots = camera.scfpf.surfaces
    if len(slots) != len(blend.layers):
        return False
    for slot, layer in zip(slots, blend.layers, strict=True):
        own = slot.object is not None and slot.object.type == "MESH" and slot.object.parent == camera
        mesh = slot.object.data if own else None
        keys = mesh.shape_keys if mesh is not None else None
        if keys is None or not {FIRST_KEY, SECOND_KEY} <= set(keys.key_blocks.keys()):
            return False
        if slot.object.scfpf_surface.kind != ("GRID" if blend.mesh is None else "UV_MESH"):
            return False
        if len(mesh.vertices) != layer[0].size // 3:
            return False
        if blend.mesh is not None and not np.array_equal(
            _mesh_places(mesh).astype(np.float32), blend.mesh.places.astype(np.float32)
        ):
            return False
    return True


def _write_shapes(camera, blend: Blend) -> None:
    """Write the shapes of each surface of a camera with room for them; keys, drivers and objects stay.

    Call ``write_map`` afterwards.
    """
    for slot, layer in zip(camera.scfpf.surfaces, blend.layers, strict=True):
        surface = slot.object
        shapes = [shape.reshape(-1, 3).astype(np.float32).ravel() for shape in layer]
        first, second, *further = shapes
        surface.data.vertices.foreach_set("co", first)
        blocks = surface.data.shape_keys.key_blocks
        wholes = {further_key(number): points for number, points in enumerate(further, 3)}
        for key in [key for key in blocks if FURTHER_KEY.fullmatch(key.name) and key.name not in wholes]:
            surface.shape_key_remove(key)
        for name, points in ((FIRST_KEY, first), (SECOND_KEY, second), (WHOLE_KEY, second)):
            if name in blocks:
                blocks[name].data.foreach_set("co", points)
        for name, points in wholes.items():
            if name in blocks:
                blocks[name].data.foreach_set("co", points)
            else:
                _keep_whole(surface, name, points)
        # The points are in camera space.
        surface.matrix_parent_inverse.identity()
        surface.matrix_basis.identity()
        surface.data.update()


def drive(key, camera, expression: str = "") -> None:
    """Drive the value of a shape by the camera's factor.

    expression: of the variable ``factor``, simple enough for Blender without Python; empty for the factor.
    """
    key.slider_min, key.slider_max = SMALLEST_BLEND, LARGEST_BLEND
    driver = key.driver_add("value").driver
    driver.type = "SCRIPTED" if expression else "AVERAGE"
    variable = driver.variables.new()
    variable.name, variable.type = "factor", "SINGLE_PROP"
    target = variable.targets[0]
    target.id = camera
    target.data_path = FACTOR_PATH
    # Without the add-on the file has no such property.
    target.use_fallback_value = True
    target.fallback_value = 0.5
    if expression:
        driver.expression = expression
