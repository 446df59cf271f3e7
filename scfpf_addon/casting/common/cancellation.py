# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that is given up in its middle: whatever a thread does, it ends at the next rays that it casts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock, local
from typing import Protocol


class Cancelled(Exception):
    """The thread's work is given up."""


class Signal(Protocol):
    """Says whether work is to be given up: an event, or what asks the user."""

    def is_set(self) -> bool:
        """Whether it is."""


class _Watched(local):
    """The signal that each thread looks at."""

    stop: Signal | None = None


_watched = _Watched()


@contextmanager
def cancelled_by(stop: Signal) -> Iterator[None]:
    """While this lasts ``raise_if_cancelled`` raises Cancelled in this thread once the signal is set."""
    before, _watched.stop = _watched.stop, stop
    try:
        yield
    finally:
        _watched.stop = before


class _Unstoppable:
    """How many threads are where they cannot stop."""

    def __init__(self) -> None:
        self.count, self.lock = 0, Lock()


_unstoppable = _Unstoppable()


@contextmanager
def uncancellable() -> Iterator[None]:
    """While this lasts there is work that does not end when it is to: Embree builds."""
    with _unstoppable.lock:
        _unstoppable.count += 1
    try:
        yield
    finally:
        with _unstoppable.lock:
            _unstoppable.count -= 1


def is_uncancellable() -> bool:
    """Whether any thread does such work."""
    return _unstoppable.count > 0


def raise_if_cancelled() -> None:
    """A place at which this thread's work may end: raises Cancelled if it is to."""
    stop = _watched.stop
    if stop is not None and stop.is_set():
        raise Cancelled
