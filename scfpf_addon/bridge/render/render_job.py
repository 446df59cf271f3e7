# SPDX-License-Identifier: GPL-3.0-or-later
"""A render: everything that it needs is read at once, then a thread sees arrays only."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.cancellation import is_uncancellable
from ...casting.common.memory import available_memory
from ...casting.scene.cast_scene import CastError
from ...projection.volume.viewing_volume import Projection
from ...shading.frame import Frame, render_frame
from ...shading.passes.cryptomatte import identifiers
from ...shading.passes.data_passes import DataPasses
from ...shading.scene.motion import Moment
from ...shading.scene.shading_scene import Scene
from ...shading.settings.frame_settings import Border, FrameSettings
from ..camera.ordinary_camera import FrustumError, depth_plane, frustum_projection
from ..camera.read_depth_of_field import read_lens
from ..camera.read_projection import ProjectionError, read_projection
from ..camera.stereo_views import Eye, MultiViewError, eye_place, seen_by, unseen_settings
from ..scene.read_images import with_images
from ..scene.read_motion import read_moments, read_neighbours
from ..scene.read_scene import SceneError, read_scene
from ..scene.render_depsgraph import RenderDepsgraphError, with_render_depsgraph
from ..settings.sampling import sampling_of
from ..settings.stylised_properties import stylised_of
from ..volume.missing_objects import absent_text
from ..volume.volume_object import sync_volume_object
from .render_passes import crypto_names, passes_of_clear_things
from .scene_cache import SceneCache
from .scene_preparation import build, coarse_picture

# 16384 × 16384. A pixel is in the film and in Blender's buffer, then there and in the packed file,
# which takes 38 bytes.
MAXIMUM_PIXELS = 2**28
BYTES_PER_PIXEL = 48

NO_THREAD = "The system starts no more threads: close other programs, or restart Blender, and render again"


class RenderError(ValueError):
    """A render is not possible; the message has the remedy."""


# All that ``prepare`` and a job's ``result`` raise for bad input; anything else is a bug.
RENDER_ERRORS = (
    CastError,
    FrustumError,
    MemoryError,
    MultiViewError,
    ProjectionError,
    RenderDepsgraphError,
    RenderError,
    SceneError,
)


def reason(error: BaseException) -> str:
    """The message of one of RENDER_ERRORS: Python may raise a MemoryError without a text."""
    return (
        str(error)
        or "There is not enough memory for this picture: lower the resolution, or close other programs"
    )


@dataclass(frozen=True)
class RenderInputs:
    """Arrays and numbers only: Blender may change or free anything while they are used.

    moments: what the samples see while the shutter is open, () without motion blur.
    """

    projection: Projection
    scene: Scene
    settings: FrameSettings
    moments: tuple[Moment, ...] = ()


def picture_size(scene) -> tuple[int, int]:
    """Width and height in pixels from the scene's resolution and percentage, at least 1 × 1.

    Raises RenderError for a picture that no memory holds.
    """
    render = scene.render
    width = max(render.resolution_x * render.resolution_percentage // 100, 1)
    height = max(render.resolution_y * render.resolution_percentage // 100, 1)
    require_size(width, height)
    return width, height


def require_size(width: int, height: int) -> None:
    """Raise RenderError for a picture that no memory holds, or that this computer's does not now."""
    needed, free = width * height * BYTES_PER_PIXEL, available_memory()
    if width * height <= MAXIMUM_PIXELS and (free is None or needed <= free):
        return
    there_is = "" if free is None else f" and {free / 1e9:.1f} GB are free"
    raise RenderError(
        f"A picture of {width} × {height} pixels would need about {needed / 1e9:.1f} GB of memory"
        f"{there_is}; lower the resolution or its percentage in Output Properties"
    )


def picture_aspect(scene) -> float:
    """Width / height of the picture as it is shown, pixel aspect included."""
    return shown_aspect(scene.render, *picture_size(scene))


def shown_aspect(render, width: int, height: int) -> float:
    """Width / height of a picture of width × height pixels as it is shown."""
    return width * render.pixel_aspect_x / (height * render.pixel_aspect_y)


def prepare(scene, view_layer, camera, pixel_error: float | None = None) -> RenderInputs:
    """Read all that a picture of ``view_layer`` through ``camera`` needs, as evaluated for a render.

    pixel_error: overrides the camera's own. Of a scene with several views it is the camera's own view,
    between the eyes. Raises one of RENDER_ERRORS.
    """
    size = picture_size(scene)
    if lost := absent_text(camera, scene, "choose another camera"):
        raise RenderError(lost)
    # Restores what keeps hidden surfaces evaluated, should it have been deleted.
    sync_volume_object(camera)

    def read(depsgraph, set_frame) -> RenderInputs:
        return with_motion(depsgraph, camera, read_inputs(depsgraph, camera, size, pixel_error), set_frame)

    inputs = with_render_depsgraph(scene, view_layer, read, with_time=True)
    if not scene.render.use_multiview:
        return inputs
    warning = f"This is one view, that of '{camera.name}': press F12 with SCFPF for all views of the scene"
    return replace(inputs, scene=replace(inputs.scene, warnings=(*inputs.scene.warnings, warning)))


