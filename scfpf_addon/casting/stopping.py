# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that is given up in its middle: whatever a thread does, it ends at the next rays that it casts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, local


class Stopped(Exception):
    """The thread's work is given up."""


class _Watched(local):
    """The event that each thread looks at."""

    stop: Event | None = None


_watched = _Watched()


@contextmanager
def watching(stop: Event) -> Iterator[None]:
    """While this lasts ``stop_here`` raises Stopped in this thread once the event is set."""
    _watched.stop = stop
    try:
        yield
    finally:
        _watched.stop = None


def stop_here() -> None:
    """A place at which this thread's work may end: raises Stopped if it is to."""
    stop = _watched.stop
    if stop is not None and stop.is_set():
        raise Stopped
