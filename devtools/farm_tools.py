# SPDX-License-Identifier: GPL-3.0-or-later
"""The tools that the tests of render jobs run: an environment apart from Blender's, made on first use.

Only tests use them. They stay apart because they bring packages that Blender's Python has no need of.
"""

from __future__ import annotations

import hashlib
import os
import pathlib
import shutil
import subprocess
import sys

from . import environments
from .environments import FOLDER, REQUIREMENTS, STAMP, Failure

NAME = "farm"


def python() -> str:
    """The interpreter of the environment, made or renewed if necessary. Raises Failure."""
    wanted = (REQUIREMENTS / f"{NAME}.txt").read_bytes()
    folder = FOLDER / f"{NAME}-{sys.version_info[0]}.{sys.version_info[1]}"
    interpreter = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    stamp, digest = folder / STAMP, hashlib.sha256(wanted).hexdigest()
    if not (stamp.is_file() and stamp.read_text(encoding="utf-8") == digest):
        _make(folder, interpreter)
        stamp.write_text(digest, encoding="utf-8")
    return str(interpreter)


def _make(folder: pathlib.Path, interpreter: pathlib.Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    install = [str(interpreter), *environments.pip_install(), "-q", "-r", str(REQUIREMENTS / f"{NAME}.txt")]
    for command in ([sys.executable, "-m", "venv", str(folder)], install):
        if subprocess.call(command) != 0:
            raise Failure(f"cannot make {folder} for the tests of render jobs: see above")
