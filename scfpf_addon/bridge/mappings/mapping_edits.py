# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of a camera's stack of image mappings."""

from __future__ import annotations

import json
import math

import bpy
import numpy as np

from ...projection.file_limits import PresetError, parsed
from ...projection.mappings.calibrated import MODELS, CalibratedLens, lens_data, read_lens
from ...projection.mappings.kinds import COEFFICIENTS, KINDS, MAXIMUM_MAPPINGS
from ...projection.user_error import UserError
from ..blender.all_or_nothing import at_end
from ..blender.mesh_grid import write_grid
from ..blender.scene_objects import delete_with_data, link_beside
from ..blender.slot_animation import MAPPINGS, clear_slots, remove_slot
from ..volume.camera_members import all_cameras, cameras_with, grids_of
from ..volume.volume_object import sync_volume_object

# The numbers in each property of a mapping, by their names in projections and presets.
NUMBERS = {
    "centre": ("centre_x", "centre_y"),
    "numerator": COEFFICIENTS[:3],
    "denominator": COEFFICIENTS[3:],
    **{name: (name,) for name in ("radius", "magnification", "falloff", "arc", "distance")},
}
# Hidden from Blender's own lists of node groups by the dot.
CURVE_NAME, CURVE_NODE = ".SCFPF Radial Curve", "Curve"
# Points of a new grid, up and across.
GRID_SHAPE = (5, 7)
# The distance of a new grid: this multiple of the camera's clip start, but at least so many Blender units.
GRID_CLIP_STARTS, GRID_DISTANCE = 4.0, 1.0

# A lens that leaves the image unchanged.
PINHOLE = CalibratedLens(MODELS[0], (2.0, 2.0), (1.0, 0.0, 0.0, 1.0), (1.0, 1.0))


def curve_node(tree):
    """The Float Curve node of a radial curve's node group, or None."""
    node = tree.nodes.get(CURVE_NODE) if tree is not None else None
    return node if node is not None and node.bl_idname == "ShaderNodeFloatCurve" else None


def new_curve(points=((0.0, 0.0), (1.0, 1.0))):
    """A node group with a Float Curve through points (K, 2), whose radii rise."""
    tree = bpy.data.node_groups.new(CURVE_NAME, "ShaderNodeTree")
    node = tree.nodes.new("ShaderNodeFloatCurve")
    node.name = node.label = CURVE_NODE
    points = np.asarray(points, np.float64)
    mapping = node.mapping
    # Corners of the image have radii above 1.
    mapping.clip_max_x = max(1.0, points[-1, 0])
    mapping.clip_max_y = max(1.0, points[:, 1].max())
    curve = mapping.curves[0]
    first, last = curve.points
    first.location, last.location = points[0].tolist(), points[-1].tolist()
    for place in points[1:-1]:
        curve.points.new(*place.tolist())
    if len(points) > 2:
        # These handles neither overshoot nor reverse.
        for point in curve.points:
            point.handle_type = "AUTO_CLAMPED"
    mapping.update()
    return tree


def calibrated_lens(text: str) -> CalibratedLens:
    """The lens in the property ``calibration``, whose text keeps all digits. Raises UserError."""
    try:
        return read_lens(parsed(text), "lens")
    except PresetError as error:
        raise UserError(
            "The calibration cannot be read: {0}; make the camera anew from its file", error
        ) from error


def calibration_text(lens: CalibratedLens) -> str:
    """A lens as the property ``calibration`` holds it."""
    return json.dumps(lens_data(lens))


def take_kind(camera, mapping) -> None:
    """Give a mapping the datablock or the lens that its kind needs, if it has none."""
    if mapping.kind == "RADIAL_CURVE" and curve_node(mapping.curve) is None:
        mapping.curve = new_curve()
    elif mapping.kind == "GRID" and mapping.grid is None:
        mapping.grid = new_grid(camera)
    elif mapping.kind == "CALIBRATION" and not mapping.calibration:
        mapping.calibration = calibration_text(PINHOLE)


