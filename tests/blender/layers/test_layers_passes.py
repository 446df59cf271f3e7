# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of image layers through Cycles, compared with those of a plain render and with closed forms."""

import bpy
import numpy as np
import pytest
from engine_images import passes
from layer_scenes import add, alone, flexible, layered, looking, new_camera, passes_alone
from rig_scenes import glowing

pytestmark = pytest.mark.usefixtures("built_groups")

PASSES = {
    "z": "Depth",
    "position": "Position",
    "normal": "Normal",
    "mist": "Mist",
    "uv": "UV",
    "object_index": "Object Index",
    "material_index": "Material Index",
    "diffuse_direct": "Diffuse Direct",
    "emit": "Emission",
}
# Their names before Blender 5.
OLD_NAMES = {
    "Object Index": "IndexOB",
    "Material Index": "IndexMA",
    "Diffuse Direct": "DiffDir",
    "Emission": "Emit",
}


def named(name):
    return name if bpy.app.version >= (5, 0, 0) else OLD_NAMES.get(name, name)


def wanted_passes(scene):
    """Switch passes on, and return their names in files."""
    layer = bpy.context.view_layer
    for name in PASSES:
        setattr(layer, f"use_pass_{name}", True)
    aov = layer.aovs.add()
    aov.name, aov.type = "Own", "VALUE"
    return {named(name) for name in PASSES.values()} | {"Own"}


def with_passes(scene, path, **options):
    """The passes of the button's file, without the name of their view layer, and its warnings."""
    path.unlink(missing_ok=True)
    image = layered(filepath=str(path), **options)
    found = {name.partition(".")[2]: values for name, values in passes(path).items()}
    np.testing.assert_array_equal(found["Combined"], image)
    return found


def test_a_twins_passes_are_those_of_the_plain_render(scene, tmp_path):
    names = wanted_passes(scene)
    scene.world = bpy.data.worlds.new("Mist")
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 2.0, 20.0
    glowing("Wall", (1, 0.5, 0.25))
    tree = bpy.data.materials["Wall"].node_tree
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name, node.inputs["Value"].default_value = "Own", 0.75
    bpy.data.materials["Wall"].pass_index = 4
    thing = bpy.data.objects["Thing"]
    thing.location.z, thing.pass_index = 0.6, 7
    file = passes_alone(scene, {"Thing", "Wall", "Floor"}, "Master", False)
    whole = {name.partition(".")[2]: values for name, values in file.items()}
    own = alone(scene, {"Thing"}, transparent=True)[..., 3]
    twin = new_camera("Side", bpy.data.objects["Master"].matrix_world)
    add("DEPTH")
    found = with_passes(scene, tmp_path / "a.exr")
    assert set(found) == names | {"Combined"}
    assert 0.05 < (own == 1).mean() < 0.5
    for name in names:
        assert np.ptp(whole[name]) > 0
        off = (np.abs(found[name] - whole[name]) / (1.0 + np.abs(whole[name]))).max(axis=2)
        if name in {"Depth", "Position", named("Object Index"), named("Material Index")}:
            assert off.max() < 1e-5, name
        else:
            # At its outline a thing mixes with all that is behind it.
            assert off[(own == 0) | (own == 1)].max() < 1e-5, name
            assert off.mean() < 1e-3, name
    # A rig with the volume of its camera's own lens measures as an ordinary camera.
    flexible(twin)
    found = with_passes(scene, tmp_path / "b.exr")
    for name in ("Depth", "Mist"):
        off = np.abs(found[name] / whole[name] - 1)[own == 1]
        assert off.max() < 1e-5, name


def test_passes_of_a_rig_measure_along_its_projectors(scene, tmp_path):
    wanted_passes(scene)
    bpy.context.view_layer.use_pass_vector = True
    scene.world = bpy.data.worlds.new("Mist")
    mist = scene.world.mist_settings
    mist.start, mist.depth, mist.falloff = 2.0, 20.0, "LINEAR"
    for number, name in enumerate(("Thing", "Wall"), 1):
        bpy.data.objects[name].pass_index = number
    side = new_camera("Side", looking((-6, -5, 5), (-0.5, 0, 0)))
    flexible(side)
    # No longer the view of its own lens.
    side.data.lens *= 1.5
    add("ORDER").halo = 0.4
    found = with_passes(scene, tmp_path / "a.exr")
    place, depth = found["Position"].astype(float), found["Depth"][..., 0]
    of_thing, of_wall = (found[named("Object Index")][..., 0] == number for number in (1, 2))
    assert of_thing.mean() > 0.03 and of_wall.mean() > 0.03
    assert (depth[~place.any(axis=2)] == 1e10).all()
    # Of the layer from its near surface on, of the rest from its camera along its axis.
    eye, axis = (np.array(side.matrix_world.col[column])[:3] for column in (3, 2))
    near = np.array(side.scfpf.surfaces[0].object.matrix_world.translation)
    away = place - eye
    expected = np.linalg.norm(away, axis=2) * (1 - (near - eye) @ axis / (away @ axis))
    np.testing.assert_allclose(depth[of_thing], expected[of_thing], rtol=1e-5)
    eye, axis = (np.array(scene.camera.matrix_world.col[column])[:3] for column in (3, 2))
    np.testing.assert_allclose(depth[of_wall], -((place - eye) @ axis)[of_wall], rtol=1e-5)
    # The mean of a pixel, whose depth is that of one place.
    density = np.clip((depth - 2) / 20, 0, 1)
    assert np.median(np.abs(found["Mist"][..., 0] - density)[of_thing]) < 1e-3
    bpy.ops.ed.undo_push(message="one picture")
    assert_kept(tmp_path / "kept.exr", found)
    for name in ("Thing", "Wall"):
        bpy.data.objects[name].pass_index += 2
    other = with_passes(bpy.context.scene, tmp_path / "b.exr")
    bpy.ops.ed.undo_push(message="another one")
    assert_kept(tmp_path / "kept.exr", other)
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    assert_kept(tmp_path / "kept.exr", found)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert_kept(tmp_path / "kept.exr", found)


def assert_kept(path, found):
    """Assert that the datablock of the last picture has some passes."""
    bpy.data.images["SCFPF Render Passes"].save_render(str(path), scene=bpy.context.scene)
    kept = passes(path)
    assert len(kept) == len(found)
    for name, values in found.items():
        np.testing.assert_array_equal(kept[f"{bpy.context.view_layer.name}.{name}"], values, name)
