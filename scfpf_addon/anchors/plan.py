# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of an image's anchors: few cameras that together see what it shows.

If all projectors come from one point, anchors stand there: one that looks as the image does, or the faces of
a cube. Otherwise they are chosen one after the other by what each adds for its pixels, as in the greedy
algorithm for set covers (Chvátal 1979). Candidates are the pinholes nearest to the projectors of parts of the
image, parallel cameras, and cameras near to what these parts show.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..casting.common.cancellation import raise_if_cancelled
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection
from .anchor import Anchor, Window
from .seen_scene import SeenScene
from .shown_points import ShownPoints, joined_points, shown_points

# An anchor's pixels along a side of the image's pixel, at least and at most, and as a share of its hits'.
FEWEST_TEXELS, MOST_TEXELS, TEXELS_OF_A_HIT = 1.5, 3.0, 0.75
# Image positions along the longer side that the first round looks at, and those of the second one.
COLUMNS, MORE_COLUMNS = 64, 160
# The first and last positions are so far inside the image.
EDGE = 1e-6
# Projectors that pass a point within this share of their distance come from it.
ONE_EYE = 1e-3
# The half of the widest field of view that one anchor serves, as a tangent: 100°.
WIDEST = float(np.tan(np.radians(50.0)))
# A face of the cube reaches this far beyond its edges, as a factor: neighbours share what fades.
FACE = 1.06
# Rows of nearly square parts of the image, and numbers of strips across or up it; they overlap by half.
ROWS, STRIPS = (1, 2, 3, 4, 6), (2, 4, 8, 12)
# A part with fewer points makes no candidate.
FEWEST = 4
# Near cameras stand so many radii of a part's points away.
NEAR = (2.0, 4.0)
# The share of a part's points whose wish for pixels its anchor meets.
WISHES = 0.1
# Points that would have pixels larger than this, as a share of the image's, are not seen well enough.
COARSEST = 1.25
# The least cosine between an anchor's ray and a normal, and as a share of the projector's own.
LEAST_COSINE, SHARE_OF_COSINE = 0.05, 0.4
# An anchor costs as much as this share of the image with pixels of anchors' size, besides its own pixels.
FIXED_COST = 0.67
# An anchor that adds less than this share of the points is not worth a render.
LEAST_GAIN = 2e-4
# An anchor of frames before that adds less than this share of the points is not rendered on.
LEAST_KEPT = 5e-3
# The window of an anchor is wider than the points looked at by so many of its pixels and by this share of it
# on each side, for what lies between and beside them; things are rendered from this share before the nearest.
MARGIN, GROWN, BEFORE = 3.0, 0.04, 0.01
# What lies farther than this multiple of the farthest point is not rendered.
BEYOND = 4.0
# Nothing is rendered that is nearer than this share of the nearest point.
NEAREST = 0.02
MOST_SIDE = 8192


@dataclass(frozen=True)
class PlanLimits:
    """The limits that a plan of anchors keeps.

    texels: an anchor's pixels along a side of the image's pixel. finer: how many times as many near anchors
    have. most: the number of anchors. pixels: those of all anchors, as a multiple of the image with pixels by
    ``texels``: they are kept until they are joined. largest: those of one. coverage: the share of points
    after which no further one is added.
    """

    texels: float = FEWEST_TEXELS
    finer: float = 1.0
    most: int = 96
    pixels: float = 14.0
    largest: float = 1.8
    coverage: float = 0.9995

    @classmethod
    def of_samples(cls, samples: int) -> PlanLimits:
        """The limits for an image with so many hits a pixel.

        Finer pixels than these hits are apart would not be seen, coarser ones blur and fray what is drawn on
        surfaces.
        """
        return cls(texels=float(np.clip(TEXELS_OF_A_HIT * np.sqrt(samples), FEWEST_TEXELS, MOST_TEXELS)))


