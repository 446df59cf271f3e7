# SPDX-License-Identifier: GPL-3.0-or-later
"""All or nothing: after an error the datablocks that a block has made go, and values that it has set return.

What a block deletes cannot return, so it deletes last. An edit that does not know whether it runs in a block
keeps what it changes by ``keep``, ``keep_whole`` and ``way_back``, and deletes by ``at_end``.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from operator import itemgetter

import bpy
from mathutils import Matrix

# The collection of bpy.data whose members no block makes. Members of collections without ``remove`` belong to
# windows or to other datablocks.
LIBRARIES = "libraries"
# The add-on's own custom properties begin so.
OWN_KEYS = "scfpf_"

# Properties that place an object.
PLACE = (
    "location",
    "rotation_mode",
    "rotation_euler",
    "rotation_quaternion",
    "rotation_axis_angle",
    "scale",
)

# The names of the datablocks that each block in progress has found, by session id.
_found: list[dict[int, str]] = []
# What is done at the end of the outermost block if it does not raise, and whether after all other endings.
_endings: list[tuple[bool, Callable[[], object]]] = []


class Kept(ExitStack):
    """The way back of a block: values that it keeps and callbacks, taken in reverse order if it raises."""

    def keep(self, owner, *names: str) -> None:
        """Keep properties of an RNA struct; all that can be set, with lists of groups, if none is named."""
        if not names:
            self.take_back(_set_all, owner, _all_values(owner))
        for name in names:
            value = _plain(getattr(owner, name))
            self.take_back(_set if owner.is_property_set(name) else _unset, owner, name, value)

    def keep_keys(self, datablock) -> None:
        """Keep the add-on's custom properties of a datablock."""
        self.take_back(_set_keys, datablock, _own_keys(datablock))

    def take_back(self, function: Callable, *args: object) -> None:
        """Have a function called with arguments, unless a datablock among them has been removed by then."""
        structs = [each for each in args if isinstance(each, bpy.types.bpy_struct)]
        self.callback(_unless_gone, [each.id_data for each in structs], function, *args)


# The ways back that edits within each block in progress have noted.
_edits: list[Kept] = []


@contextmanager
def all_or_nothing() -> Iterator[Kept]:
    """Remove the datablocks that the block has made, and take its way back, if it raises."""
    names, first, depth = _present_names(), len(_endings), len(_edits)
    _found.append(names)
    _edits.append(Kept())
    try:
        with ExitStack() as last:
            last.callback(_restore_datablocks, names)
            with Kept() as kept, _edits[depth] as edits:
                try:
                    yield kept
                except BaseException:
                    # What the way back sets is not kept.
                    _edits[depth] = Kept()
                    raise
                for done in (kept.pop_all(), edits.pop_all()):
                    if depth:
                        # The block around this one may still raise.
                        _edits[depth - 1].callback(done.close)
            last.pop_all()
    except BaseException:
        del _endings[first:]
        raise
    finally:
        _found[:] = [other for other in _found if other is not names]
        del _edits[depth:]
    if not depth:
        _end_all()


def _end_all() -> None:
    endings, _endings[:] = _endings[:], []
    for _last, ending in sorted(endings, key=itemgetter(0)):
        try:
            ending()
        except Exception:
            # The edit is done. What is left over is used by nothing.
            traceback.print_exc()


def way_back(function: Callable, *args: object) -> None:
    """Have a function called with arguments if the block in progress raises; nothing without a block.

    It is not called if the datablock of one of the arguments has been removed by then.
    """
    if _edits:
        _edits[-1].take_back(function, *args)


def keep(owner, *names: str) -> None:
    """Keep properties of an RNA struct in the block in progress, see ``Kept.keep``."""
    if _edits:
        _edits[-1].keep(owner, *names)


def keep_whole(datablock) -> None:
    """Keep a datablock, all of it, in the block in progress: a copy takes its place if the block raises.

    The copy is removed at the end, after which Blender sorts the whole scene for evaluation anew.
    """
    if _edits:
        backup = datablock.copy()
        way_back(put_back, backup, datablock)
        at_end(bpy.data.batch_remove, [backup])


def at_end(function: Callable, *args: object, last: bool = False) -> None:
    """Call a function with arguments at the end of the outermost block in progress, at once without one.

    It deletes what the edit has left unused: if it raises, the edit is done all the same. last: call it
    when all that is unused has been deleted.
    """
    if _edits:
        _endings.append((last, partial(function, *args)))
    else:
        function(*args)


