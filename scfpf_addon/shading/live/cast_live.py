# SPDX-License-Identifier: GPL-3.0-or-later
"""Live images: the hits of one projector through the middle of each pixel, in bands of rows on all cores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from threading import Thread
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.cast import cast
from ...casting.common.cancellation import Signal, cancelled_by
from ...casting.common.hits import CastCounts, Hits
from ...casting.common.parallel import started, thread_count
from ...casting.layers.layer_parts import LayerParts
from ...casting.layers.layered_cast import LayeredCast
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ...projection.volume.folds import find_folds
from ...projection.volume.viewing_volume import Projection, Projectors
from ..typing import Single
from ..vectors import dot
from .live_hits import LiveHits
from .live_scene import LiveScene, LiveTables
from .view_axes import ViewAxes, neighbour_steps, view_axes

# The largest displacement of a silhouette by curved projectors, in pixels of the image that is made.
PIXEL_ERROR = 1.0
# Pixels in a band: fewer do not pay for the planning of their chords, more do not fit in a core's cache.
BAND_PIXELS = 1 << 16
# An image of fewer pixels is one band: others would wait for the interpreter.
FEWEST_PIXELS = 1 << 14

# Colours (H, W, 4) of hits, display-encoded sRGB, premultiplied; the number is that of pixels of the screen
# across a pixel of the image.
Paint = Callable[[LiveHits, float], Single]


class LiveWindow(NamedTuple):
    """The part of a camera's frame that an image shows, in shares of the frame, and the image's pixels.

    width, height: at least 2.
    """

    left: float
    bottom: float
    right: float
    top: float
    width: int
    height: int

    def coarser(self, step: float) -> LiveWindow:
        """The same part in pixels ``step`` times as wide and high."""
        size = (max(round(length / step), 2) for length in (self.width, self.height))
        return self._replace(**dict(zip(("width", "height"), size, strict=True)))

    @property
    def pixel_size(self) -> tuple[float, float]:
        """Width and height of a pixel in shares of the frame."""
        return (self.right - self.left) / self.width, (self.top - self.bottom) / self.height

    def centres(self, rows: slice) -> tuple[Array, Array]:
        """x and y of the middles of the pixels of whole rows, each (N,), in shares of the frame."""
        wide, high = self.pixel_size
        x = self.left + (np.arange(self.width) + 0.5) * wide
        y = self.bottom + (np.arange(rows.start, rows.stop) + 0.5) * high
        return np.tile(x, len(y)), np.repeat(y, self.width)


class Never:
    """A signal that cancels nothing."""

    def is_set(self) -> bool:
        """Return whether the work is cancelled."""
        return False


@dataclass(frozen=True)
class LiveProjection:
    """A projection in world space.

    is_mirrored: whether its image is that of a mirror outside of folds; mirrored: of each of its layers.
    members: (O,) the number of the layer of each object of the scene, for any further ones 0.
    """

    projection: Projection
    is_mirrored: bool
    mirrored: tuple[bool, ...] = ()
    members: NDArray[np.uint8] | None = None

    @classmethod
    def of(cls, projection: Projection, members: NDArray[np.uint8] | None = None) -> LiveProjection:
        """Find out the handedness of a projection and of its layers."""
        own, *layers = (find_folds(each).mirrored for each in projection.of_layers)
        return cls(projection, own, tuple(layers), members)

    def parts(self, scene: LiveScene, inside: Projection) -> LayerParts | None:
        """The parts of a scene in the layers, None without any. inside: the projection in cast space."""
        if self.members is None or not inside.layers or scene.cast_scene is None or scene.tables is None:
            return None
        numbers = np.zeros(max(int(scene.tables.object.max(initial=0)) + 1, len(self.members)), np.uint8)
        numbers[: len(self.members)] = self.members
        return LayerParts.of(numbers.take(scene.tables.object), scene.cast_scene, inside.layers)


def live_image(
    scene: LiveScene,
    view: LiveProjection,
    window: LiveWindow,
    paint: Paint,
    step: float = 1.0,
    signal: Signal | None = None,
    threads: int = 0,
) -> Single:
    """Make the image of a window, (H, W, 4) float32 from the bottom, display-encoded and premultiplied.

    window: in pixels of the screen. step: the number of these across a pixel of the image. signal: raises
    Cancelled when it is set. threads: 0 for all cores. Raises CastError.
    """
    return paint(cast_live(scene, view, window.coarser(step), signal, threads), step)


def cast_live(
    scene: LiveScene, view: LiveProjection, window: LiveWindow, signal: Signal | None = None, threads: int = 0
) -> LiveHits:
    """Cast a projector through the middle of each pixel of a window.

    signal: raises Cancelled when it is set. threads: 0 for all cores. Raises CastError.
    """
    hits = _empty(scene.tables, window)
    count = thread_count(threads)
    if window.width * window.height < FEWEST_PIXELS:
        count = 1
    bands = max(count, -(-window.width * window.height // BAND_PIXELS))
    bands = min(-(-bands // count) * count, window.height // 2)
    edges = [window.height * k // bands for k in range(bands + 1)]
    inside = view.projection
    if scene.cast_scene is not None:
        inside = inside.transformed(scene.cast_scene.matrix)

    parts = view.parts(scene, inside)

    def fill(rows: slice) -> None:
        """Cast the projectors of a band of rows."""
        with cancelled_by(signal or Never()):
            if parts is None:
                seen = _seen(scene.cast_scene, inside, view.is_mirrored, window, rows)
            else:
                seen = _seen_in_layers(parts, inside, view, window, rows)
            _fill_band(scene, *seen, slice(rows.start * window.width, rows.stop * window.width), hits)

    _do_all(fill, [slice(*ends) for ends in pairwise(edges)], count)
    return hits


def _do_all(work: Callable[[slice], None], parts: list[slice], count: int) -> None:
    """Do the work of all parts in ``count`` threads, one of which is the caller's; raise its exceptions."""
    left, errors = list(reversed(parts)), list[BaseException]()

    def work_off() -> None:
        """Take parts until all are taken or one has failed."""
        while left and not errors:
            try:
                some = left.pop()
            except IndexError:  # another thread took the last one
                return
            try:
                work(some)
            except BaseException as error:  # A thread has nowhere to raise.
                errors.append(error)

    others: list[Thread] = started(work_off, min(count, len(parts)) - 1)
    work_off()
    for thread in others:
        thread.join()
    if errors:
        raise errors[0]


