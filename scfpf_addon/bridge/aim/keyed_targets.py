# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframed targets: a solution for each key, as shape keys whose values are keyframed.

Between two keys Blender interpolates the control points linearly.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import bpy
import numpy as np

from ...aim.solver.start import projection_of
from ...projection.surfaces.nurbs import NurbsPatch
from ...projection.user_error import Message, UserError
from ..blender.slot_animation import AIM_TARGETS, SLOT_PATH, curve_collections
from ..blender.user_errors import translated_report
from ..settings.aim_properties import LARGEST
from .aimed_volume import Patches, moved, note_solution, start_of, write_volume
from .kept_volume import volume_kept
from .read_problem import read_inputs
from .solution import Solution
from .solve_targets import camera_again, judge_of, judged, solution_of, solving
from .solve_work import Steps, Work
from .verdict import require_better, require_possible, store_verdict

# The shape key of the start, and the beginning of the names of others, which the frame follows.
START_SHAPE, SHAPE = "Start", "Aim "
# More keys are refused: each is a solution and a shape.
MOST_KEYS = 64
# Columns of the image that is judged between two keys, where only the pins count.
FEW_COLUMNS = 16
# The share of the time of a solve that the keys take; what is between them takes the rest.
SOLVING = 0.9


def key_frames(camera) -> list[float]:
    """The frames at which targets in use, their eyes or their handles have keyframes, ascending."""
    frames: set[float] = set()
    targets = camera.scfpf.aim_targets
    for curve in _curves(camera):
        found = SLOT_PATH.match(curve.data_path)
        number = int(found[2]) if found is not None and found[1] == AIM_TARGETS else len(targets)
        if number < len(targets) and targets[number].is_on:
            frames.update(_frames(curve))
    for target in targets:
        for obj in (target.eye, target.handle) if target.is_on else ():
            if obj is not None:
                for curve in _curves(obj):
                    frames.update(_frames(curve))
    return sorted(frames)


def _curves(owner):
    """The F-curves of an object that are no drivers."""
    return (curve for curves in curve_collections(owner) for curve in curves if curve.driver is None)


def _frames(curve) -> list[float]:
    return [float(point.co[0]) for point in curve.keyframe_points]


def solving_animation(camera, context) -> Steps:
    """Solve for the targets, at each of their keys if they have several.

    The scene ends at its present frame. Raises the errors of ``solving``; then the volume is as before.
    """
    frames = key_frames(camera)
    if len(frames) < 2:
        return (yield from solving(camera, context.evaluated_depsgraph_get()))
    if len(frames) > MOST_KEYS:
        raise UserError("The targets have keys at {0} frames: {1} are the most", len(frames), MOST_KEYS)
    if bpy.app.is_job_running("RENDER"):
        raise UserError("Keyframed targets cannot be solved during a render: wait until it has ended")
    uid, scene = camera.session_uid, context.scene
    present, scene = (scene.frame_current, scene.frame_subframe), scene.session_uid
    del camera, context
    try:
        solutions = yield from _solutions(uid, frames)
        between = yield from _worst_between(uid, frames, solutions)
    finally:
        for each in bpy.data.scenes:
            if each.session_uid == scene:
                each.frame_set(present[0], subframe=present[1])
    camera = camera_again(uid)
    with volume_kept(camera):
        _write(camera, frames, solutions)
        bpy.context.view_layer.update()
        return _keyed_verdict(camera, frames, solutions, between, sum(present))


def _keyed_verdict(camera, frames: list[float], solutions: list[Solution], between: float, present: float):
    """Store the verdict on solutions at keys; return the line to report. present: the frame of the scene."""
    nearest = int(np.abs(np.array(frames) - present).argmin())
    message = store_verdict(camera, solutions[nearest])
    worst = max(float(solution.judgement.pixels.max()) for solution in solutions)
    aim = camera.scfpf.aim
    aim.between, aim.is_solved = between, True
    found = len(frames), f"{worst:.2g}", f"{between:.2g}"
    keys = translated_report(Message("{0} keys, up to {1} px at them and {2} px between", *found))
    aim.message = f"{keys} · {message}"
    return aim.message


