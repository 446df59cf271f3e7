# SPDX-License-Identifier: GPL-3.0-or-later
"""A small diagram of a viewing volume for the corner of a thumbnail: its surfaces and some projectors."""

from __future__ import annotations

import importlib
import io

import numpy as np
from numpy.typing import NDArray

from .volume_pictures import volume_lines

# Projectors in each direction, and the directions of the diagram's right and up in the camera's space: the
# volume is seen from its right, from above and from behind.
PROJECTORS = (3, 3)
RIGHT, UP = np.array([0.55, 0.0, -0.83]), np.array([-0.30, 0.93, -0.20])
# Pixels: width and height, the margin, and the widths of lines. Colours as the viewport's, on a dark plate.
SIZE, MARGIN = (56, 42), 4.0
WIDTHS = {"SURFACE": 0.5, "PROJECTOR": 0.9, "FOLD": 0.9, "RIM": 1.5}
COLOURS = {"SURFACE": "#2f8f5f", "PROJECTOR": "#7fb2ff", "FOLD": "#ff6a5a", "RIM": "#8cf0a8"}
PLATE, ALPHA = "#14181d", 0.86
DPI = 72.0


def volume_icon(module: str, projection, reach: float) -> NDArray[np.uint8]:
    """An RGBA image (H, W, 4), row 0 at the top.

    projection: in the camera's space. reach: lines are cut at this distance from the camera.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.collections import LineCollection
    from matplotlib.patches import FancyBboxPatch

    diagram = importlib.import_module(f"{module}.scfpf_addon.projection.diagrams.diagram")
    lines = volume_lines(diagram, projection, PROJECTORS, reach)
    flat = {role: np.stack([own @ RIGHT, own @ UP], axis=-1) for role, own in lines.items()}
    points = np.concatenate([one.reshape(-1, 2) for one in flat.values()])
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    wide, tall = np.array(SIZE) - 2 * MARGIN
    scale = min(wide / max(high[0] - low[0], 1e-9), tall / max(high[1] - low[1], 1e-9))
    offset = np.array(SIZE) / 2 - scale * (low + high) / 2
    figure = pyplot.figure(figsize=np.array(SIZE) / DPI, dpi=DPI)
    pane = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    pane.set_xlim(0, SIZE[0])
    pane.set_ylim(0, SIZE[1])
    pane.axis("off")
    look = {"boxstyle": "round,pad=2.5", "facecolor": PLATE, "alpha": ALPHA, "linewidth": 0}
    pane.add_patch(FancyBboxPatch((3.0, 3.0), SIZE[0] - 6, SIZE[1] - 6, **look))
    for role in ("SURFACE", "PROJECTOR", "FOLD", "RIM"):
        pane.add_collection(
            LineCollection(scale * flat[role] + offset, colors=COLOURS[role], linewidths=WIDTHS[role])
        )
    held = io.BytesIO()
    figure.savefig(held, format="rgba", dpi=DPI, transparent=True)
    pyplot.close(figure)
    return np.frombuffer(held.getvalue(), np.uint8).reshape(SIZE[1], SIZE[0], 4)
