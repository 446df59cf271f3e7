# SPDX-License-Identifier: GPL-3.0-or-later
"""Every ratio that has a goal, in one table: the goal, what prototypes reached, and now.

    python3 dev.py bench --ratios [--quick] [--json FILE] [--markdown docs/performance.md]
    python3 dev.py bench --ratios --from FILE [--markdown docs/performance.md]

Runs the benchmarks of casting, the nodes preview, the Cycles rig and the engine one after the other; half an
hour on a quiet machine. --json keeps all their figures, --from makes the table of such a file and runs none.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import engine, portals, run, scanline
from benchmarks.document import check_files, replace_section

FOLDER = Path(__file__).resolve().parent
SECTION = "ratios"
# Scripts, and what they are asked for.
SCRIPTS = {"run": ["--million"], "scanline": [], "portals": [], "engine": []}
SIZES = (100_000, 1_000_000)
# A cast bent by 60 degrees, in times of the straight one; the first goal there was.
CURVED_BY_STRAIGHT_GOAL = 10.0
# A thing moved in a preview, in times of all of them moved; asked for was "much cheaper".
MOVE_GOAL = 2.0
# What prototypes took at 0.1 px and exact, by bend in degrees, at 100,000 triangles.
PROTOTYPES = {10: ("3.1–3.2", "6.4–6.8"), 60: ("3.8–4.5", "7.9–10.1"), 180: ("4.4–5.3", "10.5–13.7")}

Figures = dict[str, Any]


class Ratio(NamedTuple):
    """A line of the table. most: whether the goal is an upper bound. now: by what it is of."""

    what: str
    goal: float
    most: bool
    prototype: str
    now: dict[str, float]
    unit: str = "×"

    def said(self, value: float) -> str:
        """A value in the unit."""
        if self.unit == "%":
            return f"{value:.0%}".replace("%", " %")
        return f"{value:.1f}" if value >= 2.0 else f"{value:.2f}"

    def met(self, value: float) -> bool:
        """Return whether a value, as it is said, is as good as the goal."""
        rounded = round(value, 2 if self.unit == "%" or value < 2.0 else 1)
        return rounded <= self.goal if self.most else rounded >= self.goal

    def line(self) -> str:
        """The line; what misses the goal is in italics."""
        now = (
            f"{name} {self.said(v) if self.met(v) else f'*{self.said(v)}*'}" for name, v in self.now.items()
        )
        goal = f"{'≤' if self.most else '≥'} {self.said(self.goal)}"
        return f"| {self.what} | {goal} | {self.prototype} | {', '.join(now)} |"


def of_casting(figures: Figures) -> Iterator[Ratio]:
    """Frames and casts against raw Embree."""

    def each(size: int, ratio: Callable[[dict[str, float]], float]) -> dict[str, float]:
        rows = (row for row in figures["speed"] if abs(row["triangles"] / size - 1) < 0.2)
        return {row["scene"]: ratio(row["seconds"]) for row in rows}

    for size in SIZES:
        many = f"{size // 1000}k" if size < 1_000_000 else "1M"
        measured_then = size == SIZES[0]
        for title, shading in (("frame", "flat"), ("smooth", "smooth")):
            share = each(size, lambda s, title=title: s["raw"] / s[title])
            what = f"a straight frame, {shading} shading, {many}: share of raw Embree"
            prototype = "62–68 %" if measured_then and shading == "flat" else ""
            yield Ratio(what, run.STRAIGHT_GOAL, False, prototype, share, "%")
        for angle, goals in run.CURVED_GOALS.items():
            for kind, goal, prototype in zip(("", " exact"), goals, PROTOTYPES[angle], strict=True):
                now = each(size, lambda s, key=f"{angle}°{kind}": s[key] / s["raw"])
                what = f"bent by {angle}°, {kind.strip() or '0.1 px'}, {many}: × raw Embree"
                yield Ratio(what, goal, True, prototype if measured_then else "", now)
    now = each(SIZES[0], lambda s: s["60°"] / s["straight"])
    yield Ratio("bent by 60°, 0.1 px, 100k: × the straight cast", CURVED_BY_STRAIGHT_GOAL, True, "4.5", now)


def of_preview(figures: Figures) -> Iterator[Ratio]:
    """The nodes preview against Blender's Lattice modifier, at a million vertices and triangles."""
    for key, of, what, goal, prototype in (
        ("vertices", "vertices", "remap of 1M vertices", scanline.REMAP_GOAL, "2.1–3.1"),
        ("whole", "triangles", "the whole chain, 1M triangles", scanline.WHOLE_GOAL, "12"),
    ):
        most = min((row[of] for row in figures["scanline"]), key=lambda count: abs(count - SIZES[1]))
        now = {
            row["volume"]: row["processor"][key] / row["processor"]["lattice"]
            for row in figures["scanline"]
            if row[of] == most
        }
        yield Ratio(f"nodes preview, {what}: × the Lattice modifier", goal, True, prototype, now)
    move = max(figures["moves"], key=lambda row: row["triangles"])
    now = {"all / one": move["seconds"]["whole"] / move["seconds"]["small"]}
    yield Ratio(
        "nodes preview, 1M triangles, all things moved: × one small thing moved", MOVE_GOAL, False, "", now
    )


