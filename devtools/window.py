# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenarios of tests/window in a Blender with a window: an installed one, or that of a Debian made once.

On Linux as root, debootstrap makes a Debian in the user's cache folder, with Blender and a virtual X server.
It needs no mounts, and takes a minute and 2 GB. Without any such Blender the summary ends with a warning; a
scenario that fails is a failure.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pathlib
import platform
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import NamedTuple

from .environments import ROOT, Failure, say
from .testing import Result

SCENARIOS = ROOT / "tests" / "window"
SHOTS = SCENARIOS / "shots"
OLDEST = (4, 5)
# Limits in seconds: for everything, for making the Debian, and for a quick answer.
LIMIT, MAKING, ANSWER = 3600.0, 420.0, 60.0
MIRROR, SUITE = "http://deb.debian.org/debian", "sid"  # the only release with Blender 4.5 or later
# Blender's extension manager imports the Python packages, which Debian only recommends.
PACKAGES = (
    *("blender", "xvfb", "imagemagick", "xdotool", "libgl1-mesa-dri", "libegl1"),
    *("python3-numpy", "python3-cattr", "python3-requests", "python3-zstandard"),
)
NEEDED_BYTES = 4e9
# How the names of Blender's reports of crashes end, and the lines of a report that are shown.
CRASH, LAST_LINES = ".crash.txt", 40
# What lies beside the scenarios: those of the recipes perform what the pages tell.
BESIDE = MappingProxyType({name: ROOT / name for name in ("demo", "presets")})
LEFT_OUT = shutil.ignore_patterns("__pycache__", "shots", "output")
# The sizes of screens for tests, which is mostly what their time depends on, and for pictures of pages.
SMALL_SCREEN, SCREEN = (1024, 640), (1600, 1000)
# Where a Debian keeps the shaders that its software renderer has compiled: ten seconds of each start.
SHADERS = "var/cache/scfpf-shaders"
LEASH = ("timeout", f"{LIMIT:.0f}")  # ends the command even if this process is killed


class Unavailable(Exception):
    """The reason why this machine has no Blender with a window, or none in time."""


class Place(NamedTuple):
    """A Blender, and the root of its system."""

    title: str
    blender: str
    root: pathlib.Path

    def command(self, *words: str) -> list[str]:
        """The command line that runs words in that system."""
        return [*words] if self.root == pathlib.Path("/") else ["chroot", str(self.root), *words]

    def inside(self, path: pathlib.Path) -> str:
        """A path as seen from that system."""
        return f"/{path.relative_to(self.root)}"


def test(blender: str | None, names: list[str]) -> tuple[list[Result], list[str]]:
    """Run scenarios (none: all) with the zip of dist/; returns results and warnings.

    blender: the path of the Blender to use, or None for any.
    """
    deadline = time.monotonic() + LIMIT
    try:
        if sys.platform != "linux" or platform.machine() != "x86_64":
            raise Unavailable("that is written for Linux on x64")
        with place(blender, deadline) as found:
            shutil.rmtree(SHOTS, ignore_errors=True)
            picked = chosen(names)
            groups = [(picked, SHOTS)]
            if not picked and (os.cpu_count() or 1) > 1 and not shows_on_display(found):
                groups = [(share, SHOTS / f"{number}") for number, share in enumerate(shares(), 1)]
            with ThreadPoolExecutor(len(groups)) as pool:
                running = [
                    pool.submit(run, found, group, deadline, BESIDE, into, SMALL_SCREEN)
                    for group, into in groups
                ]
            ended = [one.result() for one in running]
    except Unavailable as reason:
        return [], [f"NOT tested in a Blender with a window: {reason}"]
    results, warnings = zip(*ended)
    return [*itertools.chain(*results)], [*itertools.chain(*warnings)]


def chosen(names: list[str]) -> list[str]:
    """The driver's arguments for files and tests of tests/window given in pytest's form."""
    parts = [name.partition("::") for name in names]
    stems = [(pathlib.Path(file).stem, scenario) for file, _, scenario in parts]
    if any(not scenario and not stem.startswith("scenarios_") for stem, scenario in stems):
        return []
    return [f"{stem}::{scenario}" if scenario else stem for stem, scenario in stems]


def shares() -> list[list[str]]:
    """The modules of all scenarios, for two Blenders side by side: a scenario waits half of its time."""
    groups: list[list[str]] = [[], []]
    sizes = [0, 0]
    for path in sorted(SCENARIOS.rglob("scenarios_*.py"), key=lambda path: -path.stat().st_size):
        smaller = sizes.index(min(sizes))
        groups[smaller].append(path.stem)
        sizes[smaller] += path.stat().st_size
    return groups


@contextlib.contextmanager
def place(blender: str | None, deadline: float) -> Iterator[Place]:
    """A Blender of this machine, else that of the Debian in the cache folder."""
    try:
        found = here(blender, deadline)
    except Unavailable as reason:
        if blender:
            raise Failure(f"--blender-window: {reason}") from None
        with debian(deadline, str(reason)) as found:
            yield found
    else:
        yield found


