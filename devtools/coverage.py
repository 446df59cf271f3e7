# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lines of the pure packages the pure tests run: coverage.py, threads and branches included.

What is measured is in pyproject.toml. Why the lines that are left do not run is in docs/contributing.md.
"""

from __future__ import annotations

from . import environments, testing
from .environments import Environment

# The share of lines and branches, in per cent, below which all pure tests are too few.
LEAST = 95


def test(environment: Environment, arguments: list[str]) -> int:
    """Run the pure tests under coverage.py, print what is missing and write HTML; the exit code.

    arguments: as for `python3 dev.py test`; files and folders choose some of the pure tests. Fails when a
    test does, or when all of them cover too little.
    """
    plan = testing.plan(arguments)
    if "pure" not in plan:
        raise environments.Failure("--coverage is for the pure tests: tests/projection, casting, shading")
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
