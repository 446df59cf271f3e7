# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual environments of the checkout, one for each supported Blender, made on first use."""

from __future__ import annotations

import hashlib
import pathlib
import platform
import shlex
import subprocess
from typing import NamedTuple

from . import pythons

ROOT = pathlib.Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".venvs"
REQUIREMENTS = ROOT / "devtools" / "requirements"
STAMP = "requirements.sha256"

INSTALL_HELP = """\
  Debian, Ubuntu  apt install python{0} python{0}-venv   (where the release has it)
  Fedora          dnf install python{0}
  macOS           brew install python@{0}
  Windows         winget install Python.Python.{0}
  anywhere        pyenv install {0}   or   uv python install {0}"""

LIBRARY_HELP = """\
Blender's module was installed but cannot be imported; see the reason above. On Linux it needs X11 and GL
libraries even without a display. Debian, Ubuntu:
  apt install libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1 libegl1"""


class Failure(Exception):
    """An error with a message for the developer, which dev.py prints before it stops."""


class Blender(NamedTuple):
    """A supported Blender as a Python module, and the one Python that it is made for."""

    name: str
    requirement: str
    python: str


# The first one whose Python is found runs the demo, the linter and the benchmarks.
BLENDERS = (Blender("5.2", "bpy~=5.2.0", "3.13"), Blender("4.5", "bpy~=4.5.0", "3.11"))


class Environment(NamedTuple):
    """A finished virtual environment."""

    title: str  # "Blender 5.2, Python 3.13.0"
    folder: pathlib.Path
    python: str  # the path of its interpreter


def say(text: str) -> None:
    """Print a line of progress."""
    print(f"-- {text}", flush=True)


def run_through(command: list[str]) -> int:
    """Run a command in the checkout with its output in view, and return its exit code."""
    return subprocess.call(command, cwd=ROOT)


def run(command: list[str]) -> None:
    """Run a command in the checkout with its output in view. Raises Failure with the command."""
    status = run_through(command)
    if status != 0:
        raise Failure(f"exit code {status} from: {shlex.join(command)}")


def first() -> Environment:
    """The environment of the first supported Blender whose Python is installed. Raises Failure."""
    for blender in BLENDERS:
        environment = ensure(blender)
        if environment is not None:
            return environment
    raise Failure(needed_help(BLENDERS))


def ensure(blender: Blender) -> Environment | None:
    """This Blender's environment, made or renewed if necessary; None, with a message, without its Python."""
    folder = FOLDER / f"blender-{blender.name}"
    interpreter = folder / ("Scripts/python.exe" if pythons.WINDOWS else "bin/python")
    stamp = folder / STAMP
    digest = requirement_digest(blender)
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == digest:
        made, _ = pythons.probe((str(interpreter),), blender.python)
        if made is not None:
            return Environment(
                f"Blender {blender.name}, Python {made.full_version}", folder, str(interpreter)
            )
    base, faults = pythons.find(blender.python)
    for fault in faults:
        say(f"passed over {fault}")
    if base is None:
        say(f"no Python {blender.python} here, which Blender {blender.name} needs")
        return None
    say(f"making {folder.relative_to(ROOT)} with Python {base.full_version}; the download is some 400 MB")
    run([base.executable, "-m", "venv", "--clear", str(folder)])
    try:
        run([str(interpreter), *pip_install(), blender.requirement, *requirement_options()])
    except Failure as error:
        raise Failure(
            f"{error}\npip could not install what Blender {blender.name} needs; the reason stands above. If "
            f"there is no {blender.requirement} for this machine ({platform.system()} {platform.machine()}), "
            "name the other Python: python3 dev.py test --python 3.11"
        ) from None
    try:
        run([str(interpreter), "-c", "import bpy, embreex.rtcore_scene"])
    except Failure:
        raise Failure(LIBRARY_HELP) from None
    stamp.write_text(digest, encoding="utf-8")
    return Environment(f"Blender {blender.name}, Python {base.full_version}", folder, str(interpreter))


def pip_install() -> list[str]:
    """The arguments `-m pip install` for wheels only, as source builds need compilers."""
    return ["-m", "pip", "install", "--disable-pip-version-check", "--only-binary=:all:"]


def requirement_options() -> list[str]:
    """The requirement files of an environment, as options of pip."""
    return ["-r", str(REQUIREMENTS / "test.txt"), "-r", str(REQUIREMENTS / "tools.txt")]


def requirement_digest(blender: Blender) -> str:
    """The digest of the requirements; an environment with another one is made again."""
    files = [(REQUIREMENTS / name).read_text(encoding="utf-8") for name in ("test.txt", "tools.txt")]
    return hashlib.sha256("\n".join([blender.requirement, *files]).encode()).hexdigest()


def needed_help(blenders: tuple[Blender, ...]) -> str:
    """The message that none of these Blenders' Pythons was found, and how to install one."""
    wanted = " or ".join(f"{blender.python} (Blender {blender.name})" for blender in blenders)
    return (
        f"this needs a 64-bit CPython {wanted}; the one running is {platform.python_version()}, and none was "
        "found on PATH, through the py launcher or in pyenv's folder.\nInstall one in any way, for example\n"
        f"{INSTALL_HELP.format(blenders[0].python)}\nand type the same command again."
    )
