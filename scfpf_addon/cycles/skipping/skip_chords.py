# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of each cell that rays of a rig skip, found from the scene as a render evaluates it.

The ends of the chords are those that the rig's own nodes compute, so that what is tested is what rays travel.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import bpy
import numpy as np

from ...bridge.render.image_size import image_size
from ...bridge.scene.instances import Instance
from ...bridge.scene.mesh_arrays import foreach
from ...bridge.scene.render_depsgraph import with_render_depsgraph
from ...casting.cells.occupied_chords import occupied_chords
from ...projection.typing import Array, BoolArray
from ...projection.user_error import UserError
from ..chords.chord_plan import ChordPlan
from ..portals.paths import Faces, faces_of
from ..portals.sheets import first_sheet, sheet_shape
from ..rig_data import probe_mesh
from .bodies import Bodies, Unbounded
from .reasons import movers_of, moves, obstacle
from .scene_state import objects_state, shown_objects
from .swept_bodies import SweptBodies, shutter_of

# Widths of a cell of sheets whose rays skip chords, in pixels: the first with at most so many cells counts.
CELL_PIXELS = (8, 12, 16, 24, 32)
MOST_CELLS = 16_000


class EmptySpaceQuery(NamedTuple):
    """A look at a scene for empty chords.

    frames: at which chords are to be empty; none if nothing moves. patience: seconds that it may take.
    apart: whether Blender is rendering the scene, which is then evaluated as a copy.
    """

    frames: Sequence[float] = ()
    patience: float = math.inf
    apart: bool = False


class EmptyChords(NamedTuple):
    """Faces of sheets whose rays skip chords, and the states of objects that they are for, by frame.

    objects: empty for a look at the present frame.
    """

    faces: Faces
    objects: dict[float, dict[int, tuple]]


class NotSkipping(Exception):
    """Rays have to travel all chords. The message is the reason, as a sentence without its end."""


def faces_that_skip(rig, chords: ChordPlan, look: EmptySpaceQuery) -> EmptyChords:
    """The faces of sheets whose rays skip the chords in which nothing is. Raises NotSkipping.

    The rig's mesh is a probe afterwards: call ``write_sheets`` in any case.
    """
    scene = rig.scfpf_rig.scene
    if reason := obstacle(rig):
        raise NotSkipping(reason)
    cells = fine_cells(chords.cells, image_size(scene))
    probe_mesh(rig, chords, cells)
    search = _ChordSearch(rig, chords, cells, look)
    occupied, ends = search.run()
    return EmptyChords(faces_of(occupied, cells, ends), search.objects)


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


class _ChordSearch:
    """The search for chords in which anything may be at some frames."""

    def __init__(self, rig, chords: ChordPlan, cells: tuple[int, int], look: EmptySpaceQuery) -> None:
        settings = rig.scfpf_rig
        self._rig, self._look, self._count = rig, look, chords.count
        self._name, self._shape = settings.portals.name_full, sheet_shape(cells, chords.disc)
        self._movers, self._volume_moves = movers_of(rig), moves(rig)
        self._shutter = shutter_of(settings.scene.render)
        self._ends: Array | None = None
        self._occupied: BoolArray | None = None
        self._shown = shown_objects(rig)
        self.objects: dict[float, dict[int, tuple]] = {}

    def run(self) -> tuple[BoolArray, Array]:
        """Return whether anything may be in each cell's chords, (n, rows, columns), and the chords' ends.

        The ends are those of the last frame, (n + 1, 3, rows + 1, columns + 1). Raises NotSkipping.
        """
        scene = self._rig.scfpf_rig.scene
        if self._look.apart:
            scene = scene.copy()
        try:
            for layer in scene.view_layers:
                with_render_depsgraph(scene, layer, self._of_layer, with_time=True)
        except (Unbounded, UserError) as error:
            raise NotSkipping(str(error)) from error
        finally:
            if self._look.apart:
                bpy.data.scenes.remove(scene)
        assert self._occupied is not None and self._ends is not None
        return self._occupied, self._ends

    def _of_layer(self, depsgraph, set_frame) -> None:
        settings, frames = self._rig.scfpf_rig, self._look.frames
        if not frames:
            self._of_frame(depsgraph, lambda _: None, True)
            return
        own = settings.scene.frame_current_final
        begun = time.monotonic()

        def go_to(frame: float) -> None:
            whole = math.floor(frame)
            set_frame(whole, subframe=frame - whole)

        try:
            for number, frame in enumerate(frames):
                self._of_frame(
                    depsgraph,
                    lambda share, frame=frame: go_to(
                        frame + self._shutter.centre + share * self._shutter.half
                    ),
                    number == 0,
                )
                if len(frames) > 1:
                    self._note_state(depsgraph, frame, go_to)
                taken = (time.monotonic() - begun) * len(frames) / (number + 1)
                if taken > self._look.patience:
                    raise NotSkipping("The frames of the scene take too long to look through")
        finally:
            go_to(own)

    def _note_state(self, depsgraph, frame: float, go_to: Callable[[float], None]) -> None:
        """Note where objects are at a frame, as viewports will show them."""
        if frame not in self.objects:
            if self._shutter.half > 0.0:
                go_to(frame)
            self.objects[frame] = objects_state([obj.evaluated_get(depsgraph) for obj in self._shown])

    def _of_frame(self, depsgraph, go_to: Callable[[float], None], is_first: bool) -> None:
        """Add what is in the way at a frame. go_to: a time from -1 to 1, while the shutter is open."""
        go_to(0.0)
        if self._ends is None or self._volume_moves:
            self._ends = self._read_ends(depsgraph)
        bodies, blurs = Bodies(), self._shutter.half > 0.0 and bool(self._look.frames)
        everything = is_first or self._volume_moves
        wanted = None if everything else self._is_mover
        if blurs and everything:
            bodies.read(depsgraph, lambda instance: not self._is_mover(instance))
        elif not blurs:
            bodies.read(depsgraph, wanted)
        if blurs:
            swept = SweptBodies(self._is_mover)
            swept.read(depsgraph, 0.0)
            for share in sorted(swept.times - {0.0}):
                go_to(share)
                swept.read(depsgraph, share)
            swept.add_to(bodies)
        finite = np.isfinite(self._ends).all(axis=(0, 1))
        size = float(np.ptp(self._ends[:, :, finite], axis=(0, 2)).max()) if finite.any() else 0.0
        occupied = occupied_chords(self._ends, bodies.points(size))
        self._occupied = occupied if self._occupied is None else self._occupied | occupied

    def _is_mover(self, instance: Instance) -> bool:
        return not self._movers.isdisjoint((instance.key.uid, instance.key.owner_uid))

    def _read_ends(self, depsgraph) -> Array:
        """The ends of all chords, (n + 1, 3, rows, columns). Raises NotSkipping."""
        rows, columns = self._shape
        portals = depsgraph.objects.get(self._name)
        if portals is None:
            raise NotSkipping("A view layer of the scene leaves the rig out")
        mesh, first = portals.data, first_sheet(self._count)
        if len(mesh.vertices) != first + (self._count + 1) * rows * columns:
            raise NotSkipping("The rig has lost its nodes: undo, or remove it and press Cycles again")
        ends = foreach(mesh.attributes["position"].data, "vector", 3)[first:]
        return ends.reshape(self._count + 1, rows, columns, 3).transpose(0, 3, 1, 2)
