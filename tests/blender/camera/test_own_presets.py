# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's own presets: saved, listed, applied, shared as files, removed; and invalid files."""

import errno
import json
import os
import pathlib

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded_layout import drawn


@pytest.fixture
def camera():
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 90, 100
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    return bpy.context.object


@pytest.fixture
def folder(addon):
    """The folder of own presets, empty before and after."""
    place = addon("bridge.camera.preset_folder").own_folder(create=True)

    def clear():
        for path in place.iterdir():
            path.unlink()

    clear()
    yield place
    clear()


@pytest.fixture
def sampled(addon):
    """Return Q at some image positions, in camera space."""
    read = addon("bridge.camera.read_projection").read_projection

    def sample(camera):
        x, y, t = np.random.default_rng(3).uniform(size=(3, 300))
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9)
        image = projection.parameters(x, y)
        position = projection.volume.evaluate(image.u, image.v, t).position
        inward = np.linalg.inv(np.array(camera.matrix_world, np.float64))
        return inward[:3, :3] @ position + inward[:3, 3:], image.mask

    return sample


def check_round_trip(camera, sampled, tolerance=2e-6):
    before, mask = sampled(camera)
    assert bpy.ops.scfpf.preset_save(name="Mine", description="How it is.", replace=True) == {"FINISHED"}
    assert bpy.ops.scfpf.preset_apply(preset="perspective") == {"FINISHED"}
    assert bpy.ops.scfpf.preset_apply_own(preset="mine", fit=False) == {"FINISHED"}
    after, mask_after = sampled(camera)
    np.testing.assert_array_equal(mask_after, mask)
    size = np.ptp(before, axis=1).max()
    assert np.linalg.norm(after - before, axis=0)[mask].max() < tolerance * size


@pytest.mark.parametrize(
    "preset",
    ["around_the_car", "cylindrical_panorama", "digital_cubism", "polynomial_fisheye", "occlusion_camera"],
)
def test_what_is_saved_is_what_comes_back(camera, folder, sampled, preset):
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    camera.location, camera.rotation_euler = (1, 2, 3), (0.3, 0.2, 0.1)
    camera.scfpf.u_range = 0.125, 0.75
    kinds = [slot.object.scfpf_surface.kind for slot in camera.scfpf.surfaces]
    names = [slot.object.name for slot in camera.scfpf.surfaces]
    check_round_trip(camera, sampled)
    assert [slot.object.scfpf_surface.kind for slot in camera.scfpf.surfaces] == kinds
    assert [slot.object.name.split(".")[0] for slot in camera.scfpf.surfaces] == [
        name.split(".")[0] for name in names
    ]


