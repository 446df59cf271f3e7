# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancellation of a thread's work: it ends at the next rays that the thread casts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock, local
from typing import NamedTuple, Protocol


class Cancelled(Exception):
    """The thread's work has been cancelled."""


class Signal(Protocol):
    """A cancellation signal: an event, or an object that asks the user."""

    def is_set(self) -> bool:
        """Return whether the work is cancelled."""


class _ThreadSignal(local):
    """The cancellation signal of each thread."""

    signal: Signal | None = None


_watched = _ThreadSignal()


@contextmanager
def cancelled_by(signal: Signal) -> Iterator[None]:
    """Within this context ``raise_if_cancelled`` raises Cancelled in this thread once the signal is set."""
    before, _watched.signal = _watched.signal, signal
    try:
        yield
    finally:
        _watched.signal = before


class _AnyOf(NamedTuple):
    """A signal that is set once one of others is."""

    signals: tuple[Signal, ...]

    def is_set(self) -> bool:
        """Return whether the work is cancelled."""
        return any(signal.is_set() for signal in self.signals)


@contextmanager
def also_cancelled_by(signal: Signal) -> Iterator[None]:
    """Within this context work is cancelled by the signal, and still by that of the context around it."""
    around = _watched.signal
    with cancelled_by(signal if around is None else _AnyOf((around, signal))):
        yield


class _Uncancellable:
    """The number of threads whose work cannot be cancelled at the moment."""

    def __init__(self) -> None:
        self.count, self.lock = 0, Lock()


_working = _Uncancellable()


@contextmanager
def uncancellable() -> Iterator[None]:
    """Within this context the thread cannot be cancelled, because Embree builds."""
    with _working.lock:
        _working.count += 1
    try:
        yield
    finally:
        with _working.lock:
            _working.count -= 1


def is_uncancellable() -> bool:
    """Return whether the work of any thread cannot be cancelled at the moment."""
    return _working.count > 0


def raise_if_cancelled() -> None:
    """Raise Cancelled if this thread's work has been cancelled."""
    signal = _watched.signal
    if signal is not None and signal.is_set():
        raise Cancelled