def here(blender: str | None, deadline: float) -> Place:
    """The given Blender, or that of PATH, with the programs for windows and screenshots."""
    path = shutil.which(blender or "blender")
    if path is None:
        raise Unavailable(f"there is no {blender or 'blender on PATH'}")
    if not shutil.which("import"):
        raise Unavailable("ImageMagick's import is not on PATH")
    if not shutil.which("Xvfb") and not os.environ.get("DISPLAY"):
        raise Unavailable("there is neither Xvfb on PATH nor a DISPLAY")
    return checked(Place("", path, pathlib.Path("/")), deadline)


def checked(found: Place, deadline: float) -> Place:
    """The place with its title, if its Blender starts and is new enough."""
    text = finish(found.command(found.blender, "--version"), min(deadline, time.monotonic() + ANSWER))
    version = re.search(r"^Blender (\d+)\.(\d+)\S*", text, re.MULTILINE)
    if version is None or (int(version[1]), int(version[2])) < OLDEST:
        raise Unavailable(f"{found.blender} is no Blender {OLDEST[0]}.{OLDEST[1]} or later")
    return found._replace(title=f"{version[0]} with a window")


@contextlib.contextmanager
def debian(deadline: float, otherwise: str) -> Iterator[Place]:
    """The Debian of the cache folder, made if necessary, and locked against other runs."""
    if os.geteuid() != 0:
        raise Unavailable(f"{otherwise}, and only root can make one with debootstrap")
    base = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    cache = pathlib.Path(os.environ.get("SCFPF_WINDOW_CACHE") or pathlib.Path(base, "scfpf-window"))
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Unavailable(f"{otherwise}, and {error}") from None
    with locked(cache / "lock", deadline):
        root = cache / SUITE
        stamp, contents = cache / "made", " ".join((MIRROR, *PACKAGES))
        if not stamp.is_file() or stamp.read_text() != contents:
            if not shutil.which("debootstrap"):
                raise Unavailable(f"{otherwise}, and debootstrap is missing (apt install debootstrap)")
            stamp.unlink(missing_ok=True)
            make(root, min(deadline, time.monotonic() + MAKING))
            stamp.write_text(contents)
        try:
            found = checked(Place("", "/usr/bin/blender", root), deadline)
        except Unavailable:
            stamp.unlink()  # the next run makes it again
            raise
        yield found


@contextlib.contextmanager
def locked(path: pathlib.Path, deadline: float) -> Iterator[None]:
    """Hold a lock file, after any other run releases it."""
    import fcntl  # not on every system that can import this module

    with path.open("w") as file:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise Unavailable(f"another run holds {path}") from None
                time.sleep(1.0)
        yield


def make(root: pathlib.Path, deadline: float) -> None:
    """Make a Debian with the packages; the remains of an interrupted run are removed."""
    remove(root)
    if shutil.disk_usage(root.parent).free < NEEDED_BYTES:
        raise Unavailable(f"{root.parent} has less than {NEEDED_BYTES / 1e9:.0f} GB free")
    say(f"making a Debian {SUITE} with Blender in {root}; some 600 MB are fetched, once")
    apt = ["env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "--yes", "--no-install-recommends"]
    try:
        finish(["debootstrap", "--variant=minbase", SUITE, str(root), MIRROR], deadline)
        finish(["chroot", str(root), *apt, "install", *PACKAGES], deadline)
        finish(["chroot", str(root), "apt-get", "clean"], deadline)
    except BaseException:
        remove(root)
        raise


def remove(root: pathlib.Path) -> None:
    """Unmount the mounts of an interrupted debootstrap, and delete a Debian."""
    mounted = [line.split()[1] for line in pathlib.Path("/proc/mounts").read_text().splitlines()]
    for path in sorted(mounted, reverse=True):
        if path.startswith(f"{root}/"):
            finish(["umount", path], time.monotonic() + ANSWER)
    if root.exists():
        shutil.rmtree(root)


def finish(command: list[str], deadline: float) -> str:
    """Run a command and return its output. Raises Unavailable if it fails or takes too long."""
    with tempfile.TemporaryFile("w+", errors="replace") as file:
        try:
            with started(command, stdout=file, stderr=subprocess.STDOUT) as process:
                status = process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            raise Unavailable(f"there was no time to finish: {' '.join(command)[:80]}") from None
        file.seek(0)
        text = file.read()
    if status != 0:
        print(text[-3000:], flush=True)
        raise Unavailable(f"exit code {status}, as printed above, from: {' '.join(command)[:80]}")
    return text


@contextlib.contextmanager
def started(command: list[str], **options: object) -> Iterator[subprocess.Popen]:
    """A process with its own group, all of which ends with the context."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True, **options)
    try:
        yield process
    finally:
        # It is terminated before it is killed: a killed X server leaves its lock file.
        for how in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, how)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(5.0)


def shows_on_display(found: Place) -> bool:
    """Return whether windows open on the user's own display, for want of Xvfb."""
    return found.root == pathlib.Path("/") and not shutil.which("Xvfb")


@contextlib.contextmanager
def screen(
    found: Place, environ: dict[str, str], deadline: float, size: tuple[int, int]
) -> Iterator[dict[str, str]]:
    """The environment with the DISPLAY of a virtual screen, or the user's own without Xvfb."""
    if shows_on_display(found):
        yield {**environ, "DISPLAY": os.environ["DISPLAY"]}
        return
    # -displayfd: the server chooses a free number and prints it.
    words = [*LEASH, "Xvfb", "-displayfd", "1", "-nolisten", "tcp"]
    words += ["-screen", "0", f"{size[0]}x{size[1]}x24"]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "env": environ}
    with started(found.command(*words), **options) as server:
        wait = min(ANSWER, max(deadline - time.monotonic(), 0.0))
        number = server.stdout.readline() if select.select([server.stdout], [], [], wait)[0] else b""
        if not number.strip():
            raise Unavailable("Xvfb does not start")
        yield {**environ, "DISPLAY": f":{int(number)}", "LIBGL_ALWAYS_SOFTWARE": "1"}


