# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures with layers by Cycles, render by render: Blender's jobs in a window, at once without one."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, Literal

import bpy

from ...bridge.blender.all_or_nothing import all_or_nothing
from ...bridge.blender.scene_objects import object_by_uid, scene_by_uid
from ...bridge.blender.user_errors import USER_ERRORS, reason
from ...bridge.render.command_line import CYCLES_RENDERS
from ...bridge.render.image_file import frame_file, is_multilayer, require_place, save_result
from ...bridge.render.result_image import keep_result, result_image, show_progress
from ...bridge.tasks.background import AwaitedWork
from ...bridge.tasks.task import Task
from ...projection.user_error import Message, UserError
from ..rig_data import require_cycles
from .layer_passes import COMBINED
from .layered_render import LayeredRender
from .pass_files import Pass, deliver_passes
from .temporary_scene import TemporaryScene

NOT_RENDERED = "{0} has written no picture: look at the system console for its reason"
LOST = "The scene or the camera was deleted meanwhile: render again"
# What a step asks for: a render by Blender, work in a thread, nothing after the last picture.
Step = Literal["RENDER", "WORK", ""]


class LayersJob:
    """Pictures with layers, one a frame. Call ``close`` in any case: the artist's scene is as before then.

    Between two steps it keeps names and numbers only. warnings: what the pictures do not show as asked.
    written: the files. outcome: what was rendered, and in what time. engine: the name of what renders. work:
    what a thread is to do before the next step.
    """

    engine = "Cycles"

    def __init__(self, context, camera, frames: Sequence[int] = (), path: str = "") -> None:
        """frames: of an animation, none for the scene's present frame. path: of files, see ``frame_file``.

        Raises USER_ERRORS.
        """
        scene = context.scene
        self.require(scene)
        self._scene, self._layer, self._camera = (
            scene.session_uid,
            context.view_layer.name,
            camera.session_uid,
        )
        self._is_animation, self._path = bool(frames), path
        self._frames = [*frames] or [scene.frame_current]
        self._passing: Any = None
        self._render: Any = None
        self._frame_before, self._moved = (scene.frame_current, scene.frame_subframe), False
        self._begun, self._count = time.monotonic(), len(self._frames)
        self._done, self._text = 0, ""
        self.work: Task[Any] | None = None
        self.warnings: list[str] = []
        self.written: list[str] = []
        self.outcome = ""
        if path:
            require_place(self._file(self._frames[0]))

    def require(self, scene) -> None:
        """Raise UserError if pictures of a scene cannot be rendered so."""
        require_cycles(scene)

    def picture(self, scene, view_layer):
        """The temporary scene of one picture, which has its name, and the picture's renders."""
        passing = TemporaryScene(scene, view_layer)
        return passing, LayeredRender(passing)

    def step(self) -> Step:
        """Take what Blender has rendered or a thread has done, and prepare the next of these.

        Raises USER_ERRORS. After any error only ``close`` is left to be called.
        """
        with all_or_nothing():
            return self._next()

    def _next(self) -> Step:
        """Advance to the next render or work. Raises USER_ERRORS."""
        self.work = None
        while self._render is not None or self._begin():
            assert self._render is not None
            try:
                wanted = next(self._steps)
            except StopIteration:
                self._deliver()
                continue
            except OSError as error:
                raise UserError(NOT_RENDERED, self.engine) from error
            if isinstance(wanted, AwaitedWork):
                self._text, self.work = wanted
                return "WORK"
            self._text = wanted
            self._done += 1
            return "RENDER"
        return ""

    def render(self, in_window: bool) -> None:
        """Have Blender render: in a job of its own in a window, else at once. Raises UserError."""
        assert self._passing is not None
        call = ("INVOKE_DEFAULT",) if in_window else ()
        try:
            bpy.ops.render.render(*call, write_still=True, use_viewport=False, scene=self._passing.name)
        except RuntimeError as error:
            reason = str(error).removeprefix("Error: ").strip()
            raise UserError("Blender does not render: {0}", reason) from error

    @property
    def is_working(self) -> bool:
        """Return whether a thread is still at work."""
        return self.work is not None and self.work.running

    @property
    def progress(self) -> Message:
        """The name of the present render or work, for the status bar."""
        if self.work is not None:
            text = (
                Message("{0}, {1:.0%}", self._text, self.work.progress) if self.work.progress else self._text
            )
            if self._count == 1:
                return text
            return Message("frame {0} of {1}, {2}", self._count - len(self._frames), self._count, text)
        total = self._render.total if self._render is not None else 0
        if self._count == 1:
            return Message("{0} ({1} of {2})", self._text, self._done, total)
        place = self._count - len(self._frames), self._count
        return Message("frame {0} of {1}, {2} ({3} of {4})", *place, self._text, self._done, total)

    def close(self) -> None:
        """Remove everything that was made for the renders, and return to the artist's frame."""
        self._end_picture()
        scene = scene_by_uid(self._scene)
        if self._moved and scene is not None:
            scene.frame_set(self._frame_before[0], subframe=self._frame_before[1])
        self._moved = False

    def _end_picture(self) -> None:
        passing, self._passing = self._passing, None
        work, self.work = self.work, None
        try:
            if work is not None:
                work.cancel()
                work.wait()
            if self._render is not None:
                self._steps.close()
        finally:
            self._render = None
            if passing is not None:
                passing.remove()

    def _begin(self) -> bool:
        """Begin the next picture that is to be made; False if there is none."""
        while self._frames:
            scene, camera = scene_by_uid(self._scene), object_by_uid(self._camera)
            if scene is None or camera is None:
                raise UserError(LOST)
            frame = self._frames.pop(0)
            is_there = self._path and self._is_animation and os.path.exists(self._file(frame))
            if is_there and not scene.render.use_overwrite:
                continue
            if self._is_animation:
                # Renders of a copy show objects as the artist's scene has evaluated them.
                self._moved = True
                scene.frame_set(frame)
            self._passing, self._render = self.picture(scene, scene.view_layers[self._layer])
            self._frame, self._done = frame, 0
            self._steps = self._render.steps(camera)
            return True
        return False

    def _deliver(self) -> None:
        """Keep the finished picture, and write its file."""
        assert self._render is not None and self._render.pixels is not None
        pixels, passes = self._render.pixels, self._render.passes
        self.warnings += [text for text in self._render.warnings if text not in self.warnings]
        self._end_picture()
        height, width = pixels.shape[:2]
        show_progress(pixels)
        path, scene = self._file(self._frame) if self._path else "", scene_by_uid(self._scene)
        if is_multilayer(path, scene) or (passes and not self._frames):
            self._deliver_passes({COMBINED: Pass("RGBA", pixels), **passes}, path)
        del pixels, passes
        if not self._frames and (warning := keep_result()):
            self.warnings.append(warning)
        if path and not is_multilayer(path, scene):
            self.written.append(save_result(result_image(), path, scene))
        made = f"{len(self.written)} pictures, " if self._is_animation else ""
        self.outcome = f"{made}{width}×{height} by {self.engine} in {time.monotonic() - self._begun:.1f} s"

    def _deliver_passes(self, passes: dict[str, Pass], path: str) -> None:
        """Write the file of a picture with its passes if it is to have them; keep those of the last one."""
        scene = scene_by_uid(self._scene)

        def save(image) -> None:
            self.written.append(save_result(image, path, scene, with_passes=True))

        save_if = save if is_multilayer(path, scene) else None
        keeps = len(passes) > 1 and not self._frames
        if warning := deliver_passes(passes, self._layer, save_if, keeps):
            self.warnings.append(warning)

    def _file(self, frame: int) -> str:
        return frame_file(self._path, scene_by_uid(self._scene), frame, self._is_animation)


def render_for_command(camera, frames: Sequence[int], path: str) -> tuple[list[str], str]:
    """Render files for the command line; return warnings and what was rendered. Raises UserError."""
    try:
        job = render_layers(bpy.context, camera, frames, path)
    except USER_ERRORS as error:
        raise UserError(reason(error)) from error
    return job.warnings, job.outcome


def register():
    CYCLES_RENDERS.append(render_for_command)


def unregister():
    CYCLES_RENDERS.clear()


def render_layers(context, camera, frames: Sequence[int] = (), path: str = "") -> LayersJob:
    """Do all of a ``LayersJob`` at once, and return it. Raises USER_ERRORS; earlier files stay then."""
    return all_at_once(LayersJob(context, camera, frames, path))


def all_at_once(job):
    """Do all steps of a job, and return it. Raises USER_ERRORS."""
    try:
        while wanted := job.step():
            if wanted == "RENDER":
                job.render(in_window=False)
            else:
                job.work.run()
    finally:
        job.close()
    return job
