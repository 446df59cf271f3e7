# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that picture a viewing volume, as in the paper's figures: surfaces green, projectors blue.

Lines are segments, (S, 2, 3) float32, in the space of the projection; those of
no length and those that touch a hole of a surface or lead from tile to tile are left out.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .bezier import bernstein, chord_count
from .typing import Array, BoolArray, IndexArray
from .volume import Projection

Role: TypeAlias = Literal["SURFACE", "PROJECTOR", "FRAME"]
Segments: TypeAlias = NDArray[np.float32]

# Display colours, red green blue alpha.
COLORS: dict[Role, tuple[float, float, float, float]] = {
    "SURFACE": (0.13, 0.65, 0.22, 1.0),
    "PROJECTOR": (0.16, 0.36, 0.95, 1.0),
    "FRAME": (0.45, 0.95, 0.35, 1.0),
}

# A drawn projector leaves its curve by at most this share of its control polygon's length.
BEND_TOLERANCE = 2e-3
# More chords than this in one span cannot be told apart on a screen.
MAXIMUM_CHORDS = 128
# Halvings that find the rim of what an image shows: to 2^-40 of the image.
RIM_STEPS = 40


def surface_lines(projection: Projection, index: int, lines: int = 8, resolution: int = 48) -> Segments:
    """Lines of constant u and of constant v on control surface ``index``.

    Over the u and v ranges, lines + 1 in each direction with the borders among
    them, each of ``resolution`` segments. A point surface has none.
    """
    across = np.linspace(0.0, 1.0, lines + 1)
    along = np.linspace(0.0, 1.0, resolution + 1)
    fixed, moving = np.meshgrid(across, along, indexing="ij")
    surface = projection.volume.surfaces[index]
    families = []
    for x, y in ((fixed, moving), (moving, fixed)):
        sample = surface.evaluate(*_ranged(projection, x.ravel(), y.ravel()))
        drawn = sample.position.reshape(3, *x.shape)
        families.append(_segments(drawn, sample.valid.reshape(x.shape), sample.tile.reshape(x.shape)))
    return np.concatenate(families)


def projector_lines(
    projection: Projection, count_u: int, count_v: int, chords: int | None = None
) -> Segments:
    """A sampling of the volume's projectors: count_u × count_v of them, evenly over the u and v ranges.

    The borders are among them when a count is 2 or more. chords: segments in
    each span of a projector; None: as many as the bend of each needs, one for straight ones.
    """
    x, y = np.meshgrid(_even(count_u), _even(count_v))
    controls = projection.volume.controls(*_ranged(projection, x.ravel(), y.ravel()))
    result = []
    for matrix in projection.volume.spans.matrices:
        points = np.einsum("kc,cdn->kdn", matrix, controls.points)
        length = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum(axis=0)
        if chords is None:
            # A span of no length has no bend either; any tolerance does for it.
            needed = chord_count(points, np.where(length > 0, BEND_TOLERANCE * length, 1.0))
            needed = np.minimum(needed, MAXIMUM_CHORDS)
        else:
            needed = np.full(len(length), chords)
        for count in np.unique(needed):
            chosen = needed == count
            weights = bernstein(len(points) - 1, np.linspace(0.0, 1.0, count + 1))
            curves = np.einsum("ks,kdn->dns", weights, points[:, :, chosen])
            valid = np.repeat(controls.valid[chosen, None], count + 1, axis=1)
            result.append(_segments(curves, valid))
    return np.concatenate(result)


def image_frame(projection: Projection, resolution: int = 48) -> Segments:
    """The rim of the image on the near surface: resolution segments for each side of the image.

    Where the re-parameterisation shows only a part of the image the rim is that
    of the part, taken as star-shaped about the image's centre.
    """
    step = np.arange(resolution) / resolution
    one, nought = np.ones(resolution), np.zeros(resolution)
    x = np.concatenate([step, one, 1 - step, nought, [0.0]])
    y = np.concatenate([nought, step, one, 1 - step, [0.0]])
    inside, outside = np.zeros(len(x)), np.ones(len(x))

    def shown(share: Array) -> BoolArray:
        return projection.parameters(0.5 + (x - 0.5) * share, 0.5 + (y - 0.5) * share).mask

    inside[shown(outside)] = 1.0
    for _ in range(0 if inside.all() else RIM_STEPS):
        middle = (inside + outside) / 2
        mask = shown(middle)
        inside, outside = np.where(mask, middle, inside), np.where(mask, outside, middle)
    image = projection.parameters(0.5 + (x - 0.5) * inside, 0.5 + (y - 0.5) * inside)
    sample = projection.volume.surfaces[0].evaluate(image.u, image.v)
    return _segments(sample.position[:, None], (sample.valid & image.mask)[None], sample.tile[None])


def diagram(projection: Projection, count_u: int, count_v: int) -> dict[Role, Segments]:
    """All the lines of a volume by their role; count_u × count_v projectors."""
    indices = range(len(projection.volume.surfaces))
    return {
        "SURFACE": np.concatenate([surface_lines(projection, index) for index in indices]),
        "PROJECTOR": projector_lines(projection, count_u, count_v),
        "FRAME": image_frame(projection),
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


def _ranged(projection: Projection, x: Array, y: Array) -> tuple[Array, Array]:
    (u0, u1), (v0, v1) = projection.u_range, projection.v_range
    return u0 + x * (u1 - u0), v0 + y * (v1 - v0)


def _segments(lines: Array, valid: BoolArray, tile: IndexArray | None = None) -> Segments:
    """Segments of L polylines of K points each. lines: (3, L, K); valid, tile: (L, K).

    Where the tile changes the polyline is broken: tiles need not meet.
    """
    points = np.moveaxis(lines, 0, -1).astype(np.float32)
    pairs = np.stack([points[:, :-1], points[:, 1:]], axis=2)
    kept = valid[:, :-1] & valid[:, 1:] & (pairs[:, :, 0] != pairs[:, :, 1]).any(axis=2)
    if tile is not None:
        kept &= tile[:, :-1] == tile[:, 1:]
    segments: Segments = np.ascontiguousarray(pairs[kept])
    return segments
