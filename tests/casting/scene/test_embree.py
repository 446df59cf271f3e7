# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes handed to Embree by its own interface are those that embreex makes."""

import ctypes
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scfpf_addon.casting.scene import embree_meshes, embreex
from scfpf_addon.casting.scene.embreex import load_embreex

RAYS = 4000


def soup(generator, count=500):
    """Triangles whose vertices are shared, and stand in other orders and kinds than Embree's."""
    vertices = np.asfortranarray(generator.uniform(-1.0, 1.0, (3 * count // 2, 3)))
    return vertices, generator.integers(0, len(vertices), (count, 3), dtype=np.int32)


def cast(scene, generator):
    """Embree's output for rays in all directions."""
    origins, ways = generator.uniform(-1.0, 1.0, (2, RAYS, 3)).astype(np.float32)
    return scene.run(origins, ways, np.full(RAYS, 9.0, np.float32), output=True)


def test_embree_takes_the_arrays_as_they_are():
    """The scene's handle is found in this embreex; otherwise every image takes much longer."""
    modules = load_embreex()
    _, kept, _ = embree_meshes.build_mesh(*soup(np.random.default_rng(1)))
    assert not isinstance(kept, modules[1].TriangleMesh)


@pytest.mark.parametrize("corners", [3, 4])
@pytest.mark.parametrize("fault", ["no library", "another object"])
def test_both_ways_meet_the_same(fault, corners, monkeypatch):
    vertices, faces = soup(np.random.default_rng(2))
    if corners == 4:
        # Pairs of triangles with a common side, every other one with a corner named twice: a triangle.
        faces = np.concatenate([faces, faces[:, 2:]], axis=1)
        faces[::2, 3] = np.roll(faces[::2, 0], 1)
    quick, _kept, one = embree_meshes.build_mesh(vertices, faces)
    assert quick.is_committed == 1
    if fault == "no library":
        monkeypatch.setattr(embree_meshes, "_library", lambda module: None)
    else:
        monkeypatch.setattr(
            embree_meshes, "SceneObject", type("Other", (ctypes.Structure,), {"_fields_": ()})
        )
    modules = load_embreex()
    slow, mesh, several = embree_meshes.build_mesh(vertices, faces)
    assert isinstance(mesh, modules[1].TriangleMesh)
    assert (one, several) == (1, corners - 2)
    by_arrays, copied = (cast(scene, np.random.default_rng(3)) for scene in (quick, slow))
    assert (by_arrays["primID"] >= 0).mean() > 0.5
    copied["primID"] //= several
    for name, values in by_arrays.items():
        # A quad has weights of its own, and other roundings.
        if corners == 3 or name == "primID":
            np.testing.assert_array_equal(values, copied[name])
        elif name in ("tfar", "Ng"):
            np.testing.assert_allclose(values, copied[name], atol=1e-5)


def test_what_memory_does_not_hold_is_said(monkeypatch):
    """Embree reports its error by a number, 4 for memory; embreex would write it to a log."""
    modules = load_embreex()
    monkeypatch.setattr(embree_meshes._library(modules[0].__file__), "rtcGetDeviceError", lambda device: 4)
    with pytest.raises(MemoryError, match="not enough memory"):
        embree_meshes.build_mesh(*soup(np.random.default_rng(4)))


def test_the_library_is_asked_only_where_it_has_all_functions(monkeypatch):
    monkeypatch.setitem(embree_meshes.FUNCTIONS, "rtcNoSuchFunction", (None,))
    assert embree_meshes._library.__wrapped__(load_embreex()[0].__file__) is None


def test_a_library_that_does_not_open_is_none(tmp_path):
    assert embree_meshes._library.__wrapped__(str(tmp_path / "embreex" / "rtcore_scene.so")) is None


def test_an_embree_of_the_program_itself_comes_first(monkeypatch):
    """On Linux embreex calls it, too, as in Debian's Blender; a mixture of two never ends to build."""
    program = SimpleNamespace(
        rtcNewScene=None, **{name: SimpleNamespace() for name in embree_meshes.FUNCTIONS}
    )
    module = load_embreex()[0].__file__
    monkeypatch.setattr(embree_meshes.sys, "platform", "linux")
    monkeypatch.setattr(embree_meshes.ctypes, "CDLL", {None: program}.__getitem__)
    assert embree_meshes._library.__wrapped__(module) is program
    del program.rtcCommitScene
    assert embree_meshes._library.__wrapped__(module) is None


@pytest.fixture
def installed(tmp_path):
    """embreex as it is installed, in a folder of its own; its files are links."""
    real = distribution("embreex")
    for file in real.files:
        place = tmp_path / str(file)
        if "__pycache__" not in place.parts and file.parts[0] != "..":
            place.parent.mkdir(parents=True, exist_ok=True)
            place.symlink_to(real.locate_file(file).resolve())
    return tmp_path


LOAD = """
import sys
sys.path.insert(0, sys.argv[1])
sys.path.append(sys.argv[2])
from scfpf_addon.casting.common.hits import CastError
from scfpf_addon.casting.scene.embreex import load_embreex
try:
    print("loaded", load_embreex()[0].__file__)
except CastError as error:
    print(error)
"""


def loaded(folder):
    """The output of a program that loads embreex from a folder."""
    root = Path(__file__).resolve().parents[3]
    done = subprocess.run([sys.executable, "-c", LOAD, folder, root], capture_output=True, text=True)
    assert done.returncode == 0, f"the program has ended itself: {done.stderr}"
    return done.stdout


def test_a_library_that_is_cut_off_is_said_and_not_loaded(installed):
    """The system ends a program that loads one: a disk was full, or a download ended early."""
    assert embreex.truncated_library("embreex") == ""
    library = next(path for path in installed.rglob("*embree4*") if path.is_file())
    start = library.read_bytes()[: 1 << 20]
    library.unlink()
    library.write_bytes(start)
    said = loaded(installed)
    assert said.startswith("the ray caster embreex is damaged") and f"{library.name} has 1,048,576 of" in said
    library.unlink()
    assert "No such file" in loaded(installed)


def test_a_package_without_a_record_is_not_looked_at(installed):
    """Some systems' own packages have none."""
    next(installed.glob("*.dist-info/RECORD")).unlink()
    assert loaded(installed).startswith("loaded")
