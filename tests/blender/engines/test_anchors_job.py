# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures by ordinary engines through anchors, beside ordinary cameras and beside what projectors meet."""

from dataclasses import replace
from itertools import pairwise

import bpy
import numpy as np
import pytest
from file_state import differences, file_state
from layer_scenes import add, collected, flexible, looking, new_camera, select_only
from quick_solves import quicken

WIDTH, HEIGHT = 64, 36


@pytest.fixture
def scene():
    """Things whose colour is their position, divided by 16 and raised to be positive, in a dark world."""
    scene = bpy.context.scene
    material = bpy.data.materials.new("Position")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    place, scale, glow, output = (
        tree.nodes.new(kind)
        for kind in (
            "ShaderNodeNewGeometry",
            "ShaderNodeVectorMath",
            "ShaderNodeEmission",
            "ShaderNodeOutputMaterial",
        )
    )
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value, scale.inputs[2].default_value = (1 / 16,) * 3, (0.5,) * 3
    tree.links.new(place.outputs["Position"], scale.inputs[0])
    tree.links.new(scale.outputs[0], glow.inputs["Color"])
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    for size, at in ((8.0, (0, 0, 0)), (1.2, (1.5, 1, -2)), (1.0, (-2, 1.5, -1)), (1.5, (0, -1.5, 2))):
        bpy.ops.mesh.primitive_cube_add(size=size, location=at)
        bpy.context.object.data.materials.append(material)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.max_bounces = 0
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.object.camera_add()
    camera = bpy.context.object
    camera.name, camera.data.clip_start = "Master", 0.01
    scene.camera = camera
    return scene


def result():
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def ordinary(scene, tmp_path):
    """The picture of the scene's camera as F12 makes it."""
    from engine_images import f12, write_multilayer

    write_multilayer(scene, tmp_path / "own")
    return next(values for name, values in f12(scene).items() if name.endswith("Combined"))


def places(addon, camera):
    """The positions (H, W, 3) that projectors through the pixels' centres meet, NaN for nothing."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    geometry = addon("bridge.scene.read_scene").read_scene(depsgraph).geometry
    projection = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, WIDTH / HEIGHT)
    cast_scene = addon("casting.scene.cast_scene").CastScene(geometry.vertices, geometry.triangles)
    hits = addon("casting.frame").cast_frame(cast_scene, projection, WIDTH, HEIGHT)
    position = hits.position / cast_scene.scale + cast_scene.centre[:, None]
    position[:, hits.triangle < 0] = np.nan
    return position.T.reshape(HEIGHT, WIDTH, 3)


def edges(position, reach=0.4):
    """Pixels beside others whose places are far from theirs, round a corner, or that show nothing."""
    jump = np.zeros(position.shape[:2], bool)
    for axis in (0, 1):
        step = ~(np.abs(np.diff(position, 2, axis=axis)).max(axis=2) <= reach)
        jump |= np.pad(step, [(1, 1) if axis == k else (0, 0) for k in (0, 1)])
    grown = np.pad(jump, 1)
    return np.any([np.roll(grown, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)[
        1:-1, 1:-1
    ]


def test_a_cameras_own_frustum_is_its_own_picture(scene, jobs, tmp_path):
    expected = ordinary(scene, tmp_path)
    flexible(scene.camera)
    job = jobs.render_anchors(bpy.context, scene.camera)
    assert "by Cycles" in job.outcome and not job.warnings
    np.testing.assert_allclose(result(), expected, atol=1e-6)


@pytest.mark.parametrize(
    "preset", ["cylindrical_panorama", "angular_fisheye", "inverted_perspective", "deep_curvy_volume"]
)
def test_pixels_show_what_their_projectors_meet(scene, jobs, addon, preset):
    """Colours are positions: they are those that the caster finds, but at edges."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 4
    wanted = places(addon, scene.camera)
    jobs.render_anchors(bpy.context, scene.camera)
    found = (result()[..., :3] - 0.5) * 16
    inner = ~edges(wanted)
    assert inner.mean() > 0.1
    # Of a pixel's size there: the distance to its neighbours.
    size = np.linalg.norm(np.gradient(wanted, axis=1), axis=2) + np.linalg.norm(
        np.gradient(wanted, axis=0), axis=2
    )
    off = np.linalg.norm(found - wanted, axis=2) / np.maximum(size, 1e-6)
    assert (off[inner] < 0.5).mean() > 0.98
    assert np.median(off[inner]) < 0.1


