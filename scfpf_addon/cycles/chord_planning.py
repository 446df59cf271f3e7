# SPDX-License-Identifier: GPL-3.0-or-later
"""The planning of a rig's chords for all frames of its volume."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..bridge.blender.scene_objects import holds, object_by_uid, scene_by_uid
from ..bridge.camera.ordinary_camera import is_own_view
from ..bridge.camera.read_projection import read_projection
from ..bridge.render.image_size import image_aspect, image_size
from ..bridge.volume.volume_object import sync_volume_object
from ..projection.user_error import UserError
from ..projection.volume.viewing_volume import Projection
from ..scanline.table.table_object import grid_cells
from .chords.chord_plan import ChordPlan, plan_chords
from .rig_data import build_groups, check, check_surfaces, remove_groups
from .smoke import changing_smoke, keyed_frames, smoke_around
from .watched_volume import may_move

# Frames of an animated volume, or of smoke that changes, that are looked at.
FRAMES = 9
# Progress once the frames are read, and once the node groups are built.
AFTER_FRAMES, AFTER_GROUPS = 0.4, 0.7


class Planned(NamedTuple):
    """The plan that a rig is made from.

    animated: whether the volume may be. smoke: an object whose smoke the near surface is in at another frame,
    and that frame; ("", 0) without one. looked_at: the objects whose smoke was followed through the frames.
    """

    chords: ChordPlan
    animated: bool
    smoke: tuple[str, int] = ("", 0)
    looked_at: tuple[str, ...] = ()


class Planning:
    """The planning of chords, step by step, so that it can be cancelled. It leaves the scene as it was.

    It keeps names, numbers and arrays only.
    """

    def __init__(self, context, camera) -> None:
        """Raises UserError, or an error of ``read_projection``."""
        scene = context.scene
        check(scene, camera)
        check_surfaces(camera)
        sync_volume_object(camera)
        self._scene, self._camera = scene.session_uid, camera.session_uid
        self._name, self._groups, self._has_moved = camera.name, None, False
        self._frame = scene.frame_current, scene.frame_subframe
        self._projections: list[Projection] = []
        self._is_own_view = True
        self._animated = may_move(camera)
        self._smoke, self._changing = ("", 0), tuple(changing_smoke(scene, self._animated))
        self._read(context, camera)
        self._frames: list[int] = []
        if self._animated or self._changing:
            ends = scene.frame_start, scene.frame_end
            frames = {*np.linspace(*ends, FRAMES).round().astype(int).tolist()}
            frames |= {frame for frame in keyed_frames(self._changing) if ends[0] <= frame <= ends[1]}
            self._frames = sorted(frames)
        self._count = len(self._frames)

    @property
    def progress(self) -> float:
        """The share of the plan that is done, from 0 to 1."""
        if self._frames:
            return AFTER_FRAMES * (1.0 - len(self._frames) / self._count)
        return AFTER_FRAMES if self._groups is None else AFTER_GROUPS

    @property
    def text(self) -> str:
        """The next step, for the status bar."""
        if self._frames:
            return f"frame {self._count - len(self._frames) + 1} of {self._count}"
        return "nodes" if self._groups is None else "sheets"

    def step(self, context) -> bool:
        """Take a step; return whether there are more. Raises as ``__init__`` does."""
        camera = self.camera(context)
        if self._frames:
            self._has_moved = True
            context.scene.frame_set(self._frames.pop(0))
            self._read(context, camera)
            if not self._frames:
                self._return(context.scene)
        elif self._groups is None:
            self._groups = build_groups(camera)
        return bool(self._frames) or self._groups is None

    def plan(self, context) -> Planned:
        """The chords for all frames that were read."""
        chords = chords_of(self.camera(context), context.scene, self._projections, self._is_own_view)
        return Planned(chords, self._animated, self._smoke, self._changing)

    def camera(self, context):
        """The camera. Raises UserError if it or its scene has gone."""
        camera = object_by_uid(self._camera)
        is_here = context.scene.session_uid == self._scene and camera is not None
        if not is_here or not holds(context.scene.objects, camera):
            raise UserError("'{0}' was deleted meanwhile: undo, or choose another camera", self._name)
        return camera

    def give_up(self) -> None:
        """Leave the scene as it was."""
        scene = scene_by_uid(self._scene)
        if self._has_moved and scene is not None:
            self._return(scene)
        remove_groups(self._groups or [])

    def _read(self, context, camera) -> None:
        depsgraph = context.evaluated_depsgraph_get()
        projection = read_projection(camera, depsgraph, image_aspect(context.scene))
        if self._animated or not self._projections:
            self._projections.append(projection)
        if self._changing and self._has_moved and not self._smoke[0]:
            name = smoke_around(context.scene, projection)
            self._smoke = name, context.scene.frame_current if name else 0
        self._is_own_view &= is_own_view(projection, camera.evaluated_get(depsgraph), depsgraph)

    def _return(self, scene) -> None:
        frame, subframe = self._frame
        scene.frame_set(frame, subframe=subframe)
        self._has_moved = False


def planned(context, camera) -> Planned:
    """Take all steps of a ``Planning`` at once. Raises as it does; nothing is changed then."""
    planning = Planning(context, camera)
    try:
        while planning.step(context):
            pass
        return planning.plan(context)
    except Exception:
        planning.give_up()
        raise


def chords_of(camera, scene, projections: list[Projection], is_own_view: bool = False) -> ChordPlan:
    """Plan the chords of projections for a camera's settings. Raises UserError.

    is_own_view: see ``ChordPlan``.
    """
    lines = grid_cells([slot.object for slot in camera.scfpf.surfaces])
    plan = plan_chords(projections, image_size(scene), camera.scfpf.pixel_error, lines)
    return replace(plan, is_own_view=is_own_view)
