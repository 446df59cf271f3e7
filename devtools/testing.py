# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of pytest: pure tests, Blender tests and the installed zip, each in a process of its own.

The pure tests import `scfpf_addon`. The Blender tests import the same files as
`bl_ext.checkout.scfpf.scfpf_addon`, the last ones as `bl_ext.user_default.scfpf.scfpf_addon`. Their classes
differ, and Blender can register only one add-on of a name. window.py runs the fourth part, the scenarios in a
window.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import time
import xml.etree.ElementTree
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from .environments import ROOT, say

TESTS = ROOT / "tests"
FOLDERS = {part: TESTS / part for part in ("blender", "installed", "window")}
WHOLE_SUITE = {
    "pure": [str(TESTS), *(f"--ignore={folder}" for folder in FOLDERS.values())],
    "blender": [str(FOLDERS["blender"])],
    "installed": [str(FOLDERS["installed"])],
    "window": [],
}
NO_TESTS_COLLECTED = 5  # pytest's exit code
# Options of pytest that leave out what one Blender is enough for.
WITHOUT_ONCE = ["-m", "not once"]
# With this variable the Blender tests install the zip in dist/; without it they load the checkout.
INSTALL_ZIP = "SCFPF_INSTALL_ZIP"


class Result(NamedTuple):
    """The result of a run of tests."""

    title: str
    passed: int
    failed: int
    skipped: int
    ended_well: bool  # False after a crash or a usage error too, when nothing was counted

    def line(self) -> str:
        """One line of the closing table."""
        counts = f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"
        return f"{self.title}: {counts}{'' if self.ended_well else '  <-- FAILED'}"


def plan(arguments: list[str]) -> dict[str, list[str]]:
    """The arguments of each part to run; without a file or folder every part runs.

    Options are those of pytest. The window part takes none: it runs if it is named, or without arguments.
    """
    named: dict[str, list[str]] = {part: [] for part in WHOLE_SUITE}
    options = []
    for argument in arguments:
        file, colons, test = argument.partition("::")
        path = pathlib.Path(os.path.abspath(file))
        if path.exists() and path.is_relative_to(TESTS):
            named[part_of(path)].append(f"{path}{colons}{test}")
        else:
            options.append(argument)
    targets = {part: names for part, names in named.items() if names} or WHOLE_SUITE
    planned = {part: [*names, *options] for part, names in targets.items()}
    if "window" in planned:
        planned["window"] = named["window"]
    if options and not named["window"]:
        planned.pop("window", None)
    return planned


def part_of(path: pathlib.Path) -> str:
    """The part of the suite that a file or folder of tests/ belongs to."""
    return next((part for part, folder in FOLDERS.items() if path.is_relative_to(folder)), "pure")


def run_pytest(
    title: str, report: pathlib.Path, command: list[str], environ: Mapping[str, str] | None = None
) -> Result:
    """Run a command of pytest whose --junitxml is ``report``, with its output in view, and count."""
    return count(title, report, lambda: subprocess.call(command, cwd=ROOT, env=environ))


def run_beside(
    label: str,
    title: str,
    report: pathlib.Path,
    command: list[str],
    environ: Mapping[str, str] | None = None,
) -> Result:
    """Do as ``run_pytest`` beside other runs, with ``label`` before each line of the output."""
    return count(title, report, lambda: call_labelled(label, command, environ))


def call_labelled(label: str, command: list[str], environ: Mapping[str, str] | None) -> int:
    """Run a command with a label before each line of its output; returns the exit code."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(command, cwd=ROOT, env=environ, text=True, errors="replace", **pipes) as process:
        for line in process.stdout:
            print(f"{label} {line}", end="", flush=True)
    return process.returncode


def count(title: str, report: pathlib.Path, call: Callable[[], int]) -> Result:
    """The result of a call of pytest that returns its exit code."""
    say(title)
    report.unlink(missing_ok=True)
    started = time.monotonic()
    status = call()
    title = f"{title} ({time.monotonic() - started:.0f} s)"
    if not report.is_file():
        say(f"{title}: ended with exit code {status} before pytest could report")
        return Result(title, 0, 0, 0, False)
    return read_report(report, title, status)


def read_report(report: pathlib.Path, title: str, status: int) -> Result:
    """The counts in a report of pytest."""
    suites = xml.etree.ElementTree.parse(report).getroot().iter("testsuite")
    keys = ("tests", "failures", "errors", "skipped")
    counts = [[int(suite.get(key, 0)) for key in keys] for suite in suites]
    tests, failures, errors, skipped = (sum(column) for column in zip(*counts))
    failed = failures + errors
    ended_well = status in (0, NO_TESTS_COLLECTED) and not failed
    return Result(title, tests - failed - skipped, failed, skipped, ended_well)


def close(results: list[Result], warnings: Sequence[str] = ()) -> int:
    """Print the table, warnings and sum; returns 0 if every run ended well and some test ran, else 1."""
    print()
    for result in results:
        say(result.line())
    for warning in warnings:
        say(f"WARNING: {warning}")
    passed = sum(result.passed for result in results)
    failed = sum(result.failed for result in results)
    skipped = sum(result.skipped for result in results)
    crashed = sum(not result.ended_well and not result.failed for result in results)
    print(f"{passed} passed, {failed + crashed} failed, {skipped} skipped", flush=True)
    return 0 if passed and all(result.ended_well for result in results) else 1
