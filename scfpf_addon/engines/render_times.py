# SPDX-License-Identifier: GPL-3.0-or-later
"""The times of engines' renders, from which the time of others is estimated: files keep them as text."""

from __future__ import annotations

import json
from typing import NamedTuple


class TakenTime(NamedTuple):
    """The time of some renders. pixels: of all of them."""

    renders: int = 0
    pixels: int = 0
    seconds: float = 0.0


# Those of the last picture in this session, by the identifier of the engine.
_last: dict[str, TakenTime] = {}


def note_time(engine: str, taken: TakenTime) -> None:
    """Note the time that a picture's renders took."""
    if taken.renders:
        _last[engine] = taken


def times_text(text: str) -> str:
    """The times as text, with those of an earlier text for engines that have not rendered in this session."""
    return json.dumps(_times(text) | _last)


def estimated_seconds(engine: str, renders: int, pixels: float, text: str = "") -> float | None:
    """The seconds that so many renders will take, or None before the first ones.

    Half by their number, half by their pixels: small renders have fixed costs. text: see ``times_text``, for
    engines that have not rendered in this session.
    """
    before = (_times(text) | _last).get(engine)
    if before is None:
        return None
    return 0.5 * before.seconds * (renders / before.renders + pixels / before.pixels)


def _times(text: str) -> dict[str, TakenTime]:
    """The times of a text, {} if it holds none."""
    try:
        found = {name: TakenTime(int(a), int(b), float(c)) for name, (a, b, c) in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError):
        return {}
    return {name: each for name, each in found.items() if each.renders > 0 and each.pixels > 0}
