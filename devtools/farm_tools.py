# SPDX-License-Identifier: GPL-3.0-or-later
"""The tools that the tests of render jobs run: an environment apart from Blender's, made on first use.

Only tests use them. They stay apart because they bring packages that Blender's Python has no need of.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pathlib
import subprocess
import sys
import tempfile

from . import environments
from .environments import FOLDER, REQUIREMENTS, Failure

NAME = "farm"


def python() -> str:
    """The interpreter of the environment, made or renewed if necessary. Raises Failure."""
    wanted = hashlib.sha256((REQUIREMENTS / f"{NAME}.txt").read_bytes()).hexdigest()
    # Named by what is in it: processes that make it at the same time make the same.
    folder = FOLDER / f"{NAME}-{sys.version_info[0]}.{sys.version_info[1]}-{wanted[:8]}"
    if not folder.is_dir():
        _make(folder)
    return str(_interpreter(folder))


def _interpreter(folder: pathlib.Path) -> pathlib.Path:
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _make(folder: pathlib.Path) -> None:
    """Make an environment beside its place, and move it there when it is complete. Raises Failure."""
    with tempfile.TemporaryDirectory(prefix=f".{NAME}-", dir=FOLDER, ignore_cleanup_errors=True) as scratch:
        part = pathlib.Path(scratch, "environment")
        install = [*environments.pip_install(), "-q", "-r", str(REQUIREMENTS / f"{NAME}.txt")]
        for command in ([sys.executable, "-m", "venv", str(part)], [str(_interpreter(part)), *install]):
            if subprocess.call(command) != 0:
                raise Failure(f"cannot make {folder} for the tests of render jobs: see above")
        # Another process was quicker if it is there.
        with contextlib.suppress(OSError):
            part.rename(folder)
    if not folder.is_dir():
        raise Failure(f"cannot move the environment for the tests of render jobs to {folder}")
