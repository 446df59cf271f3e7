# SPDX-License-Identifier: GPL-3.0-or-later
"""Several cameras and scenes, markers, hidden and excluded collections, local view."""

import bpy
import numpy as np
import pytest

U, V, T = np.random.default_rng(41).random((3, 40))


@pytest.fixture
def shown(addon):
    def positions(camera, scene=None):
        read_projection = addon("bridge.camera.read_projection").read_projection
        scene = scene or bpy.context.scene
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.context.view_layer.update()
            depsgraph = bpy.context.evaluated_depsgraph_get()
            return read_projection(camera, depsgraph, 16 / 9).volume.evaluate(U, V, T).position

    return positions


def add_camera(name, location=(0, 0, 10), rotation=(0, 0, 0)):
    bpy.ops.object.camera_add(location=location, rotation=rotation)
    camera = bpy.context.object
    camera.name = name
    bpy.context.view_layer.update()
    with bpy.context.temp_override(active_object=camera, object=camera):
        assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    camera.scfpf.samples = 1
    camera.scfpf.edit_volume = True  # or else its surfaces could not be selected
    return camera


def small(scene):
    scene.render.resolution_x, scene.render.resolution_y = 16, 9


@pytest.fixture
def two():
    """A camera that looks down at a large cube and one that looks up into nothing."""
    bpy.ops.mesh.primitive_cube_add(size=6)
    bpy.context.scene.render.film_transparent = True
    small(bpy.context.scene)
    return add_camera("Down"), add_camera("Up", rotation=(np.pi, 0, 0))


def coverage(image=None):
    """Return the share of the image that shows something."""
    image = image or bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values[3::4].mean()


def bind(scene, frame, camera):
    """Do what Marker > Bind Camera to Markers does, for a marker at a frame."""
    scene.timeline_markers.new(camera.name, frame=frame).camera = camera


def test_markers_choose_the_camera_that_render_uses(two):
    down, up = two
    scene = bpy.context.scene
    bind(scene, 1, down)
    bind(scene, 11, up)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    for frame, camera, covered in ((1, down, True), (10, down, True), (11, up, False), (30, up, False)):
        scene.frame_set(frame)
        assert scene.camera == camera
        down.scfpf.report = up.scfpf.report = ""
        assert bpy.ops.scfpf.render() == {"FINISHED"}
        assert (coverage() > 0.2) == covered
        assert bool(camera.scfpf.report) and not (up if camera == down else down).scfpf.report


def test_markers_in_the_command_line(addon, two, tmp_path):
    down, up = two
    scene = bpy.context.scene
    bind(scene, 1, down)
    bind(scene, 11, up)
    scene.frame_set(11)
    path = tmp_path / "markers.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    run = addon("bridge.render.command_line").run
    for options, covered in ((["--frame", "1"], True), (["--frame", "12"], False), ([], False)):
        output = tmp_path / "out.png"
        assert run(["render", str(path), "-o", str(output), *options]) == 0
        image = bpy.data.images.load(str(output))
        assert (coverage(image) > 0.2) == covered, options
        bpy.data.images.remove(image)


def test_marker_of_an_ordinary_camera_renders_the_active_flexible_one_or_says_so(two):
    """The scene's camera is no flexible one: the active one is meant, as without markers."""
    down, _ = two
    scene = bpy.context.scene
    bpy.ops.object.camera_add()
    bind(scene, 5, bpy.context.object)
    scene.frame_set(5)
    bpy.context.view_layer.objects.active = down
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    assert coverage() > 0.2
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    with pytest.raises(RuntimeError, match="no flexible camera"):
        bpy.ops.scfpf.render()


def test_one_camera_in_two_scenes_of_different_size_and_content(two, shown):
    down, _ = two
    first = bpy.context.scene
    before = shown(down)
    other = bpy.data.scenes.new("Other")
    small(other)
    other.render.film_transparent = True
    for obj in (down, *(slot.object for slot in down.scfpf.surfaces)):
        other.collection.objects.link(obj)
        obj.hide_viewport = True
    other.camera = down
    bpy.context.view_layer.update()
    assert np.abs(shown(down, other) - before).max() == 0
    first.camera = down
    assert bpy.ops.scfpf.render() == {"FINISHED"} and coverage() > 0.2
    other.collection.objects.link(bpy.data.objects.new("Nothing", None))
    window = bpy.context.window_manager.windows[0]
    window.scene = other
    with bpy.context.temp_override(window=window):
        assert bpy.context.scene == other
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5)
        assert bpy.ops.scfpf.render() == {"FINISHED"}
    assert 0 < coverage() < 0.2
    window.scene = first


