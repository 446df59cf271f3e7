# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that skip empty chords in scenes and volumes that move, compared with rays that travel all chords."""

import bpy
import numpy as np
import pytest
from engine_images import passes, write_multilayer
from rig_scenes import (
    add_box,
    keep_groups,
    project,
    reference,
    show_whole_sheets,
    start_anew,
    switch,
    volume_scene,
)

WIDTH, HEIGHT = 60, 40
FRAMES = (1, 4, 6)
# Pixels that may differ: rounding decides which of two things that touch in a pixel its ray meets.
ROUNDED = 2
# Their values in a blurred image of things that glow differ by more.
BLUR_OFF = 0.02


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture
def skipping(addon, monkeypatch):
    """The module, which takes the time that a busy machine needs."""
    module = addon("cycles.skipping.refresh")
    monkeypatch.setattr(module, "PATIENCE", 600.0)
    return module


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


@pytest.fixture
def rendered(skipping, rig_of):
    """The frames that rays skipped chords for, and the vertices of the sheets, after each image."""
    found = []

    def note(*_):
        rig = rig_of()
        assert skipping.skips(rig), rig.scfpf_rig.travels_all
        found.append((frames_of(skipping, rig), len(rig.scfpf_rig.portals.data.vertices)))

    bpy.app.handlers.render_post.append(note)
    yield found
    if note in bpy.app.handlers.render_post:
        bpy.app.handlers.render_post.remove(note)


def at_frame(path, frame, samples=1):
    """The passes of a frame as `blender -b -f` renders it, without going there before."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    layer.use_pass_position = layer.use_pass_object_index = True
    scene.cycles.samples, scene.cycles.seed = samples, 3
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", reference.JITTER
    write_multilayer(scene, path)
    ends = scene.frame_start, scene.frame_end
    scene.frame_start = scene.frame_end = frame
    scene.render.filepath = f"{path}_####"
    bpy.ops.render.render(animation=True)
    scene.frame_start, scene.frame_end = ends
    found = passes(f"{path}_{frame:04}.exr")
    result = {name.split(".", 1)[1]: values for name, values in found.items()}
    result["Object Index"] = next(v for n, v in result.items() if "Index" in n)[..., 0].astype(int)
    return result


def crossing(addon, camera, name="Crossing", frames=(1, 8)):
    """A box that crosses the image and turns."""
    volume = project(addon, camera).volume
    ends = volume.evaluate(np.array([0.1, 0.9]), np.array([0.3, 0.7]), np.array([0.5, 0.5])).position
    size = 0.2 * np.linalg.norm(ends[:, 1] - ends[:, 0])
    bpy.ops.mesh.primitive_cube_add(size=size, location=ends[:, 0])
    box = bpy.context.object
    box.name, box.pass_index = name, 90
    for frame, place, turn in zip(frames, ends.T, (0.0, 2.5), strict=True):
        box.location, box.rotation_euler = place, (0.3 * turn, turn, 0.0)
        box.keyframe_insert("location", frame=frame)
        box.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)
    return box


def moving_surface(camera):
    """The middle surface moves."""
    surface = camera.scfpf.surfaces[1].object
    for frame, x in ((1, 0.0), (8, 1.0)):
        surface.location.x += x
        surface.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)


def prepared(addon, name="nonlinear_twist"):
    camera = volume_scene(addon, name, WIDTH, HEIGHT)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 6
    return camera


def assert_alike(some, every):
    other = some["Object Index"] != every["Object Index"]
    assert (every["Object Index"] > 0).mean() > 0.02
    assert other.sum() <= ROUNDED


def frames_of(skipping, rig):
    return sorted(skipping._made_for.get(rig.session_uid, {None: 0}))


def test_a_moving_scene_skips_what_is_empty_at_all_frames(addon, skipping, rig_of, tmp_path, monkeypatch):
    camera = prepared(addon)
    crossing(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig, scene = rig_of(), bpy.context.scene
    assert skipping.skips(rig), rig.scfpf_rig.travels_all
    assert frames_of(skipping, rig) == [1, 2, 3, 4, 5, 6]
    text = rig.scfpf_rig.portals[skipping.TEXT_KEY]
    assert "frames 1 to 6" in text and bpy.app.version_string in text
    for frame in (3, 6, 1):
        scene.frame_set(frame)
        assert skipping.skips(rig), frame
    # As on a farm, whose Blender does not have the add-on.
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    some = {frame: at_frame(tmp_path / f"some{frame}", frame) for frame in (*FRAMES, 8)}
    show_whole_sheets(addon, rig)
    for frame, seen in some.items():
        assert_alike(seen, at_frame(tmp_path / f"every{frame}", frame))


def portals_seen(rig):
    """Vertices of the rig's mesh as a render has it at the present frame."""
    scene, name = bpy.context.scene, rig.scfpf_rig.portals.name
    depsgraph = bpy.context.evaluated_depsgraph_get()
    rig.hide_viewport = rig.scfpf_rig.portals.hide_viewport = False
    depsgraph.update()
    count = len(scene.objects[name].evaluated_get(depsgraph).data.vertices)
    rig.hide_viewport = rig.scfpf_rig.portals.hide_viewport = True
    return count


