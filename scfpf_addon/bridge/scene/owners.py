# SPDX-License-Identifier: GPL-3.0-or-later
"""Instanced objects under the names of what instances them: that is what an artist can select and move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...casting.common.geometry import Geometry
from .instances import instances


def under_owners(geometry: Geometry, depsgraph) -> Geometry:
    """Number the objects of a geometry by their instancers, one object for all that one of them shows.

    Objects that stand in the scene themselves, too, or that several others instance, keep their own names.
    """
    owners: dict[str, set[str]] = {}
    for instance in instances(depsgraph, {"MESH"}):
        owners.setdefault(instance.key.name, set()).add(instance.key.owner_name)
    names: dict[str, int] = {}
    numbers = []
    for name in geometry.object_names:
        found = owners.get(name, set())
        owner = next(iter(found)) if len(found) == 1 else name
        numbers.append(names.setdefault(owner, len(names)))
    table = np.array(numbers, np.int32)
    return replace(geometry, object_index=table[geometry.object_index], object_names=tuple(names))
