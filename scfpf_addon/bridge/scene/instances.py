# SPDX-License-Identifier: GPL-3.0-or-later
"""The one stream of a depsgraph's instances, from which every reader of a scene takes those that it needs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...casting.common.ray_visibility import EVERYWHERE
from ...projection.typing import Array
from .mesh_arrays import LARGEST_COORDINATE, of_mesh
from .read_visibility import ObjectKey, ShownInRenders, flattened_copies

# Types of objects that show nothing to rays, but may instance objects that do.
SHAPELESS = {"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT_PROBE", "SPEAKER"}
# Types of objects that are no things: lamps are seen, too, but only as light.
NO_THINGS = SHAPELESS | {"LIGHT"}

Read = TypeVar("Read")


class Instance:
    """An entry of ``depsgraph.object_instances``, valid until the stream goes on: keep no reference to it.

    obj: the evaluated object. key: of it and its instancer. rays: its ray visibility, EVERYWHERE if that is
    not asked for.
    """

    __slots__ = ("_entry", "key", "obj", "rays")

    def __init__(self, entry, obj, key: ObjectKey, rays: int) -> None:
        self._entry, self.obj, self.key, self.rays = entry, obj, key, rays

    @property
    def parent(self):
        """The evaluated object that instances this one, or None."""
        return self._entry.parent

    @property
    def owner(self):
        """The original of the instancer, or of the object itself if nothing instances it."""
        return (self._entry.parent or self.obj).original

    @property
    def matrix(self) -> Array:
        """The transform to world space, (4, 4)."""
        return np.array(self._entry.matrix_world, np.float64)

    @property
    def data(self) -> int:
        """The address of the evaluated data, 0 without any: instances of one mesh share it."""
        data = self.obj.data
        return data.as_pointer() if data else 0

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the instance in its instancer, the same at all times; empty without an instancer."""
        return tuple(self._entry.persistent_id) if self._entry.is_instance else ()


def instances(
    depsgraph, types: Collection[str] | None = None, renders: ShownInRenders | None = None
) -> Iterator[Instance]:
    """Each instance of a depsgraph, and each object that nothing instances, in an order that stays the same.

    types: of the objects, None for all. renders: None for all that the depsgraph evaluates, or only those
    that some ray of a render meets.
    """
    # Of instanced objects, by session ids of object and instancer. Their data may differ.
    known: dict[tuple[int, int], tuple[ObjectKey, int]] = {}
    names: dict[int, str] = {}
    for entry in depsgraph.object_instances:
        obj = entry.object
        if types is not None and obj.type not in types:
            continue
        own, parent = obj.original, entry.parent
        uid = own.session_uid
        if parent is None:
            name = own.name_full
            key = ObjectKey(uid, name, uid, name)
            rays = EVERYWHERE if renders is None else renders.rays(obj, None, key)
        else:
            owner = parent.original
            uids = uid, owner.session_uid
            if uids not in known:
                for one, each in zip(uids, (own, owner), strict=True):
                    if one not in names:
                        names[one] = each.name_full
                key = ObjectKey(uid, names[uid], uids[1], names[uids[1]])
                known[uids] = key, EVERYWHERE if renders is None else renders.rays(obj, parent, key)
            key, rays = known[uids]
        if rays:
            yield Instance(entry, obj, key, rays)


def has_type(depsgraph, kind: str) -> bool:
    """Return whether a depsgraph evaluates an object of a type."""
    return any(True for _ in instances(depsgraph, {kind}))


def copies_shown(meshes: Sequence[int], matrices: Sequence[Array]) -> NDArray[np.bool_]:
    """Return which instances of meshes renders show, (N,): those with finite transforms.

    Copies of a mesh that their transforms flatten are left out. meshes: a number or an address of the mesh of
    each instance that any ray meets. matrices: (N, 4, 4).
    """
    mesh = np.unique(np.array(meshes, np.int64), return_inverse=True)[1]
    matrix = np.array(matrices).reshape(-1, 4, 4)
    shown = is_finite(matrix)
    finite = np.flatnonzero(shown)
    shown[finite[flattened_copies(mesh[finite], matrix[finite])]] = False
    return shown


def is_finite(matrix: Array) -> NDArray[np.bool_]:
    """Return whether all values of matrices (..., 4, 4) are numbers that can be computed with, (...)."""
    finite: NDArray[np.bool_] = (np.abs(matrix) <= LARGEST_COORDINATE).all(axis=(-2, -1))
    return finite


class MeshTable(Generic[Read]):
    """Evaluated meshes, each read once for all instances that share it. rows: by their numbers."""

    def __init__(self, read: Callable[..., Read]) -> None:
        """read: of a bpy.types.Mesh."""
        self.rows: list[Read] = []
        self._read = read
        self._numbers: dict[int, int] = {}

    def number(self, instance: Instance) -> int:
        """The number of an instance's mesh."""
        number = self._numbers.setdefault(instance.data, len(self.rows))
        if number == len(self.rows):
            self.rows.append(of_mesh(instance.obj, self._read))
        return number

    def of(self, instance: Instance) -> Read:
        """The row of an instance's mesh."""
        return self.rows[self.number(instance)]
