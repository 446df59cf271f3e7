# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes that the artist's view layer has switched on, of which only renders of colours need any."""

from __future__ import annotations

from ...projection.user_error import Message
from ..aov_passes import AOVS

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
LEFT_OUT = "Pictures with layers by Cycles lack some passes, which the SCFPF engine may have: {0}"
# Cycles divides light by its colour, without which it cannot be joined.
LIGHT, COLOR = ("_direct", "_indirect"), "_color"
# The names of these colours since Blender 5, and before.
COLOR_NAMES = {
    "use_pass_diffuse_color": ("Diffuse Color", "DiffCol"),
    "use_pass_glossy_color": ("Glossy Color", "GlossCol"),
    "use_pass_transmission_color": ("Transmission Color", "TransCol"),
    "use_pass_subsurface_color": ("Subsurface Color", "SubsurfaceCol"),
}


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