def of_engine(figures: Figures) -> Iterator[Ratio]:
    """The engine against Cycles as it comes and with direct light alone, by the clock."""
    for subject, light in (("default", "its default bounces"), ("direct", "direct light only")):
        times = {}
        for name, kinds in figures.items():
            for kind, step, what in (("off", "cold", ""), ("on", "camera moved", ", kept, camera moved")):
                if kind in kinds:
                    cycles, ours = (kinds[kind][one]["seconds"][step] for one in (subject, "SCFPF"))
                    times[name + what] = cycles / ours
        what = f"Cycles with {light}, from click to picture, 1M: × the engine"
        yield Ratio(what, engine.TIME_GOAL, False, "", times)
    memory = {
        name: kinds["off"]["SCFPF"]["memory"] / kinds["off"]["direct"]["memory"]
        for name, kinds in figures.items()
    }
    yield Ratio("the engine's memory, 1M: × Cycles'", engine.MEMORY_GOAL, True, "", memory)


def of_rig(figures: Figures) -> Iterator[Ratio]:
    """The rig against an ordinary camera, both in Cycles."""
    prototypes = {"around_the_car": "22", "nonlinear_twist": "5.5"}
    for stem, goal in portals.GOALS.items():
        now = {"the demo's street": figures[stem]["path"]}
        title = stem.replace("_", " ")
        yield Ratio(f"Cycles through the rig, {title}: × a camera", goal, True, prototypes.get(stem, ""), now)


GROUPS = {"run": of_casting, "scanline": of_preview, "engine": of_engine, "portals": of_rig}


def table(figures: dict[str, Figures]) -> list[str]:
    """The table in Markdown, of the benchmarks whose figures are there."""
    lines = ["| ratio | goal | prototype | now |", "|---|---|---|---|"]
    return lines + [
        one.line() for name, group in GROUPS.items() if name in figures for one in group(figures[name])
    ]


def measured(quick: bool) -> dict[str, Figures]:
    """The figures of all scripts, each run in a process of its own."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in SCRIPTS.items():
            path = Path(folder, f"{name}.json")
            command = [sys.executable, str(FOLDER / f"{name}.py"), "--json", str(path), *arguments]
            status = subprocess.call([*command, *["--quick"] * quick])
            if status:
                sys.exit(f"benchmarks/{name}.py ended with exit code {status}")
            found[name] = json.loads(path.read_text(encoding="utf-8"))
    return found


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--from", type=Path, dest="kept", metavar="FILE", help="use the figures in FILE")
    parser.add_argument("--markdown", metavar="FILE", help="put the table into a document")
    parser.add_argument("--quick", action="store_true", help="smaller scenes and images, fewer runs")
    options = parser.parse_args()
    check_files(
        parser, read=options.kept, written=options.json, document=options.markdown, sections=[SECTION]
    )
    if options.kept:
        figures = json.loads(options.kept.read_text(encoding="utf-8"))
    else:
        figures = measured(options.quick)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    lines = table(figures)
    print("\n" + "\n".join(lines))
    if options.markdown:
        replace_section(options.markdown, SECTION, lines)


if __name__ == "__main__":
    main()
