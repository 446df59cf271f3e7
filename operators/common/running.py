# SPDX-License-Identifier: GPL-3.0-or-later
"""The modal operators that run: Blender drops them without notice when the extension is disabled."""

from __future__ import annotations

from typing import NamedTuple

import bpy


class _Place(NamedTuple):
    """Addresses of the window, the area and the region that an operator was called in, 0 if absent."""

    window: int
    area: int
    region: int


_running: list[tuple[object, _Place]] = []


def _address(found) -> int:
    return 0 if found is None else found.as_pointer()


def begin(operator, context) -> None:
    """Note a modal operator that has begun. It calls ``end`` when it finishes and in ``cancel``."""
    place = _Place(_address(context.window), _address(context.area), _address(context.region))
    _running.append((operator, place))


def end(operator) -> None:
    """Note that a modal operator has ended; nothing happens if that is known."""
    _running[:] = [one for one in _running if one[0] is not operator]


def cancel_all() -> None:
    """Cancel all running operators, the latest first, in the windows that they were called in.

    The file may be changed, other than in ``cancel``: operators that then leave nothing have ``disable``.
    """
    while _running:
        operator, place = _running.pop()
        with _override(place):
            getattr(operator, "disable", operator.cancel)(bpy.context)


def _override(place: _Place):
    """The context of a place, as far as it still exists."""
    windows = bpy.context.window_manager.windows
    window = next((w for w in windows if w.as_pointer() == place.window), None)
    if window is None:
        return bpy.context.temp_override()
    area = next((a for a in window.screen.areas if a.as_pointer() == place.area), None)
    region = next((r for r in area.regions if r.as_pointer() == place.region), None) if area else None
    found = {"window": window, "area": area, "region": region}
    return bpy.context.temp_override(**{name: one for name, one in found.items() if one is not None})