@dataclass(frozen=True)
class AnchorPlan:
    """The anchors of an image.

    covered: the share of the points looked at that an anchor sees. pixels: those of all anchors, as a
    multiple of the image's. is_one_eye: whether all projectors come from one point.
    """

    anchors: tuple[Anchor, ...]
    covered: float
    pixels: float
    is_one_eye: bool


# The matrix of a camera, and whether its rays are parallel; with the numbers of points that it is made for.
Camera = tuple[Array, bool]
CameraOfPart = tuple[IndexArray, Camera]


@dataclass(eq=False)
class _Candidate:
    """An anchor that may be chosen. sees: (N,), the points that it serves; of those, the ones that nothing
    hides once ``is_checked``."""

    anchor: Anchor
    sees: BoolArray
    is_checked: bool = False


def plan_anchors(
    scenes: Sequence[SeenScene],
    projections: Sequence[Projection],
    size: tuple[int, int],
    axes: Array,
    limits: PlanLimits | None = None,
    kept: Sequence[Anchor] = (),
    things_only: bool = False,
) -> AnchorPlan:
    """Plan the anchors of an image, or of some frames of a shot.

    scenes: of each frame. projections: of each, in world space. size: of the image in pixels. axes: (3, 3),
    right, up and back of its camera. kept: anchors of other frames, of which those are taken that serve.
    things_only: whether the sky is not looked at, as in a layer.
    Raises CastError and Cancelled.
    """
    limits = limits or PlanLimits()
    points = _looked_at(scenes, projections, size, COLUMNS)
    if things_only:
        points = points.take(np.flatnonzero(points.is_hit))
    if not len(points.number):
        return AnchorPlan((), 1.0, 0.0, False)
    eye = common_eye(points)
    if eye is not None:
        anchors = _from_one_eye(points, eye, axes, size, limits)
        return _plan(scenes, anchors, points, size, limits, True)
    points = points.take(np.flatnonzero(points.is_hit))
    cover = Cover(scenes, size, limits)
    anchors = cover.extended(cover.serving(kept, points), points)
    more = _looked_at(scenes, projections, size, MORE_COLUMNS)
    more = more.take(np.flatnonzero(more.is_hit))
    anchors = cover.extended(anchors, more)
    return _plan(scenes, anchors, more, size, limits, False)


def have_one_eye(
    scenes: Sequence[SeenScene], projections: Sequence[Projection], size: tuple[int, int]
) -> bool:
    """Return whether all projectors of each frame come from one point."""
    looked = zip(scenes, projections, strict=True)
    return all(common_eye(_looked_at([scene], [each], size, COLUMNS)) is not None for scene, each in looked)


def sky_anchors(
    scene: SeenScene, projection: Projection, size: tuple[int, int], axes: Array, limits: PlanLimits
) -> list[Anchor]:
    """Anchors of the world alone, in the middle of a scene, for what projectors see that meet nothing."""
    points = sky_points(scene, projection, size)
    if not len(points.number):
        return []
    return _from_one_eye(at_infinity(points, scene.scene.centre), scene.scene.centre, axes, size, limits)


def sky_points(scene: SeenScene, projection: Projection, size: tuple[int, int]) -> ShownPoints:
    """Return the points whose projectors meet no thing, of a grid over the image."""
    points = _looked_at([scene], [projection], size, COLUMNS)
    return points.take(np.flatnonzero(~points.is_hit))


def at_infinity(points: ShownPoints, eye: Array) -> ShownPoints:
    """Points that an eye (3,) sees in the directions in which their projectors leave, all at distance 1."""
    length = points.length / np.maximum(np.linalg.norm(points.position - points.begin, axis=0), 1e-300)
    place = eye[:, None] + points.direction
    return points._replace(position=place, begin=place, length=length)