def test_deleting_one_scene_leaves_the_camera_whole_in_the_other(two, shown):
    down, _ = two
    before = shown(down)
    first = bpy.context.scene
    copy = bpy.data.scenes.new("Copy")
    for obj in list(first.collection.objects):
        if obj not in copy.collection.objects.values():
            copy.collection.objects.link(obj)
    shown(down, copy)
    bpy.context.window_manager.windows[0].scene = copy
    bpy.data.scenes.remove(first)
    for slot in down.scfpf.surfaces:
        slot.object.hide_viewport = True
    assert np.abs(shown(down, copy) - before).max() == 0
    copy.camera = down
    assert bpy.ops.scfpf.render() == {"FINISHED"} and coverage() > 0.2


SWITCHES = ("hide_viewport", "exclude", "hide_render", "eye", "holdout", "indirect_only")


@pytest.mark.parametrize("switch", SWITCHES)
def test_collection_of_camera_and_surfaces_switched_off(two, shown, switch):
    """The volume stays current and the image the same, in whichever way its collection is hidden."""
    down, _ = two
    scene = bpy.context.scene
    rig = bpy.data.collections.new("Rig")
    scene.collection.children.link(rig)
    for obj in (down, *(slot.object for slot in down.scfpf.surfaces)):
        rig.objects.link(obj)
        scene.collection.objects.unlink(obj)
    scene.camera = down
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    covered, before = coverage(), shown(down)
    layer = bpy.context.view_layer.layer_collection.children["Rig"]
    if switch in ("hide_viewport", "hide_render"):
        setattr(rig, switch, True)
    else:
        setattr(layer, "hide_viewport" if switch == "eye" else switch, True)
    assert np.abs(shown(down) - before).max() == 0
    far = down.scfpf.surfaces[1].object
    far.location.x += 1
    assert np.abs(shown(down) - before - np.array([[1], [0], [0]]) * T).max() < 1e-4
    far.location.x -= 1
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    assert coverage() == covered


def test_view_layers(two, shown):
    """A second view layer that lacks the rig's collection reads and renders the same volume."""
    down, _ = two
    scene = bpy.context.scene
    before = shown(down)
    rig = bpy.data.collections.new("Rig")
    scene.collection.children.link(rig)
    for obj in (down, *(slot.object for slot in down.scfpf.surfaces)):
        rig.objects.link(obj)
        scene.collection.objects.unlink(obj)
    scene.camera = down
    second = scene.view_layers.new("Second")
    second.layer_collection.children["Rig"].exclude = True
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        window.view_layer = second
        assert bpy.ops.scfpf.render() == {"FINISHED"} and coverage() > 0.2
        bpy.context.view_layer.update()
    with bpy.context.temp_override(scene=scene, view_layer=second):
        second.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        assert depsgraph.view_layer.name == "Second"
    assert np.abs(shown(down) - before).max() == 0


def test_local_view(two, shown, addon):
    """Local view of one surface hides the others; volume and image stay unchanged."""
    down, _ = two
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    space = area.spaces.active
    before = shown(down)
    bpy.context.scene.camera = down
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == down.scfpf.surfaces[0].object)
    with bpy.context.temp_override(window=window, area=area, region=region):
        assert bpy.ops.view3d.localview(frame_selected=False) == {"FINISHED"}
        try:
            assert space.local_view and not down.local_view_get(space)
            down.scfpf.surfaces[1].object.location.x += 1
            assert np.abs(shown(down) - before - np.array([[1], [0], [0]]) * T).max() < 1e-4
            assert bpy.ops.scfpf.render() == {"FINISHED"} and coverage() > 0.1
            # A surface added in local view is seen there, as everything that Blender adds.
            bpy.context.view_layer.objects.active = down
            assert bpy.ops.scfpf.surface_add(kind="PLANE") == {"FINISHED"}
            new = down.scfpf.surfaces[down.scfpf.active_surface].object
            # What Blender's own objects answer: in 4.5 without a window, always no.
            answer = down.scfpf.surfaces[0].object.local_view_get(space)
            assert new.local_view_get(space) == answer
            bpy.context.view_layer.objects.active = down
            assert bpy.ops.scfpf.surface_duplicate() == {"FINISHED"}
            assert down.scfpf.surfaces[down.scfpf.active_surface].object.local_view_get(space) == answer
            assert bpy.ops.scfpf.camera_add(preset="nonlinear_twist") == {"FINISHED"}
            made = bpy.context.object
            assert made.local_view_get(space) == answer
            assert all(slot.object.local_view_get(space) == answer for slot in made.scfpf.surfaces)
        finally:
            bpy.ops.view3d.localview(frame_selected=False)


def test_two_cameras_edited_by_turns(two, shown):
    down, up = two
    first, second = shown(down), shown(up)
    for camera, other, kept in ((down, up, second), (up, down, None)):
        bpy.context.view_layer.objects.active = camera
        assert bpy.ops.scfpf.surface_add(kind="SPHERE") == {"FINISHED"}
        assert len(camera.scfpf.surfaces) == 3
        if kept is not None:
            assert np.abs(shown(other) - kept).max() == 0
    assert np.abs(shown(down) - first).max() > 0.01