def new_grid(camera, places=None):
    """A mesh over the image, a child of the camera, as a deformed grid.

    places: (R, C, 2), the image positions to look up; None for an undeformed grid.
    """
    if places is None:
        lines = (np.linspace(0.0, 1.0, count) for count in GRID_SHAPE[::-1])
        places = np.stack(np.meshgrid(*lines), axis=-1)
    name = f"{camera.name} Picture Grid"
    grid = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    write_grid(grid.data, np.concatenate([places, np.zeros((*places.shape[:2], 1))], axis=-1))
    grid.display_type = "WIRE"
    grid.hide_render = True
    lens = camera.data
    distance = max(GRID_DISTANCE, GRID_CLIP_STARTS * lens.clip_start)
    width = lens.ortho_scale if lens.type == "ORTHO" else 2 * distance * math.tan(lens.angle_x / 2)
    render = bpy.context.scene.render
    height = (
        width * (render.resolution_y * render.pixel_aspect_y) / (render.resolution_x * render.pixel_aspect_x)
    )
    grid.parent = camera
    grid.location = -width / 2, -height / 2, -distance
    grid.scale = width, height, 1.0
    link_beside(grid, camera)
    return grid


def add_mapping(camera, kind: str, name: str):
    """Append a mapping to a camera's stack and make it active. Raises UserError for too many mappings."""
    settings = camera.scfpf
    if len(settings.mappings) >= MAXIMUM_MAPPINGS:
        raise UserError("A camera has at most {0} mappings: remove one first", MAXIMUM_MAPPINGS)
    mapping = settings.mappings.add()
    mapping.name = name
    mapping.kind = kind
    mapping.radius = 1.0 if kind == "DISTORTION" else 0.5
    take_kind(camera, mapping)
    settings.active_mapping = len(settings.mappings) - 1
    sync_volume_object(camera)
    return mapping


def remove_mapping(camera, index: int) -> None:
    """Remove a mapping from the stack, and its curve and mesh if nothing else uses them."""
    settings = camera.scfpf
    mapping = settings.mappings[index]
    curve, grid = mapping.curve, mapping.grid
    remove_slot(settings, index, MAPPINGS)
    _remove_unused(camera, curve, grid)
    sync_volume_object(camera)


def clear_mappings(camera) -> None:
    """Empty a camera's stack, as ``remove_mapping`` does."""
    held = [(mapping.curve, mapping.grid) for mapping in camera.scfpf.mappings]
    if not held:
        return
    clear_slots(camera.scfpf, MAPPINGS)
    for curve, grid in held:
        _remove_unused(camera, curve, grid)
    sync_volume_object(camera)


def _remove_unused(camera, curve, grid) -> None:
    if curve is not None and curve.users == 0 and curve.is_editable:
        at_end(bpy.data.node_groups.remove, curve)
    if grid is None or grid.parent != camera or not grid.is_editable:
        return
    if not cameras_with(grid, grids_of):
        at_end(delete_with_data, grid)


def write_mappings(camera, mappings) -> None:
    """Replace a camera's stack by mappings of a preset (projection.mappings.kinds.ImageMapping)."""
    clear_mappings(camera)
    for stored in mappings:
        mapping = camera.scfpf.mappings.add()
        mapping.name = stored.name
        if stored.kind == "RADIAL_CURVE":
            mapping.curve = new_curve(stored.points)
        elif stored.kind == "GRID":
            mapping.grid = new_grid(camera, stored.points)
        if stored.lens is not None:
            mapping.calibration = calibration_text(stored.lens)
        mapping.kind = stored.kind
        for key, names in NUMBERS.items():
            if names[0] in stored.parameters:
                values = [stored.parameters[name] for name in names]
                setattr(mapping, key, values if len(values) > 1 else values[0])
        mapping.influence, mapping.backwards = stored.influence, stored.backwards
    sync_volume_object(camera)


def read_numbers(mapping) -> dict[str, float]:
    """The numbers of a mapping's kind, by their names in projections and presets."""
    used = {name.removesuffix("_degrees") for name in KINDS.get(mapping.kind, ())}
    numbers: dict[str, float] = {}
    for key, names in NUMBERS.items():
        if names[0] in used:
            value = getattr(mapping, key)
            numbers |= zip(names, value if len(names) > 1 else [value], strict=True)
    return numbers


def own_mapping_data(camera) -> int:
    """Copy the curves and grids that a camera shares with others; return how many."""
    others = [other for other in all_cameras() if other != camera]
    copied = 0
    for mapping in camera.scfpf.mappings:
        if mapping.curve is not None and mapping.curve.users > 1:
            mapping.curve = mapping.curve.copy()
            copied += 1
        if mapping.grid is not None and cameras_with(mapping.grid, grids_of, others):
            copy = mapping.grid.copy()
            copy.data = copy.data.copy()
            link_beside(copy, camera)
            copy.parent = camera
            mapping.grid = copy
            copied += 1
    return copied