def _set_frame(frame: float):
    """Go to a frame; return the depsgraph."""
    whole = int(np.floor(frame))
    bpy.context.scene.frame_set(whole, subframe=frame - whole)
    return bpy.context.evaluated_depsgraph_get()


def _solutions(uid: int, frames: list[float]) -> Generator[Work, Any, list[Solution]]:
    """The solutions at all keys, of one start in camera space."""
    start, found = start_of(camera_again(uid)), []
    for number, frame in enumerate(frames):
        with _at(frame):
            inputs = read_inputs(camera_again(uid), _set_frame(frame), start)
            require_possible(camera_again(uid), inputs)
            part = SOLVING / len(frames)
            solution = yield Work(partial(solution_of, inputs), number * part, part)
            require_better(camera_again(uid), solution)
        start = moved(inputs.start, inputs.inward)
        found.append(solution)
    return found


@contextmanager
def _at(frame: float):
    """Name the frame in the messages of UserError."""
    try:
        yield
    except UserError as error:
        raise UserError("At frame {0:g}: {1}", frame, error) from error


def _own_nets(solution: Solution) -> Patches:
    """The control surfaces of a solution in camera space."""
    return moved(solution.result.patches, solution.inputs.inward)


def _write(camera, frames: list[float], solutions: list[Solution]) -> None:
    """Write solutions as shape keys of one volume."""
    first = solutions[0].inputs
    start = moved(first.start, first.inward)
    write_volume(camera, start, start)
    nets = [_own_nets(solution) for solution in solutions]
    for number, slot in enumerate(camera.scfpf.surfaces):
        surface = slot.object
        surface.shape_key_add(name=START_SHAPE, from_mix=False)
        keys = []
        for frame, net in zip(frames, nets, strict=True):
            key = surface.shape_key_add(name=f"{SHAPE}{frame:g}", from_mix=False)
            points = np.asarray(net[number].points, np.float32)
            key.data.foreach_set("co", points.ravel())
            keys.append(key)
        _key_values(surface, keys, frames)
    note_solution(camera)


def _key_values(surface, keys: list, frames: list[float]) -> None:
    """Keyframe each shape to act fully at its own frame and not at the neighbours'."""
    for number, key in enumerate(keys):
        for near in (number - 1, number, number + 1):
            if 0 <= near < len(frames):
                key.value = float(near == number)
                key.keyframe_insert("value", frame=frames[near])
    for curve in _curves(surface.data.shape_keys):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def _worst_between(uid: int, frames: list[float], solutions: list[Solution]) -> Generator[Work, Any, float]:
    """The largest residual of the pins midway between keys, in pixels."""
    first, worst = solutions[0].inputs, 0.0
    start = moved(first.start, first.inward)
    part = (1.0 - SOLVING) / (len(frames) - 1)
    for number, ((one, other), (left, right)) in enumerate(
        zip(pairwise(frames), pairwise(solutions), strict=True)
    ):
        middle = (one + other) / 2
        with _at(middle):
            inputs = read_inputs(camera_again(uid), _set_frame(middle), start)
        nets = zip(_own_nets(left), _own_nets(right), strict=True)
        mixed = tuple(NurbsPatch((a.points + b.points) / 2) for a, b in nets)
        after = projection_of(moved(mixed, np.linalg.inv(inputs.inward)), inputs.present.aspect)
        work = partial(_judged_pixels, inputs, after)
        worst = max(worst, (yield Work(work, SOLVING + number * part, part)))
    return worst


def _judged_pixels(inputs, after, _progress) -> float:
    """The largest residual of a projection, in pixels."""
    return float(np.minimum(judged(inputs, judge_of(inputs, FEW_COLUMNS), after).pixels, LARGEST).max())
