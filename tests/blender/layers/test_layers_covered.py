# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels that layers by Cycles spare, compared with the renders of all of them."""

import bpy
import numpy as np
import pytest
from engine_images import passes
from layer_scenes import add, flexible, layered, looking, new_camera, select_only

pytestmark = pytest.mark.usefixtures("built_groups")


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "shifted", "far away", "too far away"])
@pytest.mark.parametrize("front", ["DEPTH", "ORDER"])
def test_covered_pixels_make_no_difference(scene, addon, monkeypatch, kind, front):
    master = bpy.data.objects["Master"]
    side = new_camera("Side", looking((-5, -6, 5), (-0.8, 0, 0)))
    for lens in (master.data, side.data):
        if kind in ("orthographic", "too far away"):
            lens.type, lens.ortho_scale = "ORTHO", 9.0
        if kind == "shifted":
            lens.shift_x, lens.shift_y, lens.sensor_fit = 0.1, -0.05, "VERTICAL"
    if kind.endswith("far away"):
        for obj in scene.objects:
            obj.location.x += 1.0e6 if kind == "too far away" else 1.0e5
    bpy.context.view_layer.update()
    select_only(master)
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    bpy.data.objects["Thing"].scale = 1.5, 1.5, 1.5
    add(front).halo = 1.0
    module, found = addon("cycles.layers.layer_eyes"), []
    added = module._add_sheet

    def noted(scene, place, is_covered, *plane):
        found.append(is_covered.mean())
        return added(scene, place, is_covered, *plane)

    monkeypatch.setattr(module, "_add_sheet", noted)
    image = layered()
    # Far from the origin float32 does not tell the pixels of parallel rays apart.
    assert len(found) == (0 if kind == "too far away" else 2)
    assert all(0.02 < share < 0.99 for share in found)
    monkeypatch.setattr(module, "FEWEST", image.size)
    found.clear()
    np.testing.assert_array_equal(layered(), image)
    assert not found
    names = [*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials]
    assert not [each.name for each in names if module.SHEET in each.name]


@pytest.mark.parametrize("reason", ["denoising", "motion blur", "a lens", "a rig"])
def test_pixels_that_others_are_made_of_are_not_covered(scene, addon, monkeypatch, reason):
    master = bpy.data.objects["Master"]
    flexible(new_camera("Side", master.matrix_world))
    if reason == "a rig":
        flexible(master, "curved_convergence")
    scene.cycles.use_denoising = reason == "denoising"
    scene.render.use_motion_blur = reason == "motion blur"
    master.data.dof.use_dof = reason == "a lens"
    add("ORDER")
    module = addon("cycles.layers.layer_eyes")
    monkeypatch.setattr(module, "_add_sheet", lambda *_: pytest.fail("a sheet"))
    layered()


def test_only_pixels_apart_from_needed_ones_are_covered(addon):
    module = addon("cycles.layers.layer_eyes")
    is_needless = np.random.default_rng(0).uniform(size=(40, 60)) < 0.995
    for width, reach in ((0.01, 2), (1.5, 2), (2.5, 3)):
        needed = np.argwhere(~np.pad(is_needless, 9)) - 9
        away = np.abs(np.stack(np.indices(is_needless.shape), axis=-1)[:, :, None] - needed).max(axis=3)
        expected = away.min(axis=2) > reach
        assert 0.05 < expected.mean() < 0.95
        np.testing.assert_array_equal(module.without_neighbours(is_needless, width), expected)
    row, first, end = module.runs(is_needless)
    filled = np.zeros_like(is_needless)
    for each in zip(row, first, end, strict=True):
        filled[each[0], each[1] : each[2]] = True
    np.testing.assert_array_equal(filled, is_needless)


def test_an_override_of_materials_and_passes_see_no_sheet(scene, addon, monkeypatch, tmp_path):
    layer, path = bpy.context.view_layer, tmp_path / "passes.exr"
    layer.material_override = bpy.data.materials.new("Clay")
    for name in ("z", "position", "normal"):
        setattr(layer, f"use_pass_{name}", True)
    new_camera("Side", bpy.data.objects["Master"].matrix_world)
    add("DEPTH")
    module, found = addon("cycles.layers.layer_eyes"), []
    added = module._add_sheet
    monkeypatch.setattr(module, "_add_sheet", lambda *given: found.append(True) or added(*given))
    layered(filepath=str(path))
    covered = passes(path)
    assert found
    path.unlink()
    monkeypatch.setattr(module, "FEWEST", np.inf)
    layered(filepath=str(path))
    whole = passes(path)
    assert len(found) == 1 and len(whole) >= 4 and whole.keys() == covered.keys()
    for name, values in whole.items():
        np.testing.assert_array_equal(covered[name], values, err_msg=name)
