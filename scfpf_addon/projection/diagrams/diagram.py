# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that picture a viewing volume, as in the paper's figures: surfaces green, projectors blue.

The near rim is whole, the far one dashed; arrows show u and v; folded pieces of projectors are apart.
Lines are segments, (S, 2, 3) float32, in the space of the projection; those of
no length and those that touch a hole of a surface or lead from tile to tile are left out.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, is_dataclass

import numpy as np

from ..arrays import bilinear_net
from ..surfaces.surface import ControlSurface, Plane
from ..typing import Array, BoolArray, IndexArray
from ..volume.basis import SpanBasis
from ..volume.bezier import chord_count
from ..volume.folds import find_folds, folded_pieces
from ..volume.viewing_volume import Projection, ViewingVolume
from .line_colors import Role
from .marks import direction_arrows, far_rim, iso_lines, safe_area
from .segments import Segments, image_rim, joined, ranged, segments

# Cells along u and along v between the lines of a surface. A flat one needs few, and it often fills the view:
# a camera that is added looks as the viewport does.
SURFACE_CELLS, PLANE_CELLS = 8, 4
# Cells of a surface that leaves the net of the others, half-way between its lines, by more than this share of
# a cell's size. A sphere leaves it by 0.2.
BENT_CELLS, LEAVES_LINES = 16, 0.25
# Places along each side of a cell of drawn projectors at which bends between them are looked for, and how far
# the controls must be from where the drawn ones have them, as a share of a cell: a full turn has 0.4.
BETWEEN, LEAVES_PROJECTORS = 4, 0.5
# Those that leave as far as the farthest one but for this share are drawn with it: symmetric ones.
AS_FAR = 1e-3
# A drawn projector leaves its curve by at most this share of its control polygon's length.
BEND_TOLERANCE = 1e-3
# More chords than this in one span cannot be told apart on a screen.
MAXIMUM_CHORDS = 128
# Places in a span of rational projectors at which their bend is measured.
BEND_SAMPLES = np.linspace(0.0, 1.0, 33)
# The bend along a projector counts by this share: it only shifts chord ends, but where the curve turns back.
BEND_ALONG = 0.25
# Pieces along t in which a projector is looked at for folds, and drawn where it has one.
FOLD_PIECES = 48
# How far beside a drawn projector folds are looked for, as a share of the u and v ranges.
BESIDE = 1e-4
# Halvings that find the rim of what an image shows: to float32's 2^-24 of the image, as it is drawn.
RIM_STEPS = 24


@dataclass(frozen=True)
class DiagramOptions:
    """What to draw of a volume.

    count_u, count_v: projectors in each direction. iso: the t of the iso-surfaces.
    folds: tell folded pieces of projectors from others. pick: the image position
    (x, y) of a projector to draw apart. safe_areas: margins of safe areas, each (left and
    right, below and above) as a share of half the image, as Blender counts them. without:
    numbers of control surfaces whose lines are left out.
    """

    count_u: int
    count_v: int
    iso: tuple[float, ...] = ()
    folds: bool = True
    pick: tuple[float, float] | None = None
    safe_areas: tuple[tuple[float, float], ...] = ()
    without: tuple[int, ...] = ()


def even_iso(count: int) -> tuple[float, ...]:
    """The t of ``count`` iso-surfaces evenly between the near and the far surface."""
    return tuple((index + 1) / (count + 1) for index in range(count))


def surface_lines(
    projection: Projection, index: int, lines: int | None = None, resolution: int = 48
) -> Segments:
    """Lines of constant u and of constant v on control surface ``index``.

    Over the u and v ranges, lines + 1 in each direction with the borders among
    them, each of ``resolution`` segments. lines: None for as many as the
    surface needs. A point surface has none.
    """
    if lines is None:
        lines = _lines_needed(projection, index)
    across = np.linspace(0.0, 1.0, lines + 1)
    along = np.linspace(0.0, 1.0, resolution + 1)
    fixed, moving = np.meshgrid(across, along, indexing="ij")
    surface = projection.volume.surfaces[index]
    families = []
    for x, y in ((fixed, moving), (moving, fixed)):
        sample = surface.evaluate(*ranged(projection, x.ravel(), y.ravel()))
        drawn = sample.position.reshape(3, *x.shape)
        families.append(segments(drawn, sample.valid.reshape(x.shape), sample.tile.reshape(x.shape)))
    return joined(families)


