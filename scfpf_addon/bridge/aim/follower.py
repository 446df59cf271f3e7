# SPDX-License-Identifier: GPL-3.0-or-later
"""The follower of moving targets, for drags and for Live Aim.

The problem is read once, and each event takes one warm step of the solver.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...aim.solver.gauss_newton import Aim
from ...aim.solver.problem import AimPins
from ...aim.solver.vectors import nearest_t
from ...projection.user_error import UserError
from ..blender.scene_objects import object_by_uid
from ..settings.aim_properties import PIN, VIEW
from .aimed_volume import (
    is_keyed,
    moved,
    note_solution,
    present_patches,
    start_of,
    write_points,
    write_volume,
)
from .kept_volume import KeptVolume, volume_kept
from .read_problem import AimInputs, own_pin, read_inputs
from .solution import Measures, forget_measures
from .solve_targets import solving
from .solve_work import Steps
from .target_views import view_map


class Follower:
    """The state of a volume that follows its targets: arrays and ids. Every method raises USER_ERRORS.

    A volume that is no solution becomes one, with the same image. Call either ``finishing`` or ``restore``.
    """

    def __init__(self, camera, depsgraph) -> None:
        if is_keyed(camera):
            raise UserError("The volume is keyframed: move the targets at their keys, then press Solve")
        self._camera = camera.session_uid
        self._inputs: AimInputs = read_inputs(camera, depsgraph)
        self._solver = Aim(self._inputs.problem())
        self._replaced: KeptVolume | None = None
        if start_of(camera) is not None and self._fits(camera):
            self.resume(camera)
        else:
            start = moved(self._inputs.start, self._inputs.inward)
            self._replaced = KeptVolume(camera)
            try:
                with volume_kept(camera):
                    write_volume(camera, start, start)
            except BaseException:
                self._replaced.drop(camera)
                raise
        try:
            self._before, self._measures = present_patches(camera), Measures.of(camera)
        except BaseException:
            if self._replaced is not None:
                self._replaced.bring_back(camera)
            raise

    def _fits(self, camera) -> bool:
        present = [patch.points.shape for patch in present_patches(camera)]
        return present == [patch.points.shape for patch in self._inputs.start]

    def resume(self, camera) -> None:
        """Continue from the present control points of the camera."""
        solver, outward = self._solver, np.linalg.inv(self._inputs.inward)
        solver.points = solver.net.gather(moved(present_patches(camera), outward))
        controls = solver.pin_energy.places.controls(solver.points)[0]
        solver.t = nearest_t(controls, self._inputs.targets.pins.points)

    def step(self, depsgraph) -> float:
        """Let the volume follow the targets by one step; return the largest residual in pixels."""
        camera = self._found()
        result = self._solver.drag(self._pins(camera, depsgraph))
        if not all(np.isfinite(patch.points).all() for patch in result.patches):
            raise UserError("The volume cannot follow: move the targets back a little")
        write_points(camera, moved(result.patches, self._inputs.inward))
        note_solution(camera)
        forget_measures(camera)
        return float(result.residuals.max())

    def _found(self):
        camera = object_by_uid(self._camera)
        if camera is None or start_of(camera) is None or not self._fits(camera):
            raise UserError("The camera or its control surfaces have changed: begin again")
        return camera

    def _pins(self, camera, depsgraph) -> AimPins:
        """The pins where the targets are by now: the same points of things, seen in new directions."""
        targets = self._inputs.targets
        pins = targets.pins
        values = {
            name: getattr(pins, name).copy()
            for name in ("points", "positions", "directions", "across", "upward", "pivots")
        }
        listed = camera.scfpf.aim_targets
        for number in np.unique(targets.owners):
            if number >= len(listed):
                raise UserError("The targets have changed: begin again")
            target, own = listed[number], np.flatnonzero(targets.owners == number)
            if target.kind == VIEW:
                shown = view_map(target, depsgraph, self._inputs.present.aspect)
                points = values["points"][:, own]
                values["positions"][:, own] = shown.positions(points)
                values["directions"][:, own] = shown.directions(points)
                values["across"][:, own], values["upward"][:, own] = shown.steps(points)
            elif target.kind == PIN:
                pin = own_pin(target, depsgraph)
                for name in ("points", "positions", "directions", "pivots"):
                    values[name][:, own] = getattr(pin, name)
        values["positions"] = np.clip(np.nan_to_num(values["positions"], nan=0.5), 0.0, 1.0)
        return replace(pins, **values)

    def finishing(self, depsgraph) -> Steps:
        """Solve anew from the start and judge.

        If that fails, is cancelled or is not taken, the volume is as it was when the follower was made.
        """
        try:
            message = yield from solving(self._found(), depsgraph)
        except BaseException:
            self.restore()
            raise
        if self._replaced is not None:
            self._replaced.drop(self._found())
        return message

    def restore(self) -> None:
        """Bring back the volume from when the follower was made. Does nothing if the camera is gone."""
        camera = object_by_uid(self._camera)
        if camera is None:
            return
        if self._replaced is not None:
            self._replaced.bring_back(camera)
        elif start_of(camera) is not None and self._fits(camera):
            write_points(camera, self._before)
            note_solution(camera)
        self._measures.store(camera)


def make_followable(camera, depsgraph) -> None:
    """Give a camera a volume that can follow its targets, with the same image, if it has none.

    Raises as ``read_inputs`` and ``write_volume``.
    """
    if start_of(camera) is None:
        inputs = read_inputs(camera, depsgraph)
        start = moved(inputs.start, inputs.inward)
        with volume_kept(camera):
            write_volume(camera, start, start)
