# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of pictures that are joined: light from the anchors' renders, data from the caster."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..bridge.render.render_passes import PASS_SWITCHES, RenderPass, list_render_passes
from ..cycles.layers.layer_passes import COMBINED, MIST, SwitchedPasses, delivered, summed
from ..cycles.layers.pass_files import Pass
from ..projection.user_error import Message
from ..shading.frame import Frame
from ..shading.typing import Single

LEFT_OUT = "Pictures that are joined lack some passes, which the engine Flexible Projection may have: {0}"
# Light is that of the renders, and motion is not known from one picture.
NOT_BY_CASTER = {"DIFFUSE", "SPECULAR", "EMISSION", "ENVIRONMENT", "SHADOW", "SHADOW_CATCHER", "VECTOR"}
DATA_SWITCHES = {each.property for each in PASS_SWITCHES if each.render_pass.source not in NOT_BY_CASTER}
# Passes that neither has.
UNKNOWN = {"use_pass_vector": "Vector", "use_pass_shadow_catcher": "Shadow Catcher"}
MIST_SWITCH = "use_pass_mist"


class AnchorPasses:
    """The passes that a view layer has switched on; its other ones are off for the renders.

    data: those that the caster makes. has_mist: whether Mist is one, the last channel of what is joined.
    warnings: about those that pictures lack.
    """

    def __init__(self, layer) -> None:
        self.data: tuple[RenderPass, ...] = tuple(
            each for each in list_render_passes(layer) if each.source and each.source not in NOT_BY_CASTER
        )
        lost = [text for name, text in UNKNOWN.items() if getattr(layer, name, False)]
        self.warnings = [Message(LEFT_OUT, ", ".join(lost))] if lost else []
        self.has_mist = layer.use_pass_mist
        self._switched = SwitchedPasses(layer)
        self._switched.names -= DATA_SWITCHES | UNKNOWN.keys() | {MIST_SWITCH}
        layer.use_pass_position = False
        self._switched.switch_on(layer, is_rigged=False)
        # The names and letters of the channels behind the colours', as the first render has them.
        self._layout: list[tuple[str, str]] | None = None

    def take_mist(self, layer) -> None:
        """Let renders of a view layer have Mist, if it is switched on: for the camera's own view."""
        if self.has_mist:
            self._switched.names.add(MIST_SWITCH)
            layer.use_pass_mist, self.has_mist = True, False

    def channels(self, found: Mapping[str, Pass]) -> Single:
        """The colours and passes of a render as channels (H, W, C), the colours first.

        Raises OSError if it lacks passes that others have.
        """
        passes = summed(found, self._switched, None)
        if self._layout is None:
            self._layout = [(name, each.letters) for name, each in passes.items()]
        missing = [name for name, _ in self._layout if name not in passes]
        if missing:
            raise OSError(f"a render lacks the passes {', '.join(missing)}")
        parts = [found[COMBINED].values, *(passes[name].values for name, _ in self._layout)]
        return np.concatenate(parts, axis=2)

    def passes(self, channels: Single, frame: Frame | None) -> dict[str, Pass]:
        """The passes of joined channels (H, W, C), and those of the caster's frame."""
        found, first = {}, 4
        for name, letters in self._layout or ():
            found[name] = Pass(letters, channels[..., first : first + len(letters)])
            first += len(letters)
        found = delivered(found, self._switched)
        if self.has_mist:
            found[MIST] = Pass("Z", channels[..., -1:])
        for each in self.data if frame is not None else ():
            values = np.asarray(frame.passes[each.source], np.float32)
            found[each.name] = Pass(each.channels, values.reshape(*channels.shape[:2], -1))
        return found
