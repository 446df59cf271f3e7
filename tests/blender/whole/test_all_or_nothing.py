# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that fail at any step leave the file, its settings and the handlers as they were.

The steps are those before which something has been changed: a fault in other functions is one in these.
"""

import math
import os
import sys

import bpy
import pytest
from file_state import require_all_or_nothing
from quick_solves import quicken
from rig_scenes import bent_camera, keep_groups, start_anew

sys.path.append(os.path.join(os.path.dirname(__file__), "..", "aim", "support"))

from aim_scenes import box_scene, turned_view

OPERATORS = bpy.ops.scfpf


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture(autouse=True)
def quick_solves(addon, monkeypatch):
    """See ``quicken``; and each problem is solved once."""
    quicken(addon, monkeypatch, columns=32)
    targets = addon("bridge.aim.solve_targets")
    solve, found = targets.solution_of, []

    def once(inputs, progress):
        """The solution of a problem that is the same at each step."""
        found[:] = found or [solve(inputs, progress)]
        return found[0]

    monkeypatch.setattr(targets, "solution_of", once)


def select(*names):
    """Select objects, the last of them as the active one."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[-1]]


def rigged(addon):
    bent_camera(addon)
    assert OPERATORS.cycles_rig() == {"FINISHED"}
    bpy.data.objects["Camera"].scfpf.surfaces[1].object.location.x += 1.0
    select("Camera")


def composited(addon):
    rigged(addon)
    if bpy.app.version < (5, 0, 0):
        # A scene keeps its tree from then on, whoever has made it.
        bpy.context.scene.use_nodes = True


def previewed(addon):
    bent_camera(addon)
    assert OPERATORS.preview_toggle() == {"FINISHED"}


def on_another_layer(addon):
    """A preview of a view layer that is not the present one."""
    bent_camera(addon)
    scene = bpy.context.scene
    scene.view_layers.new("Other")
    assert OPERATORS.preview_toggle() == {"FINISHED"}
    source = addon("scanline.preview.preview_data").previews()[0]
    other = next(layer for layer in scene.view_layers if layer != bpy.context.view_layer)
    addon("scanline.preview.preview")._put_into(source, other.name)


def layered(addon):
    camera, scene = bent_camera(addon), bpy.context.scene
    select("Red")
    assert OPERATORS.layer_add(camera="Camera") == {"FINISHED"}
    camera.scfpf.layers[0].camera.location.x += 0.5
    scene.render.resolution_x, scene.render.resolution_y = 12, 8
    camera.scfpf.samples = scene.cycles.samples = 1
    select("Camera")


def engine_layered(addon):
    layered(addon)
    bpy.context.scene.render.engine = "SCFPF"


def by_cycles(addon):
    camera, scene = bent_camera(addon), bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 12, 8
    scene.render.engine = "CYCLES"
    camera.scfpf.samples = scene.cycles.samples = 1
    select("Camera")


def red(addon):
    bent_camera(addon)
    select("Red")


def box(_addon):
    box_scene(bpy.context.scene)


def viewed(_addon):
    turned_view(box_scene(bpy.context.scene), 8.0)


def pinned(_addon):
    box_scene(bpy.context.scene)
    assert OPERATORS.aim_pin_add(camera="Camera", point=(1, 0, 1)) == {"FINISHED"}


def ordinary(_addon):
    box_scene(bpy.context.scene)
    select("Camera")


def bent(addon):
    bent_camera(addon)
    select("Red", "Camera")


def two(addon):
    bent_camera(addon)
    select("Camera")
    assert OPERATORS.camera_duplicate() == {"FINISHED"}
    bpy.context.object.location.x += 1.0
    select("Camera", "Camera.001")


def blended(addon):
    """A blend, one of whose cameras has moved, and another flexible camera."""
    two(addon)
    assert OPERATORS.camera_blend() == {"FINISHED"}
    bpy.context.object.name = "Blend"
    select("Camera.001")
    assert OPERATORS.camera_duplicate() == {"FINISHED"}
    bpy.data.objects["Camera"].location.z += 0.5
    select("Camera.002", "Blend")


def blend_of_three(addon):
    blended(addon)
    assert OPERATORS.blend_camera_add() == {"FINISHED"}


def keyed_blend(addon):
    blended(addon)
    blend = bpy.data.objects["Blend"]
    settings = addon("bridge.blends.blend_ends").ends_of(blend)[0].settings
    settings.kind = "LINEAR"
    for frame, angle in ((1, 0.0), (3, 1.0)):
        settings.angle = angle
        blend.keyframe_insert(settings.path_from_id("angle"), frame=frame)


def screen(_addon):
    bpy.ops.mesh.primitive_plane_add(location=(0, 4, 0), rotation=(math.pi / 2, 0, 0))
    bpy.ops.mesh.primitive_cube_add(location=(0, 9, 0))
    bpy.ops.object.empty_add()
    select("Empty", "Plane")


