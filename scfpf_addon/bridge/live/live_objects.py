# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects of a viewport's scene, read again only where an edit has changed them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import compress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.ray_visibility import CAMERA
from ...projection.typing import Array
from ...shading.live.live_scene import COLOR_LAYER
from ..scene.instances import Instance, copies_shown, instances
from ..scene.mesh_arrays import MeshArrays, of_mesh, read_mesh, without_slots
from ..scene.read_layers import read_layer
from ..scene.read_materials import unmet_slots, volume_only_materials
from ..scene.read_visibility import ObjectKey, ShownInRenders


class Attributes(NamedTuple):
    """The attributes of meshes that are read besides their shape."""

    uv: bool
    color: bool


class LookTable:
    """The numbers of objects and of looks in a scene; a number is never used again for something else.

    objects: by their numbers. look_object, look_slot: the object and the material slot of each look.
    """

    def __init__(self) -> None:
        self.objects: list[ObjectKey] = []
        self.look_object: list[int] = []
        self.look_slot: list[int] = []
        self._numbers: dict[ObjectKey, int] = {}
        self._first: dict[tuple[int, int], int] = {}

    def number(self, key: ObjectKey) -> int:
        """The number of an object."""
        number = self._numbers.setdefault(key, len(self.objects))
        if number == len(self.objects):
            self.objects.append(key)
        return number

    def layers(self, members: Mapping[int, int]) -> NDArray[np.uint8]:
        """The number of the image layer of each object, or of its instancer. members: by session id."""
        found = (key.image_layer(members) for key in self.objects)
        return np.fromiter(found, np.uint8, len(self.objects))

    def first_look(self, number: int, slots: int) -> int:
        """The first of the looks of an object with so many material slots, which are consecutive."""
        first = self._first.setdefault((number, slots), len(self.look_object))
        if first == len(self.look_object):
            self.look_object += [number] * slots
            self.look_slot += range(slots)
        return first


class MeshInstance(NamedTuple):
    """An instance of a mesh: its object's number, first look and number of looks, and its matrix (4, 4)."""

    mesh: MeshArrays
    number: int
    first_look: int
    looks: int
    matrix: Array

    def is_same(self, other: MeshInstance | None) -> bool:
        """Return whether another placement is the same triangles in the same place."""
        return (
            other is not None
            and self.mesh is other.mesh
            and self[1:4] == other[1:4]
            # A tenth of the time of NumPy's comparison.
            and self.matrix.tobytes() == other.matrix.tobytes()
        )


# Placements by object number and the numbers of the instance in its instancer.
Placements = dict[tuple[int, ...], MeshInstance]


class _KnownMesh(NamedTuple):
    """A mesh that has been read, and the names of the objects that had it.

    parts: without the faces of some material slots, by these and the number of slots.
    """

    arrays: MeshArrays
    owners: set[str]
    parts: dict[tuple[frozenset[int], int], MeshArrays]

    def part(self, hidden: frozenset[int], slots: int) -> MeshArrays:
        """The mesh without the faces of the slots ``hidden``."""
        if not hidden:
            return self.arrays
        key = hidden, slots
        if key not in self.parts:
            self.parts[key] = without_slots(self.arrays, hidden, slots)
        return self.parts[key]


