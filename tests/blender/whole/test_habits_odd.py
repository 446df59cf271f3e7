# SPDX-License-Identifier: GPL-3.0-or-later
"""Unexpected actions of artists: each succeeds or is refused with a message, and leaves nothing behind."""

import bpy
import numpy as np
import pytest
from recorded_layout import drawn, texts


@pytest.fixture
def camera():
    bpy.ops.scfpf.camera_add()
    return bpy.context.object


def select(*objects):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[-1]


def child_collection(name, linked_from=None):
    """A collection of the scene, active; linked_from: a file to link it from."""
    made = bpy.data.collections.new(name)
    if linked_from is not None:
        bpy.data.libraries.write(str(linked_from), {made})
        bpy.data.collections.remove(made)
        with bpy.data.libraries.load(str(linked_from), link=True) as (_, wanted):
            wanted.collections = [name]
        (made,) = wanted.collections
    bpy.context.scene.collection.children.link(made)
    layer = bpy.context.view_layer.layer_collection.children[name]
    bpy.context.view_layer.active_layer_collection = layer
    return layer


def test_a_surface_that_blender_has_made_a_curve_of_is_taken_off_the_list(camera):
    camera.scfpf.edit_volume = True
    surface = camera.scfpf.surfaces[0].object
    select(surface)
    assert bpy.ops.object.convert(target="CURVE") == {"FINISHED"} and surface.type == "CURVE"
    select(camera)
    camera.scfpf.active_surface = 0
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="cannot be a control surface"):
        bpy.ops.scfpf.surface_duplicate()
    assert len(bpy.data.objects) == count  # no half of a copy
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    assert len(camera.scfpf.surfaces) == 1 and len(bpy.data.objects) == count - 1 and not bpy.data.curves


def test_a_grid_mapping_whose_mesh_is_a_curve_now_is_removed(camera):
    bpy.ops.scfpf.mapping_add(kind="GRID")
    grid = camera.scfpf.mappings[0].grid
    select(grid)
    bpy.ops.object.convert(target="CURVE")
    select(camera)
    assert bpy.ops.scfpf.mapping_remove() == {"FINISHED"}
    assert not camera.scfpf.mappings and not bpy.data.curves


def test_linked_duplicates_become_grids_of_their_own(camera):
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    width = [surface.dimensions.x for surface in (near, far)]
    far.data = near.data  # as Alt-D leaves them: the empty mesh is shared, the modifiers are not
    for surface in (near, far):
        surface.scfpf_surface.kind = "GRID"
    bpy.context.view_layer.update()
    assert near.data != far.data
    np.testing.assert_allclose([surface.dimensions.x for surface in (near, far)], width, rtol=1e-5)


def test_a_full_list_leaves_no_copy_behind(addon, camera):
    most = addon("projection.presets.preset").MAXIMUM_SURFACES
    surfaces = camera.scfpf.surfaces
    for _ in range(most - len(surfaces)):
        surfaces.add().object = surfaces[1].object
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="the most that a volume may have"):
        bpy.ops.scfpf.surface_duplicate()
    assert len(bpy.data.objects) == count


def test_a_duplicated_surface_has_its_own_keyframes(camera):
    surface = camera.scfpf.surfaces[0].object
    for frame, place in ((1, 0.0), (11, 5.0)):
        surface.location.x = place
        surface.keyframe_insert("location", index=0, frame=frame)
    camera.scfpf.active_surface = 0
    bpy.ops.scfpf.surface_duplicate()
    copy = camera.scfpf.surfaces[1].object
    assert copy.animation_data.action != surface.animation_data.action
    surface.keyframe_delete("location", index=0, frame=11)
    bpy.context.scene.frame_set(11)
    assert (surface.location.x, copy.location.x) == (0.0, 5.0)


def test_a_camera_is_added_while_another_files_collection_is_active(tmp_path):
    child_collection("Theirs", tmp_path / "theirs.blend")
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    assert bpy.context.object.users_collection[0] == bpy.context.scene.collection


def test_a_blend_of_a_camera_in_an_excluded_collection_is_seen():
    layer = child_collection("Away")
    bpy.ops.scfpf.camera_add()
    layer.exclude = True
    assert bpy.context.object is None and bpy.context.scene.camera is not None
    assert bpy.ops.scfpf.camera_blend_preset(preset="perspective") == {"FINISHED"}
    assert bpy.context.object == bpy.context.scene.camera and bpy.context.object.visible_get()


