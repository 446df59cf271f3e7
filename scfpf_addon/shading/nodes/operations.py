# SPDX-License-Identifier: GPL-3.0-or-later
"""All operations of material graphs by name."""

from __future__ import annotations

from functools import partial

from . import colors, daylight, inputs, light_path, noise, numbers, sky, textures
from .bump import bump
from .graph import Evaluator

OPERATIONS: dict[str, Evaluator] = {
    **colors.OPERATIONS,
    **inputs.OPERATIONS,
    **light_path.OPERATIONS,
    **noise.OPERATIONS,
    **numbers.OPERATIONS,
    **sky.OPERATIONS,
    **daylight.OPERATIONS,
    **textures.OPERATIONS,
}
OPERATIONS["BUMP"] = partial(bump, OPERATIONS)
