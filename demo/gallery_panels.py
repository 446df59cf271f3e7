# SPDX-License-Identifier: GPL-3.0-or-later
"""The plates of the gallery and their panels."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from .render_demo import ROOT, SHOTS, Shot

FISHEYE = SHOTS["angular_fisheye"]
SPHERES = {0: {"radius": 1.2}, 1: {"radius": 7}}


@dataclass(frozen=True)
class Panel:
    """An image of a plate: a preset in a scene.

    title: the heading of its column. projectors: the number drawn across and upwards. direction: the view on
    the set-up, in degrees to the right of the camera's back and above it. changed: values of control surfaces
    that replace the preset's, by number. drawn: the same for diagram and set-up only, if the true surface is
    too small or too distant to draw. reach: the distance from the camera at which these end. hidden: the
    collections that would occlude the set-up. style: a key of ``stylised_styles.STYLES``, or empty.
    """

    preset: str
    scene: str
    shot: Shot
    title: str = ""
    projectors: tuple[int, int] = (7, 4)
    direction: tuple[float, float] = (50.0, 25.0)
    changed: Mapping[int, Mapping[str, object]] = field(default_factory=dict)
    drawn: Mapping[int, Mapping[str, object]] = field(default_factory=dict)
    reach: float = float("inf")
    hidden: tuple[str, ...] = ()
    style: str = ""


@dataclass(frozen=True)
class Plate:
    """One or more images under a heading.

    stem: the beginning of their files' names. paper: whether they are one of the paper's figures.
    """

    stem: str
    heading: str
    text: str
    panels: tuple[Panel, ...]
    paper: bool = True


def sizes(*sizes: tuple[float, float, float]) -> dict[int, dict[str, object]]:
    """Widths, heights and distances of rectangles across the view."""
    return {
        number: {"width": width, "height": height, "location": [0, 0, -distance]}
        for number, (width, height, distance) in enumerate(sizes)
    }


def preset_text(stem: str, changed: Mapping[int, Mapping[str, object]], aspect: float | None = None) -> str:
    """A preset's JSON with some values of its control surfaces replaced."""
    data = json.loads((ROOT / "presets" / f"{stem}.json").read_text(encoding="utf-8"))
    for number, values in changed.items():
        data["surfaces"][number].update(values)
    if aspect is not None:
        data["aspect"] = aspect
    return json.dumps(data)
