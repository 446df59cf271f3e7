# SPDX-License-Identifier: GPL-3.0-or-later
"""A flexible camera: its list of surfaces, its volume object, its own frustum, presets."""

import json

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from made_cameras import names, new_camera, read, taken, three_surfaces
from mathutils import Euler, Matrix, Vector

# world_to_camera_view answers in float32; x and y here are up to 1, depths compared by ratio.
FLOAT32 = 1e-6


@pytest.fixture
def presets(addon):
    return addon("projection.presets.preset")


@pytest.fixture
def camera():
    return new_camera()


# The list


def test_surfaces_are_children_in_camera_space(bridge, camera):
    camera.matrix_world = Matrix.Translation((5, 6, 7))
    place = Matrix.LocRotScale((1, 2, -3), Euler((0.3, 0.2, 0.1)), (1, 2, 3))
    surface = bridge.add_surface(camera, "CYLINDER", matrix=np.array(place))
    bpy.context.view_layer.update()
    assert surface.parent == camera and surface.name == "Cylinder"
    assert np.allclose(surface.matrix_world, camera.matrix_world @ place, atol=1e-6)
    assert surface.users_collection == camera.users_collection
    assert surface.display_type == "BOUNDS" and surface.hide_render


def test_surfaces_go_to_the_cameras_collection(bridge):
    scene = bpy.context.scene
    cameras = bpy.data.collections.new("Cameras")
    scene.collection.children.link(cameras)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    cameras.objects.link(camera)
    surface = bridge.add_surface(camera, "PLANE")
    assert list(surface.users_collection) == [cameras]
    assert set(camera.scfpf.volume_object.users_collection) == {cameras, scene.collection}


def test_list_order(bridge, camera):
    three_surfaces(bridge, camera)
    assert names(camera) == taken(camera) == ["A", "B", "C"]
    bridge.add_surface(camera, "POINT", "First", index=0)
    assert names(camera) == taken(camera) == ["First", "A", "B", "C"]
    assert camera.scfpf.active_surface == 0
    assert bridge.move_surface(camera, 0, 2) == 2
    assert names(camera) == taken(camera) == ["A", "B", "First", "C"]
    assert bridge.move_surface(camera, 2, 9) == 3 and bridge.move_surface(camera, 3, -9) == 0
    bridge.remove_surface(camera, 1)
    assert names(camera) == taken(camera) == ["First", "B", "C"]
    assert bpy.data.objects.get("A") is None and bpy.data.meshes.get("A") is None
    bridge.clear_surfaces(camera)
    assert names(camera) == taken(camera) == []
    assert {o.name for o in bpy.data.objects} == {"Camera", "Camera Volume"}
    assert [g.name for g in bpy.data.node_groups if g.name.startswith("SCFPF Volume")] == ["SCFPF Volume 0"]
    for wrong in (-1, 0, 5):
        with pytest.raises(bridge.UserError, match="no control surface at place"):
            bridge.remove_surface(camera, wrong)


def test_surfaces_that_others_need_are_kept(bridge, camera):
    a, b, _ = three_surfaces(bridge, camera)
    other = new_camera("Other")
    bridge.attach_surface(other, a)
    bpy.ops.mesh.primitive_grid_add()
    sheet = bpy.context.object
    bridge.attach_surface(camera, sheet)
    camera.scfpf.surfaces.add().object = b
    assert names(camera) == ["A", "B", "C", "Grid", "B"]
    bridge.remove_surface(camera, 1)
    assert bpy.data.objects.get("B") and names(camera) == taken(camera) == ["A", "C", "Grid", "B"]
    bridge.clear_surfaces(camera)
    assert {o.name for o in bpy.data.objects if o.type == "MESH"} == {
        "A",
        "Grid",
        "Camera Volume",
        "Other Volume",
    }
    assert names(other) == taken(other) == ["A"]


