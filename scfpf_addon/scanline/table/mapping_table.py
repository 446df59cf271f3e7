# SPDX-License-Identifier: GPL-3.0-or-later
"""Image mappings in a camera's table: u and v at the table's corners, computed in Python, kept on its mesh.

The table is linear between corners. Its cells are so small that the mapped positions half way between corners
are off by at most TABLE_ERROR of the image, or as small as MOST_CELLS allows.
"""

from __future__ import annotations

from math import tau

import bpy
import numpy as np

from ...bridge.mappings.read_mappings import mapping_signature, read_mappings
from ...bridge.render.image_size import image_aspect
from ...bridge.surfaces.kinds import PARAMETRIC_KINDS
from ...bridge.surfaces.surface_object import surface_parameters
from ...projection.mappings.stack import BORDER, is_disc, mapped_places, seen_through
from ...projection.user_error import UserError
from ...projection.volume.reparameterisation import Polar, reparameterisation

# A twentieth of a pixel of a thousand.
TABLE_ERROR = 5e-5
FEWEST_CELLS, MOST_CELLS = (256, 128), (512, 256)
# A corner of the table shows nothing, something, or something beyond the seam of a polar image.
HOLE, SHOWN, BEYOND_SEAM = 0.0, 1.0, 1.5
# A table ignores its mesh, takes u and v from it, or also takes holes or a seam.
UNUSED, WHOLE, IN_PIECES = 0, 1, 2
# Corners farther out than this are no holes: a disc is trimmed at its rim.
INSIDE_RIM = 0.98
# An arc shorter than a full turn by more than this has a seam, in radians.
FULL_TURN = 1e-5


def image_signature(camera, scene) -> tuple:
    """The settings on which the mesh of a camera's table depends; empty without image mappings."""
    mappings = mapping_signature(camera, _depsgraph(scene))
    if not mappings:
        return ()
    settings = camera.scfpf
    return mappings, image_aspect(scene), tuple(settings.u_range), tuple(settings.v_range)


def image_mappings(camera, scene) -> tuple:
    """The image mappings of a camera in a scene. Raises UserError."""
    return read_mappings(camera, _depsgraph(scene))


def _depsgraph(scene):
    """The scene's depsgraph as last evaluated: handlers must not evaluate it again."""
    if scene == bpy.context.scene:
        return bpy.context.view_layer.depsgraph or bpy.context.evaluated_depsgraph_get()
    return scene.view_layers[0].depsgraph or bpy.context.evaluated_depsgraph_get()


def store_parameters(table, camera, scene, least_cells: tuple[int, int]) -> dict[str, int]:
    """Put u and v into a table's mesh if the camera has mappings; return the inputs that depend on it.

    least_cells: across and up, for the surfaces. A stack that cannot be read counts as none.
    """
    if not any(mapping.enabled for mapping in camera.scfpf.mappings):
        if len(table.data.vertices):
            table.data.clear_geometry()
        return {"Pictured": UNUSED, "Disc": 1}
    try:
        mappings = image_mappings(camera, scene)
    except UserError:
        return {"Pictured": UNUSED, "Disc": 1}
    aspect, settings = image_aspect(scene), camera.scfpf
    disc = is_disc(seen_through(mappings, reparameterisation(settings.reparameterisation)), aspect)
    cells = tuple(max(pair) for pair in zip(least_cells, FEWEST_CELLS, strict=True))
    if _bend(mappings, cells, aspect) > TABLE_ERROR:
        cells = tuple(max(pair) for pair in zip(cells, MOST_CELLS, strict=True))
    u, v, kind = _corners(camera, mappings, aspect, cells, disc)
    (u0, u1), (v0, v1) = settings.u_range, settings.v_range
    places = np.stack([u0 + u * (u1 - u0), v0 + v * (v1 - v0), kind], axis=1)
    mesh = table.data
    mesh.clear_geometry()
    mesh.vertices.add(len(places))
    mesh.vertices.foreach_set("co", np.nan_to_num(places).astype(np.float32).ravel())
    mesh.update()
    mesh.update_tag()
    return {
        "Pictured": WHOLE if (kind == SHOWN).all() else IN_PIECES,
        "Disc": int(disc),
        "Columns": cells[0] + 1,
        "Rows": cells[1] + 1,
    }


def _corners(camera, mappings, aspect: float, cells: tuple[int, ...], disc: bool):
    """u and v, as shares of their ranges, and HOLE, SHOWN or BEYOND_SEAM at each corner, (N,) each.

    disc: whether the image is one; its table is over the square around it.
    """
    base = reparameterisation(camera.scfpf.reparameterisation)
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.linspace(0.0, 1.0, count + 1) for count in cells)))
    radius = np.hypot(2 * x - 1, 2 * y - 1)
    if disc:
        x, y = 0.5 + (x - 0.5) / max(aspect, 1.0), 0.5 + (y - 0.5) / max(1 / aspect, 1.0)
    seen = mapped_places(mappings, x, y, aspect)
    shown, polar = seen.mask.copy(), isinstance(base, Polar)
    if not polar:
        inside = np.maximum(np.abs(seen.u - 0.5), np.abs(seen.v - 0.5)) <= 0.5 + BORDER
        shown &= inside
        seen = seen._replace(u=np.clip(seen.u, 0.0, 1.0), v=np.clip(seen.v, 0.0, 1.0))
    image = base.points(seen.u, seen.v, aspect)
    if polar and not disc:
        shown &= image.mask
    elif disc:
        shown |= radius > INSIDE_RIM
    kind = np.where(shown, SHOWN, HOLE)
    if polar and _has_seam(camera):
        kind = np.where(shown & (seen.v < 0.5), BEYOND_SEAM, kind)
    return image.u, image.v, kind


def _bend(mappings, cells: tuple[int, ...], aspect: float) -> float:
    """The greatest distance of a mapped position half way along a cell's side from the mean of its ends."""
    worst = 0.0
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in FEWEST_CELLS)))
    for dx, dy in ((0.5 / cells[0], 0.0), (0.0, 0.5 / cells[1])):
        before, here, after = (
            mapped_places(mappings, x + k * dx, y + k * dy, aspect) for k in (-1.0, 0.0, 1.0)
        )
        usable = before.mask & here.mask & after.mask
        for name in ("u", "v"):
            ends = getattr(before, name) + getattr(after, name)
            off = np.abs(0.5 * ends - getattr(here, name))[usable]
            worst = max(worst, float(off.max(initial=0.0)))
    return worst


def _has_seam(camera) -> bool:
    """Return whether a polar image may leap where its turn begins and ends: unless it is whole."""
    if tuple(camera.scfpf.u_range) != (0.0, 1.0):
        return True
    for slot in camera.scfpf.surfaces:
        surface = slot.object
        if surface is None or surface.scfpf_surface.kind == "POINT":
            continue
        if surface.scfpf_surface.kind not in PARAMETRIC_KINDS:
            return True
        try:
            arc = surface_parameters(surface).get("arc", 0.0)
        except UserError:
            return True
        if arc < tau - FULL_TURN:
            return True
    return False
