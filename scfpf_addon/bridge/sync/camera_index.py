# SPDX-License-Identifier: GPL-3.0-or-later
"""An index from objects to the cameras that use them, by which handlers find the cameras of an edit.

It holds session ids and names: no references to Blender data are kept between two calls.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Set
from itertools import islice

import bpy

from ..volume.volume_object import members

# Edits of these may change the image mappings of a camera that they do not belong to.
MAPPING_TYPES = ("IMAGE", "NODETREE")

_NONE: frozenset[int] = frozenset()


class CameraIndex:
    """The camera objects of the file at the last call of ``fill``."""

    def __init__(self) -> None:
        self._names: dict[int, tuple[str, str | None]] = {}
        self._cameras: dict[int, set[int]] = {}
        self._by_name: dict[str, set[int]] = {}
        self._others: set[str] = set()
        self._mapped: set[int] = set()
        self._turn = 0

    def fill(self, cameras) -> None:
        """Index the camera objects of the file by themselves, their volume objects, surfaces and grids."""
        self._names = {c.session_uid: (c.name, c.library.filepath if c.library else None) for c in cameras}
        table: defaultdict[int, set[int]] = defaultdict(set)
        names: defaultdict[str, set[int]] = defaultdict(set)
        for camera in cameras:
            for member in (camera, camera.scfpf.volume_object, *members(camera)):
                if member is not None:
                    table[member.session_uid].add(camera.session_uid)
                    names[member.name].add(camera.session_uid)
        self._cameras, self._by_name, self._others = dict(table), dict(names), set()
        self._mapped = {c.session_uid for c in cameras if len(c.scfpf.mappings)}

    def __len__(self) -> int:
        return len(self._names)

    def having(self, obj) -> Set[int]:
        """Session ids of the cameras that depend on an object."""
        return self._cameras.get(obj.session_uid, _NONE)

    def find(self, session_uid: int):
        """A camera of the index, or None if it is gone or renamed."""
        key = self._names.get(session_uid)
        found = None if key is None else bpy.data.objects.get(key)
        return found if found is not None and found.session_uid == session_uid else None

    def cameras(self) -> list[int]:
        """Session ids of all cameras of the index."""
        return list(self._names)

    def in_turn(self) -> set[int]:
        """The session id of the next camera in turn, in a set; an empty set for an empty index."""
        if not self._names:
            return set()
        self._turn = (self._turn + 1) % len(self._names)
        return {next(islice(self._names, self._turn, None))}

    def concerned(self, depsgraph) -> set[int]:
        """Session ids of the cameras that an evaluation's updates concern.

        Blender lists all objects whose relations, place or shape it has evaluated, and with each surface the
        camera's volume object. After linking or unlinking it lists all objects of the scene. They are looked
        up by name: `.original` of a hidden object may be freed memory after an undo (5.2).
        """
        found: set[int] = set()
        if not self._names:
            return found
        if depsgraph.id_type_updated("OBJECT"):
            known = self._by_name
            names = {
                u.id.name: _is_flagless(u) for u in depsgraph.updates if isinstance(u.id, bpy.types.Object)
            }
            # Renaming and selecting raise no flag: a known name may belong to another object.
            new = {
                n for n, flagless in names.items() if n not in known and (flagless or n not in self._others)
            }
            if new:
                self._learn(new)
            for name in names:
                found |= known.get(name, _NONE)
        if self._mapped and any(depsgraph.id_type_updated(kind) for kind in MAPPING_TYPES):
            found |= self._mapped
        return found

    def _learn(self, names: set[str]) -> None:
        """Add names that the index does not have to the objects that have them."""
        for obj in bpy.data.objects:
            if obj.session_uid in self._cameras and obj.name in names:
                self._by_name[obj.name] = self._cameras[obj.session_uid]
        self._others |= names.difference(self._by_name)


def _is_flagless(update) -> bool:
    return not (update.is_updated_geometry or update.is_updated_transform or update.is_updated_shading)
