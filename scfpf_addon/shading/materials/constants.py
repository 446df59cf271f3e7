# SPDX-License-Identifier: GPL-3.0-or-later
"""The constants of materials, and which of them are node graphs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ...projection.typing import Array, BoolArray
from ..nodes.graph import MaterialGraph


@dataclass(frozen=True)
class Materials:
    """Constants of M materials, scene-linear: colours (M, 3), the rest (M,), float64.

    Shares in [0, 1], None where all are 1. ambient: of the world's light that is left when rays follow
    reflections. specular_ambient: the same of a dielectric's reflection. specular_coverage: of the diffuse
    surface that the dielectric layer covers. grazing: of the way from F0 to 1 at which a metal's F90 lies.
    multiscatter: of the light that facets send to each other.
    graphs: by number, the materials that are more than constants.
    """

    base_color: Array
    metallic: Array
    roughness: Array
    specular_f0: Array
    emission: Array
    ambient: Array | None = None
    specular_ambient: Array | None = None
    specular_coverage: Array | None = None
    grazing: Array | None = None
    multiscatter: Array | None = None
    graphs: Mapping[int, MaterialGraph] = field(default_factory=dict)

    @classmethod
    def of_rows(cls, rows: Mapping[str, Any]) -> Materials:
        """Materials of all constants, by name."""
        return cls(**rows)

    @property
    def is_clear(self) -> BoolArray:
        """Return whether each material (M,) may let light through."""
        found: BoolArray = np.zeros(len(self.metallic), bool)
        for number, graph in self.graphs.items():
            found[number] = graph.lets_through or graph.refracts
        return found

    def followed_by(self, others: Materials) -> Materials:
        """Join constants, with others, which are all given, after these."""
        ones = np.ones(len(self.metallic))
        own = {name: ones if getattr(self, name) is None else getattr(self, name) for name in CONSTANTS}
        return Materials.of_rows(
            {name: np.concatenate([values, getattr(others, name)]) for name, values in own.items()}
        )


CONSTANTS = tuple(each.name for each in fields(Materials) if each.name != "graphs")
