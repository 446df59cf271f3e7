# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that show a viewing volume, as in the paper's figures: surfaces green, projectors blue.

The near rim is whole, the far one dashed; arrows show u and v; folded pieces of projectors are apart. Lines
are segments, (S, 2, 3) float32, in the space of the projection. Segments of length 0 are left out, and so are
those that touch a hole of a surface or lead from tile to tile.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, is_dataclass

import numpy as np

from ..volume.viewing_volume import Projection
from .line_colors import Role
from .marks import direction_arrows, far_rim, image_frame, safe_area
from .projector_lines import parted_projector_lines, picked_line, projector_lines
from .segments import Segments, joined
from .surface_lines import iso_lines, surface_lines


@dataclass(frozen=True)
class DiagramOptions:
    """The parts of a volume to draw.

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


def diagram(projection: Projection, options: DiagramOptions) -> dict[Role, Segments]:
    """The lines of a volume by their role; later roles are drawn over earlier ones."""
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
    """A fingerprint of everything on which the lines depend: equal signatures mean equal lines.

    settings: other values on which the drawing depends, such as counts; their repr counts.
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