def _lines_needed(projection: Projection, index: int) -> int:
    """Return the number of cells along u and v that shows the bends of a surface."""
    surface = projection.volume.surfaces[index]
    if isinstance(surface, Plane):
        return PLANE_CELLS
    left = _left_between(projection, surface, (SURFACE_CELLS, SURFACE_CELLS), BENT_CELLS // SURFACE_CELLS)
    return BENT_CELLS if left.max(initial=0.0) > LEAVES_LINES else SURFACE_CELLS


def _left_between(
    projection: Projection, surface: ControlSurface, cells: tuple[int, int], parts: int
) -> Array:
    """Return the distance of a surface, between a net of cells (along u, along v), from its bilinear faces.

    At ``parts`` places along each side of a cell: (V · parts + 1, U · parts + 1), in mean sizes of a cell; 0
    beside holes and in cells that lead from tile to tile.
    """
    steps = [np.linspace(0.0, 1.0, parts * count + 1) for count in cells]
    x, y = np.meshgrid(*steps)
    sample = surface.evaluate(*ranged(projection, x.ravel(), y.ravel()))
    points = np.where(sample.valid, sample.position, np.nan).reshape(3, *x.shape)
    known = points[:, np.isfinite(points[0])]
    size = float(np.linalg.norm(np.ptp(known, axis=1))) / max(cells) if known.size else 0.0
    if size == 0.0:
        return np.zeros(x.shape)
    tile = sample.tile.reshape(x.shape).astype(np.float64)
    net = bilinear_net(np.stack([*points, tile])[:, ::parts, ::parts], parts)
    away = np.linalg.norm(points - net[:3], axis=0)
    found: Array = np.where(net[3] == tile, np.nan_to_num(away / size), 0.0)
    return found


def projector_lines(
    projection: Projection, count_u: int, count_v: int, chords: int | None = None
) -> Segments:
    """A sampling of the volume's projectors: count_u × count_v of them, evenly over the u and v ranges.

    The borders are among them when a count is 2 or more, and so are projectors between them that bend
    otherwise. chords: segments in
    each span of a projector; None: as many as the bend of each needs, one for straight ones.
    """
    controls = projection.volume.controls(*ranged(projection, *_drawn_places(projection, count_u, count_v)))
    return _curves(projection.volume, controls.points, controls.valid, chords)


def parted_projector_lines(
    projection: Projection, count_u: int, count_v: int
) -> tuple[Segments, Segments, Segments]:
    """``projector_lines`` in two parts, the pieces in order and the folded ones; dashes all over folds."""
    volume, folds = projection.volume, find_folds(projection)
    places = _drawn_places(projection, count_u, count_v)
    controls = volume.controls(*ranged(projection, *places))
    ends = np.union1d(np.linspace(0.0, 1.0, FOLD_PIECES + 1), volume.spans.breaks)
    middles = (ends[1:] + ends[:-1]) / 2
    # The lines of a control grid may run here, where derivatives are those of one side: all sides count.
    beside = volume.controls(*ranged(projection, *_beside(*places)))
    folded = (
        folded_pieces(volume, beside, middles, folds.orientation).reshape(4, -1, len(middles)).any(axis=0)
    )
    dashes = segments(folds.dashes, np.ones(folds.dashes.shape[1:], bool))
    mixed = folded.any(axis=1)
    if not mixed.any():
        return _curves(volume, controls.points, controls.valid), joined([]), dashes
    whole = _curves(volume, controls.points[..., ~mixed], controls.valid[~mixed])
    weights, _ = volume.spans.weights(ends)
    curves = np.moveaxis(controls.points[..., mixed], 0, -1) @ weights
    parts = []
    for kept in (~folded[mixed], folded[mixed]):
        pairs = np.stack([curves[..., :-1], curves[..., 1:]], axis=-1)[:, kept]
        valid = np.repeat(controls.valid[mixed, None], kept.shape[1], axis=1)[kept]
        parts.append(segments(pairs, np.stack([valid, valid], axis=1)))
    return joined([whole, parts[0]]), parts[1], dashes


def picked_line(projection: Projection, x: float, y: float) -> Segments:
    """The projector through an image position; none where the image shows nothing."""
    projectors = projection.projectors(np.array([x]), np.array([y]))
    return _curves(projection.volume, projectors.points, projectors.valid)


def projector_point(projection: Projection, x: float, y: float, t: float) -> Segments:
    """The point at t of the projector through an image position, (1, 3) float32; (0, 3) without one."""
    projectors = projection.projectors(np.array([x]), np.array([y]))
    weights, _ = projection.volume.spans.weights(np.array([t]))
    points = np.einsum("k,kcn->nc", weights[:, 0], projectors.points)[projectors.valid]
    single: Segments = points.astype(np.float32)
    return single


def _drawn_places(projection: Projection, count_u: int, count_v: int) -> tuple[Array, Array]:
    """Shares x, y of the u and v ranges at which projectors are drawn: even ones, and bends between them."""
    x, y = (a.ravel() for a in np.meshgrid(_even(count_u), _even(count_v)))
    if min(count_u, count_v) < 2:
        return x, y
    cells = count_u - 1, count_v - 1
    left = np.max([_left_between(projection, s, cells, BETWEEN) for s in projection.volume.surfaces], axis=0)
    # Of each cell, without its last row and column, the places that leave the net farthest.
    blocks = left[:-1, :-1].reshape(cells[1], BETWEEN, cells[0], BETWEEN)
    most = np.maximum((1.0 - AS_FAR) * blocks.max(axis=(1, 3), keepdims=True), LEAVES_PROJECTORS)
    rows, columns = np.nonzero((blocks >= most).reshape(BETWEEN * cells[1], BETWEEN * cells[0]))
    return (
        np.concatenate([x, columns / (BETWEEN * cells[0])]),
        np.concatenate([y, rows / (BETWEEN * cells[1])]),
    )


def _beside(x: Array, y: Array) -> tuple[Array, Array]:
    """Shares near x, y (N,), inside the borders: all of them on each of the four sides in turn."""
    steps = np.array([[-BESIDE, -BESIDE, BESIDE, BESIDE], [-BESIDE, BESIDE, -BESIDE, BESIDE]])
    around = np.clip(np.stack([x, y])[:, None] + steps[..., None], BESIDE, 1.0 - BESIDE)
    return around[0].ravel(), around[1].ravel()


def _curves(volume: ViewingVolume, controls: Array, valid: BoolArray, chords: int | None = None) -> Segments:
    """The curves with control points (m+1, 3, N); see ``projector_lines``."""
    result = []
    for span in range(len(volume.spans.matrices)):
        if chords is None:
            needed = _chords_needed(volume.spans, span, controls)
        else:
            needed = np.full(controls.shape[2], chords)
        for count in np.unique(needed):
            chosen = needed == count
            shares = volume.spans.values(span, np.linspace(0.0, 1.0, count + 1))
            curves = np.moveaxis(controls[:, :, chosen], 0, -1) @ shares.T
            result.append(segments(curves, np.repeat(valid[chosen, None], count + 1, axis=1)))
    return joined(result)


def _chords_needed(spans: SpanBasis, span: int, controls: Array) -> IndexArray:
    """How many chords of equal steps in t draw each curve in a span: (N,)."""
    points = np.einsum("kc,cdn->kdn", spans.matrices[span], controls)
    length = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum(axis=0)
    # A span of no length has no bend either; any tolerance does for it.
    tolerance = np.where(length > 0, BEND_TOLERANCE * length, 1.0)
    if spans.point_weights is None:
        return np.minimum(chord_count(points, tolerance), MAXIMUM_CHORDS)
    # Bounds for rational curves ask for several times too many, so the bend is measured.
    _, slopes, bends = spans.within(span, BEND_SAMPLES)
    flat = controls.reshape(len(controls), -1)
    way, bend = ((w @ flat).reshape(len(w), *controls.shape[1:]) for w in (slopes, bends))
    whole = np.einsum("gdn,gdn->gn", bend, bend)
    speed = np.maximum(np.einsum("gdn,gdn->gn", way, way), np.finfo(float).tiny)
    across = whole - np.einsum("gdn,gdn->gn", way, bend) ** 2 / speed
    largest = np.sqrt(np.maximum(across, BEND_ALONG**2 * whole).max(axis=0))
    extent = spans.breaks[span + 1] - spans.breaks[span]
    needed = np.ceil(extent * np.sqrt(largest / (8.0 * tolerance)))
    counts: IndexArray = np.clip(needed, 1, MAXIMUM_CHORDS).astype(np.int64)
    return counts


def image_frame(projection: Projection, resolution: int = 48) -> Segments:
    """The rim of the image on the near surface: resolution segments for each side of the image.

    Where the re-parameterisation shows only a part of the image the rim is that
    of the part, taken as star-shaped about the image's centre.
    """
    x, y = image_rim(resolution)
    inside, outside = np.zeros(len(x)), np.ones(len(x))

    def shown(share: Array) -> BoolArray:
        """Whether the image shows what lies at shares (N,) of the way from its centre to its rim, (N,)."""
        return projection.parameters(0.5 + (x - 0.5) * share, 0.5 + (y - 0.5) * share).mask

    inside[shown(outside)] = 1.0
    for _ in range(0 if inside.all() else RIM_STEPS):
        middle = (inside + outside) / 2
        mask = shown(middle)
        inside, outside = np.where(mask, middle, inside), np.where(mask, outside, middle)
    image = projection.parameters(0.5 + (x - 0.5) * inside, 0.5 + (y - 0.5) * inside)
    sample = projection.volume.surfaces[0].evaluate(image.u, image.v)
    return segments(sample.position[:, None], (sample.valid & image.mask)[None], sample.tile[None])


def diagram(projection: Projection, options: DiagramOptions) -> dict[Role, Segments]:
    """All the lines of a volume by their role; later roles are drawn over earlier ones."""
    counts = options.count_u, options.count_v
    if options.folds:
        projectors, folded, dashes = parted_projector_lines(projection, *counts)
    else:
        projectors, folded, dashes = projector_lines(projection, *counts), joined([]), joined([])
    along_u, along_v = direction_arrows(projection)
    indices = [i for i in range(len(projection.volume.surfaces)) if i not in options.without]
    return {
        "ISO": joined([iso_lines(projection, t) for t in options.iso]),
        "SURFACE": joined([surface_lines(projection, index) for index in indices]),
        "FOLDED": dashes,
        "PROJECTOR": projectors,
        "FOLD": folded,
        "FAR": far_rim(projection),
        "SAFE": joined([safe_area(projection, *margins) for margins in options.safe_areas]),
        "FRAME": image_frame(projection),
        "U": along_u,
        "V": along_v,
        "PICK": joined([]) if options.pick is None else picked_line(projection, *options.pick),
    }


def volume_signature(projection: Projection, *settings: object) -> bytes:
    """A fingerprint of all that the lines depend on: equal signatures mean equal lines.

    settings: what else the drawing depends on, such as counts; their repr counts.
    """
    digest = hashlib.blake2b(digest_size=16)
    _digest(digest, (projection, settings))
    return digest.digest()


def _digest(digest: hashlib.blake2b, value: object) -> None:
    if isinstance(value, np.ndarray):
        digest.update(repr((value.shape, value.dtype.str)).encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        digest.update(type(value).__qualname__.encode())
        for field in fields(value):
            _digest(digest, getattr(value, field.name))
    elif isinstance(value, tuple):
        digest.update(str(len(value)).encode())
        for item in value:
            _digest(digest, item)
    else:
        digest.update(repr(value).encode() + b";")


def _even(count: int) -> Array:
    return np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])
