# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's SURFACE objects as NURBS patches: made, and read as evaluated.

Blender's U is our u, its V our v; points run along U first. The evaluated splines hold keyframes and edits of
points. Only the tessellated mesh shows the effect of shape keys, hooks and other modifiers; the control
points are recovered from it.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ...projection.editing.nurbs_edits import reversing
from ...projection.file_values import LARGEST_LENGTH
from ...projection.surfaces.kinds import FEWEST_NURBS_POINTS, SURFACE_KINDS
from ...projection.surfaces.nurbs import NurbsAxis, NurbsPatch, fitted_points
from ...projection.surfaces.surface import ControlSurface, Grid
from ...projection.user_error import UserError
from ..blender.all_or_nothing import at_end

KIND = "NURBS"
TITLE = SURFACE_KINDS[KIND].title
DEFAULT_ORDER = 4
ORDERS = ("order_u", "order_v")
# Blender tessellates in float32, over knots that are float32 too; a patch that leaves its
# tessellation by more than this share of the largest coordinate is another surface.
TESSELLATION_ERROR = 2e-5


def flat_points():
    """A 4 × 4 net over the unit square in the XY plane, (4, 4, 3)."""
    line = np.linspace(-0.5, 0.5, 4)
    x, y = np.meshgrid(line, line)
    return np.stack([x, y, np.zeros_like(x)], 2)


def new_data(name: str, points, parameters: dict):
    """Data for a SURFACE object: one patch that begins and ends at its outer points.

    points: (rows, columns, 3), or 4 with weights, at least 3 × 3; None is flat.
    parameters: order_u and order_v, each 4 where it is missing. Raises UserError
    when they make no patch.
    """
    points = np.asarray(flat_points() if points is None else points, np.float64)
    if points.ndim != 3 or min(points.shape[:2]) < FEWEST_NURBS_POINTS:
        raise UserError(
            "A {0} needs rows × columns of points, at least {1} × {1}, got {2}",
            TITLE,
            FEWEST_NURBS_POINTS,
            points.shape,
        )
    unknown = set(parameters) - set(ORDERS)
    if unknown:
        raise UserError("A {0} has no parameter {1!r}", TITLE, min(unknown))
    orders = [int(parameters.get(name, DEFAULT_ORDER)) for name in ORDERS]
    points = _checked(points, *(NurbsAxis(order) for order in orders))
    data = bpy.data.curves.new(name, "SURFACE")
    _make_net(data, *points.shape[:2])
    spline = data.splines[0]
    spline.use_endpoint_u = spline.use_endpoint_v = True
    spline.order_u, spline.order_v = orders
    spline.points.foreach_set("co", points.astype(np.float32).ravel())
    return data


def _checked(points, along_u: NurbsAxis, along_v: NurbsAxis):
    """The points with their weights, (rows, columns, 4), or UserError."""
    if not (np.abs(points) <= LARGEST_LENGTH).all():
        raise UserError("The points of a {0} must be numbers up to {1:g}", TITLE, LARGEST_LENGTH)
    try:
        NurbsPatch(points, along_u, along_v)
    except ValueError as error:
        raise UserError("These points make no {0}: {1}", TITLE, error) from error
    return points if points.shape[2] == 4 else np.pad(points, ((0, 0), (0, 0), (0, 1)), constant_values=1.0)


def write_parameters(surface, parameters: dict) -> None:
    """Write points, as many as there are, order_u and order_v. Raises UserError."""
    spline = _only_spline(surface)
    unknown = set(parameters) - {"points", *ORDERS}
    if unknown:
        raise UserError("A {0} has no parameter {1!r}", TITLE, min(unknown))
    now = read_parameters(surface) | parameters
    points = np.asarray(now["points"], np.float64)
    if points.shape[:2] != (spline.point_count_v, spline.point_count_u):
        raise UserError(
            "'{0}' has {1} × {2} points, not {3}",
            surface.name,
            spline.point_count_v,
            spline.point_count_u,
            points.shape,
        )
    axes = [replace(axis, order=int(now[name])) for axis, name in zip(_axes(spline), ORDERS, strict=True)]
    points = _checked(points, *axes)
    spline.order_u, spline.order_v = (axis.order for axis in axes)
    spline.points.foreach_set("co", points.astype(np.float32).ravel())
    surface.data.update_tag()


def read_parameters(surface) -> dict:
    """points (rows, columns, 4) float64 with their weights, order_u and order_v; modifiers do not count."""
    spline = _only_spline(surface)
    return {"points": _points(spline), "order_u": spline.order_u, "order_v": spline.order_v}


