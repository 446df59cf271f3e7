# SPDX-License-Identifier: GPL-3.0-or-later
"""Find a CPython of a given version: the running one, on PATH, the Windows launcher, pyenv."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
from collections.abc import Iterator
from typing import NamedTuple

WINDOWS = os.name == "nt"
# A pyenv shim or a store stub answers at once; after a minute the command waits for input.
PROBE_SECONDS = 60

PROBE = """
import json, platform, sys, sysconfig
missing = ""
try:
    import ensurepip, venv
except ImportError as error:
    missing = error.name
print(json.dumps({
    "version": "%d.%d" % sys.version_info[:2],
    "full_version": platform.python_version(),
    "implementation": sys.implementation.name,
    "bits": 64 if sys.maxsize > 2**32 else 32,
    "free_threaded": bool(sysconfig.get_config_var("Py_GIL_DISABLED")),
    "missing": missing,
    "executable": sys.executable,
}))
"""


class Python(NamedTuple):
    """A Python that can make a virtual environment."""

    executable: str
    version: str  # "3.13"
    full_version: str  # "3.13.0"


def find(version: str) -> tuple[Python | None, list[str]]:
    """The first usable Python of a version ("3.13") or None, and the faults of those before it."""
    faults = []
    for command in dict.fromkeys(candidates(version)):
        python, fault = probe(command, version)
        if python is not None:
            return python, faults
        if fault:
            faults.append(f"{' '.join(command)}: {fault}")
    return None, faults


def probe(command: tuple[str, ...], version: str) -> tuple[Python | None, str]:
    """The Python that a command starts, if it is usable and of this version, else None and its fault.

    The fault is empty for a command that does not start a Python of this version.
    """
    try:
        done = subprocess.run(
            [*command, "-c", PROBE],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=PROBE_SECONDS,
        )
        facts = json.loads(done.stdout) if done.returncode == 0 else None
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None, ""
    if facts is None or facts["version"] != version:
        return None, ""
    if facts["implementation"] != "cpython" or facts["bits"] != 64 or facts["free_threaded"]:
        return None, "not an ordinary 64-bit CPython, the only kind that Blender's module is made for"
    if facts["missing"]:
        return None, f"its module {facts['missing']} is missing (Debian: apt install python{version}-venv)"
    return Python(facts["executable"], facts["version"], facts["full_version"]), ""


def candidates(version: str) -> Iterator[tuple[str, ...]]:
    """Commands that may start a Python of this version, the most likely first."""
    if version == f"{sys.version_info[0]}.{sys.version_info[1]}":
        yield (sys.executable,)
    suffix = ".exe" if WINDOWS else ""
    for name in (f"python{version}", "python3", "python"):
        # All folders of PATH count: a pyenv shim that refuses may come before a Python that works.
        for folder in os.environ.get("PATH", "").split(os.pathsep):
            path = pathlib.Path(folder, name + suffix)
            if folder and path.is_file():
                yield (str(path),)
    if WINDOWS:
        yield ("py", f"-{version}")
    for root in pyenv_roots():
        for folder in sorted(root.glob(f"versions/{version}.*"), reverse=True):
            yield (str(folder / "python.exe" if WINDOWS else folder / "bin" / "python"),)


def pyenv_roots() -> list[pathlib.Path]:
    """The folders in which pyenv (on Windows pyenv-win) may keep its versions."""
    named = [pathlib.Path(os.environ[key]) for key in ("PYENV_ROOT", "PYENV") if os.environ.get(key)]
    home = pathlib.Path.home() / ".pyenv"
    return [*named, home / "pyenv-win" if WINDOWS else home]
