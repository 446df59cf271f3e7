# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a picture with layers: those switched on, those of each view's render, and those of the join.

Only renders of colours need any. Cycles adds up most passes over the samples of a pixel: these mix as colours
do. Of others it keeps the first sample: a pixel then has those of the view that this sample shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...bridge.blender.versions import index_pass_names
from ...projection.typing import Array
from ...projection.user_error import Message
from ...shading.typing import Single
from ..aov_passes import AOVS, FARTHEST, MET, NO_MIST, TINY
from ..portals.pass_nodes import AOV_ALONG, AOV_PLACE, AOV_RATE, AOV_START
from .pass_files import Pass

# The start of the properties of a view layer, and of Cycles' settings of it, that switch passes.
SWITCHES = ("use_pass_", "pass_", "denoising_store_passes")
# Passes that can be joined besides the view layer's own, which begin with "use_pass_".
VOLUMES = "use_pass_volume"
# Those that cannot: Cycles knows the motion in one camera's picture only, shadows on catchers are not the sum
# of those in parts, and cryptomattes belong to one render.
UNJOINED = (
    "use_pass_vector",
    "use_pass_shadow_catcher",
    "use_pass_cryptomatte_object",
    "use_pass_cryptomatte_material",
    "use_pass_cryptomatte_asset",
    "use_pass_grease_pencil",
)
# Switches that add no pass.
OPTIONS = ("use_pass_combined", "use_pass_cryptomatte_accurate")
LEFT_OUT = (
    "Pictures with layers by Cycles lack some passes, which the engine Flexible Projection may have: {0}"
)
# Cycles divides light by its colour, without which it cannot be joined.
LIGHT, COLOR = ("_direct", "_indirect"), "_color"
# The names of these colours since Blender 5, and before.
COLOR_NAMES = {
    "use_pass_diffuse_color": ("Diffuse Color", "DiffCol"),
    "use_pass_glossy_color": ("Glossy Color", "GlossCol"),
    "use_pass_transmission_color": ("Transmission Color", "TransCol"),
    "use_pass_subsurface_color": ("Subsurface Color", "SubsurfaceCol"),
}

COMBINED, POSITION, DEPTH, MIST = "Combined", "Position", "Depth", "Mist"
# Passes of one sample of each pixel.
OF_ONE_SAMPLE = (DEPTH, POSITION, *index_pass_names())
# Passes that a render has besides those that are switched on.
BESIDES = (COMBINED, "Noisy Image", *AOVS)
# Ends of the names of light that Cycles divides by its colour, and of that colour's: Blender 5's, older ones.
LIGHT_ENDS = ((" Direct", " Color"), (" Indirect", " Color"), ("Dir", "Col"), ("Ind", "Col"))
# Exponents of the falloff of mist.
FALLOFFS = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}


class SwitchedPasses:
    """The passes that a view layer has switched on. All but positions are off at first.

    warnings: about those that a join cannot make. names: of the properties that switch the others.
    """

    def __init__(self, layer) -> None:
        self.names: set[str] = set()
        left_out = []
        for owner in _owners(layer):
            for prop in owner.bl_rna.properties:
                name = prop.identifier
                if not name.startswith(SWITCHES) or prop.type != "BOOLEAN" or prop.is_readonly:
                    continue
                if prop.is_array or not getattr(owner, name):
                    continue
                is_own = owner == layer and name not in UNJOINED
                if is_own or name.startswith(VOLUMES):
                    self.names.add(name)
                else:
                    left_out.append(prop.name)
                setattr(owner, name, False)
        self.names -= {*OPTIONS}
        self.warnings = [Message(LEFT_OUT, ", ".join(left_out))] if left_out else []
        self._aovs = [(aov.name, aov.type) for aov in layer.aovs if aov.name not in AOVS]
        _drop_aovs(layer)
        layer.use_pass_combined = layer.use_pass_position = True

    def switch_on(self, layer, is_rigged: bool) -> None:
        """Switch the passes on. is_rigged: whether a rig sees, which writes AOVs of its own."""
        _switch(layer, self._with_colors(layer), True)
        own = [(name, "COLOR") for name in AOVS] if is_rigged and self.need_chords else []
        for name, kind in (*self._aovs, *own):
            aov = layer.aovs.add()
            aov.name, aov.type = name, kind

    def switch_off(self, layer) -> None:
        """Switch them off again, but for positions."""
        _switch(layer, self._with_colors(layer) - {"use_pass_position"}, False)
        _drop_aovs(layer)

    def _with_colors(self, layer) -> set[str]:
        """The names, and those of the colours by which their light is divided."""
        colors = {_color(name) for name in self.names if name.endswith(LIGHT)}
        return self.names | {name for name in colors if name in layer.bl_rna.properties}

    def is_extra(self, name: str) -> bool:
        """Return whether a pass is only there for others: a colour by which light is divided."""
        return any(name in own and switch not in self.names for switch, own in COLOR_NAMES.items())

    @property
    def is_any(self) -> bool:
        """Return whether any pass is switched on."""
        return bool(self.names or self._aovs)

    @property
    def need_chords(self) -> bool:
        """Return whether passes of rigs are made from what their portals write into AOVs."""
        return not self.names.isdisjoint(("use_pass_z", "use_pass_mist"))


def _owners(layer) -> list:
    """The view layer, and Cycles' settings of it."""
    return [owner for owner in (layer, getattr(layer, "cycles", None)) if owner is not None]


def _color(name: str) -> str:
    """The switch of the colour by which a pass of light is divided."""
    for end in LIGHT:
        name = name.removesuffix(end)
    return name + COLOR


def _switch(layer, names: set[str], is_on: bool) -> None:
    for owner in _owners(layer):
        for name in names:
            if name in owner.bl_rna.properties:
                setattr(owner, name, is_on)


def _drop_aovs(layer) -> None:
    for aov in layer.aovs[:]:
        layer.aovs.remove(aov)


class Mist(NamedTuple):
    """A world's mist: the depth where it begins and the distance until it is full, and an exponent."""

    start: float
    range: float
    exponent: float

    @classmethod
    def of(cls, world) -> Mist:
        """The mist of a world, or of None."""
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