def _make_net(data, rows: int, columns: int) -> None:
    """Make one spline of rows × columns points, U along the columns.

    Python can add curves only. Blender's own "Make Segment" joins them to a patch, in a scene of its own that
    leaves the user's selection and mode alone.
    """
    for _ in range(columns):  # joined side by side: each is a column
        spline = data.splines.new("NURBS")
        spline.points.add(rows - 1)
        for point in spline.points:
            point.select = True
    scene = bpy.data.scenes.new("SCFPF Patch")
    joined = bpy.data.objects.new("SCFPF Patch", data)
    try:
        scene.collection.objects.link(joined)
        layer = scene.view_layers[0]
        layer.objects.active = joined
        given = {"scene": scene, "view_layer": layer, "object": joined, "active_object": joined}
        with bpy.context.temp_override(**given, edit_object=None):
            bpy.ops.object.mode_set(mode="EDIT")
        with bpy.context.temp_override(**given, edit_object=joined):
            bpy.ops.curve.make_segment()
            bpy.ops.object.mode_set(mode="OBJECT")
    finally:
        bpy.data.objects.remove(joined)
        bpy.data.scenes.remove(scene)


def own_patch(surface) -> NurbsPatch:
    """The patch by its points and settings; modifiers do not count. Raises UserError."""
    spline = _only_spline(surface)
    try:
        return NurbsPatch(_points(spline), *_axes(spline))
    except ValueError as error:
        raise UserError("'{0}' is not a valid surface: {1}", surface.name, error) from error


def replace_net(surface, patch: NurbsPatch) -> None:
    """Give a surface object new data with a patch's points, weights and knots; its look stays."""
    before, old = surface.data, _only_spline(surface)
    rows, columns = np.shape(patch.points)[:2]
    data = before.copy()
    data.splines.clear()
    _make_net(data, rows, columns)
    spline = data.splines[0]
    for axis, letter in ((patch.along_u, "u"), (patch.along_v, "v")):
        setattr(spline, f"use_endpoint_{letter}", axis.endpoint)
        setattr(spline, f"use_bezier_{letter}", axis.bezier)
        setattr(spline, f"use_cyclic_{letter}", axis.cyclic)
        setattr(spline, f"order_{letter}", axis.order)
        setattr(spline, f"resolution_{letter}", getattr(old, f"resolution_{letter}"))
    spline.use_smooth, spline.material_index = old.use_smooth, old.material_index
    spline.points.foreach_set("co", np.asarray(patch.points, np.float32).ravel())
    name = before.name
    surface.data = data
    if before.users == 0:
        at_end(bpy.data.curves.remove, before)
        at_end(setattr, data, "name", name)


def reversed_order(surface, axis: str):
    """The order of the control points along axis "U" or "V" in which the patch runs backwards.

    Raises UserError for shape keys or hooks, which know points by number, and for knots that
    are not alike from both ends.
    """
    patch = own_patch(surface)
    data = surface.data
    hooked = any(modifier.type == "HOOK" for modifier in surface.modifiers)
    if data.shape_keys is not None or data.animation_data is not None or hooked:
        raise UserError(
            "'{0}' has shape keys or hooks, or animated points, that would not be mirrored: "
            "convert it to a grid first",
            surface.name,
        )
    rows, columns = np.shape(patch.points)[:2]
    try:
        return reversing(patch.along_u, columns) if axis == "U" else reversing(patch.along_v, rows)
    except UserError as error:
        raise UserError("'{0}': {1}", surface.name, error) from error


def reorder(surface, order, axis: str) -> None:
    """Put the control points along axis "U" or "V" in another order, weights included."""
    if surface.data.users > 1:
        surface.data = surface.data.copy()
    points = _points(_only_spline(surface)).take(order, axis=1 if axis == "U" else 0)
    surface.data.splines[0].points.foreach_set("co", points.astype(np.float32).ravel())
    surface.data.update_tag()


def data_properties(surface) -> list[tuple[str, object, str]]:
    """(label, owner, property) of each setting that defines a patch besides its points, for panels."""
    if surface.type != "SURFACE" or len(surface.data.splines) != 1:
        return []
    spline = surface.data.splines[0]
    names = (
        ("Order", "order"),
        ("Endpoint", "use_endpoint"),
        ("Bézier", "use_bezier"),
        ("Cyclic", "use_cyclic"),
    )
    return [(f"{label} {axis}", spline, f"{name}_{axis.lower()}") for label, name in names for axis in "UV"]


