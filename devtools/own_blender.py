# SPDX-License-Identifier: GPL-3.0-or-later
"""The test suite inside an installed Blender, with the packages that it lacks.

Blender's Python has no pytest, and often no pip. Any pip that is found installs the packages into a folder of
the checkout; Blender itself does not change.
"""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
import platform
import subprocess
import sys
import sysconfig
import tempfile

from . import environments, testing
from .environments import FOLDER, REQUIREMENTS, ROOT, STAMP, Failure, say

SCRIPT = ROOT / "tests" / "run_in_blender.py"
INNER = "--inner"  # says to the script that it runs one part, and in which folder the packages are
MARK = "scfpf-facts: "
ASK = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from devtools import own_blender
print({MARK!r} + own_blender.facts())
"""


def facts() -> str:
    """The properties of the running Python that decide about its wheels, as JSON."""
    libc, libc_version = platform.libc_ver()
    return json.dumps(
        {
            "python": f"{sys.version_info[0]}.{sys.version_info[1]}",
            "platform": sysconfig.get_platform(),
            "glibc": libc_version if libc == "glibc" else "",
        }
    )


def test(blender: str, arguments: list[str]) -> int:
    """Prepare the packages for a Blender (command or path) and run the suite in it; returns the exit code."""
    ask = [blender, "--background", "--factory-startup", "--python-expr", ASK]
    try:
        answer = subprocess.run(ask, capture_output=True, encoding="utf-8", errors="replace").stdout
    except OSError as error:
        raise Failure(f"cannot start {blender}: {error.strerror}") from None
    found = [line[len(MARK) :] for line in answer.splitlines() if line.startswith(MARK)]
    if not found:
        raise Failure(f"{blender} does not answer as a Blender does; it printed:\n{answer}")
    target = json.loads(found[0])
    folder = packages_folder(target)
    if not is_filled(folder):
        fill(folder, [pip_python(), *environments.pip_install(), *cross_options(target)])
    return subprocess.call([blender, "--background", "--python", str(SCRIPT), "--", *arguments])


def packages_folder(target: dict[str, str]) -> pathlib.Path:
    """The folder of the packages for a Python with these facts."""
    return FOLDER / f"own-blender-{target['python']}-{target['platform']}"


def requirement_digest() -> str:
    """The digest of the set of packages."""
    return hashlib.sha256((REQUIREMENTS / "test.txt").read_bytes()).hexdigest()


def is_filled(folder: pathlib.Path) -> bool:
    """Return whether the folder holds the present set of packages."""
    stamp = folder / STAMP
    return stamp.is_file() and stamp.read_text(encoding="utf-8") == requirement_digest()


def fill(folder: pathlib.Path, install: list[str]) -> None:
    """Install the packages into the folder with a `pip install` command."""
    say(f"filling {folder.relative_to(ROOT)}")
    environments.run([*install, "--upgrade", "--target", str(folder), "-r", str(REQUIREMENTS / "test.txt")])
    (folder / STAMP).write_text(requirement_digest(), encoding="utf-8")


def pip_python() -> str:
    """A Python that has pip: the running one, or that of one of the checkout's environments."""
    done = subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True)
    return sys.executable if done.returncode == 0 else environments.first().python


def cross_options(target: dict[str, str]) -> list[str]:
    """The options of pip that choose wheels for another Python than the one that runs it."""
    options = ["--implementation=cp", f"--python-version={target['python']}"]
    options += [f"--abi=cp{target['python'].replace('.', '')}", "--abi=abi3", "--abi=none"]
    return options + [f"--platform={tag}" for tag in platform_tags(target)]


def platform_tags(target: dict[str, str]) -> list[str]:
    """The wheel platforms of a system, the newest first; pip adds the older ones of macOS itself."""
    name = target["platform"].replace("-", "_").replace(".", "_")
    if not target["glibc"]:
        return [name]
    machine = name.split("_", 1)[1]
    newest = int(target["glibc"].split(".")[1])
    numbered = [f"manylinux_2_{minor}" for minor in range(newest, 4, -1)]
    return [
        f"{tag}_{machine}" for tag in (*numbered, "manylinux2014", "manylinux2010", "manylinux1", "linux")
    ]


def fill_from_inside(folder: pathlib.Path) -> None:
    """Fill the folder with the pip of the running Blender's Python, if it has one."""
    python = sys.executable
    for pip in ([python, "-m", "pip"], [python, *bundled_pip()]):
        if subprocess.run([*pip, "--version"], capture_output=True).returncode == 0:
            return fill(folder, [*pip, *environments.pip_install()[2:]])
    raise Failure(
        f"this Blender's Python ({python}) has no pip to fetch pytest with. This, outside Blender, does it:\n"
        f"  python3 dev.py test --blender {sys.argv[0]}"
    )


def bundled_pip() -> list[str]:
    """The pip wheel that CPython carries for ensurepip, which runs without being installed."""
    try:
        import ensurepip
    except ImportError:
        return ["-m", "pip"]
    wheels = sorted((pathlib.Path(ensurepip.__file__).parent / "_bundled").glob("pip-*.whl"))
    return [str(wheels[-1] / "pip")] if wheels else ["-m", "pip"]


def run_inside(blender: str, title: str, arguments: list[str]) -> int:
    """Run each part of the suite in a new process of the running Blender; returns the exit code."""
    folder = packages_folder(json.loads(facts()))
    if not is_filled(folder):
        fill_from_inside(folder)
    plan = testing.plan(arguments)
    if "installed" in plan and not any((ROOT / "dist").glob("*.zip")):
        say("NOT tested: the installed zip, since dist/ is empty (python3 dev.py build fills it)")
        del plan["installed"]
    if plan.pop("window", None) is not None:
        say("NOT tested: in a window (python3 dev.py test --blender-window PATH does that)")
    results = []
    for part, part_arguments in plan.items():
        report = folder / f"report-{part}.xml"
        command = [blender, "--background", "--factory-startup", "--python-exit-code", "1"]
        command += [
            "--python",
            str(SCRIPT),
            "--",
            INNER,
            str(folder),
            f"--junitxml={report}",
            *part_arguments,
        ]
        with tempfile.TemporaryDirectory(prefix="scfpf-profile-", ignore_cleanup_errors=True) as profile:
            # The tests must not write into the user's own profile.
            environ = {**os.environ, "BLENDER_USER_RESOURCES": profile}
            results.append(testing.run_pytest(f"{title}, {part} tests", report, command, environ))
    return testing.close(results)