def lit(_addon):
    """A wall between a viewer and a video projector that both see it."""
    bpy.ops.mesh.primitive_plane_add(size=3.0)
    for name, across in (("Viewer", -0.5), ("Device", 0.5)):
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        bpy.context.scene.collection.objects.link(camera)
        camera.location = across, 0.0, 4.0
    bpy.context.scene.camera = bpy.data.objects["Viewer"]
    select("Plane", "Device")


RIG, SKIPPING, FLEXIBLE = "cycles.rig_data", "cycles.skipping", "bridge.camera.flexible_camera"
BLEND, KEPT = "bridge.blends.camera_blend", "bridge.aim.kept_volume"
LAYERS = "cycles.layers"
# By name: the scene, the action, and the functions in which it fails, in the order of their calls.
CASES = {
    "Update Chords": (
        rigged,
        OPERATORS.cycles_rig_update,
        f"{RIG}.update_nodes {RIG}.renew_materials {SKIPPING}.skip_chords.faces_that_skip "
        f"{RIG}.write_sheets {RIG}._fill cycles.rig._note cycles.disturbed_materials.raycasting",
    ),
    "Remove Rig": (
        rigged,
        OPERATORS.cycles_rig,
        f"cycles.rig._look_through {RIG}.give_back cycles.rig._hide_surfaces",
    ),
    "Remove Preview": (
        previewed,
        OPERATORS.preview_toggle,
        "scanline.preview.preview_viewports.viewports_of scanline.preview.preview_data.pictures_of "
        "scanline.generated_collection.remove_parts",
    ),
    "passes": (
        composited,
        OPERATORS.cycles_passes,
        f"cycles.aov_passes.add cycles.aov_passes._group {RIG}.update_nodes",
    ),
    "another layer's preview": (
        on_another_layer,
        OPERATORS.preview_toggle,
        "scanline.preview.preview._put_into scanline.preview.preview_data.hide_in_layers "
        "operators.camera.preview.SCFPF_OT_preview_toggle._cautions",
    ),
    "Add Layer": (
        red,
        lambda: OPERATORS.layer_add(camera="Camera"),
        "bridge.layers.layer_edits._new_eye bridge.layers.layer_edits.color_layers",
    ),
    "layers, button": (
        layered,
        lambda: OPERATORS.render(camera="Camera"),
        "bridge.layers.read_image_layers.read_image_layers bridge.scene.read_scene.read_scene "
        "bridge.render.render_job.start shading.frame.render_frame "
        "bridge.render.result_image.show_progress",
    ),
    "layers, F12": (
        engine_layered,
        bpy.ops.render.render,
        "bridge.layers.read_image_layers.read_image_layers bridge.scene.read_scene.read_scene "
        "shading.frame.render_frame",
    ),
    "layers, Cycles": (
        layered,
        lambda: OPERATORS.layers_render(camera="Camera"),
        f"{LAYERS}.temporary_scene._settle {LAYERS}.layer_views.read_views "
        f"{LAYERS}.temporary_scene.TemporaryScene.add_groups {LAYERS}.layer_eyes._rigged {RIG}.make_rig "
        f"{SKIPPING}.refresh.write_skipping {LAYERS}.layer_eyes._place {LAYERS}.pass_files.read_passes "
        f"{LAYERS}.layer_eyes._copied {LAYERS}.joined_layers.join_into",
    ),
    "another engine": (
        by_cycles,
        lambda: OPERATORS.joined_render(camera="Camera"),
        "engines.anchor_scene.AnchorScene._prepare anchors.plan.plan_anchors "
        "engines.anchor_scene.AnchorScene.look_through engines.picture_plan.traced_views "
        "anchors.image_parts.shown_points engines.joined_tiles.join anchors.completion.looked_through",
    ),
    "Add View": (
        box,
        lambda: OPERATORS.aim_view_add(camera="Camera", object="Box"),
        f"{FLEXIBLE}.replace_surfaces {FLEXIBLE}.make_flexible bridge.aim.new_targets.add_view "
        "bridge.aim.new_targets.framing_eye bridge.blender.scene_objects.link_beside",
    ),
    "Add Pin": (
        box,
        lambda: OPERATORS.aim_pin_add(camera="Camera", point=(1, 0, 1)),
        f"{FLEXIBLE}.make_flexible bridge.aim.new_targets.add_pin bridge.aim.new_targets._new_target "
        "bridge.blender.scene_objects.link_beside",
    ),
    "Solve": (
        viewed,
        lambda: OPERATORS.aim_solve(camera="Camera"),
        f"bridge.aim.read_problem.read_inputs bridge.aim.verdict.require_better {KEPT}.volume_kept "
        f"bridge.aim.aimed_volume.write_volume {FLEXIBLE}.replace_surfaces {FLEXIBLE}.make_flexible "
        "bridge.aim.aimed_volume.note_solution bridge.aim.verdict.store_verdict "
        "bridge.aim.verdict._summary",
    ),
    "Drag": (
        pinned,
        lambda: OPERATORS.aim_drag(shift=(0.02, 0.0)),
        f"{KEPT}.volume_kept {FLEXIBLE}.replace_surfaces bridge.aim.aimed_volume.note_solution "
        "bridge.aim.solution.Measures.of operators.aim.drag.SCFPF_OT_aim_drag._place "
        "bridge.aim.verdict.require_better bridge.aim.verdict.store_verdict",
    ),
    "Blend Cameras": (
        two,
        OPERATORS.camera_blend,
        f"{BLEND}.set_blend {FLEXIBLE}.replace_surfaces {BLEND}._add_shapes {FLEXIBLE}.make_flexible "
        "bridge.camera.shown_lens.approximate_lens operators.common.tool.select_only "
        "operators.camera.blend._done",
    ),
    "Blend with Preset": (
        bent,
        lambda: OPERATORS.camera_blend_preset(preset="orthographic"),
        f"{BLEND}._add_shapes operators.camera.blend._done",
    ),
    "Update Blend": (
        blended,
        OPERATORS.blend_update,
        f"{BLEND}._write_shapes {BLEND}.write_map bridge.camera.shown_lens.approximate_lens "
        "projection.volume.folds.find_folds",
    ),
    "Add Camera to Blend": (
        blended,
        OPERATORS.blend_camera_add,
        f"operators.camera.blend.updated {BLEND}._keep_whole {BLEND}.write_map "
        "projection.volume.folds.find_folds",
    ),
    "Remove Camera from Blend": (
        blend_of_three,
        OPERATORS.blend_camera_remove,
        f"operators.camera.blend.updated {BLEND}.write_map projection.volume.folds.find_folds",
    ),
    "Blend Map": (
        blended,
        lambda: OPERATORS.blend_map(kind="LINEAR"),
        f"operators.camera.blend.updated {FLEXIBLE}.replace_surfaces {BLEND}._add_shapes "
        "projection.volume.folds.find_folds",
    ),
    "Bake Map": (
        keyed_blend,
        lambda: OPERATORS.blend_map_bake(start=1, end=3),
        f"{BLEND}.write_map bridge.blends.blend_bake.bake_map {BLEND}.read_maps "
        "bridge.blends.blend_bake.kept_frames bridge.blends.blend_bake.hat",
    ),
    "Camera from Screen": (
        screen,
        OPERATORS.camera_from_screen,
        "bridge.camera.screen_camera.look_at bridge.camera.screen_camera.volume_from_screen "
        f"bridge.camera.screen_camera._screen_group {FLEXIBLE}.make_flexible "
        "bridge.camera.shown_lens.approximate_lens operators.common.tool.show_in_local_view",
    ),
    "Picture for Video Projector": (
        lit,
        lambda: OPERATORS.video_projector_picture(width=40, height=30),
        "bridge.render.video_projector.lit_surfaces bridge.render.video_projector.device_view "
        "shading.picking.video_projector.seen_places bridge.render.video_projector.write_map",
    ),
    "Camera from Calibration": (
        screen,
        lambda: OPERATORS.camera_from_calibration(
            source="NUMBERS", radial=(-0.2, 0, 0, 0, 0, 0), st_maps="BOTH"
        ),
        "bridge.camera.calibrated_camera.set_image_size bridge.camera.calibrated_camera.volume_from_lens "
        f"{FLEXIBLE}.make_flexible bridge.camera.calibrated_camera._show_frame "
        "bridge.camera.calibrated_camera.write_lens_maps bridge.mappings.st_map_image._st_values "
        "operators.common.tool.show_in_local_view",
    ),
    "Add Flexible Camera": (
        screen,
        lambda: OPERATORS.camera_add(preset="orthographic"),
        f"{FLEXIBLE}.replace_surfaces {FLEXIBLE}.make_flexible operators.common.tool.show_in_local_view",
    ),
    "Flexible Camera from This Camera": (
        ordinary,
        OPERATORS.camera_from_camera,
        f"{FLEXIBLE}.replace_surfaces {FLEXIBLE}.make_flexible",
    ),
    "Duplicate": (bent, OPERATORS.camera_duplicate, "bridge.camera.volume_edits.make_single_user"),
    "Apply Preset": (
        bent,
        lambda: OPERATORS.preset_apply(preset="angular_fisheye"),
        f"{FLEXIBLE}.replace_surfaces {FLEXIBLE}.make_flexible bridge.camera.shown_lens.approximate_lens",
    ),
    "Set Up Cycles": (
        bent,
        OPERATORS.cycles_rig,
        f"{RIG}.make_rig {RIG}._new_portals cycles.rig_cameras.place_camera {RIG}.update_nodes "
        f"{RIG}._take_over {RIG}._fill cycles.hidden_surfaces.hide_surfaces cycles.rig._look_through "
        f"{SKIPPING}.skip_chords.faces_that_skip cycles.rig._note cycles.cautions.cautions",
    ),
    "Nodes Preview": (
        bent,
        OPERATORS.preview_toggle,
        "scanline.preview.preview_data.make_preview "
        "scanline.preview.preview_data.add_parts scanline.preview.preview_data.hide_in_layers "
        "operators.camera.preview.SCFPF_OT_preview_toggle._cautions",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_leaves_everything_as_it_was(addon, request, case):
    if "review" in case:
        request.getfixturevalue("light_nodes")
    require_all_or_nothing(addon, case, *CASES[case], keep_groups)
