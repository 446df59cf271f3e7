# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View of one viewport: its scene, its camera and its look read into a request for images."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter
from weakref import WeakValueDictionary

import bpy

from ...shading.live.cast_live import LiveProjection, LiveWindow, live_image
from ...shading.live.solid_look import SolidLook, paint
from ...shading.typing import Single
from ..camera.stereo_views import Eye
from ..layers.read_image_layers import read_image_layers
from ..render.image_size import shown_aspect
from ..render.render_inputs import read_view
from ..render.view_painter import Rectangle
from .kept_scene import KeptScene
from .live_objects import Attributes, LiveObjects, Placements
from .live_painter import LivePainter, Request
from .read_look import LookReader, wanted_attributes

# Smallest width and height of an image.
SMALLEST = 2


class LiveSource:
    """The scene of one view layer, which viewports share unless they show other objects.

    edits: how often anything has changed that an image may depend on.
    """

    def __init__(self) -> None:
        self.objects, self.kept, self.edits = LiveObjects(), KeptScene(), 0
        self.looks = LookReader()
        # Those that any viewport has wanted: two that share a scene must not read it by turns.
        self.attributes = Attributes(False, False)

    def mark_edited(self, names: set[str] | None = None, moved: bool = True) -> None:
        """Note an edit. names: of the objects whose shape has changed, None for all.

        moved: whether objects may have changed that images show.
        """
        self.edits += 1
        if moved:
            self.objects.mark(names)


# By session id of the scene, name of the view layer, and the address of a viewport that shows other objects.
_sources: WeakValueDictionary[tuple[int, str, int], LiveSource] = WeakValueDictionary()


def sources() -> list[LiveSource]:
    """The sources of all live viewports."""
    return list(_sources.values())


def source_of(depsgraph, space=None) -> LiveSource:
    """The source of a viewport. space: bpy.types.SpaceView3D, or None for all objects of a view layer."""
    is_local = space is not None and (space.local_view is not None or space.use_local_collections)
    scene = depsgraph.scene.original
    key = scene.session_uid, depsgraph.view_layer.name, space.as_pointer() if is_local else 0
    source = _sources.get(key)
    if source is None:
        source = _sources[key] = LiveSource()
    return source


class LiveView:
    """The live images of one viewport. It keeps arrays and numbers, no Blender data."""

    def __init__(self) -> None:
        self.painter = LivePainter()
        self.source: LiveSource | None = None
        self._key: tuple = ()
        # The number of requests, and when those were made that no image answers yet.
        self._asked = 0
        self._times: dict[int, float] = {}

    @property
    def seconds_behind(self) -> float:
        """The seconds since the image was the scene's; 0 if it is, or if there is none."""
        image = self.painter.image
        if image is None:
            return 0.0
        self._times = {number: time for number, time in self._times.items() if number > image.number}
        return perf_counter() - min(self._times.values()) if self._times else 0.0

    def request(
        self,
        depsgraph,
        camera,
        frame: Rectangle,
        window: LiveWindow,
        rectangle: Rectangle,
        space=None,
        eye: Eye = "",
    ) -> bool:
        """Ask for images if anything has changed; return whether that was so.

        frame: the camera's in the viewport. window: the part of it to show, which is drawn in ``rectangle``.
        Raises USER_ERRORS.
        """
        source = self.source = source_of(depsgraph, space)
        placements, look = read_scene(source, depsgraph, camera, frame.width, space, rectangle)
        key = source, source.edits, camera.original.session_uid, frame, window, rectangle, eye, look.key
        if key == self._key:
            return False
        self._key = ()
        aspect = frame.width / frame.height
        made = _request(source, depsgraph, camera, aspect, window, rectangle, eye, placements, look)
        self._asked += 1
        self._times[self._asked] = perf_counter()
        self.painter.ask(made._replace(number=self._asked))
        self._key = key
        return True

    def refresh(self, depsgraph, camera, size: tuple[int, int], step: float = 1.0) -> Single:
        """Make an image of a camera at once, (H, W, 4), without a viewport.

        size: of the viewport's frame in pixels. step: pixels of the frame across one of the image. Raises one
        of USER_ERRORS.
        """
        source = self.source = source_of(depsgraph)
        aspect = shown_aspect(depsgraph.scene_eval.render, *size)
        whole = Rectangle(0.0, 0.0, *map(float, size))
        placements, look = read_scene(source, depsgraph, camera, whole.width)
        window = LiveWindow(0.0, 0.0, 1.0, 1.0, *size)
        request = _request(source, depsgraph, camera, aspect, window, whole, "", placements, look)
        scene = source.kept.updated(request.placements)
        return live_image(
            scene, LiveProjection.of(request.projection, request.members), window, request.paint, step
        )


def _request(source, depsgraph, camera, aspect, window, rectangle, eye, placements, look) -> Request:
    layers = read_image_layers(camera.original, depsgraph, aspect, eye)
    return Request(
        members=source.objects.table.layers(layers.members) if layers.layers else None,
        kept=source.kept,
        placements=placements,
        projection=replace(read_view(depsgraph, camera.original, aspect, eye), layers=layers.layers),
        window=window,
        rectangle=rectangle,
        paint=lambda hits, step: paint(hits, look, step),
        paint_key=look.key,
    )


def read_scene(
    source: LiveSource, depsgraph, camera, width: float, space=None, rectangle: Rectangle | None = None
) -> tuple[Placements, SolidLook]:
    """Read the objects of a viewport, if they have changed, and its look.

    width: of the camera's frame, pixels. space: bpy.types.SpaceView3D, or None for the look of the scene's
    Workbench renders. rectangle: of the
    image in the region that is drawn. Raises UserError.
    """
    shading, overlay, area = depsgraph.scene.display.shading, None, (0.0, 0.0, 1.0, 1.0)
    if space is not None:
        shading, overlay = space.shading, space.overlay
    region = bpy.context.region
    if rectangle is not None and region is not None:
        left, bottom, width, height = rectangle
        across, upward = (left, left + width), (bottom, bottom + height)
        (x, right), (y, top) = (v / region.width for v in across), (v / region.height for v in upward)
        area = x, y, right, top
    wanted = wanted_attributes(shading)
    source.attributes = Attributes(*(a or b for a, b in zip(wanted, source.attributes, strict=True)))
    placements = source.objects.read(depsgraph, space, source.attributes)
    shown = camera.evaluated_get(depsgraph)
    return placements, source.looks.read(source.objects, shading, overlay, depsgraph, shown, area, width)


def shown_window(frame: Rectangle, region) -> tuple[LiveWindow, Rectangle] | None:
    """The part of a camera's frame that a region shows, and where; None if it shows none.

    Its pixels are those of the region whose middles are in the frame.
    """
    sides = []
    for start, length, size in (
        (frame.left, frame.width, region.width),
        (frame.bottom, frame.height, region.height),
    ):
        first, last = max(math.ceil(start - 0.5), 0), min(math.floor(start + length + 0.5), size)
        if last - first < SMALLEST:
            return None
        sides.append((first, last, (first - start) / length, (last - start) / length))
    (left, right, *across), (bottom, top, *up) = sides
    window = LiveWindow(across[0], up[0], across[1], up[1], right - left, top - bottom)
    return window, Rectangle(left, bottom, right - left, top - bottom)
