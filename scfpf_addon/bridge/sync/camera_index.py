# SPDX-License-Identifier: GPL-3.0-or-later
"""Which flexible cameras an edit concerns, so that handlers need not look at all of them.

A table from objects to the cameras that have them, in session ids and names: no
references to Blender data are kept between two calls.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Set
from itertools import islice

import bpy

# Edits of these may change the image mappings of a camera that they do not belong to.
MAPPING_TYPES = ("IMAGE", "NODETREE")

_NONE: frozenset[int] = frozenset()


class CameraIndex:
    """Camera objects of the file as they were when ``fill`` was last called."""

    def __init__(self) -> None:
        self._names: dict[int, tuple[str, str | None]] = {}
        self._cameras: dict[int, set[int]] = {}
        self._by_name: dict[str, set[int]] = {}
        self._others: set[str] = set()
        self._mapped: set[int] = set()
        self._turn = 0

    def fill(self, cameras, members_of) -> None:
        """Take in all camera objects of the file. members_of(camera): the objects that it depends on."""
        self._names = {c.session_uid: (c.name, c.library.filepath if c.library else None) for c in cameras}
        table: defaultdict[int, set[int]] = defaultdict(set)
        names: defaultdict[str, set[int]] = defaultdict(set)
        for camera in cameras:
            for member in (camera, *members_of(camera)):
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
        """A camera of the table, or None if it is gone or has another name."""
        key = self._names.get(session_uid)
        found = None if key is None else bpy.data.objects.get(key)
        return found if found is not None and found.session_uid == session_uid else None

    def cameras(self) -> list[int]:
        """Session ids of all cameras of the table."""
        return list(self._names)

    def in_turn(self) -> set[int]:
        """The session id of one camera of the table, of each in turn; none of an empty table."""
        if not self._names:
            return set()
        self._turn = (self._turn + 1) % len(self._names)
        return {next(islice(self._names, self._turn, None))}

    def concerned(self, depsgraph) -> set[int]:
        """Session ids of the cameras that an evaluation's updates concern.

        Blender names all objects whose relations, place or shape were evaluated anew, the volume object
        of a camera with each of its surfaces; where anything is linked or unlinked, all objects of the scene.
        They are found by name: `.original` of what is not shown may be freed memory after an undo (5.2).
        """
        found: set[int] = set()
        if not self._names:
            return found
        if depsgraph.id_type_updated("OBJECT"):
            known = self._by_name
            names = {
                u.id.name: _is_flagless(u) for u in depsgraph.updates if isinstance(u.id, bpy.types.Object)
            }
            # Renaming and selecting raise no flag, so that a name may be another object's by now.
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
        """Note whose these names are, which the table does not have."""
        for obj in bpy.data.objects:
            if obj.session_uid in self._cameras and obj.name in names:
                self._by_name[obj.name] = self._cameras[obj.session_uid]
        self._others |= names.difference(self._by_name)


def _is_flagless(update) -> bool:
    return not (update.is_updated_geometry or update.is_updated_transform or update.is_updated_shading)
