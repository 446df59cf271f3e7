# SPDX-License-Identifier: GPL-3.0-or-later
"""The times of an engine's renders in this session, from which the time of others is estimated."""

from __future__ import annotations

from typing import NamedTuple


class TakenTime(NamedTuple):
    """The time of some renders. pixels: of all of them."""

    renders: int = 0
    pixels: int = 0
    seconds: float = 0.0


# Those of the last picture, by the identifier of the engine.
_last: dict[str, TakenTime] = {}


def note_time(engine: str, taken: TakenTime) -> None:
    """Note the time that a picture's renders took."""
    if taken.renders:
        _last[engine] = taken


def estimated_seconds(engine: str, renders: int, pixels: float) -> float | None:
    """The seconds that so many renders will take, or None before the first ones.

    Half by their number, half by their pixels: small renders have fixed costs.
    """
    if engine not in _last:
        return None
    before = _last[engine]
    return 0.5 * before.seconds * (renders / before.renders + pixels / before.pixels)
