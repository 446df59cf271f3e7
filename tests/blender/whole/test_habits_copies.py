# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a flexible camera, by every way Blender has: each works at once, hidden surfaces included."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

U, V, T = np.random.default_rng(21).random((3, 40))
FLOAT32 = 1e-5


@pytest.fixture
def shown(addon):
    """Return 40 points of a camera's volume, as the depsgraph has it after one update."""
    read_projection = addon("bridge.camera.read_projection").read_projection

    def positions(camera):
        # What happened is evaluated, then what the handler did about it: as between two redraws.
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return read_projection(camera, depsgraph, 16 / 9).volume.evaluate(U, V, T).position

    return positions


def add_camera(preset="VIEW"):
    bpy.ops.scfpf.camera_add(preset=preset)
    bpy.context.object.name = "Eye"
    bpy.context.object.scfpf.edit_volume = True  # or else its surfaces could not be selected
    return bpy.context.object


def surfaces(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def select(*objects):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def hide(camera):
    """Hide the surfaces in every way that stops an object from being evaluated by itself."""
    for surface in surfaces(camera):
        surface.hide_viewport = surface.hide_render = True


def assert_own(camera):
    """The volume object is the camera's own child, in every scene of the camera, and nothing is left over."""
    volume = camera.scfpf.volume_object
    assert volume.parent == camera
    assert set(camera.users_scene) <= {s for s in bpy.data.scenes if volume in s.collection.objects.values()}
    owned = {o.scfpf.volume_object for o in bpy.data.objects if o.type == "CAMERA"}
    # The override of the library's own one belongs to the library: it would come back.
    assert {o for o in bpy.data.objects if o.scfpf_surface.is_volume and not o.override_library} <= owned


def assert_follows(camera, shown):
    """Its hidden surfaces are current: moving and resizing the far one changes the volume as it should."""
    before = shown(camera)
    far = surfaces(camera)[-1]
    far.matrix_basis.translation = far.matrix_basis.translation + Vector((0, 0, -2))
    expected = np.array(far.parent.matrix_world.to_3x3() @ Vector((0, 0, -2)))[:, None] * T ** (
        len(surfaces(camera)) - 1
    )
    assert np.abs(shown(camera) - before - expected).max() < 1e-4
    far.matrix_basis.translation = far.matrix_basis.translation + Vector((0, 0, 2))
    assert np.abs(shown(camera) - before).max() < FLOAT32 * 100


@pytest.mark.parametrize("linked", [False, True], ids=["Shift-D", "Alt-D"])
def test_duplicate_with_hidden_surfaces_works_at_once(shown, linked):
    camera = add_camera("cylindrical_panorama")
    before = shown(camera)
    # Hidden surfaces cannot be selected: they are hidden after the duplicate is made.
    select(*surfaces(camera), camera)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.object
    assert copy != camera and not set(surfaces(copy)) & set(surfaces(camera))
    hide(copy)
    assert np.abs(shown(copy) - before).max() == 0
    copy.location.x += 3
    assert np.allclose(shown(copy) - before, [[3], [0], [0]], atol=FLOAT32)
    assert_follows(copy, shown)
    assert_own(copy)
    assert_own(camera)
    assert np.abs(shown(camera) - before).max() == 0
    assert len({o.data for o in surfaces(copy) + surfaces(camera)}) == (2 if linked else 4)


@pytest.mark.parametrize("kind", ["FULL_COPY", "LINK_COPY"])
def test_scene_copy(shown, kind):
    camera = add_camera("nonlinear_twist")
    hide(camera)
    before, old = shown(camera), bpy.context.scene
    bpy.ops.scene.new(type=kind)
    scene = bpy.context.scene
    assert scene != old
    copy = scene.camera
    assert (copy == camera) == (kind == "LINK_COPY")
    assert np.abs(shown(copy) - before).max() == 0
    assert_follows(copy, shown)
    assert_own(copy)
    bpy.context.window_manager.windows[0].scene = old
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        assert bpy.context.scene == old
        assert np.abs(shown(camera) - before).max() == 0


def test_camera_alone_shares_the_surfaces_until_made_single_user(shown):
    """The copy shows the same image after moving; both follow an edit of a shared surface."""
    camera = add_camera()
    before = shown(camera)
    select(camera)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    hide(camera)
    copy.location.x += 5
    assert surfaces(copy) == surfaces(camera)
    assert np.abs(shown(copy) - before).max() == 0
    surfaces(camera)[0].location.x += 1
    assert np.abs(shown(copy) - before).max() > 0.5
    assert np.array_equal(shown(copy), shown(camera))
    assert_own(copy)
    bpy.context.scene.camera = copy
    shared = shown(copy)
    assert bpy.ops.scfpf.volume_single_user() == {"FINISHED"}
    assert np.abs(shown(copy) - shared).max() < 1e-4, "nothing jumps"
    copy.location.x += 5
    assert np.allclose(shown(copy) - shared, [[5], [0], [0]], atol=1e-4)
    assert np.abs(shown(camera) - shared).max() == 0
    # Without the original, a camera that still shares goes on showing the same.
    select(camera)
    bpy.ops.object.delete()
    assert np.allclose(shown(copy) - shared, [[5], [0], [0]], atol=1e-4)


@pytest.mark.parametrize("everything", [True, False], ids=["all", "camera alone"])
def test_copy_and_paste_between_files(shown, everything, tmp_path):
    camera = add_camera("around_the_car")
    before = shown(camera)
    select(*(surfaces(camera) if everything else ()), camera)
    assert bpy.ops.view3d.copybuffer() == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    other = add_camera()
    own = shown(other)
    # A collection that is switched off afterwards, as artists do with rigs.
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    layer = bpy.context.view_layer.layer_collection.children["Rig"]
    bpy.context.view_layer.active_layer_collection = layer
    assert bpy.ops.view3d.pastebuffer() == {"FINISHED"}
    pasted = next(o for o in rig.objects if o.type == "CAMERA")
    assert pasted != other and {o.parent for o in surfaces(pasted)} == {pasted}
    bpy.context.view_layer.update()
    layer.exclude = True
    bpy.context.scene.camera = pasted
    assert np.abs(shown(pasted) - before).max() < FLOAT32 * 100
    layer.exclude = False
    assert_follows(pasted, shown)
    assert_own(pasted)
    assert np.abs(shown(other) - own).max() == 0


@pytest.fixture
def library(tmp_path, shown):
    """A file with a flexible camera in the collection "Rig", and what it shows; another file is open."""
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Rig"]
    camera = add_camera("cylindrical_panorama")
    hide(camera)
    before = shown(camera)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path, before


def the_camera(local=True):
    (found,) = [o for o in bpy.context.scene.objects if o.type == "CAMERA" and (o.library is None) == local]
    return found


@pytest.mark.parametrize("what", ["Object/Eye", "Collection/Rig"])
def test_append(shown, library, what):
    path, before = library
    folder, name = what.split("/")
    bpy.ops.wm.append(directory=f"{path}/{folder}/", filename=name)
    camera = the_camera()
    assert np.abs(shown(camera) - before).max() == 0
    assert_follows(camera, shown)
    assert_own(camera)


@pytest.mark.parametrize("what", ["Object/Eye", "Collection/Rig"])
def test_link(addon, shown, library, what, tmp_path):
    """A linked camera works, though linking it alone puts none of its surfaces into the scene."""
    path, before = library
    folder, name = what.split("/")
    bpy.ops.wm.link(directory=f"{path}/{folder}/", filename=name, instance_collections=False)
    camera = the_camera(local=False)
    assert np.abs(shown(camera) - before).max() == 0
    absence = addon("panels.surface_list").absence_of
    assert not any(absence(bpy.context.scene, slot) for slot in camera.scfpf.surfaces)
    # It renders, and goes on doing so after a reload.
    bpy.ops.mesh.primitive_cube_add(size=20)
    bpy.context.scene.camera = camera
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 8
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    assert np.abs(shown(the_camera(local=False)) - before).max() == 0
    assert bpy.ops.scfpf.render() == {"FINISHED"}


def override(how, path):
    if how == "OBJECT":
        bpy.ops.wm.link(directory=f"{path}/Object/", filename="Eye")
        select(bpy.context.scene.objects["Eye"])
        assert bpy.ops.object.make_override_library() == {"FINISHED"}
    elif how == "INSTANCE":
        bpy.ops.wm.link(directory=f"{path}/Collection/", filename="Rig", instance_collections=True)
        assert bpy.ops.object.make_override_library() == {"FINISHED"}
    else:
        bpy.ops.wm.link(directory=f"{path}/Collection/", filename="Rig", instance_collections=False)
        rig = bpy.data.collections["Rig"]
        rig.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)
    return the_camera()