def test_a_pointer_edited_by_hand_reaches_the_volume_object(bridge, camera):
    three_surfaces(bridge, camera)
    bpy.ops.mesh.primitive_plane_add()
    quad = bpy.context.object
    camera.scfpf.surfaces[1].object = quad
    assert taken(camera) == ["A", "Plane", "C"] and quad.scfpf_surface.kind == "PATCH"
    camera.scfpf.surfaces[1].object = None
    assert taken(camera) == ["A", None, "C"]


def test_enabling_makes_the_volume_object(bridge, camera):
    camera.scfpf.enabled = True
    volume = camera.scfpf.volume_object
    assert volume.name == "Camera Volume" and volume.parent == camera
    assert volume.hide_select and not (volume.hide_render or volume.hide_viewport)
    bridge.add_surface(camera, "SPHERE")
    evaluated = volume.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert not evaluated.data.vertices and not evaluated.data.polygons
    camera.scfpf.enabled = False
    assert camera.scfpf.volume_object == volume


def test_a_volume_object_taken_away_comes_back(bridge, camera):
    three_surfaces(bridge, camera)
    volume = camera.scfpf.volume_object
    volume.parent = None
    for collection in volume.users_collection:
        collection.objects.unlink(volume)
    volume.modifiers.clear()
    assert bridge.sync_volume_object(camera) == volume
    assert volume.parent == camera and volume.users_scene == (bpy.context.scene,)
    assert taken(camera) == ["A", "B", "C"]
    bpy.data.objects.remove(volume)
    assert bridge.sync_volume_object(camera).name == "Camera Volume"
    assert taken(camera) == ["A", "B", "C"]


def test_sync_changes_nothing_that_is_right(bridge, camera):
    three_surfaces(bridge, camera)
    bpy.context.evaluated_depsgraph_get().update()
    bridge.sync_volume_object(camera)
    assert not list(bpy.context.evaluated_depsgraph_get().updates)


def test_what_is_no_camera_or_no_mesh_is_refused(bridge, camera):
    empty = bpy.data.objects.new("Empty", None)
    bridge.make_flexible(camera)
    for call in (
        lambda: bridge.make_flexible(empty),
        lambda: bridge.add_surface(empty, "PLANE"),
        lambda: bridge.attach_surface(camera, empty),
        lambda: bridge.attach_surface(camera, camera.scfpf.volume_object),
        lambda: bridge.attach_surface(camera, camera),
    ):
        with pytest.raises(bridge.UserError):
            call()
    assert names(camera) == []


def test_a_failed_add_leaves_nothing(bridge, addon, camera):
    bridge.make_flexible(camera)
    before = set(bpy.data.objects)
    with pytest.raises(addon("projection.user_error").UserError):
        bridge.add_surface(camera, "PLANE", parameters={"radius": 3})
    assert set(bpy.data.objects) == before and names(camera) == []


def test_control_objects(bridge, camera):
    three_surfaces(bridge, camera)
    bpy.ops.mesh.primitive_cube_add()
    assert bridge.control_objects() == {"A", "B", "C", "Camera Volume"}


# The camera's own frustum

LENSES = [
    {"lens": 50.0},
    {"lens": 14.0, "shift_x": 0.3, "shift_y": -0.2},
    {"lens": 200.0, "sensor_fit": "VERTICAL"},
    {"lens": 35.0, "sensor_fit": "HORIZONTAL", "sensor_width": 20.0, "shift_y": 0.5},
    {"type": "ORTHO", "ortho_scale": 7.0},
    {"type": "ORTHO", "ortho_scale": 3.0, "shift_x": 0.4, "sensor_fit": "VERTICAL"},
]
PICTURES = [(1920, 1080, 1.0, 1.0), (600, 900, 1.0, 1.0), (720, 576, 1.4568, 1.0), (500, 500, 1.0, 2.0)]