def test_the_picture_has_the_size_and_shape_that_the_scene_says(scene, jobs, addon):
    """Half the pixels, twice as wide: each shows what its projector meets."""
    flexible(scene.camera, "cylindrical_panorama")
    scene.camera.scfpf.samples = 1
    jobs.render_anchors(bpy.context, scene.camera)
    whole = result()
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, 2 * HEIGHT, 50
    render.pixel_aspect_x, render.pixel_aspect_y = 2.0, 1.0
    jobs.render_anchors(bpy.context, scene.camera)
    image = result()
    assert image.shape[:2] == (HEIGHT, WIDTH // 2)
    both = 0.5 * (whole[:, ::2] + whole[:, 1::2])
    assert np.median(np.abs(image - both)) < 0.01
    assert (render.resolution_percentage, render.pixel_aspect_x) == (50, 2.0)


def test_samples_smooth_edges(scene, jobs):
    """With one sample pixels are there or not; several lie at several places of a pixel."""
    flexible(scene.camera, "inverted_perspective")
    bpy.data.objects["Cube"].scale = (0.1, 0.1, 0.1)
    scene.render.film_transparent = True
    shares = []
    for samples in (1, 16):
        scene.camera.scfpf.samples = samples
        jobs.render_anchors(bpy.context, scene.camera)
        alpha = result()[..., 3]
        shares.append(((alpha > 0.01) & (alpha < 0.99)).mean())
    assert shares[0] == 0.0 and shares[1] > 0.01


@pytest.mark.parametrize("preset", ["cylindrical_panorama", "inverted_perspective"])
def test_the_sky_is_seen_before_what_lies_beyond_the_volume(scene, jobs, addon, preset):
    """A wall behind the far surface is in no picture: there the world shows."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 1
    bpy.data.objects["Cube"].scale = (500, 500, 500)
    scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs[0].default_value = (0.125, 0.25, 0.5, 1.0)
    jobs.render_anchors(bpy.context, scene.camera)
    image = result()
    sky = np.abs(image[..., :3] - (0.125, 0.25, 0.5)).max(axis=2) < 1e-3
    expected = np.isnan(places(addon, scene.camera)).any(axis=2)
    assert expected.mean() > 0.2 and sky[expected].mean() > 0.999


def test_dots_in_names_and_odd_passes(scene, jobs):
    """The file of a render is read whatever the view layer is called, and whatever passes it has."""
    flexible(scene.camera, "orthographic")
    scene.camera.scfpf.samples = 1
    layer = scene.view_layers[0]
    layer.name, layer.use_pass_combined, layer.use_pass_z = "Hero.001", False, True
    jobs.render_anchors(bpy.context, scene.camera)
    assert result()[..., 3].mean() > 0.9
    assert (layer.name, layer.use_pass_combined, layer.use_pass_z) == ("Hero.001", False, True)


@pytest.mark.parametrize("engine", ["eevee", "workbench"])
def test_other_engines_see_the_same_things(scene, jobs, addon, engine):
    """Through a parallel volume, one render: a small picture by Blender's other engines."""
    flexible(scene.camera, "orthographic")
    scene.camera.location.z = 3.5
    scene.camera.scfpf.samples = 1
    scene.display.shading.color_type = "OBJECT"
    versions = addon("bridge.blender.versions")
    renderer = versions.EEVEE if engine == "eevee" else "BLENDER_WORKBENCH"
    scene.eevee.taa_render_samples = 1
    job = jobs.render_anchors(bpy.context, scene.camera, renderer=renderer)
    assert engine in job.outcome.lower() and scene.render.engine == "CYCLES"
    image = result()
    assert np.isfinite(image).all()
    if engine == "eevee":
        wanted = places(addon, scene.camera)
        inner = ~edges(wanted)
        off = np.linalg.norm((image[..., :3] - 0.5) * 16 - wanted, axis=2)
        assert np.median(off[inner]) < 0.1


def test_the_scene_is_as_before_and_faults_leave_nothing(scene, jobs, addon, monkeypatch):
    flexible(scene.camera, "cylindrical_panorama")
    scene.camera.scfpf.samples = 1
    jobs.render_anchors(bpy.context, scene.camera)
    before = file_state()
    jobs.render_anchors(bpy.context, scene.camera)
    assert not differences(before, file_state())
    rendering = addon("engines.anchored_render")

    def fails(*_):
        raise OSError("of the test")

    monkeypatch.setattr(rendering, "read_passes", fails)
    with pytest.raises(addon("projection.user_error").UserError):
        jobs.render_anchors(bpy.context, scene.camera)
    assert not differences(before, file_state())


def test_what_cannot_be_is_refused_in_words(scene, jobs, addon):
    error = addon("projection.user_error").UserError
    flexible(scene.camera, "cylindrical_panorama")
    with pytest.raises(error, match="There is no render engine 'NOTHING'"):
        jobs.render_anchors(bpy.context, scene.camera, renderer="NOTHING")
    scene.render.engine = "SCFPF"
    with pytest.raises(error, match="Choose another render engine"):
        jobs.render_anchors(bpy.context, scene.camera)
    scene.render.engine = "CYCLES"
    for obj in [obj for obj in scene.objects if obj.name.startswith("Cube")]:
        bpy.data.objects.remove(obj)
    with pytest.raises(error, match="nothing to render"):
        jobs.render_anchors(bpy.context, scene.camera)


def test_what_is_left_out_is_named(scene, jobs):
    flexible(scene.camera, "cylindrical_panorama")
    scene.camera.scfpf.samples = 1
    scene.render.use_motion_blur = True
    smoke = bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke"))
    scene.collection.objects.link(smoke)
    job = jobs.render_anchors(bpy.context, scene.camera)
    for text in ("Left out of pictures that are joined: motion blur", "not along projectors: smoke"):
        assert any(text in str(warning) for warning in job.warnings)


def test_an_animation_is_written_frame_by_frame(scene, jobs, tmp_path):
    flexible(scene.camera, "orthographic")
    scene.camera.location.z = 3.5
    scene.camera.scfpf.samples = 1
    scene.render.image_settings.file_format = "PNG"
    job = jobs.render_anchors(bpy.context, scene.camera, (1, 2), str(tmp_path / "frame_##.png"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame_01.png", "frame_02.png"]
    assert len(job.written) == 2 and scene.frame_current == 1


def moving(scene, frames=(1, 40)):
    """A bent volume that moves through the room."""
    flexible(scene.camera, "inverted_perspective")
    camera = scene.camera
    camera.scfpf.samples = 1
    scene.frame_start, scene.frame_end = frames
    for frame, x in zip(frames, (0.0, 0.3), strict=True):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    for curve in curves_of(camera):
        curve.keyframe_points[0].interpolation = "LINEAR"
    scene.frame_set(frames[0])
    return camera


def curves_of(obj):
    action = obj.animation_data.action
    if hasattr(action, "fcurves"):
        return action.fcurves
    return [
        curve
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
    ]


def test_anchors_of_a_moving_volume_stay(scene, jobs, addon, tmp_path, monkeypatch):
    """They are planned once for the frames, at the places where the camera is then; each frame is right."""
    camera = moving(scene, (1, 4))
    shots = addon("anchors.shot")
    planned, rendered = [], []
    plan, complete = shots.Shot.plan, shots.completed_sets

    def noted_plan(self, chunk, looked_at, *others):
        place = np.array([0.5])
        planned.append([each.projection.projectors(place, place).points[0, 0, 0] for each in looked_at])
        assert len({id(each.scene) for each in looked_at}) == 1
        plan(self, chunk, looked_at, *others)

    def noted_sets(*everything):
        found = complete(*everything)
        rendered.append({view.anchor.matrix.tobytes() for view in found[0]})
        return found

    monkeypatch.setattr(shots.Shot, "plan", noted_plan)
    monkeypatch.setattr(addon("engines.picture_plan"), "completed_sets", noted_sets)
    jobs.render_anchors(bpy.context, camera, (1, 2, 3, 4), str(tmp_path / "frame_##.exr"))
    assert len(planned) == 1 and abs(planned[0][-1] - planned[0][0] - 0.3) < 1e-5
    assert all(len(one & other) > 0.7 * len(one) for one, other in pairwise(rendered))
    found = (result()[..., :3] - 0.5) * 16
    scene.frame_set(4)
    wanted = places(addon, camera)
    inner = ~edges(wanted)
    assert inner.mean() > 0.1 and np.median(np.linalg.norm(found - wanted, axis=2)[inner]) < 0.1


def test_a_frame_is_the_same_wherever_a_run_begins(scene, jobs, tmp_path):
    """Bit for bit, by Workbench: in a run, alone, and in a run that begins in another part of the shot."""
    camera = moving(scene)
    scene.display.shading.light, scene.display.shading.color_type = "MATCAP", "RANDOM"
    shown = {}
    for frames in ((17, 18, 19), (19,), (33, 19)):
        path = str(tmp_path / f"from_{frames[0]}_##.exr")
        job = jobs.render_anchors(bpy.context, camera, frames, path, "BLENDER_WORKBENCH")
        assert len(job.written) == len(frames)
        shown[frames] = result()
    first, *others = shown.values()
    assert first[..., :3].std() > 0.05
    assert all(np.array_equal(first, other) for other in others)


def test_frames_use_a_kept_plan_where_nothing_moves(scene, jobs, addon, tmp_path, monkeypatch):
    """Then all frames are the still picture, whichever are rendered."""
    flexible(scene.camera, "inverted_perspective")
    camera = scene.camera
    camera.scfpf.samples = 1
    assert bpy.ops.scfpf.joined_plan(camera=camera.name) == {"FINISHED"}

    def fails(*_):
        raise AssertionError("planned again")

    for module in ("engines.picture_plan", "anchors.shot"):
        monkeypatch.setattr(addon(module), "plan_anchors", fails)
    jobs.render_anchors(bpy.context, camera, renderer="BLENDER_WORKBENCH")
    still = result()
    jobs.render_anchors(bpy.context, camera, (20, 40), str(tmp_path / "##.exr"), "BLENDER_WORKBENCH")
    np.testing.assert_array_equal(result(), still)


def test_a_kept_plan_is_used_as_long_as_it_fits(scene, jobs, addon, monkeypatch):
    """The picture is the same, and is not planned again until camera, things or size change."""
    flexible(scene.camera, "inverted_perspective")
    camera = scene.camera
    camera.scfpf.samples = 1
    jobs.render_anchors(bpy.context, camera)
    fresh = result()
    assert bpy.ops.scfpf.joined_plan(camera=camera.name) == {"FINISHED"}
    plan = addon("anchors.kept_plan").KeptPlan.read(camera.scfpf.anchor_plan)
    assert plan.size == (WIDTH, HEIGHT) and plan.shown > 0.99 and len(plan.anchors) > 3
    rendering, planned = addon("engines.picture_plan"), []
    plan_anchors = rendering.plan_anchors

    def noted(*everything, **options):
        planned.append(True)
        return plan_anchors(*everything, **options)

    monkeypatch.setattr(rendering, "plan_anchors", noted)
    jobs.render_anchors(bpy.context, camera)
    np.testing.assert_allclose(result(), fresh, atol=1e-6)
    assert not planned
    for change in (
        lambda: setattr(camera, "location", (0.1, 0.0, 0.0)),
        lambda: setattr(bpy.data.objects["Cube.001"], "location", (1.6, 1.0, -2.0)),
        lambda: setattr(scene.render, "resolution_x", WIDTH + 2),
    ):
        change()
        bpy.ops.scfpf.joined_plan(camera=camera.name)
        del planned[:]
        jobs.render_anchors(bpy.context, camera)
        assert not planned
        change_back = camera.scfpf.anchor_plan
        camera.scfpf.anchor_plan = plan.text
        jobs.render_anchors(bpy.context, camera)
        assert planned and camera.scfpf.anchor_plan == plan.text
        camera.scfpf.anchor_plan = change_back


def test_the_plan_and_its_time_are_seen_after_the_file_is_opened_again(scene, addon, tmp_path, monkeypatch):
    """The panel's line has both: the time of the renders before the file was saved counts."""
    flexible(scene.camera, "inverted_perspective")
    scene.camera.scfpf.samples = 1
    assert bpy.ops.scfpf.joined_plan(camera=scene.camera.name) == {"FINISHED"}
    assert bpy.ops.scfpf.joined_render(camera=scene.camera.name) == {"FINISHED"}
    text, times = addon("panels.messages").plan_text, addon("engines.render_times")
    monkeypatch.setattr(addon("panels.messages"), "joined_engine", lambda _scene: "CYCLES")
    line = text(scene, scene.camera)
    assert "Plan: " in line and "about" in line
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    monkeypatch.setattr(times, "_last", {})
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    assert text(bpy.context.scene, bpy.context.scene.camera) == line
    # Damaged text is none.
    for damaged in ("", "{", "[1]", '{"CYCLES": 3}', '{"CYCLES": [0, 0, 1]}'):
        assert times.estimated_seconds("CYCLES", 3, 100.0, damaged) is None


@pytest.mark.parametrize("text", ["", "{", "[]", "[1,2,3,4,5,6]", '[1,"",[1,1],1,true,[[[],[],[],[],0]]]'])
def test_a_damaged_plan_is_none(addon, text):
    assert addon("anchors.kept_plan").KeptPlan.read(text) is None


def mapped(addon, camera):
    for kind in ("RADIAL_CURVE", "LENS"):
        assert bpy.ops.scfpf.mapping_add(kind=kind) == {"FINISHED"}
    return camera


def polar(addon, camera):
    camera.scfpf.reparameterisation = "POLAR"
    return camera


def blended(addon, camera):
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    return bpy.context.object


def aimed(addon, camera):
    """One of the cubes is seen from farther to its left."""
    camera.scfpf.aim.columns, camera.scfpf.aim.rows, camera.scfpf.aim.degree = 8, 6, 2
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Cube.001") == {"FINISHED"}
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, left=0.2) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.aim_solve(camera=camera.name) == {"FINISHED"}
    assert camera.scfpf.aim.is_solved
    return camera


def from_screen(addon, camera, pop_out=False):
    """An eye before a window in the room, which renders do not show."""
    bpy.ops.mesh.primitive_plane_add(size=1.2, location=(0, 0, -0.6))
    screen = bpy.context.object
    screen.name = "Screen"
    bpy.ops.object.empty_add(location=(0.1, 0.0, 0.0))
    eye = bpy.context.object
    screen.select_set(True)
    bpy.context.view_layer.objects.active = screen
    assert eye.select_get() and bpy.ops.scfpf.camera_from_screen(pop_out=pop_out) == {"FINISHED"}
    screen.hide_render = not pop_out
    return bpy.context.object


def popping_out(addon, camera):
    """A screen in the picture, before which things stand that pop out of it."""
    bpy.data.objects["Cube.002"].location = 0.05, 0.1, -0.4
    bpy.data.objects["Cube.002"].scale = (0.1, 0.1, 0.1)
    made = from_screen(addon, camera, True)
    assert addon("bridge.volume.screens").screens_of(made)
    return made


@pytest.mark.parametrize("kind", [mapped, polar, blended, aimed, from_screen, popping_out])
def test_every_kind_of_volume_is_joined(scene, jobs, addon, monkeypatch, kind):
    """Colours are positions: those of the engine's Position pass, within half a pixel but at edges."""
    quicken(addon, monkeypatch)
    flexible(scene.camera, "angular_fisheye" if kind is polar else "perspective")
    scene.camera.scfpf.samples = 1
    camera = kind(addon, scene.camera)
    scene.camera = camera
    camera.scfpf.samples = 1
    bpy.context.view_layer.update()
    jobs.render_anchors(bpy.context, camera)
    found = (result()[..., :3] - 0.5) * 16
    wanted = position_pass(scene, addon, camera)
    inner = ~edges(wanted)
    size = sum(np.linalg.norm(np.gradient(wanted, axis=axis), axis=2) for axis in (0, 1))
    off = np.linalg.norm(found - wanted, axis=2) / np.maximum(size, 1e-6)
    assert inner.mean() > 0.1
    assert (off[inner] < 0.5).mean() > 0.98


def position_pass(scene, addon, camera, name="POSITION"):
    """The engine's own Position pass (H, W, 3) by one sample, or another one, NaN where it shows nothing."""
    inputs = addon("bridge.render.render_inputs")
    reading = addon("bridge.scene.render_depsgraph").with_render_depsgraph
    seen = reading(
        scene,
        bpy.context.view_layer,
        lambda depsgraph: inputs.read_inputs(depsgraph, camera, (WIDTH, HEIGHT), passes=(name,)),
    )
    frame = addon("shading.frame").render_frame(
        seen.projection, seen.scene, replace(seen.settings, samples=1)
    )
    wanted = np.array(frame.passes[name], np.float64)[..., :3]
    wanted[np.abs(wanted).max(axis=2) == 0.0] = np.nan
    return wanted


def layered(scene, front="DEPTH", halo=0.0):
    """One of the cubes is seen from its side, through a bent volume; a wall hides it from the camera."""
    flexible(scene.camera, "inverted_perspective")
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(2.6, 0.0, 2.0))
    bpy.context.object.name, bpy.context.object.scale = "Wall", (0.1, 3.0, 3.0)
    bpy.context.object.data.materials.append(bpy.data.materials["Position"])
    side = new_camera("Side", looking((3.4, 0.5, 3.0), (0.0, -1.5, 2.0)))
    flexible(side, "deep_curvy_volume")
    collected("Things", "Cube.001", "Cube.003")
    select_only(scene.camera)
    layer = add(front=front)
    layer.halo, layer.position = halo, (0.85, 0.5)
    scene.camera.scfpf.samples = 1
    bpy.context.view_layer.update()
    return scene.camera


def test_clear_layers_beside_cycles(scene, jobs):
    """Half of what is behind a half clear thing of a layer shows through, as by Cycles' own layers."""
    camera = layered(scene, "ORDER")
    camera.scfpf.samples, scene.cycles.samples, scene.cycles.max_bounces = 4, 16, 8
    scene.cycles.transparent_max_bounces = 8
    clear = bpy.data.materials["Position"].copy()
    tree = clear.node_tree
    glow, output = (
        next(node for node in tree.nodes if node.type == kind) for kind in ("EMISSION", "OUTPUT_MATERIAL")
    )
    mix, through = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    for one, other in (
        (through.outputs[0], mix.inputs[1]),
        (glow.outputs[0], mix.inputs[2]),
        (mix.outputs[0], output.inputs["Surface"]),
    ):
        tree.links.new(one, other)
    for name in ("Cube.001", "Cube.003"):
        bpy.data.objects[name].active_material = clear
    jobs.render_anchors(bpy.context, camera)
    found = result()
    assert bpy.ops.scfpf.layers_render(camera=camera.name) == {"FINISHED"}
    wanted = result()
    off, inner = np.abs(found - wanted).max(axis=2), ~edges(wanted[..., :3], 0.02)
    assert inner.mean() > 0.4 and (off[inner] < 0.02).all() and off[inner].mean() < 1e-3


@pytest.mark.parametrize(
    ("front", "halo", "engine"),
    [
        ("DEPTH", 0.0, "CYCLES"),
        ("ANCHOR", 0.0, "CYCLES"),
        ("ORDER", 0.0, "CYCLES"),
        ("ORDER", 0.7, "CYCLES"),
        pytest.param("ORDER", 0.0, "EEVEE", marks=pytest.mark.once),
    ],
)
def test_layers_are_joined(scene, jobs, addon, front, halo, engine):
    """Each pixel shows what the engine's Position pass has, of the same layer; objects stay as they were."""
    camera = layered(scene, front, halo)
    if engine == "EEVEE":
        # Instances belong to the layer of what makes them.
        source = bpy.data.collections.new("Source")
        source.objects.link(bpy.data.objects["Cube.003"])
        empty = bpy.data.objects.new("Instances", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", source, (0, 2.2, 0)
        bpy.data.collections["Things"].objects.link(empty)
        for collection in (bpy.data.collections["Things"], scene.collection):
            collection.objects.unlink(bpy.data.objects["Cube.003"])
        bpy.context.view_layer.update()
    before = file_state()
    scene.eevee.taa_render_samples = 1
    renderer = engine if engine == "CYCLES" else addon("bridge.blender.versions").EEVEE
    job = jobs.render_anchors(bpy.context, camera, renderer=renderer)
    changes = [each for each in differences(before, file_state()) if not each.startswith("images")]
    assert not changes
    found = (result()[..., :3] - 0.5) * 16
    wanted = position_pass(scene, addon, camera)
    without = places(addon, camera)
    inner, is_other = ~edges(wanted), ~(np.linalg.norm(wanted - without, axis=2) < 0.5)
    size = sum(np.linalg.norm(np.gradient(wanted, axis=axis), axis=2) for axis in (0, 1))
    off = np.linalg.norm(found - wanted, axis=2) / np.maximum(size, 1e-6)
    assert inner.mean() > 0.1 and (inner & is_other).mean() > 0.02
    assert (off[inner] < 0.5).mean() > 0.97
    assert (off[inner & is_other] < 0.5).mean() > 0.97
    assert not any("ayers" in str(text) for text in job.warnings)


def test_layers_by_workbench(scene, jobs):
    """Which knows no shadows of what its cameras miss: the warning says so, and all pixels have colors."""
    camera = layered(scene)
    scene.display.shading.light, scene.display.shading.color_type = "FLAT", "OBJECT"
    for obj in scene.objects:
        if obj.type == "MESH":
            obj.color = (0, 1, 0, 1) if obj.name in ("Cube.001", "Cube.003") else (1, 0, 0, 1)
    for engine, green in (("BLENDER_WORKBENCH", True), ("CYCLES", False)):
        job = jobs.render_anchors(bpy.context, camera, renderer=engine)
        named = [text for text in job.warnings if "shadows and reflections between layers" in str(text)]
        assert bool(named) == green
        if green:
            image = result()[..., :3]
    is_layer, is_rest = image[..., 1] > image[..., 0] + 0.3, image[..., 0] > image[..., 1] + 0.3
    assert is_layer.mean() > 0.03 and is_rest.mean() > 0.03
    # The position of the cube that is seen, which Cycles has shown.
    cube = np.abs((result()[..., :3] - 0.5) * 16 - (0.0, -1.5, 2.0)).max(axis=2) < 0.8
    assert (cube == is_layer).mean() > 0.99


def test_layers_move(scene, jobs, addon, tmp_path):
    """In an animation a layer's anchors are planned for the shot, and each frame shows its own place."""
    camera = layered(scene, "ORDER")
    side = bpy.data.objects["Side"]
    for frame, x in ((1, 3.4), (20, 3.0)):
        side.location.x = x
        side.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 20
    jobs.render_anchors(bpy.context, camera, (9, 12), str(tmp_path / "##.exr"))
    found = (result()[..., :3] - 0.5) * 16
    scene.frame_set(12)
    wanted = position_pass(scene, addon, camera)
    inner = ~edges(wanted)
    size = sum(np.linalg.norm(np.gradient(wanted, axis=axis), axis=2) for axis in (0, 1))
    off = np.linalg.norm(found - wanted, axis=2) / np.maximum(size, 1e-6)
    assert inner.mean() > 0.1 and (off[inner] < 0.5).mean() > 0.97
