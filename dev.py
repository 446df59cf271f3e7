# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything a developer types: `python3 dev.py demo`, `gallery`, `test`, `build`, `lint`, `bench`, others.

Nothing has to be installed or done before: it finds a Python for which there is a Blender, makes its own
virtual environments in .venvs/ and goes on from there. It starts with any Python from 3.9 on.
"""

import sys

if sys.version_info < (3, 9):
    sys.exit("dev.py needs Python 3.9 or later to start; this is Python %d.%d." % sys.version_info[:2])

import argparse
import functools
import os
import shutil
import time
from concurrent.futures import ThreadPoolExecutor

from devtools import corpus, coverage, environments, own_blender, package, pictures, sizes, testing, window

# Parts of the suite without a window, the longest first, and how many run at a time: more than two cores
# need, so that none is idle while the last ones end.
PARTS = ("blender", "pure", "installed")
AT_A_TIME = 3

# What lint runs.
CHECKS = (("ruff", "check", "."), ("ruff", "format", "--check", "."), ("mypy",))

# Scripts in benchmarks/ by what is asked for.
BENCHMARKS = {
    "speed": ("run", "scanline"),
    "ratios": ("ratios",),
    "trade": ("trade", "peers"),
    "extremes": ("extremes",),
    "cycles": ("portals",),
    "street": ("street/portals_passed",),
    "lock": ("real/lock_spans",),
    "engine": ("engine",),
    "live": ("live/street_drag",),
    "aim": ("aim/bars",),
    "layers": ("street/layer_cost",),
    "soak": ("soak",),
    "scale": ("scale",),
    "anchors": ("street/anchored",),
    "counts": ("counts",),
}


def command_demo(options, rest):
    """Render the demo through seven presets into demo/output/."""
    environment = environments.first()
    environments.run([environment.python, "demo/render_demo.py", "--output", "demo/output", *rest])


def command_thumbnails(options, rest):
    """Render the pictures of the presets in the menus anew, into presets/thumbnails/."""
    environments.run([environments.first().python, "demo/render_thumbnails.py", *rest])


def command_recipes(options, rest):
    """Make the recipes: pages and pictures in docs/recipes/, .blend files in demo/output/recipes/."""
    environments.run([environments.first().python, "demo/recipes/make.py", *rest])


def command_compositions(options, rest):
    """Make the compositions: pictures in docs/compositions/, .blend files in demo/output/compositions/."""
    environments.run([environments.first().python, "demo/compositions/make.py", *rest])


def command_showpieces(options, rest):
    """Render docs/showpieces/ through Cycles and EEVEE, an hour or more; names choose some."""
    environments.run([environments.first().python, "demo/showpieces/render.py", *rest])


def command_messages(options, rest):
    """Write the catalogue of the interface's texts, from which translations are made."""
    environments.run([environments.first().python, "devtools/catalogue.py", *rest])


def command_gallery(options, rest):
    """Render the pictures of docs/gallery.md: every figure of the paper, and what lies beyond."""
    environment = environments.first()
    environments.run([environment.python, "demo/render_gallery.py", "--output", "docs/gallery.md", *rest])


def command_pictures(options, rest):
    """Take the screenshots of README.md and docs/guide.md, and write docs/presets.md; names choose some.

    The name over-time, and names that begin with aim- or layers-, are rendered for the guide, docs/aim.md and
    docs/compose.md; without names all are.
    """
    rendered = {
        "aim-": "demo/aim/pictures.py",
        "layers-": "demo/recipes/layer_pictures.py",
        "over-time": "demo/time_film.py",
    }
    for start, script in rendered.items():
        chosen = [name for name in rest if name.startswith(start)]
        if chosen or not rest:
            environments.run([environments.first().python, script, *chosen])
    if not rest or not rest[0].startswith(tuple(rendered)):
        pictures.take(environments.first(), options.blender_window, rest)


def command_test(options, rest):
    """Run all tests under every supported Blender whose Python is here; further arguments go to pytest."""
    if options.blender:
        return own_blender.test(options.blender, rest)
    if options.coverage:
        return coverage.test(environments.first(), rest)
    wanted = [b for b in environments.BLENDERS if not options.python or b.python in options.python]
    found = [environments.ensure(blender) for blender in wanted]
    missing = tuple(blender for blender, made in zip(wanted, found) if made is None)
    present = [made for made in found if made is not None]
    if not present or (missing and options.python):
        raise environments.Failure(environments.needed_help(missing))
    with ThreadPoolExecutor(1) as beside:
        # From the first on: building the zips keeps one core busy.
        linted = beside.submit(lint_result, present[0].python) if options.lint else None
        results, warnings = test_in(present, testing.plan(rest), options.blender_window)
        if linted is not None:
            results.append(linted.result())
    for blender in missing:
        warnings.append(f"NOT tested on Blender {blender.name}: no Python {blender.python} here")
    return testing.close(results, warnings)


def test_in(present, plan, blender_window):
    """Build the zips if they are needed and run the planned parts; returns the results and the warnings."""
    results, zipped = [], None
    if plan.keys() & {"installed", "window"}:
        try:
            zipped = package.build(present[0])
        except environments.Failure as failure:
            environments.say(f"the zips could not be built: {failure}")
            results.append(testing.Result("building the zips", 0, 0, 0, False))
    runs = [(environment, part) for part in PARTS for environment in present if part in plan]
    if not zipped:
        runs = [(environment, part) for environment, part in runs if part != "installed"]
    scenarios = plan["window"] if "window" in plan and zipped else None
    made, warnings = run_parts(runs, plan, bool(zipped), scenarios, blender_window)
    if "window" not in plan and "installed" in plan:
        warnings.append("NOT tested in a window: with options that part runs only if tests/window is named")
    return results + made, warnings


