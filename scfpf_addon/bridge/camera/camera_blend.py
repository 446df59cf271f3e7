# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera between two others: its surfaces are grids of two shapes, mixed by one animatable factor.

The shapes are shape keys that drivers mix: files need no Python to play the animation. With a field of
factors over the image the second shape is that of the second camera only where the field is 1. A third shape,
which nothing mixes, then keeps the whole of it. A field without a border has a seam: the surfaces are then UV
meshes that are cut along it.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from ...projection.editing.blend_fields import BlendField
from ...projection.editing.blending import SHARP_FACES, SMOOTH_FACES, Blend
from ...projection.editing.seam_mesh import SeamMesh
from ...projection.editing.volume_edits import lattice
from ...projection.surfaces.uv_chart import UVChart
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.typing import Array
from ...projection.volume.reparameterisation import Polar
from ..blender.image_masks import mask_pixels
from ..blender.scene_objects import link_beside
from ..blender.slot_animation import curve_collections
from .flexible_camera import NewSurface, replace_surfaces

# Range of the factor: 0 is the first camera, 1 the second one.
SMALLEST_BLEND, LARGEST_BLEND = -2.0, 3.0
FIRST_KEY, SECOND_KEY = "First Camera", "Second Camera"
WHOLE_KEY = "Second Camera, Everywhere"
# The attribute of vertices within the field along whose border a mesh is cut, and the custom property with
# that field's numbers.
WITHIN, SEAM = "SCFPF Within", "scfpf_seam"
# The first words of the shapes that Bake Map makes, and the path of what it bakes.
BAKED, FIELD_PATH = "Baked Map", "scfpf.blend_field."
FACTOR_PATH = "scfpf.blend_factor"


def is_blend(camera) -> bool:
    """Return whether a camera's near surface has the two shapes of a blend."""
    slots = camera.scfpf.surfaces
    near = slots[0].object if len(slots) else None
    keys = near.data.shape_keys if near is not None and near.type == "MESH" else None
    return keys is not None and SECOND_KEY in keys.key_blocks


def knows_its_ends(camera) -> bool:
    """Return whether both ends of a camera's blend are known."""
    ends = camera.scfpf.blend_ends
    return ends.first is not None and (ends.second is not None or bool(ends.preset))


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
        names = ["Near" if k == 0 else "Far" if k == last else f"Layer {k + 1}" for k in range(last + 1)]
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
        _note_seam(camera, blend.mesh)
    write_field(camera)


def least_faces(camera) -> int:
    """The least number of faces along each axis of a blend camera's grids, for its field."""
    settings = camera.scfpf.blend_field
    if settings.kind == "NONE":
        return 1
    if settings.border <= 0.0 and settings.kind != "IMAGE" and not is_map_animated(camera):
        # Straight seams need none, a circle is a polygon.
        return SMOOTH_FACES if settings.kind == "RADIAL" else 1
    is_smooth = settings.kind != "IMAGE" and settings.border >= 2.0 / SMOOTH_FACES
    return SMOOTH_FACES if is_smooth else SHARP_FACES


def seams_of(camera) -> list[BlendField]:
    """The fields without a border of a blend camera and of the blends at its ends, the camera's own first."""
    found, seen, left = [], [], [camera]
    while left:
        own = left.pop(0)
        if own is None or own in seen:
            continue
        seen.append(own)
        field = read_field(own)
        if field is not None and field.has_seam and not is_map_animated(own):
            found.append(field)
        left += [own.scfpf.blend_ends.first, own.scfpf.blend_ends.second]
    return found


def is_map_animated(camera) -> bool:
    """Return whether keyframes or drivers move a blend camera's map, which then has no sharp seams."""
    return any(
        curve.data_path.startswith(FIELD_PATH) for curves in curve_collections(camera) for curve in curves
    )


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
    return f"Pictures do not follow the keyframes of the map of '{camera.name}': press Bake Map"


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
    """Return whether a blend camera's surfaces do not fit its field: Update Blend makes others."""
    wanted = least_faces(camera)
    slots = camera.scfpf.surfaces
    field = read_field(camera)
    is_polar = camera.scfpf.reparameterisation == "POLAR"
    if field is not None and field.has_seam and not is_polar and not is_map_animated(camera):
        return any(
            slot.object is not None
            and slot.object.type == "MESH"
            and not _is_cut(slot.object.data, field, camera)
            for slot in slots
        )
    return any(
        wanted > 1
        and slot.object is not None
        and slot.object.type == "MESH"
        and len(slot.object.data.vertices) < (wanted + 1) ** 2
        for slot in slots
    )


