# SPDX-License-Identifier: GPL-3.0-or-later
"""The decisions of dev.py: which Python, which tests where, what a report says, which wheels."""

import argparse
import os
import pathlib
import platform
import re
import subprocess
import sys
import time

import pytest

from benchmarks.document import check_files, replace_section
from devtools import coverage, environments, own_blender, package, pythons, testing, window

ROOT = pathlib.Path(__file__).resolve().parents[1]
RUNNING = f"{sys.version_info[0]}.{sys.version_info[1]}"
REPORT = """<testsuites><testsuite name="pytest" errors="{errors}" failures="{failures}" skipped="{skipped}"
tests="{tests}" time="1"></testsuite></testsuites>"""


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """A machine without any Python but the one that runs."""
    monkeypatch.setattr(pathlib.Path, "home", lambda: tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("PYENV_ROOT", raising=False)
    monkeypatch.delenv("PYENV", raising=False)


def fake_python(path, version, missing="", status=0):
    """A program that answers the probe as a Python of that version would."""
    path.parent.mkdir(parents=True, exist_ok=True)
    facts = (
        f'{{"version": "{version}", "full_version": "{version}.4", "implementation": "cpython", "bits": 64, '
        f'"free_threaded": false, "missing": "{missing}", "executable": "{path}"}}'
    )
    path.write_text(f"#!/bin/sh\necho '{facts}'\nexit {status}\n")
    path.chmod(0o755)


def test_a_python_of_another_version_is_not_taken():
    assert pythons.probe((sys.executable,), "3.8") == (None, "")
    assert pythons.probe((str(ROOT / "not-there"),), RUNNING) == (None, "")


@pytest.mark.skipif(os.name == "nt", reason="the stand-ins are shell scripts")
def test_path_is_searched_past_a_shim_that_refuses(nowhere, monkeypatch, tmp_path):
    fake_python(tmp_path / "shims" / "python3.77", "3.77", status=127)
    fake_python(tmp_path / "bare" / "python3.77", "3.77", missing="ensurepip")
    fake_python(tmp_path / "whole" / "python3", "3.77")
    folders = [str(tmp_path / name) for name in ("shims", "bare", "whole")]
    monkeypatch.setenv("PATH", os.pathsep.join([*folders, os.environ["PATH"], "/bin"]))
    found, faults = pythons.find("3.77")
    assert found == pythons.Python(str(tmp_path / "whole" / "python3"), "3.77", "3.77.4")
    assert len(faults) == 1 and "python3.77-venv" in faults[0]


@pytest.mark.skipif(os.name == "nt", reason="the stand-ins are shell scripts")
def test_pyenv_is_searched_without_its_shims(nowhere, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", "/bin")
    fake_python(tmp_path / ".pyenv" / "versions" / "3.77.4" / "bin" / "python", "3.77")
    assert pythons.find("3.77")[0].full_version == "3.77.4"


def test_what_to_install_is_said(nowhere):
    text = environments.needed_help(environments.BLENDERS)
    for blender in environments.BLENDERS:
        assert f"{blender.python} (Blender {blender.name})" in text
    assert platform.python_version() in text and "winget install Python.Python.3.13" in text


def test_whole_suite_runs_in_four_processes():
    assert list(testing.plan([])) == ["pure", "blender", "installed", "window"]


def test_options_of_pytest_reach_pytest_only():
    plan = testing.plan(["-x"])
    assert list(plan) == ["pure", "blender", "installed"]
    assert all(arguments[-1] == "-x" for arguments in plan.values())
    assert f"--ignore={ROOT / 'tests' / 'blender'}" in plan["pure"]


def test_named_tests_run_where_they_belong(monkeypatch):
    monkeypatch.chdir(ROOT / "tests")
    manifest = "blender/interface/test_package.py::test_manifest_is_valid"
    plan = testing.plan(["test_dev.py", manifest, "-k", "x or y"])
    assert plan == {
        "pure": [f"{ROOT / 'tests' / 'test_dev.py'}", "-k", "x or y"],
        "blender": [
            f"{ROOT / 'tests' / 'blender' / 'interface' / 'test_package.py'}::test_manifest_is_valid",
            "-k",
            "x or y",
        ],
    }


def test_coverage_is_of_pure_tests_only():
    nowhere = environments.Environment("none", ROOT, "not a Python")
    with pytest.raises(environments.Failure, match="tests/projection"):
        coverage.test(nowhere, [str(ROOT / "tests" / "blender" / "interface" / "test_package.py")])


@pytest.mark.parametrize(
    "counts, status, good",
    [((9, 0, 0, 2), 0, True), ((9, 1, 0, 0), 1, False), ((9, 0, 1, 0), 1, False), ((0, 0, 0, 0), 5, True)],
)
def test_report_is_counted(tmp_path, counts, status, good):
    tests, failures, errors, skipped = counts
    report = tmp_path / "report.xml"
    report.write_text(REPORT.format(tests=tests, failures=failures, errors=errors, skipped=skipped))
    result = testing.read_report(report, "title", status)
    assert result == ("title", tests - failures - errors - skipped, failures + errors, skipped, good)


def test_a_crash_is_a_failure(tmp_path, capsys):
    report = tmp_path / "report.xml"
    report.write_text("left from an earlier run")
    crash = [sys.executable, "-c", "import os; os._exit(3)"]
    result = testing.run_pytest("crash", report, crash)
    assert not result.ended_well
    fine = testing.Result("fine", 5, 0, 1, True)
    assert testing.close([fine, result]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "5 passed, 1 failed, 1 skipped"
    assert testing.close([fine]) == 0
    assert testing.close([testing.Result("none ran", 0, 0, 0, True)]) == 1


def test_scenarios_are_named_as_tests_are(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert testing.plan(["tests/window", "-x"]) == {"window": [str(ROOT / "tests/window")]}
    assert window.chosen(testing.plan(["tests/window"])["window"]) == []
    names = ["tests/window/scenarios_panels.py", "tests/window/scenarios_render.py::picks"]
    assert window.chosen(testing.plan(names)["window"]) == ["scenarios_panels", "scenarios_render::picks"]
    assert "window" not in testing.plan(["tests/casting"])


@pytest.mark.parametrize(
    "results, status, counts, good, said",
    [
        ("scenarios: a b\nok: a (1 s)\nok: b (2 s)", 0, (2, 0), True, ""),
        ("scenarios: a b\nok: a (1 s)\nFAILED: b (2 s)", 1, (1, 1), False, ""),
        ("scenarios: a b\nok: a (1 s)", 139, (1, 1), False, "ended with exit code 139 in b"),
        ("scenarios: a b\nok: a (1 s)", 0, (1, 1), False, "ended with exit code 0 in b"),
        ("scenarios: a\nok: a (1 s)", 139, (1, 0), False, "ended with exit code 139 in its start or end"),
        ("", 1, (0, 0), False, "ended with exit code 1 in its start or end"),
        ("scenarios: a b c\nok: a (1 s)", None, (1, 2), False, "time ran out: b, c"),
        ("scenarios: m::a n::a\nok: m::a (1 s)", 0, (1, 1), False, "ended with exit code 0 in n::a"),
        ("scenarios: a b c\nFAILED: a (1 s)", None, (0, 3), False, "time ran out: b, c"),
        ("", None, (0, 0), False, "time ran out: all scenarios"),
    ],
)
def test_what_scenarios_came_to(tmp_path, results, status, counts, good, said):
    (tmp_path / "results.txt").write_text(results)
    (result,), warnings = window.outcome("title", tmp_path, status, 9.0)
    assert (result.passed, result.failed) == counts and result.ended_well == good
    assert said in " ".join([result.title, *warnings])
    assert bool(warnings) == (status is None)


def test_a_crash_in_a_window_tells_where(tmp_path):
    (tmp_path / "results.txt").write_text("scenarios: a b\nok: a (1 s)")
    (tmp_path / "output.txt").write_text("\n".join(["long ago"] * 99 + ["Fatal Python error", "in here"]))
    (tmp_path / "blender.crash.txt").write_text("# backtrace\nBKE_here")
    for status, told in ((139, True), (None, False)):
        (result,), warnings = window.outcome("title", tmp_path, status, 9.0)
        said = "\n".join(warnings)
        assert not result.ended_well
        assert ("Fatal Python error\nin here" in said and "BKE_here" in said) == told
        assert len(said.splitlines()) < 99


def test_a_window_that_cannot_be_had_is_a_warning(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("SCFPF_WINDOW_CACHE", str(tmp_path))
    results, warnings = window.test(None, [])
    assert not results and len(warnings) == 1
    fine = testing.Result("fine", 5, 0, 0, True)
    assert testing.close([fine], warnings) == 0
    assert "-- WARNING: NOT tested in a Blender with a window: " in capsys.readouterr().out
    if sys.platform == "linux":
        with pytest.raises(environments.Failure, match="--blender-window"):
            window.test(str(tmp_path / "blender"), [])


@pytest.mark.skipif(os.name == "nt", reason="sessions of processes are POSIX's")
def test_nothing_is_left_of_a_step_that_takes_too_long(tmp_path):
    pid_file = tmp_path / "pid"
    script = f"sleep 300 & echo $! > {pid_file}; wait"
    with pytest.raises(window.Unavailable, match="no time"):
        window.finish(["sh", "-c", script], time.monotonic() + 1.0)
    ask = ["ps", "-o", "stat=", "-p", pid_file.read_text().strip()]
    for _ in range(100):
        if subprocess.run(ask, capture_output=True, text=True).stdout.strip()[:1] in ("", "Z"):
            return
        time.sleep(0.1)
    pytest.fail("a grandchild lives on")


def test_manifest_names_a_wheel_for_each_python_and_platform():
    names = package.manifest_wheels()
    tags = {tuple(name[: -len(".whl")].split("-")[2:]) for name in names}
    assert len(names) == len(tags) == 12 == len(package.locked_hashes())
    assert {python for python, _, _ in tags} == {"cp311", "cp313", "cp314"}


def test_a_wheel_of_another_hash_is_refused(tmp_path):
    path = tmp_path / "some.whl"
    assert not package.is_locked(path, package.locked_hashes())
    path.write_bytes(b"not the wheel")
    assert not package.is_locked(path, package.locked_hashes())


def test_download_asks_for_what_the_wheel_is():
    command = package.download_command(
        "embreex-1-cp314-cp314-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
    )
    wanted = {"--require-hashes", "--no-deps", "--only-binary=:all:", "--python-version=314", "--abi=cp314"}
    wanted |= {"--platform=manylinux_2_27_x86_64", "--platform=manylinux_2_28_x86_64"}
    assert wanted <= set(command)


def test_platform_tags():
    linux = own_blender.platform_tags({"platform": "linux-x86_64", "glibc": "2.28"})
    assert linux[0] == "manylinux_2_28_x86_64" and linux[-1] == "linux_x86_64"
    assert "manylinux_2_17_x86_64" in linux and "manylinux_2_29_x86_64" not in linux
    assert own_blender.platform_tags({"platform": "win-amd64", "glibc": ""}) == ["win_amd64"]
    mac = own_blender.platform_tags({"platform": "macosx-11.2-arm64", "glibc": ""})
    assert mac == ["macosx_11_2_arm64"]


def test_help_needs_nothing_but_a_python(tmp_path):
    """No environment is made, no network asked, to say what there is."""
    done = subprocess.run(
        [sys.executable, "-S", "-E", str(ROOT / "dev.py"), "--help"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    commands = ["demo", "gallery", "recipes", "compositions", "showpieces", "messages", "thumbnails"]
    commands += ["pictures", "test", "build", "lint", "sizes", "corpus", "bench"]
    assert re.findall(r"^    (\w+)(?: |$)", done.stdout, re.MULTILINE) == commands


BAD_FILES = {
    "no document": (["--markdown", "absent.md"], "absent.md: No such file"),
    "no marks": (["--markdown", "plain.md"], "plain.md has no lines <!-- ratios -->"),
    "a document that is a folder": (["--markdown", "."], "cannot put figures into"),
    "no folder": (["--json", "absent/figures.json"], "cannot write absent/figures.json"),
    "a folder": (["--json", "."], "cannot write ."),
    "no figures": (["--from", "absent.json"], "there is no file absent.json"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_benchmarks_look_at_their_files_before_any_work(tmp_path, monkeypatch, capsys, name):
    arguments, message = BAD_FILES[name]
    monkeypatch.chdir(tmp_path)
    pathlib.Path("plain.md").write_text("no place for figures\n")
    parser = argparse.ArgumentParser()
    for option in ("--markdown", "--json", "--from"):
        parser.add_argument(option, dest=option[2:4])
    options = parser.parse_args(arguments)
    with pytest.raises(SystemExit):
        check_files(parser, read=options.fr, written=options.js, document=options.ma, sections=["ratios"])
    assert message in capsys.readouterr().err


def test_every_benchmark_with_files_looks_at_them():
    """Every script that names a file to write calls the check before its work."""
    for path in (ROOT / "benchmarks").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if re.search(r'add_argument\("--(json|markdown)"', text):
            assert "check_files(" in text, path.name


def test_figures_replace_those_between_the_marks(tmp_path):
    document = tmp_path / "page.md"
    document.write_text("a\n<!-- x -->\nold\n<!-- end of x -->\nb\n")
    check_files(argparse.ArgumentParser(), document=document, sections=["x"], written=tmp_path / "new.json")
    replace_section(document, "x", ["one", "two"])
    assert document.read_text() == "a\n<!-- x -->\none\ntwo\n<!-- end of x -->\nb\n"