@pytest.mark.parametrize("picture", PICTURES)
@pytest.mark.parametrize("lens", LENSES)
def test_volume_from_camera_is_blenders_own_view(bridge, reading, camera, lens, picture):
    scene = bpy.context.scene
    camera.data.clip_start, camera.data.clip_end = 0.5, 8.0
    for key, value in lens.items():
        setattr(camera.data, key, value)
    render = scene.render
    render.resolution_x, render.resolution_y, render.pixel_aspect_x, render.pixel_aspect_y = picture
    camera.matrix_world = Matrix.LocRotScale((0.3, -0.2, 0.1), Euler((1.1, 0.1, 0.4)), (2, 2, 2))
    bpy.context.view_layer.update()
    bridge.volume_from_camera(camera, scene)
    bpy.context.view_layer.update()
    projection = read(reading, camera)
    line = np.linspace(0, 1, 5)
    u, v, t = (axis.ravel() for axis in np.meshgrid(line, line, line))
    points = projection.volume.evaluate(u, v, t).position
    for point, x, y, share in zip(points.T, u, v, t, strict=True):
        seen = world_to_camera_view(scene, camera, Vector(point))
        assert abs(seen.x - x) < FLOAT32 and abs(seen.y - y) < FLOAT32
        assert seen.z == pytest.approx(0.5 + share * 7.5, rel=FLOAT32)


def test_volume_from_camera_replaces_and_keeps_the_lens(bridge, camera):
    three_surfaces(bridge, camera)
    camera.scfpf.reparameterisation, camera.scfpf.basis = "POLAR", "POLYLINE"
    camera.data.lens = 85
    bridge.volume_from_camera(camera, bpy.context.scene)
    assert names(camera) == ["Near", "Far"] and camera.data.lens == 85
    assert (camera.scfpf.reparameterisation, camera.scfpf.basis) == ("RECTANGLE", "BEZIER")
    assert camera.scfpf.enabled and bpy.data.objects.get("A") is None


@pytest.mark.parametrize("damage", ["PANO", "no depth", "too large", "zero scale"])
def test_volume_from_camera_refuses_what_has_no_frustum(bridge, camera, damage):
    three_surfaces(bridge, camera)
    if damage == "PANO":
        camera.data.type = "PANO"
    elif damage == "no depth":
        camera.data.clip_start = camera.data.clip_end
    elif damage == "too large":
        camera.data.clip_end = 1e12
    else:
        camera.scale = 0, 0, 0
        bpy.context.view_layer.update()
    before = set(bpy.data.objects)
    with pytest.raises(ValueError, match=r"'Camera'|Width must lie from 0 to"):
        bridge.volume_from_camera(camera, bpy.context.scene)
    assert names(camera) == ["A", "B", "C"] and set(bpy.data.objects) == before


# Presets

PRESET = {
    "format": 1,
    "name": "Test",
    "description": "",
    "source": "",
    "basis": "POLYLINE",
    "reparameterisation": "RECTANGLE",
    "u_range": [0.1, 0.9],
    "v_range": [0.0, 1.0],
    "aspect": 1.5,
    "fit": "WIDTH",
    "surfaces": [
        {"name": "Eye", "kind": "POINT", "location": [0, 0, 0]},
        {
            "name": "Near",
            "kind": "PLANE",
            "width": 2.0,
            "height": 1.5,
            "location": [0.1, 0.2, -1],
            "rotation_degrees": [10, 20, 30],
        },
        {
            "name": "Arc",
            "kind": "CYLINDER",
            "radius": 4.0,
            "arc_degrees": 120,
            "height": 3,
            "scale": [1, 2, 1.5],
        },
        {
            "name": "Patch",
            "kind": "PATCH",
            "points": [[[-3, -2, -9], [3, -2, -9]], [[-4, 2, -9], [4, 3, -10]]],
        },
        {
            "name": "Sheet",
            "kind": "GRID",
            "points": [[[x, y, -12 - x * y] for x in (-5, 0, 5)] for y in (-3, 4)],
        },
    ],
}