def read_inputs(
    depsgraph,
    camera,
    size: tuple[int, int],
    pixel_error: float | None = None,
    border: Border | None = None,
    passes: tuple[str, ...] = (),
    may_be_empty: bool = False,
    scene: Scene | None = None,
    aspect: float | None = None,
    stopped: Callable[[], bool] | None = None,
    eye: Eye = "",
) -> RenderInputs:
    """Read all that a picture of a depsgraph through a camera, flexible or not, needs.

    size: of the whole picture in pixels. pixel_error: overrides the camera's own. border:
    the part that is made. passes: names of ``shading.passes.PASSES``. may_be_empty: as in
    ``read_scene``. scene: read from the depsgraph before. aspect: of the picture as it is shown,
    by its size and the scene's pixel aspect if not given. stopped: as in ``read_scene``. eye: of a
    stereoscopic scene. Raises one of RENDER_ERRORS.
    """
    width, height = size
    render = depsgraph.scene_eval.render
    if aspect is None:
        aspect = shown_aspect(render, width, height)
    evaluated = camera.evaluated_get(depsgraph)
    options = evaluated.scfpf
    projection = read_view(camera, depsgraph, aspect, eye)
    plane = None if options.enabled else depth_plane(eye_place(evaluated, eye))
    lens, lens_warning = read_lens(evaluated, projection, depsgraph, eye)
    if scene is None:
        scene = with_images(
            read_scene(depsgraph, may_be_empty, "UV" in passes, stopped),
            projection,
            transparent=render.film_transparent,
        )
    others = lens_warning, unseen_settings(evaluated, eye), passes_of_clear_things(scene, passes)
    scene = replace(scene, warnings=(*scene.warnings, *filter(None, others)))
    marks = {}
    if any(name.startswith("CRYPTO") for name in passes):
        marks = {kind: identifiers(names) for kind, names in crypto_names(scene).items()}
    return RenderInputs(
        projection,
        scene,
        FrameSettings(
            width,
            height,
            samples=options.samples,
            pixel_error=options.pixel_error if pixel_error is None else pixel_error,
            transparent=render.film_transparent,
            threads=render.threads if render.threads_mode == "FIXED" else 0,
            border=border,
            passes=DataPasses(passes, plane, identifiers=marks),
            depth_of_field=lens,
            stylised=stylised_of(depsgraph.scene_eval, width),
            **sampling_of(depsgraph.scene_eval),
        ),
    )


def read_view(camera, depsgraph, aspect: float, eye: Eye = "") -> Projection:
    """The projection of a camera, flexible or not, or of one of its eyes. Raises one of RENDER_ERRORS."""
    evaluated = camera.evaluated_get(depsgraph)
    if evaluated.scfpf.enabled:
        projection = read_projection(camera, depsgraph, aspect)
    else:
        projection = frustum_projection(evaluated, depsgraph, aspect)
    return projection.transformed(seen_by(evaluated, eye)) if eye else projection


def with_motion(
    depsgraph, camera, inputs: RenderInputs, set_frame, stopped=lambda: False, eye: Eye = ""
) -> RenderInputs:
    """The inputs with what is seen while the shutter is open, if the scene has motion blur.

    inputs: as read of the depsgraph, the camera and the eye. set_frame: evaluates the depsgraph at another
    time. stopped(): whether the render is to be given up.
    """
    aspect = inputs.projection.aspect

    def view():
        projection = read_view(camera, depsgraph, aspect, eye)
        return projection, read_lens(camera.evaluated_get(depsgraph), projection, depsgraph, eye)[0]

    def everything():
        projection, lens = view()
        with_uv = inputs.scene.geometry.uv is not None
        there = read_scene(depsgraph, True, with_uv, stopped)
        there = with_images(there, projection, transparent=depsgraph.scene_eval.render.film_transparent)
        # Of the frame itself there is one warning more, and once is enough.
        return projection, replace(there, warnings=inputs.scene.warnings), lens

    scene, settings = depsgraph.scene_eval, inputs.settings
    if "VECTOR" in settings.passes.names and not stopped():
        frame = scene.frame_current + scene.frame_subframe
        neighbours = read_neighbours(frame, inputs.scene, set_frame, everything)
        settings = replace(settings, passes=replace(settings.passes, neighbours=neighbours))
    moments: tuple[Moment, ...] = ()
    if depsgraph.view_layer_eval.use_motion_blur:
        moments = read_moments(scene, settings.samples, inputs.scene, set_frame, everything, view, stopped)
    return replace(inputs, settings=settings, moments=moments)


