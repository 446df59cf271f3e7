# SPDX-License-Identifier: GPL-3.0-or-later
"""Quilts: many views of one volume side by side in one image, for light-field and lenticular displays.

The views stand in a row from left to right. In the image the first one is at the lower left, the others
follow row by row upwards, as displays by Looking Glass Factory expect it (docs.lookingglassfactory.com,
Quilts).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..camera.stereo_views import SideView
from ..scene.render_depsgraph import with_render_depsgraph
from .image_size import require_size
from .render_inputs import RenderInputs, read_inputs, synced_image_size, with_light_warnings


class Quilt(NamedTuple):
    """The layout of a quilt. cone: the angle between the first and the last view at the focus, radians.

    focus: depth of what shows no parallax, in the camera's units, above 0.
    """

    columns: int
    rows: int
    cone: float
    focus: float

    @property
    def count(self) -> int:
        """The number of views."""
        return self.columns * self.rows

    def views(self) -> list[SideView]:
        """The views from left to right."""
        reach = self.focus * math.tan(self.cone / 2.0)
        return [SideView(float(offset), self.focus) for offset in np.linspace(-reach, reach, self.count)]

    def place(self, number: int, size: tuple[int, int]) -> tuple[slice, slice]:
        """The rows and columns of pixels of a view. size: of a view, in pixels."""
        return tile_place(number, self.columns, size)


def tile_place(number: int, columns: int, size: tuple[int, int]) -> tuple[slice, slice]:
    """The rows and columns of pixels of a tile, the first at the lower left. size: of each, in pixels."""
    width, height = size
    row, column = divmod(number, columns)
    return slice(row * height, (row + 1) * height), slice(column * width, (column + 1) * width)


def read_quilt(scene, view_layer, camera, quilt: Quilt) -> list[RenderInputs]:
    """Read the inputs of the views of a flexible camera, which share one scene. Raises USER_ERRORS.

    They are without motion blur.
    """
    width, height = synced_image_size(scene, camera)
    require_size(quilt.columns * width, quilt.rows * height)

    def read(depsgraph) -> list[RenderInputs]:
        found: list[RenderInputs] = []
        for view in quilt.views():
            known = found[0].scene if found else None
            found.append(read_inputs(depsgraph, camera, (width, height), eye=view, scene=known))
        return [with_light_warnings(found[0], depsgraph), *found[1:]]

    return with_render_depsgraph(scene, view_layer, read)
