# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials of a scene: constants, or a graph if they are more than that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.typing import Array
from ...projection.user_error import Message
from ...shading.materials.constants import Materials
from ...shading.nodes.graph import MaterialGraph
from ..blender import versions
from ..blender.shader_nodes import (
    color_input,
    constant_glow,
    is_fed,
    output_node,
    output_shaders,
    value_input,
)
from .read_graph import GraphReading, read_graph

# Reflectance at normal incidence of the default specular level ½ at IOR 1.5.
DEFAULT_F0 = 0.04
# The name of faces without a material in cryptomattes, as in Cycles.
NO_MATERIAL = "default_surface"


@dataclass(frozen=True)
class MaterialConstants:
    """The constants of a material, scene-linear. base_color, emission: (3,). grazing: see ``Materials``."""

    base_color: Array
    metallic: float = 0.0
    roughness: float = 0.5
    specular_f0: float = DEFAULT_F0
    emission: Array | tuple = (0.0, 0.0, 0.0)
    grazing: float = 1.0


# The material of faces without one, and one without a surface, as in Cycles and EEVEE.
DEFAULT_GREY = MaterialConstants(np.full(3, 0.8))
BLACK = MaterialConstants(np.zeros(3), roughness=1.0, specular_f0=0.0)


class MaterialTable:
    """The materials of a scene, each read once. Number 0 is the default grey.

    unmet: the numbers of those that no ray meets, see ``GraphReading``.
    """

    def __init__(self) -> None:
        self._rows = [DEFAULT_GREY]
        self.pass_indices = [0]
        self.names = [NO_MATERIAL]
        self._numbers: dict[int, int] = {}
        self._notes: dict[str, list[str]] = {}
        self.graphs: dict[int, MaterialGraph] = {}
        self.unmet: set[int] = set()

    def number(self, material) -> int:
        """The number of an evaluated material, or of None."""
        if material is None:
            return 0
        key = material.as_pointer()
        if key not in self._numbers:
            number = self._numbers[key] = len(self._rows)
            constants, is_complete = read_material(material)
            if versions.uses_nodes(material):
                reading = read_graph(material.node_tree)
                self._note(material, reading)
                if reading.graph is None:
                    constants = BLACK
                elif not (reading.plain and is_complete):
                    self.graphs[number] = reading.graph
                if reading.volume_only:
                    self.unmet.add(number)
            self._rows.append(constants)
            self.pass_indices.append(material.pass_index)
            self.names.append(material.name)
        return self._numbers[key]

    def _note(self, material, reading: GraphReading) -> None:
        """Note the parts of a material that images do not show."""
        for note in (*reading.notes, *_unshown(material.node_tree)):
            self._notes.setdefault(note, []).append(material.name)

    def materials(self) -> Materials:
        """All materials as arrays, with colours and values in their allowed ranges."""
        columns = {
            name: np.nan_to_num(np.array([getattr(row, name) for row in self._rows], np.float64))
            for name in ("base_color", "metallic", "roughness", "specular_f0", "emission", "grazing")
        }
        for name in ("metallic", "roughness", "specular_f0"):
            columns[name] = columns[name].clip(0.0, 1.0)
        columns["base_color"] = columns["base_color"].clip(0.0)
        return Materials(**columns, graphs=self.graphs)

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


def unmet_slots(obj) -> frozenset[int]:
    """The material slots of an object whose faces no ray meets."""
    slots = obj.material_slots
    return frozenset(n for n, slot in enumerate(slots) if is_volume_only(slot.material))


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


def read_material(material) -> tuple[MaterialConstants, bool]:
    """The constants of an evaluated material, and whether the material is no more than these.

    They come from the first Principled BSDF behind the active output, through groups, Mix and Add nodes;
    without one from the first Diffuse, Glossy or Emission. A colour in the place of a shader glows. An input
    that a texture feeds, and a material of other shaders, takes the viewport display's colour, metallic and
    roughness. A material without nodes is diffuse, in the viewport display's colour, as in Cycles.
    """
    viewport = MaterialConstants(
        np.array(material.diffuse_color[:3], np.float64), material.metallic, material.roughness
    )
    if not versions.uses_nodes(material):
        return MaterialConstants(viewport.base_color, roughness=1.0, specular_f0=0.0), True
    glow = constant_glow(material.node_tree)
    if glow is not None:
        return MaterialConstants(np.zeros(3), specular_f0=0.0, emission=glow), True
    shaders = list(output_shaders(material.node_tree))
    for kind, read in READERS.items():
        for node, groups in shaders:
            if node.type == kind:
                inputs = _Inputs(node, groups, viewport)
                return read(inputs), inputs.is_complete
    return viewport, False


class _Inputs:
    """A shader node's inputs, with the viewport's values for those that are not constant."""

    def __init__(self, node, groups: tuple, viewport: MaterialConstants) -> None:
        self._node = node
        self._groups = groups
        self.viewport = viewport
        self.is_complete = True

    def color(self, name: str) -> Array:
        return self._or(color_input(self._node, self._groups, name), self.viewport.base_color)

    def value(self, name: str, otherwise: float) -> float:
        return self._or(value_input(self._node, self._groups, name), otherwise)

    def _or(self, found, otherwise):
        self.is_complete = self.is_complete and found is not None
        return otherwise if found is None else found


def _principled(inputs: _Inputs) -> MaterialConstants:
    ior = inputs.value("IOR", 1.5)
    # Cycles scales the Fresnel reflectance of the IOR by twice the specular level.
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2 * 2.0 * inputs.value("Specular IOR Level", 0.5)
    strength = inputs.value("Emission Strength", 1.0)
    return MaterialConstants(
        inputs.color("Base Color"),
        inputs.value("Metallic", inputs.viewport.metallic),
        inputs.value("Roughness", inputs.viewport.roughness),
        f0,
        inputs.color("Emission Color") * strength if strength else np.zeros(3),
    )


def _diffuse(inputs: _Inputs) -> MaterialConstants:
    return MaterialConstants(inputs.color("Color"), roughness=1.0, specular_f0=0.0)


def _glossy(inputs: _Inputs) -> MaterialConstants:
    roughness = inputs.value("Roughness", inputs.viewport.roughness)
    return MaterialConstants(inputs.color("Color"), metallic=1.0, roughness=roughness, grazing=0.0)


def _emission(inputs: _Inputs) -> MaterialConstants:
    light = inputs.color("Color") * inputs.value("Strength", 1.0)
    return MaterialConstants(np.zeros(3), specular_f0=0.0, emission=light)


# In the order of preference when a material mixes several.
READERS = {
    "BSDF_PRINCIPLED": _principled,
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_GLOSSY": _glossy,
    "EMISSION": _emission,
}
