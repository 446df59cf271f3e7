# SPDX-License-Identifier: GPL-3.0-or-later
"""Set Up Cycles on volumes of every origin, and with surfaces in every place of a file.

The rig's picture is compared with the exact caster's, object by object. test_cycles_rig has presets.
"""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix
from quick_solves import quicken
from rig_scenes import (
    bend_at_random,
    exact_passes,
    fill_volume,
    keep_groups,
    make_volume,
    reference,
    render_passes,
    start_anew,
    switch,
)

WIDTH, HEIGHT = 36, 24


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture
def camera(addon):
    """A flexible camera with bent projectors, and objects on them."""
    made = reference.add_camera(WIDTH, HEIGHT)
    made.location, made.rotation_euler = (0.4, -0.6, 0.3), Euler((1.4, 0.1, 0.5))
    make_volume(addon, made, "bent cubic")
    made.scfpf.pixel_error = 0.5
    bpy.context.view_layer.update()
    fill_volume(addon, made, 12)
    bpy.context.view_layer.objects.active = made
    return made


def surfaces_of(camera):
    return [slot.object for slot in camera.scfpf.surfaces]


def to_patches(addon, camera):
    assert bpy.ops.scfpf.surface_to_patch() == {"FINISHED"}
    return camera


def far_surface_active(camera):
    camera.scfpf.active_surface = len(camera.scfpf.surfaces) - 1


def patch(addon, camera):
    far_surface_active(camera)
    return to_patches(addon, camera)


def grid(addon, camera):
    far_surface_active(camera)
    assert bpy.ops.scfpf.surface_to_grid() == {"FINISHED"}
    return camera


def uv_mesh(addon, camera):
    """The far plane as a mesh of six triangles with a UV map of its own."""
    flexible, far = addon("bridge.camera.flexible_camera"), surfaces_of(camera)[-1]
    x, y = np.meshgrid([0.0, 0.3, 1.0], [0.0, 0.6, 1.0])
    u = np.stack([x.ravel(), y.ravel()], axis=1)
    faces = [f for a in (0, 1, 3, 4) for f in ((a, a + 1, a + 4), (a, a + 4, a + 3))]
    mesh = bpy.data.meshes.new("Triangles")
    mesh.from_pydata([(8.0 * (a - 0.5), 5.0 * (b - 0.5), 0.0) for a, b in u], [], faces)
    layer = mesh.uv_layers.new(name="Mine")
    layer.uv.foreach_set("vector", u[np.ravel(faces)].astype(np.float32).ravel())
    made = bpy.data.objects.new("Triangles", mesh)
    made.parent, made.matrix_basis = camera, Matrix(far.matrix_basis)
    bpy.context.scene.collection.objects.link(made)
    flexible.remove_surface(camera, len(camera.scfpf.surfaces) - 1)
    flexible.attach_surface(camera, made)
    return camera


def blended(addon, camera):
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    blend.scfpf.pixel_error = 0.5
    return blend


def baked(addon, camera):
    """A blend whose map has keyframes, in shapes that drivers mix."""
    blend = blended(addon, camera)
    settings = addon("bridge.blends.blend_ends").ends_of(blend)[0].settings
    settings.kind, settings.border = "LINEAR", 0.8
    for frame, angle in ((1, 0.0), (3, 1.5)):
        settings.angle = angle
        blend.keyframe_insert(settings.path_from_id("angle"), frame=frame)
    assert bpy.ops.scfpf.blend_map_bake(start=1, end=3) == {"FINISHED"}
    bpy.context.scene.frame_end = 3
    bpy.context.scene.frame_set(2)
    return blend


def aimed(addon, camera):
    """One of several things seen from farther to its left."""
    camera.scfpf.aim.columns, camera.scfpf.aim.rows, camera.scfpf.aim.degree = 8, 6, 2
    thing = next(obj for obj in bpy.context.scene.objects if obj.pass_index == 1)
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object=thing.name) == {"FINISHED"}
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, left=0.1) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.aim_solve(camera=camera.name) == {"FINISHED"}
    assert camera.scfpf.aim.is_solved
    return camera


def refilled(addon, camera):
    """The camera with objects in a volume that it did not have before."""
    bpy.data.batch_remove([obj for obj in bpy.context.scene.objects if obj.pass_index])
    bpy.context.view_layer.update()
    fill_volume(addon, camera, 12)
    return camera


def polar(addon, camera):
    reference.preset(addon, camera, "angular_fisheye")
    return refilled(addon, camera)


def random_of(volume, seed):
    """A volume of another basis, bent at random."""

    def bent(addon, camera):
        make_volume(addon, camera, volume)
        bend_at_random(camera, np.random.default_rng(seed))
        return refilled(addon, camera)

    bent.__name__ = f"random {volume}"
    return bent


