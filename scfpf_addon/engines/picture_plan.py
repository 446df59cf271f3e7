# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a picture's anchors: Blender's data are read, threads plan, step by step."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..anchors.anchor_view import ViewSet, traced_views, without_unused
from ..anchors.completion import completed
from ..anchors.image_parts import ImagePart, image_parts
from ..anchors.kept_plan import KeptPlan, digest
from ..anchors.plan import PlanLimits, plan_anchors
from ..anchors.seen_scene import SeenScene
from ..anchors.shot import LayeredShot, LookedAt, completed_sets
from ..anchors.stand_ins import StandIns
from ..bridge.blender.scene_objects import object_by_uid
from ..bridge.camera.stereo_views import Eye, eye_place, eye_shift
from ..bridge.render.render_inputs import RenderInputs, read_inputs, synced_image_size
from ..bridge.scene.instances import instances
from ..bridge.scene.read_scene import NOTHING
from ..bridge.scene.render_depsgraph import with_render_depsgraph
from ..bridge.tasks.background import AwaitedWork, in_background
from ..bridge.tasks.task import Task
from ..casting.common.ray_visibility import CAMERA, visible_to
from ..casting.scene.cast_scene import CastScene
from ..cycles.layers.layers_job import LOST
from ..projection.typing import Array, BoolArray
from ..projection.user_error import Message, UserError
from .anchor_scene import AnchorScene
from .backface_culling import one_sided
from .directional import directional
from .faceless import read_stand_ins
from .joined_tiles import JoinedPart, Pictures

# What of a geometry rays meet.
SHAPE = ("vertices", "triangles", "visibility", "image_layer")
PLANNING = Message("planning the renders")
# The share of planning after which the anchors' views are traced, and that after which all pixels are looked
# at, for the status bar.
TRACED, COMPLETED = 0.4, 0.6


class ReadPicture(NamedTuple):
    """What a plan is made from: arrays only.

    inputs: of the picture. axes: (3, 3), right, up and back of its camera. one_sided, directional: see
    ``SeenScene``.
    instancers: session ids of the objects that instance others, if the picture has layers. stand_ins: of what
    the rest shows that has no faces, None if nothing. eye_lens: of an eye of the camera's own view, the place
    (4, 4) of an ordinary camera that sees the same and what is added to its horizontal shift; else None.
    """

    inputs: RenderInputs
    axes: Array
    one_sided: BoolArray | None
    directional: BoolArray | None
    instancers: frozenset[int]
    stand_ins: StandIns | None = None
    eye_lens: tuple[Array, float] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """The size in pixels."""
        return self.inputs.settings.width, self.inputs.settings.height

    @property
    def limits(self) -> PlanLimits:
        """The limits that its plan keeps."""
        return PlanLimits.of_samples(self.inputs.settings.samples)

    @property
    def made_for(self) -> str:
        """The digest of what a plan depends on."""
        there = self.inputs.scene.geometry
        stands = self.stand_ins and self.stand_ins.vertices
        of_faces = there.image_layer, self.one_sided, self.directional, stands
        arrays = visible_to(there.visibility, CAMERA), *of_faces
        asked = self.inputs.projection, self.size, self.limits.texels
        return digest(there.vertices, there.triangles, arrays, *asked)

    @property
    def parts(self) -> list[ImagePart]:
        """What the picture shows through each volume. Raises CastError, and UserError if nothing is there."""
        there = self.inputs.scene.geometry
        shown, found = visible_to(there.visibility, CAMERA), []
        if len(there.triangles):
            scene = CastScene(there.vertices, there.triangles)
            found = image_parts(
                scene, shown, self.one_sided, self.directional, there.image_layer, self.inputs.projection
            )
        if not found and self.stand_ins is not None:
            # The caster sees nothing; anchors are planned for the stand-ins alone.
            scene = SeenScene(CastScene(self.stand_ins.vertices, self.stand_ins.triangles), is_empty=True)
            found = [ImagePart(0, scene, replace(self.inputs.projection, layers=()))]
        if not found:
            raise UserError(NOTHING)
        rest = replace(found[0], scene=found[0].scene.with_stand_ins(self.stand_ins))
        return [rest, *found[1:]]

    def has_shape_of(self, other: ReadPicture) -> bool:
        """Return whether rays meet the same things as in another picture."""
        pairs = [
            (getattr(self.inputs.scene.geometry, name), getattr(other.inputs.scene.geometry, name))
            for name in SHAPE
        ]
        pairs += [(self.one_sided, other.one_sided), (self.directional, other.directional)]
        pairs.append(tuple(each.stand_ins and each.stand_ins.vertices for each in (self, other)))
        if self.inputs.projection.layers or other.inputs.projection.layers:
            return False
        return all((one is other) or np.array_equal(one, other) for one, other in pairs)


