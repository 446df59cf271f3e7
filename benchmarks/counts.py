# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts of fixed scenes, which depend on the code alone: what a change costs, without a clock.

    python3 dev.py bench --counts [--write]

Rays, chords, exact tests and the like of small images, the chords that each preset needs in Cycles, anchors
of other engines' pictures, and the portals that its rays pass on the demo's street
(``street/portals_passed.py``). Compared with those in counts.json, beside this file, as the tests do; --write
puts today's there. A count that rises is a slower renderer; commit the file together with what changed it,
and say why.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.run import lit
from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.anchors.anchor_view import traced_views
from scfpf_addon.anchors.completion import completed
from scfpf_addon.anchors.plan import plan_anchors
from scfpf_addon.anchors.seen_scene import SeenScene
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.frame import cast_frame
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.cycles.chords.chord_plan import plan_chords
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.sampling.adaptive import Adaptive
from scfpf_addon.shading.settings.frame_settings import FrameSettings

FILE = Path(__file__).with_suffix(".json")
PRESETS = Path(__file__).parents[1] / "presets"

TRIANGLES = 4000
SIZE = (144, 81)
# Of the frames, which take many samples.
FRAME_SIZE = (96, 54)
# Degree and bend in degrees; in pixels, 0 exact.
BENDS = ((1, 0), (2, 10), (2, 60), (3, 180))
PIXEL_ERRORS = (0.1, 0.0)
# Degree and bend of the volumes whose anchors are counted.
ANCHORED = ((2, 10), (2, 60))
# Of the image that a preset's chords in Cycles are counted for.
CYCLES_SIZE, CYCLES_ERROR = (960, 540), 0.25

# Ends the titles of the counts on the demo's street.
STREET = ", the street in Cycles"

Counts = dict[str, dict[str, int]]


def of_casts() -> Counts:
    """The counts of casting at the benchmarks' scenes, by scene, bend and pixel error."""
    found: Counts = {}
    for name, make in SCENES.items():
        scene = CastScene(*make(TRIANGLES))
        for degree, angle in BENDS:
            projection = bent_projection(degree, math.radians(angle))
            for error in PIXEL_ERRORS:
                counts = CastCounts()
                hits = cast_frame(scene, projection, *SIZE, pixel_error=error, threads=1, counts=counts)
                whole = {key: value for key, value in vars(counts).items() if isinstance(value, int)}
                title = f"{name}, {angle}°, {f'{error:g} px' if error else 'exact'}"
                found[title] = whole | {"hits": int((hits.triangle >= 0).sum())}
    return found


def of_frames() -> Counts:
    """The counts of whole images, with adaptive samples and only the triangles in reach."""
    settings = FrameSettings(*FRAME_SIZE, samples=16, threads=1, adaptive=Adaptive(0.01, 4))
    found: Counts = {}
    for name, make in SCENES.items():
        frame = render_frame(bent_projection(2, math.radians(60)), lit(make(TRIANGLES)), settings)
        assert frame is not None
        report = frame.report
        keys = ("projectors", "rays", "chords", "built")
        found[f"{name}, a frame"] = {key: getattr(report, key) for key in keys}
    return found


def of_presets() -> Counts:
    """Chords and cells of a sheet that each preset's image needs in Cycles."""
    found: Counts = {}
    for path in sorted(PRESETS.glob("*.json")):
        projection = read_preset(path).projection(SIZE[0] / SIZE[1])
        plan = plan_chords([projection], CYCLES_SIZE, CYCLES_ERROR)
        found[f"{path.stem}, Cycles"] = {"chords": plan.count, "across": plan.cells[0], "up": plan.cells[1]}
    return found


def of_anchors() -> Counts:
    """Anchors of bent volumes, those that the first plan lacked, and their pixels."""
    found: Counts = {}
    for name, make in SCENES.items():
        scene = SeenScene(CastScene(*make(TRIANGLES)))
        for degree, angle in ANCHORED:
            projection = bent_projection(degree, math.radians(angle))
            plan = plan_anchors([scene], [projection], SIZE, np.eye(3))
            done = completed(scene, projection, SIZE, traced_views(scene, plan.anchors))
            used = (*done.own.first, *done.own.rest)
            found[f"{name}, {angle}°, anchors"] = {
                "anchors": len(used),
                "added": len(done.added),
                "pixels": sum(done.views[number].anchor.count for number in used),
            }
    return found


def counted() -> Counts:
    """All counts."""
    return of_casts() | of_frames() | of_presets() | of_anchors()


def kept(street: bool = False) -> Counts:
    """The counts in the file, of the demo's street or the others."""
    counts: Counts = json.loads(FILE.read_text(encoding="utf-8"))
    return {title: row for title, row in counts.items() if title.endswith(STREET) == street}


def differences(now: Counts, before: Counts, slack: float = 0.0) -> list[str]:
    """The counts that differ by more than a share, a line each: before, after, and by how much."""
    lines = [f"{title}: not there before" for title in now.keys() - before.keys()]
    lines += [f"{title}: no longer there" for title in before.keys() - now.keys()]
    for title in before.keys() & now.keys():
        for key, old in before[title].items():
            new = now[title].get(key, 0)
            if abs(new - old) > slack * old:
                change = f" ({new / old - 1:+.1%})" if old else ""
                lines.append(f"{title}: {new} {key} instead of {old}{change}")
    return sorted(lines)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"put today's counts into {FILE.name}")
    options = parser.parse_args()
    from benchmarks.street import portals_passed  # needs bpy, which tests of the others do without

    portals_passed.register()
    now = counted() | portals_passed.counted()
    if FILE.exists():
        before = kept() | kept(street=True)
        print("\n".join(differences(now, before)) or f"all {len(now)} as in {FILE.name}")
    if options.write:
        rows = [f" {json.dumps(title, ensure_ascii=False)}: {json.dumps(row)}" for title, row in now.items()]
        FILE.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