def _empty(tables: LiveTables | None, window: LiveWindow) -> LiveHits:
    """Hits to be filled in, with the attributes that the tables have."""
    count = window.width * window.height
    places = [np.empty((3, count), np.float32) for _ in range(5)]
    return LiveHits(
        width=window.width,
        height=window.height,
        mask=np.empty(count, bool),
        look=np.empty(count, np.int32),
        object=np.empty(count, np.int32),
        t=np.empty(count, np.float32),
        position=places[0],
        forward=places[1],
        right=places[2],
        up=places[3],
        is_mirrored=np.empty(count, bool),
        normal=places[4],
        uv=None if tables is None or tables.uv is None else np.empty((2, count), np.float32),
        color=None if tables is None or tables.color is None else np.empty((3, count), np.float32),
    )


@dataclass(frozen=True)
class _Noted(Projection):
    """A projection that notes the projectors that casting asks for: axes need them, too."""

    noted: list[Projectors] = field(default_factory=list)

    def projectors(self, x: Array, y: Array) -> Projectors:
        found = super().projectors(x, y)
        self.noted.append(found)
        return found


def _seen(
    cast_scene: CastScene | None, projection: Projection, is_mirrored: bool, window: LiveWindow, rows: slice
) -> tuple[Hits, ViewAxes]:
    """The hits of the projectors of whole rows, and their axes. projection: in cast space."""
    x, y = window.centres(rows)
    noting = _Noted(**{name: getattr(projection, name) for name in Projection.__dataclass_fields__})
    if cast_scene is None:
        points, mask = noting.projectors(x, y)
        hits = _misses(projection, points, mask)
    else:
        hits = cast(cast_scene, noting, x, y, window.pixel_size, PIXEL_ERROR, None, window.width)
        points = noting.noted[0].points
    steps = neighbour_steps(points, hits.mask, window.width)
    where = np.where(hits.triangle >= 0, hits.t, 1.0)
    return hits, view_axes(projection.volume.spans, steps, where, hits.tangent, is_mirrored)