@dataclass
class PicturePlan:
    """The views of a picture's anchors, their pictures to come.

    is_one_eye: whether all projectors of the rest have one eye, where anchors see the sky as well. kept: the
    plan for a camera to keep, None for frames of a shot.
    """

    parts: list[JoinedPart]
    is_one_eye: bool = False
    kept: KeptPlan | None = None

    @property
    def count(self) -> int:
        """The number of anchors."""
        return sum(len(each.pictures.views) for each in self.parts)


def read_picture(passing: AnchorScene, camera, frame: int | None = None, eye: Eye = "") -> ReadPicture:
    """Read a picture of a passing scene. frame: another one than the present. Raises USER_ERRORS."""
    scene = passing.scene
    size, present = synced_image_size(scene, camera), scene.frame_current
    names = tuple(each.source for each in passing.passes.data) if frame is None else ()

    def read(depsgraph, set_frame):
        if frame is not None:
            set_frame(frame, subframe=0.0)
        inputs = read_inputs(depsgraph, camera, size, passes=names, may_be_empty=True, eye=eye)
        # Any rotation serves: one that shears or mirrors would not.
        turn = camera.evaluated_get(depsgraph).matrix_world.to_quaternion().to_matrix()
        keys = (each.key for each in instances(depsgraph)) if inputs.projection.layers else ()
        instancers = frozenset(key.owner_uid for key in keys if key.owner_uid != key.uid)
        stand_ins = read_stand_ins(depsgraph, inputs.image_layers.members)
        eye_lens = _eye_lens(camera.evaluated_get(depsgraph), eye) if inputs.is_ordinary and eye else None
        if frame is not None:
            set_frame(present, subframe=0.0)
        return inputs, np.array(turn, np.float64), (instancers, stand_ins, eye_lens)

    inputs, axes, rest = with_render_depsgraph(scene, scene.view_layers[0], read, with_time=True)
    names, material = inputs.scene.material_names, inputs.scene.geometry.material
    of_faces = one_sided(scene, names, material), directional(names, material)
    return ReadPicture(inputs, axes, *of_faces, *rest)


def _eye_lens(camera, eye: Eye) -> tuple[Array, float] | None:
    """``ReadPicture.eye_lens`` of an evaluated camera whose picture is its own view."""
    shift = eye_shift(camera, eye)
    return None if shift is None else (eye_place(camera, eye), shift)


def plan_picture_steps(
    passing: AnchorScene, camera_uid: int, picture: ReadPicture, shot: LayeredShot | None
) -> Generator[AwaitedWork, None, PicturePlan]:
    """Plan the anchors of a picture, yielding what threads are to do. shot: of an animation.

    Raises USER_ERRORS.
    """
    kept = KeptPlan.read(_camera(camera_uid).scfpf.anchor_plan)
    if shot is None:
        return (yield from in_background(PLANNING, lambda task: _still(picture, kept, task)))
    frame = passing.scene.frame_current
    parts = yield from in_background(PLANNING, lambda _task: picture.parts)
    for chunk in shot.missing(frame):
        looked_at: list[dict[int, LookedAt]] = []
        for other in shot.frames(chunk):
            there = read_picture(passing, _camera(camera_uid), other)
            text = Message("planning frame {0}", other)
            looked_at.append(
                (yield from in_background(text, lambda _task, there=there: _looked_at(there, picture, parts)))
            )

        def plan(_task: Task[bool], chunk=chunk, looked_at=looked_at) -> bool:
            threads = picture.inputs.settings.threads
            shot.plan(chunk, looked_at, picture.size, picture.axes, picture.limits, kept, threads)
            return True

        yield from in_background(PLANNING, plan)
    return (
        yield from in_background(PLANNING, lambda task: _of_shot(picture, parts, shot, frame, kept, task))
    )