def read_field(camera) -> BlendField | None:
    """The field of a blend camera; None without one, and for an image without pixels."""
    settings = camera.scfpf.blend_field
    if settings.kind == "NONE":
        return None
    pixels = None
    if settings.kind == "IMAGE":
        pixels = None if settings.image is None else mask_pixels(settings.image)
        if pixels is None:
            return None
    return BlendField(
        kind=settings.kind,
        centre=tuple(settings.center),
        size=tuple(settings.size),
        angle=settings.angle,
        border=settings.border,
        pixels=pixels,
        is_inverted=settings.is_inverted,
    )


def write_field(camera) -> None:
    """Write the second shape of a blend camera's surfaces: the second camera's as far as the field says.

    Surfaces that are not the blend's own, or have lost their order of rows, stay as they are. Baked shapes,
    which hold an earlier map, are removed.
    """
    field = read_field(camera)
    for surface in blend_surfaces(camera):
        keys = surface.data.shape_keys
        _drop_baked(surface)
        factors = None if field is None else field_factors(camera, surface, field)
        if field is not None and factors is None:
            continue
        if WHOLE_KEY not in keys.key_blocks:
            if field is None:
                continue
            points = points_of(keys.key_blocks[SECOND_KEY])
            whole = surface.shape_key_add(name=WHOLE_KEY, from_mix=False)
            whole.mute = True
            whole.data.foreach_set("co", points.ravel())
        first, second = (points_of(keys.key_blocks[name]) for name in (FIRST_KEY, WHOLE_KEY))
        if factors is not None:
            second = first + factors.astype(np.float32)[:, None] * (second - first)
        keys.key_blocks[SECOND_KEY].data.foreach_set("co", np.ascontiguousarray(second).ravel())
        surface.data.update()


def field_factors(camera, surface, field: BlendField) -> Array | None:
    """The factors of a field at the vertices of a surface, (N,); None for a grid out of order."""
    mesh, aspect = surface.data, camera.scfpf.fitted_aspect or 1.0
    if surface.scfpf_surface.kind == "UV_MESH":
        if not field.has_seam or not _is_cut(mesh, field, camera):
            return field.factors(*_mesh_places(mesh).T, aspect)
        within = np.empty(len(mesh.vertices), bool)
        mesh.attributes[WITHIN].data.foreach_get("value", within)
        return np.where(within != field.is_inverted, 1.0, 0.0)
    rows = math.isqrt(len(mesh.vertices))
    if rows**2 != len(mesh.vertices):
        return None
    return field.factors(*_image_places(camera, rows), aspect)


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


def _seam_numbers(field: BlendField, aspect: float) -> list[float]:
    """The settings that place a field's seam."""
    kind = ("LINEAR", "RADIAL", "RECTANGLE").index(field.kind)
    return [float(kind), aspect, *field.centre, *field.size, field.angle]


def _is_cut(mesh, field: BlendField, camera) -> bool:
    """Return whether a mesh is cut along a field's seam."""
    numbers = mesh.get(SEAM)
    if numbers is None or WITHIN not in mesh.attributes:
        return False
    return list(numbers) == _seam_numbers(field, camera.scfpf.fitted_aspect or 1.0)


def _note_seam(camera, mesh: SeamMesh) -> None:
    """Write which vertices are within the camera's own field, if that has a seam."""
    field = read_field(camera)
    for slot in camera.scfpf.surfaces:
        data = slot.object.data
        if field is None or not field.has_seam:
            if SEAM in data:
                del data[SEAM]
            continue
        within = data.attributes.get(WITHIN) or data.attributes.new(WITHIN, "BOOLEAN", "POINT")
        within.data.foreach_set("value", np.ascontiguousarray(mesh.sides[0]))
        data[SEAM] = _seam_numbers(field, camera.scfpf.fitted_aspect)


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
    """Write both shapes of each surface of a camera with room for them; keys, drivers and objects stay.

    Call ``write_field`` afterwards.
    """
    for slot, layer in zip(camera.scfpf.surfaces, blend.layers, strict=True):
        surface = slot.object
        first, second = (shape.reshape(-1, 3).astype(np.float32).ravel() for shape in layer)
        surface.data.vertices.foreach_set("co", first)
        blocks = surface.data.shape_keys.key_blocks
        for name, points in ((FIRST_KEY, first), (SECOND_KEY, second), (WHOLE_KEY, second)):
            if name in blocks:
                blocks[name].data.foreach_set("co", points)
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