def layered(addon, camera):
    thing = next(obj for obj in bpy.context.scene.objects if obj.pass_index)
    thing.select_set(True)
    assert bpy.ops.scfpf.layer_add(camera=camera.name) == {"FINISHED"}
    # F12 does not show layers, as a caution says.
    camera.scfpf.layers[0].is_on = False
    bpy.context.view_layer.objects.active = camera
    return camera


def moved_to(camera, collection):
    for surface in surfaces_of(camera):
        for holder in list(surface.users_collection):
            holder.objects.unlink(surface)
        collection.objects.link(surface)


def new_collection(parent):
    made = bpy.data.collections.new("Surfaces")
    parent.children.link(made)
    return made


def hidden(addon, camera):
    made = new_collection(bpy.context.scene.collection)
    made.hide_viewport = made.hide_render = True
    moved_to(camera, made)
    return camera


def excluded(addon, camera):
    moved_to(camera, new_collection(bpy.context.scene.collection))
    bpy.context.view_layer.layer_collection.children["Surfaces"].exclude = True
    return camera


def elsewhere(addon, camera):
    """In the scene of the camera they are children of it, and members of another scene too."""
    other = bpy.data.scenes.new("Other")
    for surface in surfaces_of(camera):
        other.collection.objects.link(surface)
    return camera


def linked_duplicates(addon, camera):
    """Another camera with the same surfaces, and one with surfaces that share their meshes with those."""
    other = camera.copy()
    other.location.x += 0.5
    bpy.context.scene.collection.objects.link(other)
    for slot in other.scfpf.surfaces:
        slot.object = slot.object.copy()
        bpy.context.scene.collection.objects.link(slot.object)
    bpy.context.view_layer.update()
    return other


def viewport_hidden(addon, camera):
    for surface in surfaces_of(camera):
        surface.hide_viewport = surface.hide_render = True
        surface.hide_set(True)
    return camera


def too_few_chords(addon, camera):
    """The error cannot be kept with the most chords that there may be, as of strongly bent volumes."""
    camera.scfpf.pixel_error = 0.001
    return camera


ORIGINS = {
    change.__name__: change
    for change in (
        patch,
        grid,
        uv_mesh,
        blended,
        baked,
        aimed,
        *(random_of(*each) for each in (("polyline", 1), ("B-spline", 2), ("NURBS", 3), ("grids", 4))),
        polar,
        layered,
        hidden,
        excluded,
        elsewhere,
        linked_duplicates,
        viewport_hidden,
        too_few_chords,
    )
}


@pytest.mark.parametrize("origin", ORIGINS)
def test_the_rig_shows_what_the_exact_caster_sees(addon, camera, tmp_path, monkeypatch, origin):
    if origin == "too_few_chords":
        monkeypatch.setattr(addon("cycles.chords.chord_plan"), "MOST_CHORDS", 24)
    if origin == "aimed":
        quicken(addon, monkeypatch)
    camera = ORIGINS[origin](addon, camera)
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    expected = exact_passes(addon, camera)["OBJECT_INDEX"][..., 0].astype(int)
    assert switch(camera) == {"FINISHED"}
    keep_groups()  # building them takes half of the time
    settings = addon("cycles.rig_data").rig_of(bpy.context.scene).scfpf_rig
    found = render_passes(tmp_path / "passes")["Object Index"]
    wrong = (found != expected) & ~(reference.near_edges(expected) | reference.near_edges(found))
    print(f"{origin}: {settings.chords} chords, {wrong.sum()} wrong, {(expected > 0).mean():.0%} seen")
    assert (expected > 0).mean() > 0.02
    assert wrong.sum() <= 2
    assert switch(camera) == {"FINISHED"}
    assert addon("cycles.rig_data").rigs() == []


def test_a_lattice_is_refused_and_nothing_stays(addon, camera):
    assert bpy.ops.scfpf.volume_to_lattice() == {"FINISHED"}
    names = {obj.name for obj in bpy.data.objects}
    with pytest.raises(RuntimeError, match="lattice"):
        switch(camera)
    assert {obj.name for obj in bpy.data.objects} == names and bpy.context.scene.camera == camera


def test_a_rig_of_another_camera_is_replaced_and_gives_the_settings_back(addon, camera):
    scene, data = bpy.context.scene, addon("cycles.rig_data")
    scene.render.engine, scene.camera = "BLENDER_WORKBENCH", camera
    bounces = scene.cycles.transparent_max_bounces
    assert switch(camera) == {"FINISHED"}
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_duplicate() == {"FINISHED"}
    other = bpy.context.object
    assert switch(other) == {"FINISHED"}
    assert [rig.scfpf_rig.camera for rig in data.rigs()] == [other]
    assert scene.camera == data.rigs()[0].scfpf_rig.view_camera and scene.render.engine == "CYCLES"
    assert switch(other) == {"FINISHED"}
    assert (scene.camera, scene.render.engine) == (camera, "BLENDER_WORKBENCH")
    assert scene.cycles.transparent_max_bounces == bounces
    assert "scfpf_rig_table" not in camera and "scfpf_rig_table" not in other