def _plan(
    scenes: Sequence[SeenScene],
    anchors: Sequence[Anchor],
    points: ShownPoints,
    size: tuple[int, int],
    limits: PlanLimits,
    is_one_eye: bool,
) -> AnchorPlan:
    points = points.take(np.flatnonzero(points.is_hit))
    seen = np.zeros(len(points.number), bool)
    for anchor in anchors:
        seen |= _unhidden(scenes, anchor, points, serves(anchor, points, limits))
    pixels = sum(anchor.count for anchor in anchors) / (size[0] * size[1])
    return AnchorPlan(tuple(anchors), float(seen.mean()) if len(seen) else 1.0, pixels, is_one_eye)


def _looked_at(
    scenes: Sequence[SeenScene], projections: Sequence[Projection], size: tuple[int, int], columns: int
) -> ShownPoints:
    """The points that images show at positions of a grid. number: of the position in the grid."""
    longer = max(size)
    # The borders too, a little inside: rounding decides there.
    sides = (np.linspace(EDGE, 1.0 - EDGE, max(3, round(columns * side / longer))) for side in size)
    x, y = (grid.ravel() for grid in np.meshgrid(*sides))
    pixel_size = 1.0 / size[0], 1.0 / size[1]
    found = []
    for frame, (scene, projection) in enumerate(zip(scenes, projections, strict=True)):
        raise_if_cancelled()
        points = shown_points(scene, projection, x, y, pixel_size)
        found.append(points._replace(frame=points.frame + frame))
    return joined_points(found)


def common_eye(points: ShownPoints) -> Array | None:
    """The point (3,) from which all projectors come, or None."""
    eye = nearest_to_lines(points.position, points.direction)
    if eye is None:
        return None
    way = points.position - eye[:, None]
    along = np.einsum("cn,cn->n", way, points.direction)
    off = np.linalg.norm(way - points.direction * along, axis=0)
    return eye if (along > 0.0).all() and (off <= ONE_EYE * along).all() else None


def nearest_to_lines(position: Array, direction: Array) -> Array | None:
    """The point (3,) with the least squares of distances to lines (3, N); None if they are parallel."""
    outer = np.einsum("an,bn->ab", direction, direction)
    normal = direction.shape[1] * np.eye(3) - outer
    values, vectors = np.linalg.eigh(normal)
    if values[0] <= 1e-9 * max(values[2], 1e-300):
        return None
    along = np.einsum("cn,cn->n", position, direction)
    right = (position - direction * along).sum(axis=1)
    point: Array = vectors @ ((vectors.T @ right) / values)
    return point


def _from_one_eye(
    points: ShownPoints, eye: Array, axes: Array, size: tuple[int, int], limits: PlanLimits
) -> list[Anchor]:
    """One anchor that looks along the camera, or those faces of a cube around the eye that show anything."""
    turned = axes.T @ (points.position - eye[:, None])
    ahead = -turned[2]
    if (ahead > 0.0).all():
        reach = np.abs(turned[:2] / ahead).max()
        if reach <= WIDEST:
            one = _facing(axes, eye, points, size, limits)
            return [] if one is None else [one]
    right, up, back = axes.T
    faces = [(right, up, back), (-back, up, right), (back, up, -right), (-right, up, -back)]
    faces += [(right, back, -up), (right, -back, up)]
    anchors = []
    for face in faces:
        matrix = np.stack(face, axis=1)
        turned = matrix.T @ (points.position - eye[:, None])
        depth = -turned[2]
        # Those that no other face is nearer to, and their neighbours.
        within = (depth > 0.0) & (np.abs(turned[:2]).max(axis=0) <= FACE * depth)
        if (within & (np.abs(turned[:2]).max(axis=0) <= depth)).any():
            anchors.append(_facing(matrix, eye, points.take(np.flatnonzero(within)), size, limits))
    return [anchor for anchor in anchors if anchor is not None]


def _facing(
    axes: Array, eye: Array, points: ShownPoints, size: tuple[int, int], limits: PlanLimits
) -> Anchor | None:
    """The anchor at an eye, with the axes (3, 3), for points (N,) that are all before it.

    None for points whose pixels have no size, as those of a volume that is a single projector.
    """
    anchor = _framed(camera_matrix(axes, eye), points, size, limits, False)
    if anchor is None:
        return None
    # Between the points there may be things as near as projectors begin.
    first = float((axes[:, 2] @ (eye[:, None] - points.begin)).min())
    return replace(anchor, start=max(first * (1.0 - BEFORE), NEAREST * anchor.start))


