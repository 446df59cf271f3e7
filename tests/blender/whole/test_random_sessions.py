# SPDX-License-Identifier: GPL-3.0-or-later
"""Random sessions: no traceback, no crash, all operators' errors in plain words.

`benchmarks/soak.py` runs them for as long as one likes. SCFPF_SEEDS="10:20" and SCFPF_STEPS in the
environment choose which seeds and how many steps; each seed's steps are written to the folder SCFPF_JOURNAL.
"""

import os
import pathlib

import bpy
import pytest
from random_sessions import Session

FULL = bool(os.environ.get("SCFPF_FULL_TESTS"))
SEEDS = range(*map(int, os.environ.get("SCFPF_SEEDS", "0:40" if FULL else "0:3").split(":")))
STEPS = int(os.environ.get("SCFPF_STEPS", "400" if FULL else "40"))


@pytest.mark.parametrize("seed", SEEDS)
def test_random_session(seed, addon, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if not os.environ.get("SCFPF_JOURNAL"):
        return Session(seed, tmp_path, addon).run(STEPS)
    with pathlib.Path(os.environ["SCFPF_JOURNAL"], f"{seed}.txt").open("w") as journal:
        Session(seed, tmp_path, addon, journal).run(STEPS)
    return None


def test_more_surfaces_than_a_volume_may_have_are_refused(addon):
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    surface = camera.scfpf.surfaces[0].object
    for _ in range(1000):
        camera.scfpf.surfaces.add()["object"] = surface
    assert len(camera.scfpf.surfaces) == 1002
    # The volume object takes no more than a volume may have.
    group = addon("bridge.volume.volume_object").sync_volume_object(camera).modifiers[0].node_group
    assert len(group.nodes) < 100
    for operator in (bpy.ops.scfpf.render, bpy.ops.scfpf.surface_add):
        with pytest.raises(RuntimeError, match="control surfaces") as refused:
            operator()
        assert "Traceback" not in str(refused.value)


@pytest.mark.parametrize("operator", ["preview_toggle", "cycles_rig"])
def test_a_lattice_is_refused_where_nothing_follows_it(operator):
    bpy.ops.scfpf.camera_add()
    bpy.ops.scfpf.volume_to_lattice()
    with pytest.raises(RuntimeError, match="lattice") as refused:
        getattr(bpy.ops.scfpf, operator)()
    assert "Traceback" not in str(refused.value)


def test_a_preset_is_not_exported_to_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bpy.ops.scfpf.camera_add()
    with pytest.raises(RuntimeError, match="Choose a file"):
        bpy.ops.scfpf.preset_export(name="One")
    assert not list(tmp_path.iterdir())


def test_passes_of_cycles_are_refused_in_another_engine_and_without_surfaces():
    bpy.ops.scfpf.camera_add()
    bpy.ops.scfpf.cycles_rig()
    bpy.context.scene.render.engine = "SCFPF"
    with pytest.raises(RuntimeError, match="Choose Cycles as the render engine") as refused:
        bpy.ops.scfpf.cycles_passes()
    assert "Traceback" not in str(refused.value)
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.scfpf.surface_remove()
    with pytest.raises(RuntimeError, match="needs at least two") as refused:
        bpy.ops.scfpf.cycles_passes()
    assert "Traceback" not in str(refused.value)


def test_a_grid_of_another_name_is_subdivided_or_refused():
    bpy.ops.scfpf.camera_add()
    bpy.ops.scfpf.surface_to_grid(columns=2, rows=3)
    camera = bpy.context.scene.camera
    surface = camera.scfpf.surfaces[camera.scfpf.active_surface].object
    surface.scfpf_surface.kind = "PATCH"
    assert bpy.ops.scfpf.surface_subdivide() == {"FINISHED"}
    assert len(surface.data.vertices) == 5 * 7
    surface.scfpf_surface.kind = "NURBS"
    with pytest.raises(RuntimeError, match="choose another kind") as refused:
        bpy.ops.scfpf.surface_subdivide()
    assert "Traceback" not in str(refused.value)
