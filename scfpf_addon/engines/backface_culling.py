# SPDX-License-Identifier: GPL-3.0-or-later
"""Backface culling as engines do it: EEVEE by material, Workbench for all faces, others never.

The engine Flexible Projection shows all faces, as Cycles does: its pictures and Cycles' are compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..bridge.blender import versions
from ..projection.typing import BoolArray, IndexArray

WORKBENCH = "BLENDER_WORKBENCH"


def one_sided(scene, material_names: Sequence[str], material: IndexArray) -> BoolArray | None:
    """Return which triangles the engine of a scene shows from the front only, (T,); None if none.

    material: (T,), of each triangle the place in the names.
    """
    if scene.render.engine == WORKBENCH:
        is_culled = scene.display.shading.show_backface_culling
        return np.ones(len(material), bool) if is_culled and len(material) else None
    if scene.render.engine != versions.EEVEE:
        return None
    found = [bpy.data.materials.get(name) for name in material_names]
    culled = np.array([each is not None and each.use_backface_culling for each in found], bool)
    if not culled.any():
        return None
    result: BoolArray = culled[material]
    return result