def make_smoke():
    """A box of smoke around everything."""
    bpy.ops.mesh.primitive_cube_add(size=100)
    material = bpy.data.materials.new("Smoke")
    if material.node_tree is None:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    material.node_tree.links.new(nodes.new("ShaderNodeVolumePrincipled").outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


@pytest.mark.usefixtures("built_groups")
def test_a_rig_in_smoke_that_no_viewport_shows(addon, camera):
    """Blender has no faces of what viewports do not show: its box is asked. What is excluded is not there."""
    layer = child_collection("Weather")
    smoke = make_smoke()
    select(camera)
    smoke.hide_viewport = True
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    rig = addon("cycles.rig_data").rig_of(bpy.context.scene)
    assert rig.scfpf_rig.smoke == smoke.name
    layer.exclude = True
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"}
    assert rig.scfpf_rig.smoke == ""


@pytest.mark.usefixtures("built_groups")
def test_what_is_shown_of_the_scenes_camera_is_the_flexible_one_behind_a_rig(addon, camera):
    camera.scfpf.samples = 7
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    assert bpy.context.scene.camera != camera
    assert addon("bridge.overlays.image_marks").marked_camera(bpy.context) == camera
    assert "ordinary camera" not in texts(drawn(bpy.types.SCFPF_PT_engine_camera))


def test_marks_of_the_active_camera_are_shown_while_the_scenes_is_ordinary(addon, camera):
    marked_camera = addon("bridge.overlays.image_marks").marked_camera
    bpy.ops.object.camera_add()
    ordinary = bpy.context.object
    bpy.context.scene.camera = ordinary
    assert marked_camera(bpy.context) is None
    select(camera)
    assert marked_camera(bpy.context) == camera


@pytest.mark.usefixtures("built_groups")
def test_a_rig_where_cycles_is_switched_off(addon, camera, capfd):
    """As where a file is opened: the panel says so, nothing fails, and the rig can be removed."""
    scene = bpy.context.scene
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    cautions, data = addon("cycles.cautions").cautions, addon("cycles.rig_data")
    rig = data.rig_of(scene)
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        assert cautions(scene, bpy.context.view_layer, rig) == [data.NO_CYCLES]
        bpy.ops.scfpf.surface_add(kind="CYLINDER")
        bpy.context.view_layer.update()
        assert rig.scfpf_rig.problem == data.NO_CYCLES
        with pytest.raises(RuntimeError, match="Cycles is switched off"):
            bpy.ops.scfpf.cycles_rig_update()
        select(camera)
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}  # off
        assert scene.camera == camera and data.rig_of(scene) is None
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")
    assert "Traceback" not in capfd.readouterr().err


def test_what_is_picked_through_a_linked_camera_is_refused(tmp_path, camera):
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "theirs.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "theirs.blend"), link=True) as (there, here):
        here.objects = there.objects
    for obj in here.objects:
        bpy.context.scene.collection.objects.link(obj)
    theirs = next(obj for obj in here.objects if obj.type == "CAMERA")
    bpy.context.scene.camera = theirs
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="library override"):
        bpy.ops.scfpf.pick(x=0.5, y=0.5)
    assert not theirs.scfpf.show_pick


def test_a_click_after_what_it_was_for_is_gone(addon, camera, monkeypatch):
    """Between the button and the click Blender goes on: the mapping may be removed, or undone."""
    click = addon("operators.image.image_click")
    monkeypatch.setattr(click, "image_position", lambda *_: (0.25, 0.75))
    said = []

    class Waiting(click.ImageClick):
        poll = classmethod(addon("operators.volume.mappings")._poll_mapping)
        poll_message_set = staticmethod(said.append)
        execute = addon("operators.volume.mappings").SCFPF_OT_mapping_place.execute

        def report(self, _kind, text):
            said.append(text)

        def leave(self):
            said.append("left")

    def pressed():
        event = type("Event", (), {"type": "LEFTMOUSE", "value": "PRESS", "mouse_x": 0, "mouse_y": 0})
        return Waiting().respond(bpy.context, event)

    bpy.ops.scfpf.mapping_add(kind="LENS")
    assert pressed() == {"FINISHED"} and tuple(camera.scfpf.mappings[0].centre) == (0.25, 0.75)
    bpy.ops.scfpf.mapping_remove()
    assert pressed() == {"CANCELLED"} and said[-1] == click.NO_MORE


def test_a_mirror_that_one_surface_cannot_have_changes_none(camera):
    near, far = (slot.object for slot in camera.scfpf.surfaces)
    far.scfpf_surface.kind = "GRID"
    far.data.uv_layers.remove(far.data.uv_layers[0])
    before = near.matrix_basis.copy()
    with pytest.raises(RuntimeError, match="no UV map"):
        bpy.ops.scfpf.volume_mirror()
    assert near.matrix_basis == before


def test_without_a_preview_nobody_looks_for_strokes(addon):
    """Linking one object among many names them all in the updates."""
    addon("scanline.preview.preview")._follow_strokes(None)


def test_a_mesh_as_the_scenes_camera_is_refused_in_words():
    """Blender's Ctrl-Numpad 0 makes any object the camera."""
    bpy.ops.mesh.primitive_cube_add()
    scene = bpy.context.scene
    scene.camera, scene.render.engine = bpy.context.object, "SCFPF"
    scene.render.resolution_x = scene.render.resolution_y = 8
    with pytest.raises(RuntimeError, match="'Cube' is not a camera: choose one"):
        bpy.ops.render.render()


def test_another_file_keeps_nothing_of_a_render(addon, camera):
    job = addon("bridge.render.render_job")
    bpy.ops.mesh.primitive_cube_add()
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 8
    render.use_persistent_data = True
    assert bpy.ops.scfpf.render() == {"FINISHED"} and job._cache is not None
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert job._cache is None


