# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a picture with layers: what each view's render tells of them, and how they join.

Cycles adds up most passes over the samples of a pixel: these mix as colours do. Of others it keeps the first
sample: a pixel then has those of the view that this sample shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...bridge.blender.versions import index_pass_names
from ...projection.typing import Array
from ...shading.typing import Single
from ..aov_passes import AOVS, FARTHEST, MET, NO_MIST, TINY
from ..portals.pass_nodes import AOV_ALONG, AOV_PLACE, AOV_RATE, AOV_START
from .exr_passes import Pass
from .switched_passes import SwitchedPasses

COMBINED, POSITION, DEPTH, MIST = "Combined", "Position", "Depth", "Mist"
# Passes of one sample of each pixel.
OF_ONE_SAMPLE = (DEPTH, POSITION, *index_pass_names())
# Passes that a render has besides those that are switched on.
BESIDES = (COMBINED, "Noisy Image", *AOVS)
# Ends of the names of light that Cycles divides by its colour, and of that colour's: Blender 5's, older ones.
LIGHT_ENDS = ((" Direct", " Color"), (" Indirect", " Color"), ("Dir", "Col"), ("Ind", "Col"))
# Exponents of the falloff of mist.
FALLOFFS = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}


class Mist(NamedTuple):
    """A world's mist: the depth where it begins and the distance until it is full, and an exponent."""

    start: float
    range: float
    exponent: float

    @classmethod
    def of(cls, world) -> Mist:
        """That of a world, or of None."""
        if world is None:
            return cls(*NO_MIST.values())
        mist = world.mist_settings
        return cls(mist.start, mist.depth, FALLOFFS[mist.falloff])


def summed(found: Mapping[str, Pass], wanted: SwitchedPasses, mist: Mist | None) -> dict[str, Pass]:
    """The passes of a view's render so that those of several samples are sums, 0 where nothing is met.

    found: as read from its file. mist: that of the world if a rig has rendered, whose depth and mist are made
    here, else None.
    """
    passes = {name: each for name, each in found.items() if name not in BESIDES}
    if "use_pass_position" not in wanted.names:
        passes.pop(POSITION, None)
    if mist is not None and (DEPTH in passes or MIST in passes):
        depth, distance, cover = _along_projectors(found)
        density = np.clip((distance - mist.start) / max(mist.range, TINY), 0.0, 1.0) ** mist.exponent
        made = {DEPTH: depth, MIST: 1.0 - cover * (1.0 - density)}
        for name in made.keys() & passes.keys():
            passes[name] = Pass(passes[name].letters, made[name][..., None].astype(np.float32))
    result = {}
    for name, (letters, values) in passes.items():
        if name == MIST:
            values = 1.0 - values
        elif (color := _divisor(name, found)) is not None:
            values = values * color
        result[name] = Pass(letters, values)
    return result


def delivered(joined: Mapping[str, Pass], wanted: SwitchedPasses) -> dict[str, Pass]:
    """The passes that files have, of joined ones: those that are switched on, divided as Cycles does."""
    result = {}
    for name, (letters, values) in joined.items():
        if name == MIST:
            values = 1.0 - values
        elif (color := _divisor(name, joined)) is not None:
            values = np.divide(values, color, out=np.zeros_like(values), where=color != 0.0)
        result[name] = Pass(letters, values)
    return {name: each for name, each in result.items() if not wanted.is_extra(name)}


def _divisor(name: str, passes: Mapping[str, Pass]) -> Single | None:
    """The colour by which Cycles divides light; None for other passes."""
    for end, other in LIGHT_ENDS:
        color = passes.get(name.removesuffix(end) + other)
        if name.endswith(end) and color is not None:
            return color.values
    return None


def _along_projectors(found: Mapping[str, Pass]) -> tuple[Array, Array, Array]:
    """Depth (H, W) of what a rig's render shows, its distance, and the share of samples that meet anything.

    As the compositor's group, see ``aov_passes``.
    """
    start, rate, along, place = (
        found[name].values[..., :3].astype(np.float64) for name in (AOV_START, AOV_RATE, AOV_ALONG, AOV_PLACE)
    )
    position, cover = found[POSITION].values.astype(np.float64), place[..., 2]
    share = 1.0 / np.maximum(cover, MET)[..., None]
    start, rate, (_, depth, distance) = start * share, rate * share, np.moveaxis(along * share, -1, 0)
    speed = np.maximum(np.linalg.norm(rate, axis=-1), TINY)
    depth = depth + ((position - start) * rate).sum(axis=-1) / speed
    is_met = position.any(axis=-1) & (cover > MET)
    depth, distance = (np.where(is_met, each, FARTHEST) for each in (depth, depth * distance))
    return depth, distance, np.clip(cover, 0.0, 1.0)
