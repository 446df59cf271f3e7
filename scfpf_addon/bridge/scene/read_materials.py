# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials of a scene: graphs, or constants where that is all that a graph is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.typing import Array
from ...projection.user_error import Message
from ...shading.materials.constants import Materials
from ...shading.materials.lobes import bodies, split
from ...shading.materials.parameters import ClosureRows
from ...shading.nodes.graph import MaterialGraph
from ..blender import versions
from ..blender.shader_nodes import is_fed, output_node
from .read_graph import GraphReading, read_graph

# The surface of faces without a material, as in Cycles and EEVEE.
DEFAULT_GREY = {"base_color": 0.8, "roughness": 0.5, "specular_level": 0.5}
# The name of faces without a material in cryptomattes, as in Cycles.
NO_MATERIAL = "default_surface"


class MaterialTable:
    """The materials of a scene, each read once. Number 0 is the default grey.

    unmet: the numbers of those that no ray meets, see ``GraphReading``.
    """

    def __init__(self) -> None:
        self.pass_indices = [0]
        self.names = [NO_MATERIAL]
        self._numbers: dict[int, int] = {}
        self._notes: dict[str, list[str]] = {}
        # Those without nodes, (3,), and those whose graphs are constants. All others are black.
        self._colors: dict[int, Array] = {}
        self._plain: dict[int, MaterialGraph] = {}
        self.graphs: dict[int, MaterialGraph] = {}
        self.unmet: set[int] = set()

    def number(self, material) -> int:
        """The number of an evaluated material, or of None."""
        if material is None:
            return 0
        key = material.as_pointer()
        if key not in self._numbers:
            number = self._numbers[key] = len(self.names)
            if versions.uses_nodes(material):
                reading = read_graph(material.node_tree)
                self._note(material, reading)
                if reading.graph is not None:
                    (self._plain if reading.plain else self.graphs)[number] = reading.graph
                if reading.volume_only:
                    self.unmet.add(number)
            else:
                # Diffuse, in the colour of the viewport display, as in Cycles.
                self._colors[number] = np.array(material.diffuse_color[:3], np.float64)
            self.pass_indices.append(material.pass_index)
            self.names.append(material.name)
        return self._numbers[key]

    def _note(self, material, reading: GraphReading) -> None:
        """Note the parts of a material that images do not show."""
        for note in (*reading.notes, *_unshown(material.node_tree)):
            self._notes.setdefault(note, []).append(material.name)

    def materials(self) -> Materials:
        """All materials as arrays, with colours and values in their allowed ranges."""
        rows = ClosureRows.empty(len(self.names))
        for name, value in DEFAULT_GREY.items():
            rows[name][:, 0] = value
        for number, color in self._colors.items():
            rows["base_color"][:, number] = np.nan_to_num(color).clip(0.0)
        rows.fill_constants(self._plain)
        return replace(bodies(split(rows)), graphs=self.graphs)

    @property
    def refracts(self) -> bool:
        """Return whether any material may be glass."""
        return any(graph.refracts for graph in self.graphs.values())

    def met(self, geometry: Geometry) -> Geometry:
        """The part of a geometry that rays meet."""
        kept = ~np.isin(geometry.material, list(self.unmet))
        return geometry if kept.all() else geometry.part(kept)

    def warnings(self) -> tuple[str, ...]:
        """Warnings about parts of the materials that images do not show."""
        return tuple(
            Message("Not shown as it is: {0} (in {1})", Message(note), listing(names))
            for note, names in self._notes.items()
        )


def is_volume_only(material) -> bool:
    """Return whether a material, or None, has a volume and no surface, see ``GraphReading``. Quick."""
    if material is None or not versions.uses_nodes(material):
        return False
    output = output_node(material.node_tree)
    has_volume = output is not None and is_fed(output.inputs["Volume"])
    return has_volume and read_graph(material.node_tree).volume_only


def volume_only_materials() -> frozenset[int]:
    """The session ids of the file's materials for which ``is_volume_only`` holds."""
    return frozenset(one.session_uid for one in bpy.data.materials if is_volume_only(one))


def unmet_slots(obj, volume_only: frozenset[int]) -> frozenset[int]:
    """The material slots of an object whose faces no ray meets. volume_only: ``volume_only_materials``."""
    if not volume_only:
        return volume_only
    used = enumerate(slot.material for slot in obj.material_slots)
    return frozenset(n for n, one in used if one is not None and one.original.session_uid in volume_only)


def _unshown(tree) -> Iterator[str]:
    """The inputs of a material's active output, besides its surface, that Cycles shows."""
    output = output_node(tree)
    for name in ("Displacement", "Volume") if output else ():
        if is_fed(output.inputs[name]):
            yield f"{output.bl_label}: {name}"


def listing(names: list[str], most: int = 3) -> str:
    """A list such as 'A, B, C and 4 more'."""
    shown = ", ".join(names[:most])
    return Message("{0} and {1} more", shown, len(names) - most) if len(names) > most else shown