class RenderJob:
    """One picture being made by a thread of its own. Start it with ``start``."""

    def __init__(
        self,
        inputs: RenderInputs,
        with_tiles: bool = False,
        kept: SceneCache | None = None,
        keep: bool = False,
    ):
        """with_tiles: ``new_tiles`` shows the frame in the making. kept, keep: see ``build``."""
        self._inputs: RenderInputs | None = inputs
        self.kept, self._keep = kept, keep
        self._building = True
        self._cancelled = threading.Event()
        self._progress = 0.0
        size = (inputs.settings.height, inputs.settings.width, 4)
        self._tiles = np.zeros(size, np.float32) if with_tiles else None
        self._has_new_tiles = threading.Event()
        self._frame: Frame | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="SCFPF render")

    def _run(self) -> None:
        try:
            # Let go of: what the volume cannot meet is freed once the rest is built.
            inputs, self._inputs = self._inputs, None
            built = build(inputs, self.kept, self._keep)
            inputs, self.kept, self._building = built.inputs, built.kept, False
            if self._tiles is not None:
                coarse = coarse_picture(inputs, built.cast_scene, self._cancelled.is_set)
                if coarse is not None:
                    self._tiles[:] = coarse
                    self._has_new_tiles.set()
            frame = render_frame(
                inputs.projection,
                inputs.scene,
                inputs.settings,
                built.cast_scene,
                progress=self._note_progress,
                cancelled=self._cancelled.is_set,
                on_tile=self._note_tile,
                moments=inputs.moments,
                pixels=self._tiles,
            )
            self._frame = frame and built.reported(frame)
        except BaseException as error:  # A thread has nowhere to raise: result() does it.
            self._error = error

    def _note_progress(self, fraction: float) -> None:
        self._progress = fraction

    def _note_tile(self, *_) -> None:
        self._has_new_tiles.set()

    def new_tiles(self) -> NDArray[np.float32] | None:
        """The picture so far, (H, W, 4) as in Frame, or None if nothing was added since the last call."""
        if self._tiles is None or not self._has_new_tiles.is_set():
            return None
        self._has_new_tiles.clear()
        return self._tiles

    def start(self) -> None:
        """Begin; returns at once. Raises RenderError if the system starts no thread."""
        try:
            self._thread.start()
        except RuntimeError as error:
            raise RenderError(NO_THREAD) from error

    @property
    def progress(self) -> float:
        """The share of the picture that is done, 0 to 1."""
        return self._progress

    @property
    def building(self) -> bool:
        """Whether it is building, and cannot be cancelled."""
        return self._building or is_uncancellable()

    @property
    def running(self) -> bool:
        """Whether the thread is still at work."""
        return self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """Whether ``cancel`` was called; the thread may still be finishing a tile."""
        return self._cancelled.is_set()

    def cancel(self) -> None:
        """Ask the thread to stop; returns at once."""
        self._cancelled.set()

    def wait(self) -> None:
        """Wait for the thread to end."""
        self._thread.join()

    def result(self) -> Frame | None:
        """Wait for the thread. The frame, or None if cancelled; raises what the thread raised."""
        self.wait()
        if self._error is not None:
            raise self._error
        return None if self.cancelled else self._frame


_current: RenderJob | None = None
# What the last job has built, with persistent data.
_kept: SceneCache | None = None


def start(inputs: RenderInputs, with_tiles: bool = False, keep: bool = False) -> RenderJob:
    """Start the one job that may run at a time. Raises RenderError while another runs.

    keep: what is built of the scene serves the next job too, if that keeps it and the scene is the same.
    """
    global _current
    if current() is not None:
        raise RenderError("A render is already running: wait for it, or press Esc to cancel it")
    job = RenderJob(inputs, with_tiles, _kept if keep else None, keep)
    job.start()
    _current = job
    return job


def current() -> RenderJob | None:
    """The job that is running, if any."""
    return _current if _current is not None and _current.running else None


def stop() -> None:
    """Cancel the job, if any, wait for its thread, and let go of its arrays."""
    global _current, _kept
    if _current is not None:
        _current.cancel()
        _current.wait()
        _kept = _current.kept
    _current = None


def forget() -> None:
    """As ``stop``, and let go of what was kept for the next picture, too."""
    global _kept
    stop()
    _kept = None