def camera_matrix(axes: Array, place: Array) -> Array:
    """The matrix (4, 4) of a camera at a place (3,), with its axes (3, 3)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, place
    return matrix


def _framed(
    matrix: Array,
    points: ShownPoints,
    size: tuple[int, int],
    limits: PlanLimits,
    is_parallel: bool,
    least: float = -np.inf,
) -> Anchor | None:
    """The anchor at a place whose window holds points (N,), with pixels for most; None for an endless one.

    least: the distance along the axis before which nothing is to be rendered.
    """
    turned = matrix[:3, :3].T @ (points.position - matrix[:3, 3:])
    depth = -turned[2]
    scale = 1.0 if is_parallel else depth
    low, high = ((turned[:2] / scale).min(axis=1), (turned[:2] / scale).max(axis=1))
    low, high = low - GROWN * (high - low), high + GROWN * (high - low)
    wished = points.length / scale / (limits.texels * limits.finer)
    wished = wished[wished > 0.0]
    if not len(wished):
        return None
    texel = float(np.quantile(wished, WISHES))
    texel = max(texel, float((high - low).max()) / (MOST_SIDE - 2.0 * MARGIN))
    # Pixels are square, and whole ones.
    count = np.maximum(np.ceil((high - low) / texel + 2.0 * MARGIN), 2.0)
    middle, half = 0.5 * (low + high), 0.5 * count * texel
    window = Window(*(middle - half), *(middle + half))
    nearest, farthest = float(depth.min()), float(depth.max())
    start = nearest - BEFORE * (abs(nearest) if not is_parallel else farthest - nearest + texel)
    start = max(start, least)
    end = start + BEYOND * (farthest - start)
    if is_parallel:
        # The camera stands a little before what it shows.
        ahead = start - texel
        matrix = camera_matrix(matrix[:3, :3], matrix[:3, 3] - ahead * matrix[:3, 2])
        start, end = texel, end - ahead
    across, up = count.astype(int).tolist()
    return Anchor(matrix, window, (across, up), start, end, is_parallel)


def serves(anchor: Anchor, points: ShownPoints, limits: PlanLimits) -> BoolArray:
    """Return which points an anchor serves if nothing hides them, (N,): by angle, side and pixels."""
    places = anchor.places(points.position)
    seen = anchor.holds(places)
    seen &= anchor.lengths(places.depth) <= COARSEST * points.length
    ray = anchor.directions(points.position)
    seen &= np.einsum("cn,cn->n", ray, points.direction) >= np.cos(points.angle)
    own = -np.einsum("cn,cn->n", points.normal, points.direction)
    least = np.maximum(SHARE_OF_COSINE * own, LEAST_COSINE)
    # What projectors graze is seen as well as they see it.
    seen &= -np.einsum("cn,cn->n", points.normal, ray) >= np.minimum(least, own)
    return seen


def _unhidden(scenes: Sequence[SeenScene], anchor: Anchor, points: ShownPoints, sees: BoolArray) -> BoolArray:
    """Return which of the points that an anchor serves, (N,), it sees, (N,)."""
    seen = np.zeros(len(sees), bool)
    for frame, each in enumerate(scenes):
        which, scene = np.flatnonzero(sees & (points.frame == frame)), each.scene
        if not len(which):
            continue
        # Faces that are seen from one side may hide a point or not: the look-up knows.
        if (hiding := each.two_sided) is None:
            seen[which] = True
            continue
        position = points.position.take(which, 1)
        depth = anchor.places(position).depth
        back = -anchor.directions(position)
        cosine = 1.0 if anchor.is_parallel else -(anchor.matrix[:3, 2] @ -back)
        distance = (depth - anchor.start) / np.maximum(cosine, 1e-6)
        inside = (position - scene.centre[:, None]) * scene.scale
        origin = scene.offset_origins(inside, points.triangle.take(which), back)
        seen[which] = ~hiding.occluded(origin, back, distance * scene.scale)
    return seen


class Cover:
    """The greedy choice of anchors. scenes: of each frame of the points. size: of the image in pixels."""

    def __init__(self, scenes: Sequence[SeenScene], size: tuple[int, int], limits: PlanLimits) -> None:
        self._scenes, self._size, self._limits = scenes, size, limits
        # The image in pixels of the anchors' size: costs and limits are shares of it.
        self._whole_image = size[0] * size[1] * limits.texels**2
        self._whole = np.concatenate([scene.whole for scene in scenes])

    def serving(self, anchors: Sequence[Anchor], points: ShownPoints) -> list[Anchor]:
        """The anchors that add enough to each other for points (N,) to be rendered on."""
        left = np.ones(len(points.number), bool)
        waiting = [(anchor, self._sees(anchor, points)) for anchor in anchors]
        chosen: list[Anchor] = []
        while waiting:
            gains = [np.count_nonzero(sees & left) for _, sees in waiting]
            best = int(np.argmax(gains))
            if gains[best] < LEAST_KEPT * len(left):
                break
            anchor, sees = waiting.pop(best)
            chosen.append(anchor)
            left &= ~sees
        return chosen

    def _sees(self, anchor: Anchor, points: ShownPoints) -> BoolArray:
        """Return which points an anchor serves and sees, (N,)."""
        return _unhidden(self._scenes, anchor, points, serves(anchor, points, self._limits))

    def extended(self, anchors: Sequence[Anchor], points: ShownPoints) -> list[Anchor]:
        """The anchors, and further ones for points (N,) that none of them sees."""
        count = len(points.number)
        left = np.ones(count, bool)
        for anchor in anchors:
            left &= ~self._sees(anchor, points)
        points = points.take(np.flatnonzero(left))
        cameras = (
            (part, camera) for part in _parts(points, self._size) for camera in _cameras(points.take(part))
        )
        enough = (1.0 - self._limits.coverage) * count
        return self.chosen(anchors, points, cameras, enough, max(LEAST_GAIN * count, 1.0))

    def chosen(
        self,
        anchors: Sequence[Anchor],
        points: ShownPoints,
        cameras: Iterable[CameraOfPart],
        enough: float,
        least: float,
    ) -> list[Anchor]:
        """The anchors, and further ones of the cameras for points (N,).

        enough: the number of points that may be left. least: the number of them that an anchor must add.
        """
        chosen = list(anchors)
        candidates = list(self._candidates(points, cameras))
        left = np.ones(len(points.number), bool)
        while candidates and len(chosen) < self._limits.most and left.sum() > enough:
            raise_if_cancelled()
            best = self._best(candidates, left, points)
            gain = best.sees & left
            if gain.sum() < least:
                break
            candidates.remove(best)
            made = sum(anchor.count for anchor in chosen)
            if made + best.anchor.count > self._limits.pixels * self._whole_image:
                continue
            trimmed = self._trimmed(best, points, gain)
            chosen.append(trimmed)
            left &= ~(self._sees(trimmed, points) | gain)
        return chosen

    def _best(self, candidates: list[_Candidate], left: BoolArray, points: ShownPoints) -> _Candidate:
        """The candidate that adds most for its cost. What hides points is looked up for those in front."""
        costs = np.array([FIXED_COST + c.anchor.count / self._whole_image for c in candidates])
        gains = np.array([np.count_nonzero(c.sees & left) for c in candidates]) / costs
        while True:
            first = int(gains.argmax())
            best = candidates[first]
            if best.is_checked:
                return best
            best.sees = _unhidden(self._scenes, best.anchor, points, best.sees)
            best.is_checked = True
            gains[first] = np.count_nonzero(best.sees & left) / costs[first]

    def _framed(
        self, matrix: Array, points: ShownPoints, is_parallel: bool, least: float = -np.inf
    ) -> Anchor | None:
        """The anchor at a place for points (N,); None for an endless one. least: see ``_framed``."""
        anchor = _framed(matrix, points, self._size, self._limits, is_parallel, least)
        if anchor is not None and len(self._whole):
            anchor = anchor.before(self._whole)
        return anchor

    def _trimmed(self, best: _Candidate, points: ShownPoints, gain: BoolArray) -> Anchor:
        """The anchor with a window around what it adds."""
        own = points.take(np.flatnonzero(gain))
        anchor = best.anchor
        # What the candidate's near plane leaves out must not hide what it was chosen for.
        framed = self._framed(anchor.matrix, own, anchor.is_parallel, anchor.start)
        assert framed is not None
        # Its pixels are as small as they were promised to be.
        if framed.texel > anchor.texel:
            factor = framed.texel / anchor.texel
            across, up = (int(np.ceil(side * factor)) for side in framed.size)
            extent = np.array([across, up]) * anchor.texel
            middle = np.array([framed.window[0] + framed.window[2], framed.window[1] + framed.window[3]]) / 2
            window = Window(*(middle - extent / 2), *(middle + extent / 2))
            framed = replace(framed, window=window, size=(across, up))
        return framed

    def _candidates(self, points: ShownPoints, cameras: Iterable[CameraOfPart]) -> Iterator[_Candidate]:
        for part, (matrix, is_parallel) in cameras:
            raise_if_cancelled()
            own = points.take(part)
            turned = matrix[:3, :3].T @ (own.position - matrix[:3, 3:])
            depth = -turned[2]
            near = is_parallel or (depth > 0.0).all()
            if not near or (not is_parallel and np.abs(turned[:2] / depth).max() > WIDEST):
                continue
            anchor = self._framed(matrix, own, is_parallel)
            if anchor is None or anchor.count > self._limits.largest * self._whole_image:
                continue
            sees = serves(anchor, points, self._limits)
            if sees.any():
                yield _Candidate(anchor, sees)


def _parts(points: ShownPoints, size: tuple[int, int]) -> Iterator[IndexArray]:
    """The points of overlapping parts of the image, each by their numbers (n,)."""
    aspect = size[0] / size[1]
    counts = {(max(1, round(rows * aspect)), rows) for rows in ROWS}
    counts |= {pair for strips in STRIPS for pair in ((strips, 1), (1, strips))}
    seen: set[bytes] = set()
    for across, up in sorted(counts | {(1, 1)}):
        cell = np.array([[1.0 / across], [1.0 / up]])
        for column, row in np.ndindex(2 * across - 1, 2 * up - 1):
            low = 0.5 * cell * [[column], [row]]
            which = np.flatnonzero(((points.place >= low) & (points.place < low + cell)).all(axis=0))
            if len(which) >= FEWEST and (key := which.tobytes()) not in seen:
                seen.add(key)
                yield which


def _cameras(points: ShownPoints) -> Iterator[Camera]:
    """Cameras for points: their matrices, and whether their rays are parallel."""
    mean = points.direction.mean(axis=1)
    strength = np.linalg.norm(mean)
    if strength < 0.2:
        return
    mean /= strength
    axes = looking_along(mean)
    middle = points.position.mean(axis=1)
    radius = float(np.linalg.norm(points.position - middle[:, None], axis=0).max())
    eye = nearest_to_lines(points.position, points.direction)
    if eye is not None and np.linalg.norm(eye - middle) < 1e4 * max(radius, 1e-300):
        yield camera_matrix(axes, eye), False
    yield camera_matrix(axes, middle), True
    for factor in NEAR:
        yield camera_matrix(axes, middle - mean * (factor * radius)), False


def looking_along(direction: Array) -> Array:
    """Axes (3, 3), right, up and back, of a camera that looks along a unit direction (3,), upright."""
    upright = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(direction, upright)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, direction), -direction], axis=1)