def test_weights_modifiers_and_animation_are_saved_as_they_are_now(camera, folder, sampled):
    assert bpy.ops.scfpf.preset_apply(preset="around_the_car") == {"FINISHED"}
    settings, middle = camera.scfpf, camera.scfpf.surfaces[1].object
    settings.basis, settings.surfaces[1].weight = "NURBS", 2.5
    modifier = middle.modifiers.new("Bend", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.angle = "TWIST", 0.4
    check_round_trip(camera, sampled, 5e-4)
    assert settings.surfaces[1].weight == 2.5 and settings.basis == "NURBS"
    assert settings.surfaces[1].object.scfpf_surface.kind == "GRID"


def test_a_lattice_is_saved_as_its_layers(camera, folder, sampled):
    assert bpy.ops.scfpf.preset_apply(preset="perspective") == {"FINISHED"}
    assert bpy.ops.scfpf.volume_to_lattice() == {"FINISHED"}
    for point in camera.scfpf.surfaces[0].object.data.points:
        point.co_deform.x += 0.1 * point.co.y
    bpy.context.view_layer.update()
    check_round_trip(camera, sampled, 5e-4)


def test_names_replace_only_when_asked_and_are_listed_and_removed(addon, camera, folder):
    own = addon("operators.camera.own_presets")
    assert bpy.ops.scfpf.preset_save(name="My Wide / Lens!", description="Wide.") == {"FINISHED"}
    assert sorted(path.name for path in folder.iterdir()) == ["my_wide_lens.json", "my_wide_lens.png"]
    assert own.own_presets() == [("my_wide_lens", "My Wide / Lens!", "Wide.")]
    with pytest.raises(RuntimeError, match="already: choose another name, or tick Replace"):
        bpy.ops.scfpf.preset_save(name="My Wide / Lens!")
    assert bpy.ops.scfpf.preset_save(name="My Wide / Lens!", replace=True) == {"FINISHED"}
    with pytest.raises(RuntimeError, match="Give the preset a name"):
        bpy.ops.scfpf.preset_save(name="   ")
    assert bpy.ops.scfpf.preset_remove(preset="my_wide_lens") == {"FINISHED"}
    assert not list(folder.iterdir())
    for stem in ("my_wide_lens", "../presets/perspective", "/etc/passwd"):
        with pytest.raises(RuntimeError, match="no preset"):
            bpy.ops.scfpf.preset_apply_own(preset=stem)
        with pytest.raises(RuntimeError, match="no preset"):
            bpy.ops.scfpf.preset_remove(preset=stem)
    assert addon("bridge.camera.preset_folder").stem_of("CON") == "con_preset"


def test_names_of_the_same_letters_are_presets_of_their_own(addon, camera, folder):
    """Files are named in few letters: two names in Chinese are the same file's."""
    listed = addon("operators.camera.own_presets").own_presets
    for name in ("広角", "望遠"):
        assert bpy.ops.scfpf.preset_save(name=name, description="First.") == {"FINISHED"}
    assert [item[:2] for item in listed()] == [("preset", "広角"), ("preset_2", "望遠")]
    assert bpy.ops.scfpf.preset_save(name="望遠", description="Second.", replace=True) == {"FINISHED"}
    assert {item[1:] for item in listed()} == {("広角", "First."), ("望遠", "Second.")}


def test_presets_are_shared_as_files(camera, folder, tmp_path):
    assert bpy.ops.scfpf.preset_apply(preset="sample_rate_lens") == {"FINISHED"}
    path = tmp_path / "shared"
    assert bpy.ops.scfpf.preset_export(name="Shared", filepath=str(path)) == {"FINISHED"}
    data = json.loads(pathlib.Path(f"{path}.json").read_text(encoding="utf-8"))
    assert data["name"] == "Shared" and data["mappings"][0]["kind"] == "RADIAL_CURVE"
    assert bpy.ops.scfpf.preset_import(filepath=f"{path}.json") == {"FINISHED"}
    assert sorted(item.name for item in folder.iterdir()) == ["shared.json", "shared.png"]
    with pytest.raises(RuntimeError, match="already"):
        bpy.ops.scfpf.preset_import(filepath=f"{path}.json")
    with pytest.raises(RuntimeError, match="Cannot write"):
        bpy.ops.scfpf.preset_export(name="Shared", filepath=str(tmp_path / "nowhere" / "x.json"))


def test_own_presets_have_pictures_of_their_volumes(addon, camera, folder, monkeypatch):
    """Small, of all that is drawn; another one once replaced; without one all goes on."""
    thumbnails, storing = addon("panels.thumbnails"), addon("bridge.camera.preset_folder")
    shown = set()
    for preset in ("perspective", "cylindrical_panorama"):
        assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
        assert bpy.ops.scfpf.preset_save(name="Mine", replace=True) == {"FINISHED"}
        image = bpy.data.images.load(str(folder / "mine.png"))
        pixels = np.array(image.pixels[:]).reshape(*reversed(image.size), 4)
        bpy.data.images.remove(image)
        assert pixels.shape == (72, 96, 4) and (folder / "mine.png").stat().st_size < 20_000
        drawn = np.abs(pixels - pixels[0, 0]).max(axis=2) > 0.1
        rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
        assert max(np.ptp(rows) / 72, np.ptp(columns) / 96) > 0.8, "it fills its frame"
        assert (pixels[..., 2] - pixels[..., 1]).max() > 0.2 and (pixels[..., 1] - pixels[..., 2]).max() > 0.2
        # Without a window icons have no numbers; what was loaded tells.
        thumbnails.own_thumbnail("mine")
        loaded = {name for name in thumbnails._loaded[0] if name.endswith(" mine")}
        assert len(loaded - shown) == 1
        assert tuple(thumbnails._loaded[0][(loaded - shown).pop()].image_size) == (96, 72)
        shown |= loaded
    (folder / "mine.png").write_bytes(b"no picture")
    assert storing.thumbnail_file("mine") is None
    huge = np.zeros((1, 5000, 4))
    (folder / "mine.png").write_bytes(addon("projection.presets.thumbnail").png(huge))
    assert storing.thumbnail_file("mine") is None
    (folder / "mine.png").unlink()
    assert storing.thumbnail_file("mine") is None and thumbnails.own_thumbnail("mine") == 0

    def refuse(path):
        if path.suffix == ".png":
            raise OSError(28, "No space left on device")
        return replacing(path)

    replacing = storing.replacing
    monkeypatch.setattr(storing, "replacing", refuse)
    assert bpy.ops.scfpf.preset_save(name="Other") == {"FINISHED"}
    assert [path.name for path in sorted(folder.iterdir())] == ["mine.json", "other.json"]


def test_triangular_tiles_are_saved_as_they_are(camera, folder, sampled):
    assert bpy.ops.scfpf.preset_apply(preset="multiperspective_tiles", fit=False) == {"FINISHED"}
    camera.location, camera.rotation_euler = (1, 2, 3), (0.3, 0.2, 0.1)
    camera.scfpf.surfaces[1].object.scale.x = 1.5
    bpy.context.view_layer.update()
    check_round_trip(camera, sampled)
    assert [slot.object.scfpf_surface.kind for slot in camera.scfpf.surfaces] == ["UV_MESH"] * 2


def test_files_that_are_none_are_listed_with_what_is_wrong(addon, camera, folder, tmp_path):
    (folder / "broken.json").write_text('{"format": 1}', encoding="utf-8")
    (folder / "odd.json").write_bytes(b"\xff\xfe\x00")
    listed = addon("operators.camera.own_presets").own_presets()
    assert [item[:2] for item in listed] == [("broken", "broken"), ("odd", "odd")]
    assert "needs name" in listed[0][2] and "UTF-8" in listed[1][2]
    before = [slot.object for slot in camera.scfpf.surfaces]
    with pytest.raises(RuntimeError, match="needs name"):
        bpy.ops.scfpf.preset_apply_own(preset="broken")
    with pytest.raises(RuntimeError, match="UTF-8"):
        bpy.ops.scfpf.preset_import(filepath=str(folder / "odd.json"))
    assert [slot.object for slot in camera.scfpf.surfaces] == before


PLANE = {"name": "A", "kind": "PLANE", "width": 1, "height": 1, "location": [0, 0, -1]}
BROKEN = {
    "empty": b"",
    "blank": b" \n\t",
    "no JSON": b"{'format': 1",
    "a list": b"[1, 2]",
    "a word": b"null",
    "bytes": bytes(range(256)) * 40,
    "deep": b"[" * 100_000,
    "ten megabytes of nothing": b" " * 10_000_000,
    "ten megabytes of numbers": b'{"format": [' + b"1," * 5_000_000 + b"1]}",
    "a long number": b'{"format": ' + b"9" * 5_000 + b"}",
    "huge": {"width": 1e300},
    "infinite": {"width": float("inf")},
    "not a number": {"width": float("nan")},
    "a text for a number": {"width": "1"},
    "a text for a place": {"location": "here"},
    "a number for a name": {"name": 5},
    "an unknown kind": {"kind": ["PLANE"]},
}


def test_each_broken_file_among_own_presets_says_what_is_wrong(addon, camera, folder):
    """Listed under the file's name with the fault as its tooltip; applied or imported it is refused."""
    menus, own_presets = addon("panels.preset_menus"), addon("operators.camera.own_presets").own_presets
    presets = addon("operators.camera.presets").FOLDER
    whole = json.loads((presets / "perspective.json").read_text(encoding="utf-8"))
    for name, content in BROKEN.items():
        if isinstance(content, dict):
            content = json.dumps(whole | {"surfaces": [PLANE | content, PLANE]}).encode()
        (folder / f"{name}.json").write_bytes(content)
        # Its picture is none either.
        (folder / f"{name}.png").write_bytes(content[:1000])
    listed = {stem: (title, text) for stem, title, text in own_presets()}
    assert listed.keys() == BROKEN.keys()
    for menu in (menus.SCFPF_MT_presets_own, menus.SCFPF_MT_presets_remove):
        assert drawn(menu)
    before = [slot.object for slot in camera.scfpf.surfaces]
    for name, (title, text) in listed.items():
        assert title == name and len(text) > len(f"{name}.json: ") and "\n" not in text
        calls = [
            (bpy.ops.scfpf.preset_apply_own, {"preset": name}),
            (bpy.ops.scfpf.preset_import, {"filepath": str(folder / f"{name}.json")}),
        ]
        for operator, options in calls:
            with pytest.raises(RuntimeError, match=f"{name}.json") as refused:
                operator(**options)
            assert "Traceback" not in str(refused.value) and len(str(refused.value)) < 1000
    assert [slot.object for slot in camera.scfpf.surfaces] == before
    for name in BROKEN:
        assert bpy.ops.scfpf.preset_remove(preset=name) == {"FINISHED"}
    assert not list(folder.iterdir())


def test_st_maps_and_holes_cannot_be_saved(camera, folder):
    assert bpy.ops.scfpf.mapping_add(kind="ST_MAP") == {"FINISHED"}
    camera.scfpf.mappings[0].image = bpy.data.images.new("Map", 4, 4, float_buffer=True)
    with pytest.raises(RuntimeError, match="ST map, which a preset cannot hold"):
        bpy.ops.scfpf.preset_save(name="Mine")
    assert not list(folder.iterdir())


WORDS = st.sampled_from(
    ["name", "kind", "GRID", "points", "mappings", "surfaces", "LENS", "__import__('os')"]
)
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-10, 10**12) | WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(change=st.dictionaries(
    st.sampled_from(["name", "basis", "surfaces", "mappings", "u_range", "aspect", "fit", "extra"]), ANYTHING,
    min_size=1, max_size=2))  # fmt: skip