class LiveObjects:
    """Reads the placements of a viewport's objects. Keeps arrays, names and session ids, no Blender data."""

    def __init__(self) -> None:
        self.table = LookTable()
        self.placements: Placements = {}
        # Full names of control surfaces and the like, which no image shows.
        self.left_out: set[str] = set()
        self._meshes: dict[int, _KnownMesh] = {}
        self._attributes = Attributes(False, False)
        self._stale: set[str] = set()
        self._all_stale = self._changed = True
        # The number of edits that have been noted.
        self.edits = 0
        self._volume_only: frozenset[int] = frozenset()

    def mark(self, names: set[str] | None) -> None:
        """Note objects whose meshes have changed, by their names; None for all."""
        self._changed = True
        self.edits += 1
        if names is None:
            self._all_stale = True
        else:
            self._stale |= names

    @property
    def has_other_surfaces(self) -> bool:
        """Return whether a material has lost or gained its surface since objects were read."""
        return self._volume_only != volume_only_materials()

    def read(self, depsgraph, space=None, attributes: Attributes | None = None) -> Placements:
        """The placements of the objects that a viewport and renders show.

        space: bpy.types.SpaceView3D, or None for all objects that viewports show. Raises UserError.
        """
        wanted = attributes or self._attributes
        if wanted != self._attributes:
            self._attributes, self._all_stale, self._changed = wanted, True, True
        if self._changed:
            self.placements = self._read(depsgraph, space)
            self._stale.clear()
            self._all_stale = self._changed = False
        return self.placements

    def _read(self, depsgraph, space) -> Placements:
        renders = ShownInRenders(depsgraph)
        self.left_out = renders.left_out
        self._volume_only = volume_only_materials()
        # By object and instancer: their number, -1 for those that the viewport does not show.
        numbers: dict[ObjectKey, int] = {}
        # By number and address of the mesh: the mesh without the faces that no ray meets.
        parts: dict[tuple[int, int], tuple[MeshArrays, int, int]] = {}
        fresh: dict[int, _KnownMesh] = {}
        found: list[tuple[tuple[int, ...], MeshInstance] | None] = []
        meshes, matrices = [], []
        for instance in instances(depsgraph, {"MESH"}, renders):
            key, address, matrix = instance.key, instance.data, instance.matrix
            # Hidden from the camera only, it still shares its mesh.
            meshes.append(address)
            matrices.append(matrix)
            number = numbers.get(key)
            if number is None:
                is_shown = instance.rays & CAMERA and _is_in_viewport(instance.owner, space)
                number = numbers[key] = self.table.number(key) if is_shown else -1
            if number < 0:
                found.append(None)
                continue
            part = parts.get((number, address))
            if part is None:
                part = parts[number, address] = self._part(instance, number, address, fresh)
            found.append(((number, *instance.numbers), MeshInstance(part[0], number, *part[1:], matrix)))
        self._meshes = fresh
        shown = compress(found, copies_shown(meshes, matrices))
        return {
            key: old if (old := self.placements.get(key)) and old.is_same(new) else new
            for key, new in filter(None, shown)
            if len(new.mesh.triangles)
        }

    def _part(
        self, instance: Instance, number: int, address: int, fresh: dict[int, _KnownMesh]
    ) -> tuple[MeshArrays, int, int]:
        """The mesh that rays meet of an object with a number, the first and the number of its looks."""
        slots = max(len(instance.obj.material_slots), 1)
        hidden = unmet_slots(instance.obj, self._volume_only)
        mesh = self._mesh(instance, address, fresh).part(hidden, slots)
        return mesh, self.table.first_look(number, slots), slots

    def _mesh(self, instance: Instance, address: int, fresh: dict[int, _KnownMesh]) -> _KnownMesh:
        """An instance's mesh. fresh: the meshes of this reading, by their addresses."""
        owners = {instance.obj.original.name, instance.owner.name}
        if address in fresh:
            fresh[address].owners.update(owners)
            return fresh[address]
        known = self._meshes.get(address)
        is_known = known is not None and not known.owners.isdisjoint(owners)
        # Another mesh may have taken the place of one that is gone; then its object has been evaluated.
        if known is None or not is_known or self._all_stale or not self._stale.isdisjoint(owners):
            arrays = of_mesh(instance.obj, self._read_mesh)
            same = known is not None and _is_equal(known.arrays, arrays)
            known = known if known is not None and same else _KnownMesh(arrays, set(), {})
            known = known._replace(owners=set(owners))
        fresh[address] = known
        known.owners.update(owners)
        return known

    def _read_mesh(self, mesh) -> MeshArrays:
        arrays = read_mesh(mesh, self._attributes.uv)
        if self._attributes.color:
            active = mesh.color_attributes.active_color
            values = None if active is None else read_layer(mesh, f"{COLOR_LAYER}{active.name}")
            if values is not None:
                arrays.layers[COLOR_LAYER] = values if arrays.kept is None else values[arrays.kept]
        return arrays


def _is_in_viewport(top, space) -> bool:
    """Return whether a viewport shows an object: local view and local collections may leave it out."""
    return space is None or top.visible_in_viewport_get(space)


def _is_equal(one: MeshArrays, other: MeshArrays) -> bool:
    """Return whether two readings of a mesh are equal."""
    names = ("vertices", "triangles", "normals", "slot", "uv")
    return one.layers.keys() == other.layers.keys() and all(
        _same(a, b)
        for a, b in (
            *((getattr(one, name), getattr(other, name)) for name in names),
            *((one.layers[name], other.layers[name]) for name in one.layers),
        )
    )


def _same(one: NDArray | None, other: NDArray | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))