def run(
    found: Place,
    scenarios: list[str],
    deadline: float,
    more: Mapping[str, pathlib.Path] = MappingProxyType({}),
    into: pathlib.Path = SHOTS,
    size: tuple[int, int] = SCREEN,
) -> tuple[list[Result], list[str]]:
    """Install the zip in a fresh profile there and run the scenarios.

    more: files and folders to lie beside the scenarios, by the names that they have there. into: the folder
    for what was printed and for pictures, which is emptied before. size: width and height of the screen.
    """
    zips = sorted((ROOT / "dist").glob("scfpf-*-linux_x64.zip"))
    if len(zips) != 1:
        raise Failure(f"dist/ holds {len(zips)} zips for this machine, not one")
    say(found.title)
    began = time.monotonic()
    shutil.rmtree(into, ignore_errors=True)
    with contextlib.ExitStack() as stack:
        kept_in = None if found.root == pathlib.Path("/") else found.root / "srv"
        folder = pathlib.Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="scfpf-window-", dir=kept_in))
        )
        tests, shots, home = (folder / name for name in ("tests", "shots", "home"))
        shutil.copytree(SCENARIOS, tests, ignore=LEFT_OUT)
        for name, source in more.items():
            if source.is_dir():
                shutil.copytree(source, tests / name, ignore=LEFT_OUT)
            else:
                shutil.copy(source, tests / name)
        shutil.copy(zips[0], folder)
        for path in (shots, home):
            path.mkdir()
        environ = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin" if kept_in else os.environ["PATH"]}
        environ["LANG"] = "C.UTF-8"
        environ.update({key: found.inside(home) for key in ("HOME", "XDG_RUNTIME_DIR", "TMPDIR")})
        environ["BLENDER_USER_RESOURCES"] = found.inside(home)
        if kept_in:
            (found.root / SHADERS).mkdir(parents=True, exist_ok=True)
            environ["MESA_SHADER_CACHE_DIR"] = f"/{SHADERS}"
        environ = stack.enter_context(screen(found, environ, deadline, size))
        words = [*LEASH, found.blender, "--factory-startup", "--enable-event-simulate", "--window-geometry"]
        words += ["0", "0", *map(str, size), "--python", found.inside(tests / "drive_blender.py"), "--"]
        words += ["--zip", found.inside(folder / zips[0].name), "--folder", found.inside(shots), *scenarios]
        if size == SMALL_SCREEN:
            words.append("--plain")
        try:
            process = stack.enter_context(started(found.command(*words), env=environ))
            status = process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            status = None
        finally:
            shutil.copytree(shots, into, dirs_exist_ok=True)
            for report in home.rglob(f"*{CRASH}"):
                shutil.copy(report, into)
    return outcome(found.title, into, status, time.monotonic() - began)


def outcome(
    title: str, folder: pathlib.Path, status: int | None, seconds: float
) -> tuple[list[Result], list[str]]:
    """The counts in the driver's folder. status: Blender's exit code, or None if the time ran out.

    Scenarios that were not run count as failed. The warnings tell where Blender was when it crashed.
    """
    results = folder / "results.txt"
    lines = results.read_text(encoding="utf-8").splitlines() if results.is_file() else []
    planned = [name for line in lines[:1] for name in line.split()[1:]]
    went = {line.split()[1]: line.startswith("ok:") for line in lines[1:]}
    left = [name for name in planned if name not in went]
    passed = sum(went.values())
    failed = len(went) - passed
    title = f"{title} ({seconds:.0f} s)"
    warnings = []
    if status is None:
        rest = ", ".join(left) or ("quitting" if planned else "all scenarios")
        warnings.append(f"NOT tested in a Blender with a window, since the time ran out: {rest}")
    elif left or (status != 0 and not failed):
        title += f", ended with exit code {status} in {left[0] if left else 'its start or end'}"
        for report in (folder / "output.txt", *sorted(folder.glob(f"*{CRASH}"))):
            if report.is_file():
                said = report.read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
                warnings.append("\n".join((f"the end of {report.name}:", *said)))
    return [Result(title, passed, failed + len(left), 0, status == 0 and not failed and not left)], warnings