@pytest.mark.usefixtures("built_groups")
@pytest.mark.parametrize("operator", ["preview_toggle", "cycles_rig"])
def test_what_is_removed_with_its_scene_takes_the_volume_object_of_its_camera_along(operator):
    """The camera of a preview or a rig is an ordinary one, which artists may make flexible."""
    bpy.ops.scene.new(type="EMPTY")
    bpy.ops.scfpf.camera_add()
    before = bpy.data.objects[:]
    getattr(bpy.ops.scfpf, operator)()
    camera = next(obj for obj in bpy.data.objects if obj not in before and obj.type == "CAMERA")
    camera.scfpf.enabled = True
    bpy.context.view_layer.update()
    assert camera.scfpf.volume_object is not None
    name = camera.name
    bpy.ops.scene.delete("EXEC_DEFAULT", True)
    bpy.context.view_layer.update()
    assert name not in bpy.data.objects
    assert not any(obj.scfpf_surface.is_volume for obj in bpy.data.objects)


def edited_elsewhere(kind, mode="EDIT"):
    """The camera, whose near surface of a kind is in Edit Mode in a scene that no window shows any more."""
    camera = add_camera("Edited")
    conversions = {"GRID": bpy.ops.scfpf.surface_to_grid, "NURBS": bpy.ops.scfpf.surface_to_patch}
    if kind in conversions:
        assert conversions[kind](columns=4, rows=4) == {"FINISHED"}
    if kind == "LATTICE":
        assert bpy.ops.scfpf.volume_to_lattice() == {"FINISHED"}
    if kind == "WARP":
        assert bpy.ops.scfpf.mapping_add(kind="GRID") == {"FINISHED"}
        edited = camera.scfpf.mappings[0].grid
    else:
        edited = camera.scfpf.surfaces[0].object
    edited.hide_select = False
    first, other = bpy.context.scene, bpy.data.scenes.new("Other")
    for obj in first.collection.all_objects:
        other.collection.objects.link(obj)
    other.camera = camera
    small(other)
    bpy.context.view_layer.objects.active = edited
    assert bpy.ops.object.mode_set(mode=mode) == {"FINISHED"}
    bpy.context.window.scene = other
    bpy.context.view_layer.objects.active = camera
    assert bpy.context.mode == "OBJECT" and edited.mode == mode
    return camera, edited


@pytest.mark.parametrize(
    ("kind", "mode"),
    [(kind, "EDIT") for kind in ("PLANE", "GRID", "NURBS", "LATTICE", "WARP")] + [("GRID", "SCULPT")],
)
def test_no_operator_touches_what_is_edited_in_another_scene(kind, mode, addon):
    """Its points would be lost when that mode ends, or the object with them."""
    camera, edited = edited_elsewhere(kind, mode)
    read = addon("bridge.camera.read_projection").read_projection
    before = read(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9)
    changing = (
        "surface_",
        "volume_",
        "mapping_",
        "preset_apply",
        "blend_",
        "camera_from",
        "by_distance",
        "dim",
    )
    for name in sorted(dir(bpy.ops.scfpf)):
        operator = getattr(bpy.ops.scfpf, name)
        if not name.startswith(changing) or not operator.poll():
            continue
        try:
            operator("EXEC_DEFAULT")
        except RuntimeError as error:
            assert "fault of the add-on" not in str(error), name
        assert edited.mode == mode and edited.name in bpy.context.scene.objects, name
    after = read(camera, bpy.context.evaluated_depsgraph_get(), 16 / 9)
    there = [each.volume.evaluate(U, V, T).position for each in (before, after)]
    assert np.abs(there[1] - there[0]).max() == 0
    bpy.context.window.scene = next(scene for scene in bpy.data.scenes if scene.name != "Other")
    bpy.context.view_layer.objects.active = edited
    assert bpy.ops.object.mode_set(mode="OBJECT") == {"FINISHED"}
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.volume_swap.poll() or kind == "LATTICE"


def test_a_script_cannot_reshape_what_is_edited(addon):
    camera, edited = edited_elsewhere("PLANE")
    edits, refused = addon("bridge.camera.surface_edits"), addon("projection.user_error").UserError
    depsgraph = bpy.context.evaluated_depsgraph_get()
    with pytest.raises(refused, match="being edited"):
        edits.convert_to_grid(camera, depsgraph, 0, 3, 3, 0.001)
    assert edited.name in bpy.context.scene.objects and edited.scfpf_surface.kind == "PLANE"


def test_a_kind_chosen_in_edit_mode_keeps_the_shape(shown):
    camera, edited = edited_elsewhere("PLANE")
    before = shown(camera)
    edited.scfpf_surface.kind = "GRID"
    assert np.abs(shown(camera) - before).max() < 1e-6
    assert len(edited.modifiers) == 1