@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize("aspect", [1.5, 0.8])
def test_a_preset_becomes_objects_that_make_its_volume(bridge, reading, presets, camera, aspect, scale):
    three_surfaces(bridge, camera)
    preset = presets.load_preset(json.dumps(PRESET))
    bridge.apply_preset(camera, preset, aspect, scale)
    assert names(camera) == taken(camera) == ["Eye", "Near", "Arc", "Patch", "Sheet"]
    assert bpy.data.objects.get("A") is None
    assert all(slot.object.parent == camera for slot in camera.scfpf.surfaces)
    bpy.context.view_layer.update()
    made, exact = read(reading, camera, aspect=aspect), preset.projection(aspect)
    assert made.volume.basis == "POLYLINE"
    cross = bpy.data.objects["Eye"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert max(vertex.co.x for vertex in cross.vertices) == pytest.approx(0.05 * scale)
    assert made.u_range == pytest.approx((0.1, 0.9)) and made.v_range == (0, 1)
    u, v, t = np.random.default_rng(5).random((3, 50))
    expected = scale * exact.volume.evaluate(u, v, t).position
    assert np.abs(made.volume.evaluate(u, v, t).position - expected).max() < 5e-6 * scale


def shipped(presets):
    from pathlib import Path

    return sorted((Path(__file__).resolve().parents[3] / "presets").glob("*.json"))


def test_every_shipped_preset_loads(bridge, reading, presets, camera):
    files = shipped(presets)
    assert files
    for path in files:
        preset = presets.load_preset(path.read_text(encoding="utf-8"))
        bridge.apply_preset(camera, preset, 16 / 9)
        bpy.context.view_layer.update()
        made, exact = read(reading, camera, aspect=16 / 9), preset.projection(16 / 9)
        u, v, t = np.random.default_rng(5).random((3, 50))
        expected = exact.volume.evaluate(u, v, t).position
        size = np.abs(expected).max()
        assert np.abs(made.volume.evaluate(u, v, t).position - expected).max() < 1e-6 * size
        assert 0 < camera.data.clip_start < camera.data.clip_end


def plain(kind, *surfaces, **more):
    return json.dumps(
        PRESET
        | {"u_range": [0, 1], "fit": "NONE", "basis": "BEZIER", "surfaces": [dict(s) for s in surfaces]}
        | more
    )


def planes(*sizes):
    return [
        {"name": "P", "kind": "PLANE", "width": w, "height": w / 1.5, "location": [0, 0, -d]}
        for w, d in sizes
    ]


def test_the_ordinary_lens_approximates_the_volume(bridge, presets, camera):
    bridge.apply_preset(camera, presets.load_preset(plain("P", *planes((2, 1), (20, 10)))), 1.5)
    assert camera.data.type == "PERSP"
    assert camera.data.angle_x == pytest.approx(np.pi / 2, rel=1e-5)
    assert camera.data.clip_start == pytest.approx(1, rel=1e-5)
    assert camera.data.clip_end == pytest.approx(np.sqrt(10**2 + 10**2 + (10 / 1.5) ** 2), rel=1e-5)
    bridge.apply_preset(camera, presets.load_preset(plain("P", *planes((3, 1), (3, 10)))), 1.5)
    assert camera.data.type == "ORTHO" and camera.data.ortho_scale == pytest.approx(3)
    bridge.apply_preset(camera, presets.load_preset(plain("P", *planes((8, 1), (3, 10)))), 1.5)
    assert camera.data.type == "ORTHO" and camera.data.ortho_scale == pytest.approx(5.5)
    rings = [{"name": "R", "kind": "CYLINDER", "radius": r, "arc_degrees": 350, "height": r} for r in (1, 20)]
    bridge.apply_preset(camera, presets.load_preset(plain("C", *rings)), 1.5)
    assert camera.data.type == "PERSP" and np.degrees(camera.data.angle_x) == pytest.approx(150, rel=1e-4)


def test_a_mirror_ball_has_a_wide_lens(bridge, presets, camera):
    """Projectors outside of the round image, which is as high as the render, do not count."""
    (path,) = (path for path in shipped(presets) if path.stem == "mirror_ball")
    bridge.apply_preset(camera, presets.load_preset(path.read_text(encoding="utf-8")), 16 / 9)
    assert camera.data.type == "PERSP" and np.degrees(camera.data.angle_x) == pytest.approx(150, rel=1e-4)


def test_blenders_own_frame_is_small_while_a_camera_is_flexible(bridge, presets, camera):
    def frame_height():
        corners = np.array(camera.data.view_frame(scene=bpy.context.scene))
        return float(np.ptp(corners[:, 1]) * camera.data.display_size / 2)

    camera.data.display_size, camera.data.clip_end = 3.0, 8.0
    bridge.volume_from_camera(camera, bpy.context.scene)
    assert camera.data.display_size == pytest.approx(8 / 64) and frame_height() < 0.1
    preset = presets.load_preset(plain("P", *planes((2, 1), (20, 100))))
    bridge.apply_preset(camera, preset, 1.5)
    assert camera.data.display_size == pytest.approx(camera.data.clip_end / 64)
    camera.scfpf.enabled = False
    assert camera.data.display_size == 3.0
    # An artist's own size, and camera data that another object has, stay.
    camera.scfpf.enabled = True
    camera.data.display_size = 2.0
    bridge.apply_preset(camera, preset, 1.5)
    assert camera.data.display_size == 2.0
    camera.scfpf.enabled = False
    assert camera.data.display_size == 2.0
    other = bpy.data.objects.new("Other", camera.data)
    camera.scfpf.enabled = True
    assert camera.data == other.data and camera.data.display_size == 2.0


def test_shared_camera_data_is_left_alone(bridge, presets, camera):
    twin = bpy.data.objects.new("Twin", camera.data)
    camera.data.lens = 77
    bridge.apply_preset(camera, presets.load_preset(plain("P", *planes((2, 1), (20, 10)))), 1.5)
    assert twin.data != camera.data and twin.data.lens == 77


def test_a_preset_keeps_surfaces_that_are_not_its_own(bridge, presets, camera):
    a, b, _ = three_surfaces(bridge, camera)
    other = new_camera("Other")
    bridge.attach_surface(other, a)
    b.parent = None
    bridge.apply_preset(camera, presets.load_preset(plain("P", *planes((2, 1), (20, 10)))), 1.5)
    assert bpy.data.objects.get("A") and bpy.data.objects.get("B") and not bpy.data.objects.get("C")
    assert names(camera) == ["P", "P.001"]


def test_one_preset_after_another_names_its_surfaces_as_its_file_does(addon, camera):
    """The surfaces before have their names until they are deleted."""
    bpy.context.view_layer.objects.active = camera
    folder = addon("operators.camera.presets").FOLDER
    for preset in ("perspective", "panini", "perspective", "perspective"):
        assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
        listed = json.loads((folder / f"{preset}.json").read_text(encoding="utf-8"))["surfaces"]
        assert names(camera) == [surface["name"] for surface in listed]


@pytest.mark.parametrize(("aspect", "scale"), [(0.0, 1.0), (1.5, 0.0), (1.5, float("inf")), (1.5, 1e200)])
def test_a_preset_that_fails_changes_nothing(bridge, presets, camera, aspect, scale):
    three_surfaces(bridge, camera)
    before = {o.name for o in bpy.data.objects}
    preset = presets.load_preset(json.dumps(PRESET))
    with pytest.raises(ValueError):
        bridge.apply_preset(camera, preset, aspect, scale)
    assert names(camera) == taken(camera) == ["A", "B", "C"]
    assert {o.name for o in bpy.data.objects} == before
