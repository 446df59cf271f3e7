# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory of the system: how much is available, and the peak of this process."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any


class MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API, in types of fixed size, so that tests run on other systems."""

    _fields_ = (
        ("length", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("total", "available", "a", "b", "c", "d", "e")),
    )


class MemoryCounters(ctypes.Structure):
    """PROCESS_MEMORY_COUNTERS of the 64-bit Windows API."""

    _fields_ = (
        ("length", ctypes.c_uint32),
        ("faults", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("peak", "now", "a", "b", "c", "d", "e", "f")),
    )


def available_memory() -> int | None:
    """Return the bytes that can be allocated without swapping, or None if unknown.

    Windows: GlobalMemoryStatusEx. Linux: MemAvailable. Elsewhere: all memory of the machine.
    """
    if sys.platform == "win32":
        return windows_available(_kernel())
    table = Path("/proc/meminfo")
    if table.exists():
        for line in table.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def shortage(needed: float) -> tuple[str, str] | None:
    """Return the bytes needed and available as text for a message, or None if they suffice or are unknown."""
    free = available_memory()
    return None if free is None or needed <= free else (f"{needed / 1e9:.1f} GB", f"{free / 1e9:.1f} GB")


def peak_memory() -> int:
    """Return the most bytes that this process has held at one time since it began; 0 if unknown."""
    if sys.platform == "win32":
        return windows_peak(_kernel())
    import resource  # not on Windows

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def windows_available(kernel: Any) -> int | None:
    """Ask kernel32.dll for the available memory, in bytes; None if it does not tell."""
    status = MemoryStatus(length=ctypes.sizeof(MemoryStatus))
    return int(status.available) if kernel.GlobalMemoryStatusEx(ctypes.byref(status)) else None


def windows_peak(kernel: Any) -> int:
    """Ask kernel32.dll for the peak memory of this process, in bytes; 0 if it does not tell."""
    counters = MemoryCounters(length=ctypes.sizeof(MemoryCounters))
    kernel.GetCurrentProcess.restype = ctypes.c_void_p
    process = ctypes.c_void_p(kernel.GetCurrentProcess())
    known = kernel.K32GetProcessMemoryInfo(process, ctypes.byref(counters), counters.length)
    return int(counters.peak) if known else 0


def _kernel() -> Any:
    return getattr(ctypes, "windll").kernel32  # noqa: B009 - typed on Windows only
