# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a stylised image. Lengths are in pixels of the rendered image."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ...projection.typing import Array

# Kinds of lines as bits; where lines coincide the lowest bit shows.
SILHOUETTE, OBJECT, CONTOUR, MATERIAL, CREASE = 1, 2, 4, 8, 16
# Kinds of the width of outlines; the others are inner lines.
OUTER = SILHOUETTE | OBJECT

FillKind = Literal["RENDERED", "TOON", "FLAT", "PAPER"]
HatchKind = Literal["DEPTH", "TONE"]


@dataclass(frozen=True)
class Lines:
    """The lines of a stylised image.

    kinds: bits of the above. width, inner_width: of outlines and of lines within them. color: (3,)
    scene-linear. crease_angle: the smallest angle between normals that makes a line, radians. jump: the
    smallest distance of a surface behind another that makes a line, in pixel footprints. Raises ValueError.
    """

    kinds: int = SILHOUETTE | OBJECT | CONTOUR | CREASE
    width: float = 2.0
    inner_width: float = 1.0
    color: Array = field(default_factory=lambda: np.zeros(3))
    crease_angle: float = np.pi / 6
    jump: float = 2.0

    def __post_init__(self) -> None:
        if self.width <= 0.0 or self.inner_width <= 0.0 or self.jump < 0.0:
            raise ValueError("lines need widths above 0 and a depth jump of 0 or more")


@dataclass(frozen=True)
class Hatching:
    """The hatching of a stylised image: lines of equal t (DEPTH), or strokes where little light falls (TONE).

    width: the largest of a line. color: (3,) scene-linear. count: steps of t from the near to the far
    surface. spacing: between strokes. angle: of strokes, radians from the horizontal. cross: whether darker
    tones have strokes across, not closer ones. Raises ValueError.
    """

    kind: HatchKind = "TONE"
    width: float = 1.0
    color: Array = field(default_factory=lambda: np.zeros(3))
    count: int = 32
    spacing: float = 6.0
    angle: float = np.pi / 4
    cross: bool = True

    def __post_init__(self) -> None:
        if self.width <= 0.0 or self.spacing <= 0.0 or self.count < 1:
            raise ValueError("hatching needs a width and a spacing above 0 and at least one step of t")


@dataclass(frozen=True)
class Stylised:
    """The style of an image.

    fill: between the lines: the image as rendered, the materials' colours in steps of light (TOON) or
    without light (FLAT), or paper alone. steps: of light. darkest: share of a colour in the darkest step.
    softness: in [0, 1], share of a step that blends into the next. exposure: of light for steps and strokes,
    in stops. fade: share of the fill that is paper. paper: (3,) its colour, scene-linear. on_paper: whether
    misses show paper, not the world. detail: places per pixel, along each axis, that are searched for lines.
    Raises ValueError.
    """

    lines: Lines | None = None
    hatching: Hatching | None = None
    fill: FillKind = "TOON"
    steps: int = 3
    softness: float = 0.0
    darkest: float = 0.3
    exposure: float = 0.0
    fade: float = 0.0
    paper: Array = field(default_factory=lambda: np.ones(3))
    on_paper: bool = False
    detail: int = 2

    def __post_init__(self) -> None:
        if self.steps < 1 or self.detail < 1:
            raise ValueError("Drawn Style needs at least one step of light and a detail of 1")

    @property
    def lit(self) -> bool:
        """Return whether steps or strokes depend on the light that falls on surfaces."""
        toned = self.hatching is not None and self.hatching.kind == "TONE"
        return toned or (self.fill == "TOON" and self.steps > 1)

    def scaled(self, factor: float) -> Stylised:
        """The same style for an image whose sides have ``factor`` times the pixels."""
        lines, hatching = self.lines, self.hatching
        if lines:
            lines = replace(lines, width=lines.width * factor, inner_width=lines.inner_width * factor)
        if hatching:
            hatching = replace(hatching, width=hatching.width * factor, spacing=hatching.spacing * factor)
        return replace(self, lines=lines, hatching=hatching)