def _camera(uid: int):
    """The camera with a session id. Raises UserError if it is gone."""
    camera = object_by_uid(uid)
    if camera is None:
        raise UserError(LOST)
    return camera


def _looked_at(there: ReadPicture, present: ReadPicture, parts: list[ImagePart]) -> dict[int, LookedAt]:
    """A frame that is looked at, by the numbers of layers. present, parts: the picture's own frame."""
    made_for = there.made_for
    if there.has_shape_of(present):
        return {0: LookedAt(parts[0].scene, there.inputs.projection, made_for)}
    return {each.number: LookedAt(each.scene, each.projection, made_for) for each in there.parts}


def _of_shot(
    picture: ReadPicture,
    parts: list[ImagePart],
    shot: LayeredShot,
    frame: int,
    kept: KeptPlan | None,
    task: Task[PicturePlan],
) -> PicturePlan:
    """The plan of a frame of a shot."""
    threads, found = picture.inputs.settings.threads, PicturePlan([])
    for part in parts:
        if sets := shot.sets(frame, part.number):
            views, own = completed_sets(
                part.scene, part.projection, picture.size, sets, picture.limits, threads
            )
            found.parts.append(JoinedPart(part, Pictures(views, own)))
            continue
        alone = _still(picture, kept, task, [part])
        found.parts += alone.parts
        found.is_one_eye |= alone.is_one_eye and part.number == 0
    return found


def _still(
    picture: ReadPicture, kept: KeptPlan | None, task: Task[PicturePlan], parts: list[ImagePart] | None = None
) -> PicturePlan:
    """The plan of a picture by itself. kept: a plan to be used if it fits. parts: of the picture."""
    made_for, limits, threads = picture.made_for, picture.limits, picture.inputs.settings.threads
    parts = picture.parts if parts is None else parts
    found = PicturePlan([])
    if kept is not None and kept.made_for == made_for:
        for part in parts:
            views = traced_views(part.scene, kept.of_layer(part.number), threads)
            found.parts.append(JoinedPart(part, Pictures(views, [ViewSet(tuple(range(len(views))))])))
        found.is_one_eye, found.kept = kept.is_one_eye, kept
        return found
    anchors, numbers, shown, count = [], [], 0.0, 0
    for place, part in enumerate(parts):
        seen, size = (part.scene, part.projection), picture.size
        plan = plan_anchors([seen[0]], [seen[1]], size, picture.axes, limits, things_only=part.number > 0)
        task.progress = (place + TRACED) / len(parts)
        views = traced_views(part.scene, plan.anchors, threads)
        task.progress = (place + COMPLETED) / len(parts)
        done = completed(*seen, size, views, limits=limits, threads=threads)
        # A still picture is the better for what was made for its smallest parts.
        views, sets = without_unused(done.views, [ViewSet((*done.own.first, *done.own.rest))])
        found.parts.append(JoinedPart(part, Pictures(views, sets)))
        anchors += [view.anchor for view in views]
        numbers += [part.number] * len(views)
        shown, count = shown + done.shown * done.count, count + done.count
        if part.number == 0:
            found.is_one_eye = plan.is_one_eye
    found.kept = KeptPlan(
        tuple(anchors),
        made_for,
        picture.size,
        shown / max(count, 1),
        found.is_one_eye,
        tuple(numbers),
        limits.texels,
    )
    return found
