# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of the benchmarks of real scenes: what the scenes hold, and what is made of measurements."""

import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.real.beside_cycles import CAMERA, ENGINE, RIG, Figures, line, table
from benchmarks.real.blender_apart import run_apart
from benchmarks.real.lock_spans import RECORD, Spans, cores_busy, spans

ROOT = pathlib.Path(__file__).parents[3]
SCRIPT = ROOT / "benchmarks" / "real" / "beside_cycles.py"
ROOM, MEADOW = "room, 200 materials", "meadow of cards"
# Counts what each scene holds, in a Blender of its own, and leaves the files.
COUNTED = """
import json, sys
from pathlib import Path
import bpy, numpy as np
from benchmarks.real import beside_cycles, real_scenes
beside_cycles.register()
for name in sys.argv[2:]:
    real_scenes.write(name, Path(sys.argv[1], f"{name}.blend"))
    used = {slot.material.name for each in bpy.data.objects for slot in each.material_slots}
    print(json.dumps({
        "used": sorted(used),
        "lamps": sorted(each.type for each in bpy.data.lights),
        "cards": sum(len(each.data.polygons) for each in bpy.data.objects if each.name.startswith("Plant")),
        "sum": sum(float(np.sum(each.matrix_basis)) for each in bpy.data.objects),
    }))
"""


def counted(folder, *names):
    command = [sys.executable, "-c", COUNTED, str(folder), *names]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return dict(zip(names, map(json.loads, lines), strict=True))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes")


@pytest.fixture(scope="module")
def both(folder):
    return counted(folder, MEADOW, ROOM)


def test_the_room_has_all_kinds_of_materials_and_the_same_things_each_time(both, tmp_path):
    first, again = both[ROOM], counted(tmp_path, ROOM)[ROOM]
    assert first == again
    kinds = [name.split()[0] for name in first["used"]]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "glass": 20,
        "coated": 40,
        "metal": 50,
        "plain": 90,
    }
    assert first["lamps"] == ["AREA"] * 4 + ["SUN"]


def test_the_meadow_has_thousands_of_cards_and_is_measured(both, folder):
    found = both[MEADOW]
    assert found["cards"] == 7200 and {"Lawn", "Leaf"} <= set(found["used"])
    for subject in (ENGINE, CAMERA, RIG):
        path = folder / f"{MEADOW}.blend"
        figures = Figures(**run_apart(str(SCRIPT), "--one", str(path), subject, "0", "4"))
        assert min(figures) > 0.0


def test_equal_noise_takes_samples_in_proportion_to_variance():
    """Half the noise is worth four times the samples."""
    own, other = Figures(2.0, 3.0, 0.01), Figures(3.0, 6.0, 0.02)
    assert other.ratios(own) == pytest.approx((1.5, 2.0, 8.0))


def test_missed_goals_are_named(capsys):
    own, slow, fast = Figures(2.0, 3.9, 0.1), Figures(5.0, 8.0, 0.1), Figures(3.0, 8.0, 0.1)
    met = line("street, perspective", "no bounces", {ENGINE: own, CAMERA: slow, RIG: fast}, 2.0)
    assert met[1] and "*" not in met[0]
    results = {"street, perspective": {name: {ENGINE: own, CAMERA: fast} for name in ("no", "some")}}
    lines = table(results)
    assert "*1.5 ×*" in lines[-1]
    assert "MISSED: street, perspective, no; street, perspective, some" in capsys.readouterr().out


def test_spans_are_read_from_signals():
    """Thread 1 takes the lock first; thread 2 holds it for 3 and 5 ms, and works for 7 and 11 ms without."""
    take, release = 8, 9
    own = np.cumsum([1, 3, 7, 5, 11]) * 1_000_000
    rows = [(0, 1, take), (5, 1, release)]
    rows += [(time, 2, kind) for time, kind in zip(own, (take, release, take, release, take), strict=True)]
    rows += [(6, 1, 7)]
    found = spans(np.array(rows, RECORD))
    assert found.locked == pytest.approx([0.003, 0.005]) and found.free == pytest.approx([0.007, 0.011])


@pytest.mark.parametrize("cores, busy", [(1, 1.0), (2, 2.0), (4, 4.0), (16, 5.0)])
def test_a_lock_bounds_the_cores_that_are_busy(cores, busy):
    """A fifth of the work under a lock keeps five cores busy, and no more."""
    found = Spans(np.full(500, 1e-3), np.full(500, 4e-3))
    assert found.share == pytest.approx(0.2)
    assert cores_busy(found, cores) == pytest.approx(busy, rel=0.02)