def run_parts(runs, plan, zipped, scenarios=None, blender_window=None):
    """Run parts of the suite, (environment, part) each: ``AT_A_TIME`` of them, beside the part in a window.

    A part is a process of its own that mostly keeps one core busy; Blender takes some GB of memory. The two
    processes of the part in a window wait half of the time. Tests with the mark "once" run in the
    first environment only. Where there are zips the Blender tests install theirs; otherwise they load the
    checkout. scenarios: the arguments of the part in a window, None without it. Returns the results and the
    warnings.
    """
    # Threads of OpenBLAS that wait for a core which another part keeps busy take several times as long.
    environ = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **({testing.INSTALL_ZIP: "1"} if zipped else {})}

    def run(environment, part):
        report = environment.folder / f"report-{part}.xml"
        command = [environment.python, "-m", "pytest", f"--junitxml={report}", *plan[part]]
        title = f"{environment.title}, {part} tests"
        if zipped and part == "blender":
            title += " of the installed zip"
        if environment is not runs[0][0] and "-m" not in plan[part]:
            command += testing.WITHOUT_ONCE
            title += " but those that one Blender is enough for"
        if jobs == 1:
            return [testing.run_pytest(title, report, command, environ)], []
        if (environment, part) != runs[0] and shutil.which("nice"):
            # The longest one gets ahead, or a core would be idle while it ends.
            command = ["nice", "-n", "4", *command]
        label = f"[{environment.folder.name} {part}]"
        return [testing.run_beside(label, title, report, command, environ)], []

    works = [functools.partial(run, *one) for one in runs]
    if scenarios is not None:
        # The longest of all.
        works.insert(0, lambda: window.test(blender_window, scenarios))
    if not works:
        return [], []
    jobs = min(AT_A_TIME + (scenarios is not None), len(works)) if (os.cpu_count() or 1) > 1 else 1
    with ThreadPoolExecutor(jobs) as pool:
        ended = list(pool.map(lambda work: work(), works))
    return [one for results, _ in ended for one in results], [
        one for _, warnings in ended for one in warnings
    ]


def command_build(options, rest):
    """Build the extension's zips into dist/."""
    package.build(environments.first())


def command_lint(options, rest):
    """Check style, layout and types; --fix mends what the linter can."""
    python = environments.first().python
    if options.fix:
        environments.run_through([python, "-m", "ruff", "check", "--fix", "--quiet", "."])
        environments.run([python, "-m", "ruff", "format", "."])
    failed = failed_checks(python)
    return f"-- lint: {failed} of {len(CHECKS)} checks failed" if failed else 0


def failed_checks(python):
    """The number of checks of style, layout and types that fail."""
    return sum(environments.run_through([python, "-m", *check]) != 0 for check in CHECKS)


def lint_result(python):
    """The checks as a row of the table of tests, among which they do not count."""
    started, failed = time.monotonic(), failed_checks(python)
    return testing.Result(f"lint ({time.monotonic() - started:.0f} s)", 0, failed, 0, not failed)


def command_corpus(options, rest):
    """Render every .blend file of a folder in every way, beside an ordinary camera, into a table."""
    return corpus.run(rest)


def command_sizes(options, rest):
    """Print the largest folders, files, classes and functions."""
    print(sizes.report())


def command_bench(options, rest):
    """Benchmarks: speed, or one of --ratios, --trade, --extremes, --cycles, --engine, --live, and others."""
    environment = environments.first()
    kind = next((name for name in BENCHMARKS if f"--{name}" in rest), "speed")
    arguments = [argument for argument in rest if argument != f"--{kind}"]
    for script in BENCHMARKS[kind]:
        environments.run([environment.python, f"benchmarks/{script}.py", *arguments])


def parser():
    """The command line."""
    top = argparse.ArgumentParser(prog="dev.py", description=__doc__.splitlines()[0])
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commanded = (command_demo, command_gallery, command_recipes, command_compositions, command_showpieces)
    commanded += (command_messages,)
    commanded += (command_thumbnails, command_pictures)
    for run in (
        *commanded,
        command_test,
        command_build,
        command_lint,
        command_sizes,
        command_corpus,
        command_bench,
    ):
        summary = run.__doc__.strip().splitlines()[0]
        command = commands.add_parser(
            run.__name__[len("command_") :], help=summary, description=summary, allow_abbrev=False
        )
        command.set_defaults(run=run)
    pythons = [blender.python for blender in environments.BLENDERS]
    test = commands.choices["test"]
    test.add_argument("--python", action="append", choices=pythons, help="only this Python; it must be here")
    test.add_argument("--blender", metavar="PATH", help="only inside this Blender of your own")
    what = "only the pure tests, and which lines of the pure packages they run"
    test.add_argument("--coverage", action="store_true", help=what)
    test.add_argument("--lint", action="store_true", help="lint too, beside the tests")
    for name, what in (("test", "the tests in a window use"), ("pictures", "use")):
        commands.choices[name].add_argument("--blender-window", metavar="PATH", help=f"{what} this Blender")
    commands.choices["lint"].add_argument("--fix", action="store_true", help="mend what can be mended")
    return top


def main():
    """Run one command; the exit code is 0 when all went well."""
    options, rest = parser().parse_known_args()
    rest = rest[1:] if rest[:1] == ["--"] else rest
    if rest and options.command in ("build", "lint", "sizes"):
        parser().error(f"unknown arguments: {' '.join(rest)}")
    try:
        return options.run(options, rest)
    except environments.Failure as failure:
        sys.stdout.flush()
        return f"dev.py: {failure}"
    except KeyboardInterrupt:
        return "dev.py: stopped"


if __name__ == "__main__":
    sys.exit(main())