@pytest.mark.parametrize("blurred", [False, True])
def test_other_frames_and_other_blur_have_whole_sheets(addon, skipping, rig_of, monkeypatch, blurred):
    camera = prepared(addon)
    crossing(addon, camera)
    scene = bpy.context.scene
    scene.render.use_motion_blur = blurred
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    assert skipping.skips(rig), rig.scfpf_rig.travels_all
    curve = next(c for c in rig.scfpf_rig.portals.animation_data.drivers if c.data_path != "hide_render")
    assert curve.driver.is_simple_expression, curve.driver.expression
    monkeypatch.setattr(addon("cycles.rig"), "sync", lambda *_, **__: None)
    counts = {}
    for frame in (1, 6, 7, 0):
        scene.frame_set(frame)
        counts[frame] = portals_seen(rig)
    scene.frame_set(3, subframe=0.5)
    counts[3.5] = portals_seen(rig)
    scene.frame_set(3)
    scene.render.use_motion_blur = not blurred
    counts["blur"] = portals_seen(rig)
    assert counts[1] == counts[6] and counts[1] != counts[7]
    assert counts[7] == counts[0] == counts[3.5] == counts["blur"], counts


@pytest.mark.parametrize("also_scene", [False, True])
def test_a_moving_volume_skips_frame_by_frame(
    addon, skipping, rig_of, rendered, tmp_path, monkeypatch, also_scene
):
    camera = prepared(addon)
    moving_surface(camera)
    if also_scene:
        crossing(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    assert skipping.skips(rig) and frames_of(skipping, rig) == [1], rig.scfpf_rig.travels_all
    some = {frame: at_frame(tmp_path / f"some{frame}", frame) for frame in FRAMES}
    assert [frames for frames, _ in rendered] == [[frame] for frame in FRAMES]
    assert len({vertices for _, vertices in rendered}) > 1
    bpy.app.handlers.render_post.clear()
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    show_whole_sheets(addon, rig)
    for frame, seen in some.items():
        assert_alike(seen, at_frame(tmp_path / f"every{frame}", frame))


def test_an_animation_of_a_moving_volume_in_a_window(addon, skipping, rig_of, tmp_path, monkeypatch):
    """Ctrl-F12 looks at all frames before the render job begins, which nothing may disturb."""
    camera = prepared(addon)
    moving_surface(camera)
    crossing(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    rigs = addon("cycles.rig")
    rigs.prepare_render(bpy.context, rig, animation=True)
    assert skipping.skips(rig) and frames_of(skipping, rig) == [1, 2, 3, 4, 5, 6], rig.scfpf_rig.travels_all
    for name in ("renew", "sync"):
        monkeypatch.setattr(rigs, name, lambda *_, **__: None)
    some = {frame: at_frame(tmp_path / f"some{frame}", frame) for frame in (*FRAMES, 8)}
    assert skipping.skips(rig)
    show_whole_sheets(addon, rig)
    for frame, seen in some.items():
        assert_alike(seen, at_frame(tmp_path / f"every{frame}", frame))
    monkeypatch.undo()
    # Depth needs the lengths of the chords at each frame.
    assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    rigs.prepare_render(bpy.context, rig, animation=True)
    assert skipping.skips(rig) and frames_of(skipping, rig) == [1], rig.scfpf_rig.travels_all


@pytest.mark.parametrize("position", ["START", "CENTER", "END"])
def test_blurred_things_are_seen(addon, skipping, rig_of, rendered, tmp_path, monkeypatch, position):
    """Fast turns, a deforming shape, and an instance of several motion steps."""
    camera = prepared(addon)
    scene = bpy.context.scene
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.render.motion_blur_position = position
    box = crossing(addon, camera, frames=(1, 4))
    box.shape_key_add(name="Basis")
    key = box.shape_key_add(name="Long")
    key.data[0].co.x *= 6.0
    for frame in (1, 4):
        key.value = float(frame == 4)
        key.keyframe_insert("value", frame=frame)
    other = crossing(addon, camera, "Other", frames=(2, 5))
    other.cycles.motion_steps = 2
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    assert skipping.skips(rig), rig.scfpf_rig.travels_all
    scene.cycles.max_bounces = 0
    scene.world = None
    glow = add_box("Glow", (0, 0, 1e4), (1, 1, 1)).data.materials[0]
    for obj in scene.objects:
        if obj.pass_index:
            obj.data.materials.clear()
            obj.data.materials.append(glow)
    some = {frame: at_frame(tmp_path / f"some{frame}", frame, 4) for frame in (1, 3)}
    assert len(rendered) == len(some)
    bpy.app.handlers.render_post.clear()
    monkeypatch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
    show_whole_sheets(addon, rig)
    for frame, seen in some.items():
        every = at_frame(tmp_path / f"every{frame}", frame, 4)
        off = np.abs(seen["Combined"] - every["Combined"]).max(axis=2)
        print(position, frame, off.max(), off.mean(), every["Combined"].std())
        assert every["Combined"].std() > 0.01
        assert (off > BLUR_OFF).sum() <= ROUNDED


def test_edits_of_what_moves_are_noticed(addon, skipping, rig_of):
    camera = prepared(addon)
    box = crossing(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig, scene = rig_of(), bpy.context.scene
    assert skipping.skips(rig)
    scene.frame_set(4)
    box.scale.x = 3.0
    bpy.context.view_layer.update()
    assert not skipping.skips(rig) and rig.scfpf_rig.travels_all == skipping.CHANGED


def test_an_edit_before_another_frame_is_noticed(addon, skipping, rig_of):
    """Nothing is evaluated between the edit and the frame."""
    camera = prepared(addon)
    box = crossing(addon, camera)
    assert switch(camera) == {"FINISHED"}
    rig, scene = rig_of(), bpy.context.scene
    box.scale.x = 3.0
    scene.frame_set(4)
    assert not skipping.skips(rig)


def test_what_is_simulated_keeps_all_chords(addon, skipping, rig_of):
    camera = prepared(addon)
    crossing(addon, camera).modifiers.new("Cloth", "CLOTH")
    assert switch(camera) == {"FINISHED"}
    rig = rig_of()
    assert not skipping.skips(rig) and "'Crossing' is simulated" in rig.scfpf_rig.travels_all
