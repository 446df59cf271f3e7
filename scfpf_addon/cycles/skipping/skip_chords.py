# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of each cell that rays of a rig skip, found from the scene as a render evaluates it.

The ends of the chords are those that the rig's own nodes compute, so that what is tested is what rays travel.
"""

from __future__ import annotations

from ...bridge.camera.read_projection import ProjectionError
from ...bridge.render.image_size import image_size
from ...bridge.scene.mesh_arrays import foreach
from ...bridge.scene.render_depsgraph import RenderDepsgraphError, with_render_depsgraph
from ...casting.cells.occupied_chords import occupied_chords
from ...projection.typing import BoolArray
from ..chords.chord_plan import ChordPlan
from ..portals.paths import Faces, faces_of
from ..portals.sheets import first_sheet, sheet_shape
from ..rig_data import probe_mesh
from .bodies import Bodies, Unbounded
from .reasons import obstacle

# Widths of a cell of sheets whose rays skip chords, in pixels: the first with at most so many cells counts.
CELL_PIXELS = (8, 12, 16, 24, 32)
MOST_CELLS = 16_000


class NotSkipping(Exception):
    """Rays have to travel all chords. The message is the reason, as a sentence without its end."""


def faces_that_skip(rig, chords: ChordPlan) -> Faces:
    """The faces of sheets whose rays skip the chords in which nothing is. Raises NotSkipping.

    The rig's mesh is a probe afterwards: call ``write_sheets`` in any case.
    """
    scene = rig.scfpf_rig.scene
    if reason := obstacle(rig):
        raise NotSkipping(reason)
    cells = fine_cells(chords.cells, image_size(scene))
    probe_mesh(rig, chords, cells)
    occupied = _occupied(rig, chords, cells)
    return faces_of(occupied, cells)


def fine_cells(cells: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """Cells across and up, multiples of the plan's, that are small but not too many."""
    across, up = cells
    for width in CELL_PIXELS:
        across, up = (
            count * max(1, -(-pixels // (width * count))) for count, pixels in zip(cells, size, strict=True)
        )
        if across * up <= MOST_CELLS:
            break
    return across, up


def _occupied(rig, chords: ChordPlan, cells: tuple[int, int]) -> BoolArray:
    """Whether anything may be in each chord of each cell, (n, rows, columns). Raises NotSkipping."""
    settings = rig.scfpf_rig
    scene, name = settings.scene, settings.portals.name_full
    rows, columns = sheet_shape(cells, chords.disc)
    bodies, found = Bodies(), []

    def read(depsgraph) -> None:
        bodies.read(depsgraph)
        if not found:
            mesh = depsgraph.objects[name].data
            ends = foreach(mesh.attributes["position"].data, "vector", 3)[first_sheet(chords.count) :]
            found.append(ends.reshape(chords.count + 1, rows, columns, 3).transpose(0, 3, 1, 2))

    try:
        for layer in scene.view_layers:
            with_render_depsgraph(scene, layer, read)
    except Unbounded as error:
        raise NotSkipping(str(error)) from error
    except (RenderDepsgraphError, ProjectionError) as error:
        raise NotSkipping(str(error)) from error
    return occupied_chords(found[0], bodies.points())
