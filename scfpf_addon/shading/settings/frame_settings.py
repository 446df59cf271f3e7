# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from ...projection.typing import Array
from ..passes.data_passes import DataPasses
from ..sampling.adaptive import Adaptive
from ..sampling.pixel_filter import PixelFilter
from ..scene.depth_of_field import DepthOfField
from .stylised_settings import Stylised


class Border(NamedTuple):
    """A rectangle of pixels, right and top exclusive."""

    left: int
    bottom: int
    right: int
    top: int


@dataclass(frozen=True)
class FrameSettings:
    """The settings of a frame.

    width, height: pixels. samples: of a pixel. pixel_error: the largest distance between a chord and its
    projector in pixels, 0 for exact casting. transparent: the film is transparent where nothing is hit.
    threads: 0 for all cores. border: the part of the image that is rendered; its pixels are those of the
    whole image. passes: besides the image. pixel_filter: of the image. exposure: factor of the light of the
    image and its passes, unless stylised. scrambled: pixels have different sample positions.
    adaptive: fewer samples for some pixels; implies ``scrambled``. depth_of_field: in world space, for
    straight projectors only. stylised: the style of the image, not of its passes. Raises ValueError for
    settings without an image.
    """

    width: int
    height: int
    samples: int = 4
    pixel_error: float = 0.1
    transparent: bool = False
    threads: int = 0
    border: Border | None = None
    passes: DataPasses = field(default_factory=DataPasses)
    pixel_filter: PixelFilter = field(default_factory=PixelFilter)
    exposure: float = 1.0
    scrambled: bool = False
    adaptive: Adaptive | None = None
    depth_of_field: DepthOfField | None = None
    stylised: Stylised | None = None

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1:
            size = f"{self.width} × {self.height}"
            raise ValueError(f"an image of {size} pixels cannot be made: raise the resolution")
        if self.samples < 1:
            raise ValueError("a pixel needs at least one sample")
        left, bottom, right, top = self.region
        if not (0 <= left < right <= self.width and 0 <= bottom < top <= self.height):
            raise ValueError("the border must lie in the image and hold at least one pixel")

    @property
    def region(self) -> Border:
        """The part of the image that is rendered."""
        return self.border or Border(0, 0, self.width, self.height)

    @property
    def paper(self) -> Array | None:
        """The colour (3,) of paper that shows where nothing is hit; None for the world."""
        return self.stylised.paper if self.stylised and self.stylised.on_paper else None

    @property
    def sees_volume_alone(self) -> bool:
        """Return whether frames see nothing but the viewing volume of their own time.

        Vertices of the frames before and after belong to all triangles; a lens sees past the volume's sides.
        """
        return self.passes.neighbours is None and self.depth_of_field is None