def put_back(backup, datablock) -> None:
    """Put a backup in the place of a datablock, on the way back of a block.

    The blocks around it, which have found the datablock, then take the backup for it.
    """
    uid, name, keys = datablock.session_uid, datablock.name, getattr(datablock, "shape_keys", None)
    keys_name = "" if keys is None else keys.name
    datablock.user_remap(backup)
    if datablock.users > datablock.use_fake_user:
        # An object in Edit Mode keeps its data, and would be deleted with them.
        return
    for names in _found:
        if uid in names:
            names[backup.session_uid] = names.pop(uid)
    bpy.data.batch_remove([datablock])
    backup.name = name
    if getattr(backup, "shape_keys", None) is not None and keys_name:
        backup.shape_keys.name = keys_name


def _datablocks() -> Iterator[bpy.types.ID]:
    for prop in bpy.data.bl_rna.properties:
        members = getattr(bpy.data, prop.identifier)
        if prop.type == "COLLECTION" and hasattr(members, "remove") and prop.identifier != LIBRARIES:
            yield from members


def _present_names() -> dict[int, str]:
    return {datablock.session_uid: datablock.name for datablock in _datablocks()}


def _restore_datablocks(names: dict[int, str]) -> None:
    """Remove the datablocks without a session id in ``names``, and give the others their names."""
    new = [datablock for datablock in _datablocks() if datablock.session_uid not in names]
    scenes = [datablock for datablock in new if isinstance(datablock, bpy.types.Scene)]
    for scene in scenes:
        bpy.data.scenes.remove(scene)
    bpy.data.batch_remove([datablock for datablock in new if datablock not in scenes])
    for datablock in _datablocks():
        if datablock.is_editable and datablock.name != names[datablock.session_uid]:
            datablock.name = names[datablock.session_uid]


def _all_values(owner) -> dict[str, object]:
    """The values of an RNA struct's properties that can be set, and the members of its lists."""
    values: dict[str, object] = {}
    for prop in owner.bl_rna.properties:
        if prop.identifier == "rna_type":
            continue
        value = getattr(owner, prop.identifier)
        if prop.type == "COLLECTION":
            if prop.fixed_type.base == bpy.types.PropertyGroup.bl_rna:
                values[prop.identifier] = [_all_values(item) for item in value]
        elif isinstance(value, bpy.types.PropertyGroup):
            values[prop.identifier] = _all_values(value)
        elif not prop.is_readonly:
            values[prop.identifier] = _plain(value)
    return values


def _plain(value):
    """A value that does not follow its property."""
    if isinstance(value, Matrix):
        return value.copy()  # its rows would follow
    is_array = hasattr(value, "__len__") and not isinstance(value, (str, bpy.types.bpy_struct))
    return tuple(value) if is_array else value


def _unless_gone(datablocks: list, function: Callable, *args: object) -> None:
    """Call a function, unless one of some datablocks has been removed, as temporary ones are.

    What was kept of such has gone with it: its memory must not be touched. None stands for no datablock.
    """
    try:
        for datablock in filter(None, datablocks):
            _ = datablock.session_uid
    except ReferenceError:
        return
    function(*args)


def _set_all(owner, values: dict[str, object]) -> None:
    # Pointers first: kinds and names may have to fit them.
    for name in sorted(values, key=lambda name: owner.bl_rna.properties[name].type != "POINTER"):
        value = values[name]
        if isinstance(value, dict):
            _set_all(getattr(owner, name), value)
        elif isinstance(value, list):
            items = getattr(owner, name)
            while len(items) > len(value):
                items.remove(len(items) - 1)
            while len(items) < len(value):
                items.add()
            for item, own in zip(items, value, strict=True):
                _set_all(item, own)
        else:
            _set(owner, name, value)


def _set(owner, name: str, value) -> None:
    """Set a property that differs: setting one tells handlers of a change."""
    if _plain(getattr(owner, name)) != value:
        setattr(owner, name, value)


def _unset(owner, name: str, value) -> None:
    """Set back a property that had its default."""
    if owner.is_property_set(name):
        _set(owner, name, value)
        owner.property_unset(name)


def _own_keys(owner) -> dict[str, object]:
    return {key: _plain(owner[key]) for key in owner.keys() if key.startswith(OWN_KEYS)}


def _set_keys(owner, values: dict[str, object]) -> None:
    for key in _own_keys(owner).keys() - values.keys():
        del owner[key]
    for key, value in values.items():
        if key not in owner or _plain(owner[key]) != value:
            owner[key] = value