def _seen_in_layers(
    parts: LayerParts, projection: Projection, view: LiveProjection, window: LiveWindow, rows: slice
) -> tuple[Hits, ViewAxes]:
    """The hits in front of all that the projection and its layers see, and the axes of their projectors."""
    hits, axes = _seen(parts.rest, projection, view.is_mirrored, window, rows)
    layered = LayeredCast(
        parts=parts, projection=projection, pixel_size=window.pixel_size, pixel_error=PIXEL_ERROR
    )
    nearest = layered.keys(0, hits)
    hits = hits._replace(mask=hits.mask.copy())
    x, y = window.centres(rows)
    for number, layer in enumerate(projection.layers, 1):
        which = np.flatnonzero(layered.may_meet(number, x, y))
        found = layered.hits_of(number, which, x, y, CastCounts())
        key = layered.keys(number, found)
        better = np.flatnonzero(key < nearest[which])
        won = which[better]
        if not len(won):
            continue
        hits.put(won, found.take(better))
        nearest[won] = key[better]
        # Axes need the neighbours in whole rows.
        points, mask = layer.projection.projectors(x, y)
        steps = tuple(step.take(won, 2) for step in neighbour_steps(points, mask, window.width))
        spans, mirrored = layer.projection.volume.spans, view.mirrored[number - 1]
        own = view_axes(spans, (steps[0], steps[1]), hits.t[won], hits.tangent[:, won], mirrored)
        for into, values in zip(axes, own, strict=True):
            into[..., won] = values
    return hits, axes


def _fill_band(scene: LiveScene, hits: Hits, axes: ViewAxes, own: slice, into: LiveHits) -> None:
    """Write the hits of a band."""
    is_hit = hits.triangle >= 0
    into.mask[own], into.is_mirrored[own] = hits.mask, axes.is_mirrored
    into.t[own] = hits.t
    into.forward[:, own], into.right[:, own], into.up[:, own] = axes.forward, axes.right, axes.up
    which = np.flatnonzero(is_hit)
    if scene.cast_scene is None or scene.tables is None or len(which) == 0:
        into.look[own] = into.object[own] = -1
        into.position[:, own] = into.normal[:, own] = 0.0
        for values in (into.uv, into.color):
            if values is not None:
                values[:, own] = 0.0
        return
    _write_surface(scene, hits, axes, own, into)


def _misses(projection: Projection, points: Array, mask: np.ndarray) -> Hits:
    """The hits of projectors in a scene of nothing."""
    count = points.shape[2]
    weights = projection.volume.spans.weights(np.ones(count))[1]
    return Hits.empty(count)._replace(mask=mask, tangent=np.einsum("kn,kcn->cn", weights, points))


def _write_surface(scene: LiveScene, hits: Hits, axes: ViewAxes, own: slice, into: LiveHits) -> None:
    """Write place, normal and attributes of the hits, 0 for misses."""
    cast_scene, tables, triangle = scene.cast_scene, scene.tables, hits.triangle
    if cast_scene is None or tables is None:
        return
    is_hit = triangle >= 0
    # A miss gets the values of the last triangle, which are overwritten.
    into.look[own] = np.where(is_hit, tables.look.take(triangle, mode="wrap"), -1)
    into.object[own] = np.where(is_hit, tables.object.take(triangle, mode="wrap"), -1)
    position = hits.position * (1.0 / cast_scene.scale)
    position += cast_scene.centre[:, None]
    into.position[:, own] = position
    normal = _normals(scene, triangle, hits.barycentric, axes.forward)
    into.normal[:, own] = normal
    shares = _shares(hits.barycentric)
    for values, table in ((into.uv, tables.uv), (into.color, tables.color)):
        if values is not None and table is not None:
            values[:, own] = np.einsum("kn,nkc->cn", shares, table.take(triangle, axis=0, mode="wrap"))
    if not is_hit.all():
        missed = own.start + np.flatnonzero(~is_hit)
        for values in (into.position, into.normal, into.uv, into.color):
            if values is not None:
                values[:, missed] = 0.0


def _shares(barycentric: Array) -> Single:
    """The weights of all three corners, (3, N)."""
    second, third = barycentric.astype(np.float32)
    return np.stack([1.0 - second - third, second, third])


def _normals(scene: LiveScene, triangle: IndexArray, barycentric: Array, forward: Single) -> Single:
    """Unit shading normals (3, N) on the side of the viewer."""
    assert scene.cast_scene is not None and scene.tables is not None
    flat = scene.cast_scene.planes[:3].take(triangle, 1, mode="wrap").astype(np.float32)
    side = np.where(dot(flat, forward) > 0.0, np.float32(-1), np.float32(1))
    table = scene.tables.normals
    if table is None:
        return flat * side
    normal: Single = np.einsum(
        "kn,nkc->cn", _shares(barycentric), table.take(triangle, axis=0, mode="wrap"), optimize=False
    )
    # Shading normals may be on either side of their triangle, which the artist may have turned round.
    side *= np.where(dot(normal, flat) < 0.0, np.float32(-1), np.float32(1))
    length = np.sqrt(dot(normal, normal))
    normal *= side / np.where(length > 0.0, length, np.float32(1))
    return normal