def test_what_an_override_has_from_its_file_stays_until_it_is_local(addon, camera, tmp_path):
    """Blender lets overrides add items to a list, and move and remove those alone."""
    theirs = bpy.data.collections.new("Theirs")
    bpy.context.scene.collection.children.link(theirs)
    for obj in (camera, *(slot.object for slot in camera.scfpf.surfaces)):
        theirs.objects.link(obj)
    bpy.ops.scfpf.mapping_add(kind="LENS")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "theirs.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "theirs.blend"), link=True) as (_, here):
        here.collections = ["Theirs"]
    here.collections[0].override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    bpy.context.view_layer.update()
    camera = next(obj for obj in bpy.context.scene.objects if obj.type == "CAMERA" and obj.override_library)
    select(camera)
    slots = camera.scfpf.surfaces
    assert bpy.ops.scfpf.surface_add(kind="PLANE") == {"FINISHED"}
    before, count = [slot.object for slot in slots], len(bpy.data.objects)
    camera.scfpf.active_surface = 0
    for name, options in (
        ("surface_remove", {}),
        ("surface_move", {"direction": "DOWN"}),
        ("volume_swap", {}),
        ("mapping_remove", {}),
        ("preset_apply", {"preset": "nonlinear_twist"}),
        ("camera_from_camera", {}),
        ("volume_to_lattice", {}),
    ):
        with pytest.raises(
            RuntimeError, match="is a library override: surfaces, mappings, targets and layers"
        ):
            getattr(bpy.ops.scfpf, name)(**options)
        assert [slot.object for slot in slots] == before and len(bpy.data.objects) == count, name
    camera.scfpf.active_surface = 1
    assert bpy.ops.scfpf.surface_remove() == {"FINISHED"} and len(slots) == 2
    assert bpy.ops.object.make_local(type="SELECT_OBJECT") == {"FINISHED"}
    assert bpy.ops.scfpf.volume_swap() == {"FINISHED"}


@pytest.mark.usefixtures("built_groups")
@pytest.mark.parametrize("name", ["cycles_rig", "preview_toggle"])
def test_the_scenes_camera_that_was_deleted_and_is_kept_for_a_pointer(camera, name):
    """Deleting takes an object out of the scene; it stays its camera as long as anything points to it."""
    scene = bpy.context.scene
    bpy.context.scene.camera = camera
    scene.collection.objects.unlink(camera)
    bpy.ops.object.select_all(action="DESELECT")
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=f"'{camera.name}' was deleted: undo that"):
        getattr(bpy.ops.scfpf, name)()
    assert len(bpy.data.objects) == count


@pytest.mark.usefixtures("built_groups")
def test_a_preview_that_a_viewport_shows_in_a_blender_without_windows(addon, camera):
    """Blender's areas have no true places there: to join two of them never ended."""
    data = addon("scanline.preview.preview_data")
    bpy.ops.scfpf.preview_toggle()
    with pytest.raises(RuntimeError, match="there is no window"):
        bpy.ops.scfpf.preview_show()
    (area,) = (a for a in bpy.context.window.screen.areas if a.type == "VIEW_3D")
    space, count = area.spaces.active, len(bpy.context.window.screen.areas)
    space.use_local_camera, space.camera = (
        True,
        data.preview_of(camera, bpy.context.scene).scfpf_preview.view_camera,
    )
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    assert (
        not data.previews() and not space.use_local_camera and len(bpy.context.window.screen.areas) == count
    )


@pytest.mark.parametrize("way", ["cycles_rig", "preview_toggle"])
def test_a_second_camera_does_without_a_node_group_that_the_artist_has_deleted(way):
    """The groups of the first one in another scene lack it, at whatever depth."""

    def add():
        bpy.ops.mesh.primitive_cube_add(location=(0, 0, -3))
        assert bpy.ops.scfpf.camera_add(preset="perspective") == {"FINISHED"}
        return bpy.context.object

    add()
    assert getattr(bpy.ops.scfpf, way)() == {"FINISHED"}
    groups = {group.name for group in bpy.data.node_groups}
    inner = {n.node_tree.name for g in bpy.data.node_groups for n in g.nodes if n.type == "GROUP"}
    for name in sorted(groups & inner)[::4]:
        bpy.context.window.scene = bpy.data.scenes.new("Next")
        camera = add()
        bpy.data.node_groups.remove(bpy.data.node_groups[name])
        assert getattr(bpy.ops.scfpf, way)() == {"FINISHED"}, name
        made = [each for each in bpy.context.scene.objects if each.modifiers and each != camera]
        lost = [n for m in made for g in within(m.modifiers[-1].node_group) for n in g.nodes if is_lost(n)]
        assert made and not lost, name


def within(group):
    """A node group and those in it."""
    return [
        group,
        *(
            g
            for node in group.nodes
            if node.type == "GROUP" and node.node_tree
            for g in within(node.node_tree)
        ),
    ]


def is_lost(node):
    return node.type == "GROUP" and node.node_tree is None
