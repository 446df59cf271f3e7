# SPDX-License-Identifier: GPL-3.0-or-later
"""Available and peak memory, with a stand-in for Windows that fills its documented structures."""

import ctypes
import struct
import sys

import numpy as np
import pytest

from scfpf_addon.casting.common import memory
from scfpf_addon.casting.common.memory import available_memory, peak_memory


class Kernel:
    """The functions of kernel32.dll; they write the bytes that Windows documents for 64 bits."""

    def __init__(self, answers=1):
        self.answers = answers

        class GetCurrentProcess:
            restype = None

            def __call__(self):
                return 2**64 - 1

        self.GetCurrentProcess = GetCurrentProcess()

    def GlobalMemoryStatusEx(self, status):
        """DWORD length, load; DWORDLONG total, available, then five more."""
        address = ctypes.addressof(status._obj)
        assert struct.unpack("<I", ctypes.string_at(address, 4)) == (64,) == (ctypes.sizeof(status._obj),)
        ctypes.memmove(address, struct.pack("<2I7Q", 64, 25, 16 << 30, 12 << 30, *range(5)), 64)
        return self.answers

    def K32GetProcessMemoryInfo(self, process, counters, size):
        """DWORD length, faults; SIZE_T peak working set, working set, then six more."""
        assert self.GetCurrentProcess.restype is ctypes.c_void_p and process.value == 2**64 - 1
        address = ctypes.addressof(counters._obj)
        assert size == 72 == ctypes.sizeof(counters._obj)
        ctypes.memmove(address, struct.pack("<2I8Q", 72, 7, 5_000_000_000, 1, *range(6)), 72)
        return self.answers


def test_memory_is_told():
    held = np.ones(30_000_000)
    assert peak_memory() > held.nbytes
    assert available_memory() is None or available_memory() > 0


@pytest.mark.parametrize(("answers", "available", "peak"), [(1, 12 << 30, 5_000_000_000), (0, None, 0)])
def test_windows_is_asked_as_it_documents(monkeypatch, answers, available, peak):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(memory, "_kernel", lambda: Kernel(answers))
    assert available_memory() == available
    assert peak_memory() == peak
