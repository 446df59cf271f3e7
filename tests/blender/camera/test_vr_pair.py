# SPDX-License-Identifier: GPL-3.0-or-later
"""360° stereo: each eye sees what Cycles' own panoramic camera with Spherical Stereo sees."""

import math

import bpy
import numpy as np
import pytest
from engine_images import passes, write_multilayer
from mathutils import Matrix

POSITION = "ViewLayer.Position"
VIEWS = ("left", "right")
WIDTH, HEIGHT = 96, 48
CURSOR = (0.4, -0.3, 0.2)


def room(scene, tmp_path):
    """Walls, floor and ceiling of different distances, turned, so that no two directions look alike."""
    bpy.ops.mesh.primitive_cube_add(
        size=1, location=(0.5, 0.3, 0.4), rotation=(0.1, 0.2, 0.3), scale=(5, 7, 3)
    )
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(1.0, 0.6, 0.1))
    scene.cursor.location = CURSOR
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    bpy.context.view_layer.use_pass_position = True
    write_multilayer(scene, tmp_path / "out")
    render.image_settings.views_format = "INDIVIDUAL"


def positions(scene):
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    render = scene.render
    return {
        view: passes(f"{render.filepath}{render.views[view].file_suffix}.exr")[POSITION][..., :3]
        for view in VIEWS
    }


@pytest.mark.parametrize(
    ("interocular", "convergence", "merge"),
    [(0.065, 1.95, (60, 75)), (0.5, 3.0, (30, 80)), (0.5, 0.0, (45, 90))],
)
def test_each_eye_sees_what_cycles_sees(tmp_path, interocular, convergence, merge):
    scene = bpy.context.scene
    room(scene, tmp_path)
    done = bpy.ops.scfpf.vr_pair(
        interocular=interocular,
        convergence=convergence,
        merge_from=math.radians(merge[0]),
        merge_to=math.radians(merge[1]),
    )
    assert done == {"FINISHED"}
    scene.render.engine = "SCFPF"
    for name in ("VR_L", "VR_R"):
        bpy.data.objects[name].scfpf.samples = 1
    ours = positions(scene)

    assert_alike(ours, of_cycles(scene, interocular, convergence, merge))


def set_eyes(lens, interocular, convergence, merge):
    """Give a camera the stereoscopy of a pair. merge: degrees, None for none."""
    stereo = lens.stereo
    stereo.use_spherical_stereo, stereo.use_pole_merge = True, merge is not None
    stereo.interocular_distance = interocular
    stereo.convergence_mode = "OFFAXIS" if convergence else "PARALLEL"
    stereo.convergence_distance = convergence or 1.95
    if merge is not None:
        stereo.pole_merge_angle_from, stereo.pole_merge_angle_to = (math.radians(angle) for angle in merge)


def of_cycles(scene, interocular, convergence, merge):
    """What Cycles' own panoramic camera shows both eyes."""
    scene.render.engine, scene.render.views_format = "CYCLES", "STEREO_3D"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    bpy.ops.object.camera_add(location=CURSOR, rotation=(math.pi / 2, 0, 0))
    scene.camera = bpy.context.object
    lens = scene.camera.data
    lens.type = "PANO"
    (lens if hasattr(lens, "panorama_type") else lens.cycles).panorama_type = "EQUIRECTANGULAR"
    set_eyes(lens, interocular, convergence, merge)
    return positions(scene)


def assert_alike(ours, its):
    """Each eye's positions are those of Cycles' eye, and not those of the other one."""
    for view, other in zip(VIEWS, reversed(VIEWS), strict=True):
        off = np.linalg.norm(ours[view] - its[view], axis=-1)
        # Edges of the room and of the box may fall on the other side of a pixel's centre.
        assert (off > 0.02).mean() < 0.03, (view, np.sort(off.ravel())[-200::20])
        assert np.median(off) < 1e-3
        crossed = np.linalg.norm(ours[view] - its[other], axis=-1)
        assert np.median(crossed) > 5 * np.median(off)


@pytest.mark.parametrize(
    ("interocular", "convergence", "merge"), [(0.5, 3.0, (30, 80)), (0.5, 0.0, None), (0.065, 1.95, (60, 75))]
)
def test_a_panoramas_own_spherical_stereo_is_that_of_cycles(tmp_path, interocular, convergence, merge):
    """One camera with Stereo 3D: F12 renders both eyes."""
    scene = panorama(tmp_path, interocular, convergence, merge)
    scene.render.engine, scene.camera.scfpf.samples = "SCFPF", 1
    ours = positions(scene)
    assert_alike(ours, of_cycles(scene, interocular, convergence, merge))


def panorama(tmp_path, interocular=0.5, convergence=3.0, merge=(30, 80)):
    """A scene with Stereo 3D whose camera is an equirectangular panorama with spherical stereo."""
    scene = bpy.context.scene
    room(scene, tmp_path)
    scene.render.use_multiview, scene.render.views_format = True, "STEREO_3D"
    assert bpy.ops.scfpf.camera_add(preset="equirectangular") == {"FINISHED"}
    camera = scene.camera = bpy.context.object
    camera.matrix_world = Matrix.Translation(CURSOR) @ Matrix.Rotation(math.pi / 2, 4, "X")
    camera.data.type = "PERSP"
    set_eyes(camera.data, interocular, convergence, merge)
    bpy.context.view_layer.update()
    return scene


def test_bent_projectors_have_no_spherical_stereo_and_say_so(addon, tmp_path):
    scene = panorama(tmp_path)
    bpy.ops.scfpf.preset_apply(preset="inverted_perspective")
    scene.camera.data.type = "PERSP"
    camera, inputs = scene.camera, addon("bridge.render.render_inputs")
    if len(camera.scfpf.surfaces) == 2:
        bpy.ops.scfpf.surface_insert()
    read = inputs.read_inputs(bpy.context.evaluated_depsgraph_get(), camera, (8, 4), eye="LEFT")
    assert any("Spherical stereo" in str(text) for text in read.scene.warnings)
    read = inputs.read_inputs(bpy.context.evaluated_depsgraph_get(), camera, (8, 4))
    assert not any("Spherical stereo" in str(text) for text in read.scene.warnings)


def test_both_eyes_move_together_and_are_found_by_multi_view():
    assert bpy.ops.scfpf.vr_pair() == {"FINISHED"}
    left, right = bpy.data.objects["VR_L"], bpy.data.objects["VR_R"]
    scene = bpy.context.scene
    assert scene.camera == left and scene.render.views_format == "MULTIVIEW"
    assert {view.camera_suffix for view in scene.render.views} == {"_L", "_R"}
    left.location = (3, 4, 5)
    bpy.context.view_layer.update()
    assert np.allclose(right.matrix_world, left.matrix_world)


def test_a_second_pair_is_refused_and_leaves_the_file_as_it_was():
    bpy.ops.scfpf.vr_pair()
    names = {obj.name for obj in bpy.data.objects}
    with pytest.raises(RuntimeError, match="'VR_L' exists"):
        bpy.ops.scfpf.vr_pair()
    assert names == {obj.name for obj in bpy.data.objects}
    bpy.data.objects.remove(bpy.data.objects["VR_L"])
    bpy.data.objects.remove(bpy.data.objects["VR_R"])
    with pytest.raises(RuntimeError, match="larger Convergence"):
        bpy.ops.scfpf.vr_pair(interocular=0.5, convergence=0.4)
