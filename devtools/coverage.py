# SPDX-License-Identifier: GPL-3.0-or-later
"""The coverage of the pure packages by the pure tests, measured by coverage.py with threads and branches.

pyproject.toml says what is measured. docs/contributing.md explains the lines that are left.
"""

from __future__ import annotations

from . import environments, testing
from .environments import Environment

# The least share of lines and branches that all pure tests must cover, in per cent.
LEAST = 95


def test(environment: Environment, arguments: list[str]) -> int:
    """Run the pure tests under coverage.py, print the missing lines and write HTML; returns the exit code.

    arguments: as for `python3 dev.py test`; files and folders choose some of the pure tests. It fails if a
    test fails, or if all tests together cover less than LEAST.
    """
    plan = testing.plan(arguments)
    if "pure" not in plan:
        raise environments.Failure(
            "--coverage is for the pure tests: tests/projection, casting, aim, shading"
        )
    install = [*environments.pip_install(), "--quiet", "-r", str(environments.REQUIREMENTS / "coverage.txt")]
    environments.run([environment.python, *install])
    report = environment.folder / "report-coverage.xml"
    data = f"--data-file={environment.folder / 'coverage'}"
    command = [environment.python, "-m", "coverage", "run", data, "-m", "pytest", f"--junitxml={report}"]
    result = testing.run_pytest(f"{environment.title}, pure tests", report, [*command, *plan["pure"]])
    status = environments.run_through([environment.python, "-m", "coverage", "report", data])
    pages = environment.folder / "coverage-html"
    environments.run_through(
        [environment.python, "-m", "coverage", "html", data, "--quiet", "-d", str(pages)]
    )
    environments.say(f"line by line: {pages / 'index.html'}")
    return testing.close([result]) or status