def test_a_linked_camera_and_its_override_may_be_in_one_scene(shown, library):
    """Both have the same name."""
    path, before = library
    camera = override("HIERARCHY", path)
    linked = the_camera(local=False)
    assert linked.name == camera.name
    camera.location.x += 2
    bpy.ops.mesh.primitive_cube_add(size=20)
    assert np.abs(shown(linked) - before).max() == 0
    assert np.allclose(shown(camera) - before, [[2], [0], [0]], atol=FLOAT32)
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 8
    for one in (camera, linked):
        bpy.context.scene.camera = one
        assert bpy.ops.scfpf.render() == {"FINISHED"}


@pytest.mark.parametrize("how", ["OBJECT", "INSTANCE", "HIERARCHY"])
def test_override_is_edited_and_reloaded(addon, shown, library, how, tmp_path):
    path, before = library
    camera = override(how, path)
    assert camera.override_library and np.abs(shown(camera) - before).max() == 0
    # Objects made by "Make Library Override" are system overrides until the artist frees them.
    for obj in [camera, *surfaces(camera)]:
        obj.override_library.is_system_override = False
    far = surfaces(camera)[-1]
    assert far.override_library
    far.location.z -= 2
    radius = addon("bridge.surfaces.surface_object").surface_parameters(far)["radius"]
    addon("bridge.surfaces.surface_object").set_surface_parameters(far, {"radius": 2 * radius})
    camera.scfpf.samples, camera.scfpf.basis = 9, "POLYLINE"
    edited = shown(camera)
    assert np.abs(edited - before).max() > 1
    assert_own(camera)
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    camera = the_camera()
    assert camera.override_library and camera.scfpf.samples == 9 and camera.scfpf.basis == "POLYLINE"
    assert np.abs(shown(camera) - edited).max() == 0
    assert_own(camera)
    bpy.data.libraries[0].reload()
    camera = the_camera()
    assert np.abs(shown(camera) - edited).max() == 0
    # A surface more than the library has, inserted in the override.
    bpy.context.scene.camera = camera
    select(camera)
    camera.scfpf.active_surface = 0
    assert bpy.ops.scfpf.surface_add(kind="CYLINDER") == {"FINISHED"}
    wider = shown(camera)
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    camera = the_camera()
    assert len(surfaces(camera)) == 3 and np.abs(shown(camera) - wider).max() < FLOAT32