def test_no_file_does_more_than_be_refused(addon, camera, folder, change):
    """Any file is imported as a preset or refused in one line; the camera stays unchanged."""
    presets = addon("operators.camera.presets").FOLDER
    data = json.loads((presets / "sample_rate_lens.json").read_text(encoding="utf-8")) | change
    path = folder / "fuzzed.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    try:
        bpy.ops.scfpf.preset_import(filepath=str(path), replace=True)
    except RuntimeError as error:
        assert "Traceback" not in str(error) and "fuzzed.json: " in str(error)
    assert len(camera.scfpf.surfaces) == 2


def test_export_leaves_all_other_files_alone(camera, tmp_path):
    """A temporary file's name belongs to nobody else, and no link leads out of the folder."""
    folder, elsewhere = tmp_path / "here", tmp_path / "elsewhere.txt"
    folder.mkdir()
    elsewhere.write_text("not yours")
    for name in ("mine.part", "mine.json.part", "mine.tmp"):
        (folder / name).symlink_to(elsewhere)
    (folder / "mine.PART").write_text("somebody's")
    names = {path.name for path in folder.iterdir()}
    assert bpy.ops.scfpf.preset_export(name="Mine", filepath=str(folder / "mine.json")) == {"FINISHED"}
    assert {path.name for path in folder.iterdir()} == names | {"mine.json"}
    assert elsewhere.read_text() == "not yours"
    assert (folder / "mine.PART").read_text() == "somebody's"
    assert (folder / "mine.part").is_symlink()