def read_patch(evaluated, mode: str) -> ControlSurface:
    """An evaluated SURFACE object in its own space.

    mode: VIEWPORT or RENDER, of the depsgraph. Returns a NurbsPatch, or a Grid of the tessellated vertices
    where modifiers reshaped them so that no net of control points fits.
    Raises UserError unless it is a single valid patch.
    """
    name, spline = evaluated.name, _only_spline(evaluated)
    points = _points(spline)
    if not np.isfinite(points).all():
        raise UserError("'{0}' has control points that are not finite", name)
    try:
        patch = NurbsPatch(points, *_axes(spline))
    except ValueError as error:
        raise UserError(
            "'{0}' is not a valid surface: {1}; change its Active Spline settings or its points in Edit Mode",
            name,
            error,
        ) from error
    if not _is_deformed(evaluated, mode):
        return patch
    samples = _tessellation(evaluated, mode)
    if not np.isfinite(samples).all():
        raise UserError("A shape key or modifier of '{0}' makes points that are not finite", name)
    net = fitted_points(samples, patch.points[..., 3], patch.along_u, patch.along_v)
    fitted = replace(patch, points=np.concatenate([net, patch.points[..., 3:]], axis=2))
    return fitted if _passes_through(fitted, samples) else Grid(_closed(samples, patch))


def _only_spline(surface):
    if surface.type != "SURFACE":
        raise UserError(
            "'{0}' is of type {1}, not a surface: choose another kind for it",
            surface.name,
            surface.type.title(),
        )
    splines = surface.data.splines
    if len(splines) != 1:
        raise UserError(
            "'{0}' has {1} patches and needs just one: separate the others in Edit Mode with P"
            if splines
            else "'{0}' has no patch and needs just one: add one in Edit Mode",
            surface.name,
            len(splines),
        )
    return splines[0]


def _points(spline):
    points = np.empty(4 * len(spline.points), np.float32)
    spline.points.foreach_get("co", points)
    return points.reshape(spline.point_count_v, spline.point_count_u, 4).astype(np.float64)


def _axes(spline) -> tuple[NurbsAxis, NurbsAxis]:
    return (
        NurbsAxis(spline.order_u, spline.use_endpoint_u, spline.use_bezier_u, spline.use_cyclic_u),
        NurbsAxis(spline.order_v, spline.use_endpoint_v, spline.use_bezier_v, spline.use_cyclic_v),
    )


def _is_deformed(evaluated, mode: str) -> bool:
    show = "show_render" if mode == "RENDER" else "show_viewport"
    return evaluated.data.shape_keys is not None or any(
        getattr(modifier, show) for modifier in evaluated.modifiers
    )


def _tessellation(evaluated, mode: str):
    """The vertices of the drawn surface, (V, U, 3) float64, own space."""
    data, spline = evaluated.data, evaluated.data.splines[0]
    steps_u, steps_v = spline.resolution_u, spline.resolution_v
    if mode == "RENDER":
        steps_u, steps_v = data.render_resolution_u or steps_u, data.render_resolution_v or steps_v
    columns, rows = spline.point_count_u * steps_u, spline.point_count_v * steps_v
    mesh = evaluated.to_mesh()
    try:
        if len(mesh.vertices) != columns * rows:
            raise UserError(
                "A modifier of '{0}' adds or removes points: remove it, or convert the surface to a mesh",
                evaluated.name,
            )
        points = np.empty(3 * columns * rows, np.float32)
        mesh.vertices.foreach_get("co", points)
    finally:
        evaluated.to_mesh_clear()
    return points.reshape(columns, rows, 3).swapaxes(0, 1).astype(np.float64)


def _passes_through(patch: NurbsPatch, samples) -> bool:
    rows, columns = samples.shape[:2]
    u = np.arange(columns) / (columns - (not patch.along_u.cyclic))
    v = np.arange(rows) / (rows - (not patch.along_v.cyclic))
    u, v = (grid.ravel() for grid in np.meshgrid(u, v))
    distance = np.abs(patch.evaluate(u, v).position - samples.reshape(-1, 3).T).max()
    return bool(distance <= TESSELLATION_ERROR * np.abs(samples).max())


def _closed(samples, patch: NurbsPatch):
    """Samples of a cyclic surface with their first row or column repeated at the end."""
    if patch.along_u.cyclic:
        samples = np.concatenate([samples, samples[:, :1]], axis=1)
    if patch.along_v.cyclic:
        samples = np.concatenate([samples, samples[:1]], axis=0)
    return samples