def test_purge_leaves_a_camera_whole(shown):
    camera = add_camera("nonlinear_twist")
    hide(camera)
    before, count = shown(camera), len(bpy.data.objects)
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    assert len(bpy.data.objects) == count and np.abs(shown(camera) - before).max() == 0
    assert_own(camera)


@pytest.mark.parametrize("how", ["X", "Outliner"])
def test_deleting_the_camera_leaves_an_artist_s_surfaces_and_no_volume_object(shown, how):
    camera = add_camera()
    kept = surfaces(camera)
    for surface in kept:
        surface.scfpf_surface.kind, surface.scfpf_surface.is_made = "GRID", False
    bpy.context.view_layer.update()
    if how == "X":
        select(camera)
        bpy.ops.object.delete()
    else:
        bpy.data.objects.remove(camera)
    bpy.context.view_layer.update()
    assert set(bpy.data.objects) == set(kept)
    assert not [g for g in bpy.data.node_groups if g.name.startswith("SCFPF Volume")]
    # The surfaces serve another camera.
    bpy.ops.object.camera_add()
    other = bpy.context.object
    other.scfpf.enabled = True
    for surface in kept:
        surface.select_set(True)
    assert bpy.ops.scfpf.surface_attach() == {"FINISHED"}
    assert set(surfaces(other)) == set(kept)
    shown(other)


def test_deleting_the_volume_object_does_no_harm(shown):
    camera = add_camera("angular_fisheye")
    hide(camera)
    before = shown(camera)
    bpy.data.objects.remove(camera.scfpf.volume_object)
    assert np.abs(shown(camera) - before).max() == 0
    assert_follows(camera, shown)
    assert_own(camera)


@pytest.mark.parametrize("how", ["X", "Outliner"])
def test_deleting_a_used_surface_says_so_and_undo_brings_it_back(addon, shown, how):
    camera = add_camera()
    bpy.ops.scfpf.surface_add(kind="PLANE")
    middle = surfaces(camera)[1]
    name = middle.name
    error = addon("projection.user_error").UserError
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="whole")
        before = shown(camera)
        if how == "X":
            select(middle)
            bpy.ops.object.delete()
        else:
            bpy.data.objects.remove(middle)
        bpy.ops.ed.undo_push(message="deleted")
        with pytest.raises(
            error, match=f"'{name}' was deleted" if how == "X" else "surface 2 of 'Eye' is empty"
        ):
            shown(camera)
        bpy.ops.ed.undo()
        assert np.abs(shown(bpy.data.objects["Eye"]) - before).max() == 0
        bpy.ops.ed.redo()
        camera = bpy.data.objects["Eye"]
        camera.scfpf.active_surface = 1
        select(camera)
        assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
        assert np.abs(shown(camera) - before).max() < 10, "straight projectors are left"


def test_handlers_do_nothing_while_nothing_has_changed(addon, shown, monkeypatch):
    """Moving things, playing the animation and turning the view never look at all objects."""
    camera = add_camera()
    shown(camera)
    handlers = addon("bridge.sync.camera_sync")
    calls = []
    monkeypatch.setattr(handlers, "sync_volume_object", lambda c: calls.append(c.name))
    for frame in range(1, 4):
        camera.location.x = frame
        surfaces(camera)[0].location.y = frame
        bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.update()
    assert calls == []
    bpy.ops.object.camera_add()
    bpy.context.view_layer.update()
    assert calls == [], "a camera without surfaces concerns nobody"
    select(camera)
    bpy.ops.object.duplicate()
    bpy.context.view_layer.update()
    assert set(calls) == {"Eye", "Eye.001"}, "a user more of what they share"


def test_handlers_end(addon, shown):
    """The handler's own changes do not call for another round of it."""
    camera = add_camera()
    select(*surfaces(camera), camera)
    bpy.ops.object.duplicate()
    shown(bpy.context.object)
    rounds = []
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: rounds.append(1))
    try:
        for _ in range(5):
            bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.pop()
    assert not rounds
