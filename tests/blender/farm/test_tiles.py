# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles of a picture and their join, beside the picture of one Blender, bit for bit."""

import bpy
import numpy as np
import pytest
from engine_images import passes, write_multilayer
from farm_jobs import SIZE, pixels, set_up_cycles
from layer_scenes import collected, looking, new_camera

ENGINES = {"engine": "SCFPF", "cycles": "CYCLES"}


@pytest.fixture
def joined(task, saved, tmp_path):
    """Render the saved file in tiles that do not divide evenly, join them, and return the folder."""

    def make(way, grid="3x2"):
        columns, rows = map(int, grid.split("x"))
        words = ("--way", way, "--tiles", grid)
        for tile in range(columns * rows):
            assert task(saved, tmp_path / "out", *words, "--tile", tile, last=1) == 0
        assert task(saved, tmp_path / "out", *words, action="join", last=1) == 0
        assert not list((tmp_path / "out" / "tiles").iterdir())
        return tmp_path / "out"

    return make


def by_one_blender(saved, way, folder):
    """Render the file's first frame by F12 into the folder, or as the button of layers does."""
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    scene = bpy.context.scene
    if way == "layers":
        ending = scene.render.file_extension
        done = bpy.ops.scfpf.layers_render(camera=scene.camera.name, filepath=str(folder / f"one{ending}"))
        assert done == {"FINISHED"}
        return
    scene.render.engine, scene.render.filepath = ENGINES[way], str(folder / "one")
    bpy.ops.render.render(write_still=True)


def add_compositor(scene):
    """Let the compositor blur the picture by a pass."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    render, blur = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeBlur")
    if "Size" in blur.inputs and blur.inputs["Size"].type == "VECTOR":
        blur.inputs["Size"].default_value = (4.0, 3.0)
    else:
        blur.size_x, blur.size_y = 4, 3
    tree.links.new(render.outputs["Normal"], blur.inputs["Image"])
    tree.links.new(blur.outputs["Image"], output.inputs[0])


def switch_passes_on(scene):
    """Give the scene a second view layer, and passes of every kind."""
    first = scene.view_layers[0]
    first.use_pass_z = first.use_pass_normal = first.use_pass_cryptomatte_object = True
    first.use_pass_diffuse_direct = True
    scene.view_layers.new("Second").use_pass_z = True


@pytest.mark.parametrize("way", ENGINES)
def test_all_passes_are_joined(joined, saved, tmp_path, way):
    scene = bpy.context.scene
    if way == "cycles":
        set_up_cycles()
    else:
        scene.render.engine = "SCFPF"
    switch_passes_on(scene)
    write_multilayer(scene, "//")
    bpy.ops.wm.save_mainfile()
    folder = joined(way)
    by_one_blender(saved, way, tmp_path)
    path, one = folder / "film_0001.exr", passes(tmp_path / "one.exr")
    made = passes(path)
    assert {"ViewLayer.Normal", "ViewLayer.CryptoObject00", "Second.Depth"} <= made.keys() == one.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(made[name], values, name)
    assert np.ptp(made["ViewLayer.Depth"]) > 0.0
    notes = [file.read_bytes().count(b'"Cube":"') for file in (path, tmp_path / "one.exr")]
    assert notes[0] == notes[1] > 0, "the names of the cryptomatte are in the file"


def test_the_compositor_sees_the_joined_picture(joined, saved, tmp_path):
    scene = bpy.context.scene
    scene.render.engine = "SCFPF"
    scene.view_layers[0].use_pass_normal = True
    add_compositor(scene)
    bpy.ops.wm.save_mainfile()
    folder = joined("engine")
    by_one_blender(saved, "engine", tmp_path)
    one = pixels(tmp_path / "one.png")
    assert np.array_equal(pixels(folder / "film_0001.png"), one) and np.ptp(one) > 0.1


@pytest.mark.parametrize("form", ["INDIVIDUAL", "STEREO_3D"])
def test_views_of_a_stereo_picture_are_joined(joined, saved, tmp_path, form):
    scene = bpy.context.scene
    scene.render.engine, scene.render.use_multiview = "SCFPF", True
    scene.render.image_settings.views_format = form
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    bpy.ops.wm.save_mainfile()
    folder = joined("engine", "2x2")
    by_one_blender(saved, "engine", tmp_path)
    endings = ("_L.png", "_R.png") if form == "INDIVIDUAL" else (".png",)
    made = [pixels(folder / f"film_0001{ending}") for ending in endings]
    for mine, ending in zip(made, endings, strict=True):
        np.testing.assert_array_equal(mine, pixels(tmp_path / f"one{ending}"))
    if form == "INDIVIDUAL":
        assert not np.array_equal(*made)
    else:
        assert len(made[0]) == 2 * SIZE[0] * SIZE[1] * 4


@pytest.mark.parametrize("front", ["DEPTH", "HALO"])
def test_tiles_of_layers_are_joined(joined, saved, tmp_path, front):
    """With passes in the file; things in the middle of the picture are in several tiles."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1))
    collected("Things", "Cube")
    scene.camera.scfpf.pixel_error = 0.2
    new_camera("Side", looking((-5, -5, 4)))
    bpy.context.view_layer.objects.active = scene.camera
    given = {"camera": scene.camera.name, "collection": "Things", "seen_by": "Side", "front": "DEPTH"}
    assert bpy.ops.scfpf.layer_add(**given) == {"FINISHED"}
    if front == "HALO":
        scene.camera.scfpf.layers[-1].halo = 1.5
    scene.view_layers[0].use_pass_normal = True
    write_multilayer(scene, "//")
    bpy.ops.wm.save_mainfile()
    folder = joined("layers")
    by_one_blender(saved, "layers", tmp_path)
    made, one = passes(folder / "film_0001.exr"), passes(tmp_path / "one.exr")
    assert made.keys() == one.keys() and "ViewLayer.Normal" in one
    for name, values in one.items():
        np.testing.assert_array_equal(made[name], values, name)
    shown = one["ViewLayer.Combined"][..., 3]
    assert (shown > 0).mean() > 0.1


def test_layers_leave_the_render_region_as_f12_does(saved, tmp_path):
    """Blender's own way of cutting, and of leaving the rest empty, is taken from the whole picture."""
    scene = bpy.context.scene
    render = scene.render
    write_multilayer(scene, tmp_path / "out")
    name, path = scene.camera.name, str(tmp_path / "out.exr")

    def made():
        assert bpy.ops.scfpf.layers_render(camera=name, filepath=path) == {"FINISHED"}
        return passes(path)["ViewLayer.Combined"]

    whole = made()
    height, width = whole.shape[:2]
    render.use_border = True
    render.border_min_x, render.border_max_x = (5 + 0.5) / width, (17 + 0.5) / width
    render.border_min_y, render.border_max_y = (3 + 0.5) / height, (12 + 0.5) / height
    part = np.zeros_like(whole)
    part[3:12, 5:17] = whole[3:12, 5:17]
    np.testing.assert_array_equal(made(), part)
    render.use_crop_to_border = True
    np.testing.assert_array_equal(made(), whole[3:12, 5:17])
    render.border_min_x = render.border_max_x = 0.5
    with pytest.raises(RuntimeError, match="The render region has no pixels"):
        made()