def test_a_link_in_place_of_a_preset_is_replaced_and_not_followed(camera, tmp_path):
    elsewhere, link = tmp_path / "elsewhere.json", tmp_path / "mine.json"
    elsewhere.write_text("not yours")
    link.symlink_to(elsewhere)
    assert bpy.ops.scfpf.preset_export(name="Mine", filepath=str(link)) == {"FINISHED"}
    assert elsewhere.read_text() == "not yours" and not link.is_symlink()
    assert json.loads(link.read_text())["name"] == "Mine"


def test_a_full_disk_keeps_the_earlier_preset(camera, tmp_path, monkeypatch):
    path = tmp_path / "mine.json"
    path.write_text("the earlier one")

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RuntimeError, match="No space left on device"):
        bpy.ops.scfpf.preset_export(name="Mine", filepath=str(path))
    assert path.read_text() == "the earlier one" and os.listdir(tmp_path) == ["mine.json"]


def test_a_menu_does_not_wait_for_what_is_no_file_nor_for_many_large_ones(addon, folder, monkeypatch):
    """A FIFO in the folder would be waited for; slow files are read at the next opening."""
    own = addon("operators.camera.own_presets")
    monkeypatch.setattr(own, "_read", {})
    if os.name == "posix":
        for name in ("pipe.json", "pipe.png"):
            os.mkfifo(folder / name)
        assert [(stem, text) for stem, _, text in own.own_presets()] == [
            ("pipe", "cannot read pipe.json: it is not a regular file")
        ]
        assert addon("bridge.camera.preset_folder").thumbnail_file("pipe") is None
        (folder / "pipe.json").unlink()
    for number in range(3):
        (folder / f"{number}.json").write_text("{}")
    monkeypatch.setattr(own, "MENU_SECONDS", -1.0)
    assert {text for _, _, text in own.own_presets()} == {"Not read yet: open the menu again"}
    monkeypatch.setattr(own, "MENU_SECONDS", 60.0)
    assert all("the preset needs format" in text for _, _, text in own.own_presets())
