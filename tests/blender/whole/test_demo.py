# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo's street: its objects, the measures of the car, the space around it, and a small image."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from demo import car, render_demo, street

pytestmark = pytest.mark.usefixtures("kept_street")

TRIANGLE_BUDGET = 300_000
CAR_TRIANGLES = (20_000, 60_000)
# Vertices are float32 in Blender.
ROUNDING = 1e-4


@pytest.fixture
def scene(kept_street):
    street_scene = render_demo.build_street()
    bpy.context.view_layer.update()
    return street_scene


def meshes(collection):
    return [obj for obj in collection.all_objects if obj.type == "MESH"]


def triangle_count(objects):
    for mesh in {obj.data for obj in objects}:
        mesh.calc_loop_triangles()
    return sum(len(obj.data.loop_triangles) for obj in objects)


def world_vertices(obj):
    flat = np.empty(len(obj.data.vertices) * 3, np.float32)
    obj.data.vertices.foreach_get("co", flat)
    matrix = np.array(obj.matrix_world, np.float64)
    return flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def faces_of(obj, material):
    """Centres in world space, (n, 3), of an object's faces of a material."""
    slot = obj.data.materials.find(material)
    assert slot >= 0, f"{obj.name} has no {material}"
    centres = [face.center[:] for face in obj.data.polygons if face.material_index == slot]
    matrix = np.array(obj.matrix_world, np.float64)
    return np.array(centres) @ matrix[:3, :3].T + matrix[:3, 3]


def test_inventory(scene):
    groups = {collection.name: collection for collection in scene.collection.children}
    assert set(groups) == {"Ground", "Houses", "Street furniture", "Car", "Parked cars", "Lights"}
    assert len(meshes(groups["Houses"])) >= 30
    assert sum(obj.name.startswith("Tree pit") for obj in groups["Street furniture"].objects) == 24
    assert len([obj for obj in groups["Houses"].objects if obj.type == "FONT"]) == 8
    lamps = [obj.data for obj in groups["Lights"].objects]
    assert sorted(lamp.type for lamp in lamps) == ["AREA", "POINT", "POINT", "SUN"]
    assert all(lamp.use_shadow for lamp in lamps)
    assert scene.world is not None and scene.view_settings.view_transform == "AgX"
    assert CAR_TRIANGLES[0] <= triangle_count(meshes(groups["Car"])) <= CAR_TRIANGLES[1]
    assert triangle_count([obj for obj in scene.objects if obj.type == "MESH"]) <= TRIANGLE_BUDGET


def test_materials_are_constants_and_many(scene):
    assert len(bpy.data.materials) >= 40
    for material in bpy.data.materials:
        shader = material.node_tree.nodes["Principled BSDF"]
        assert not any(socket.is_linked for socket in shader.inputs), material.name


def test_meshes_are_valid_and_have_materials(scene):
    for mesh in bpy.data.meshes:
        assert not mesh.validate(verbose=True), mesh.name
        assert len(mesh.materials) and all(mesh.materials), mesh.name


def test_the_car_has_the_measures_of_its_frame(scene):
    parts = {obj.name: world_vertices(obj) for obj in meshes(bpy.data.collections["Car"])}
    everything = np.concatenate(list(parts.values()))
    low, high = everything.min(axis=0), everything.max(axis=0)
    assert low[1] == pytest.approx(-2.2, abs=0.02) and high[1] == pytest.approx(2.2, abs=0.02)
    assert low[2] == pytest.approx(0, abs=ROUNDING)
    body = parts["Car body"]
    assert np.abs(body[:, 0]).max() == pytest.approx(car.car_body.HALF_WIDTH, abs=0.005)
    assert parts["Car cabin"][:, 2].max() == pytest.approx(1.445, abs=0.01)
    # Mirrors apart, nothing is wider than the body by more than a number's thickness.
    below_the_mirrors = everything[everything[:, 2] < 0.85]
    assert np.abs(below_the_mirrors[:, 0]).max() < car.car_body.HALF_WIDTH + 0.05
    # The preset's frame: x right, y up, z towards the viewer in front of the nose.
    nose, roof = np.array([0, 0.5, 2.2, 1]), np.array([0, 1.4, 0, 1])
    assert (car.CAR_TO_WORLD @ nose)[:3].tolist() == [0, -2.2, 0.5]
    assert (car.CAR_TO_WORLD @ roof)[:3].tolist() == [0, 0, 1.4]


def test_every_side_of_the_car_tells_which_it_is(scene):
    part = bpy.data.objects
    assert (faces_of(part["Car front"], "Headlight")[:, 1] < -1.9).all()
    assert (faces_of(part["Car rear"], "Tail-light")[:, 1] > 1.9).all()
    assert (faces_of(part["Car rear"], "Plate yellow")[:, 1] > 1.9).all()
    assert "Tail-light" not in part["Car front"].data.materials
    assert (faces_of(part["Car left side"], "Sign white")[:, 0] > 0.8).all()
    assert (faces_of(part["Car right side"], "Sign white")[:, 0] < -0.8).all()
    assert car.LEFT_NUMBER != car.RIGHT_NUMBER


def test_the_body_s_faces_look_outwards(scene):
    """A ray from afar meets the car's paint and glass from outside."""
    for name in ("Car body", "Car cabin"):
        obj = bpy.data.objects[name]
        for direction in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1)):
            ray = np.array(direction, np.float64)
            for shift in (-0.3, 0.0, 0.3):
                start = np.array([0.0, 0.0, 1.1 if name == "Car cabin" else 0.6]) - 5 * ray
                start += shift * np.array([abs(ray[1]), abs(ray[0]) + abs(ray[2]), 0])
                hit, _, normal, _ = obj.ray_cast(start, ray)
                assert hit and np.dot(normal, ray) < 0, (name, direction, shift)


def test_the_room_round_the_car_is_free(scene):
    """No box of an object reaches into it; of the ground, no box of a face, for there are kerbs elsewhere."""
    low, high = np.array(street.FREE_ZONE)
    allowed = set(bpy.data.collections["Car"].all_objects)
    boxes = []
    for obj in bpy.data.collections["Ground"].objects:
        corners = world_vertices(obj)
        boxes += [(obj.name, corners[list(face.vertices)]) for face in obj.data.polygons]
        allowed.add(obj)
    for obj in scene.objects:
        if obj.type in {"MESH", "FONT"} and obj not in allowed:
            boxes.append(
                (obj.name, np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box]))
            )
    assert len(boxes) > 400
    for name, box in boxes:
        apart = (box.min(axis=0) >= high) | (box.max(axis=0) <= low)
        assert apart.any(), f"{name} stands in the way of the volume round the car"


def test_the_volume_round_the_car_stays_in_the_free_room(scene, addon):
    text = render_demo.preset_files()["around_the_car"].read_text(encoding="utf-8")
    preset = addon("projection.presets.preset").load_preset(text)
    camera = render_demo.add_shot(scene, text, render_demo.SHOTS["around_the_car"])
    bpy.context.view_layer.update()
    width, height = render_demo.SHOTS["around_the_car"].size
    volume = preset.projection(width / height).volume.transformed(np.array(camera.matrix_world, np.float64))
    u, v, t = (a.ravel() for a in np.meshgrid(*[np.linspace(0, 1, count) for count in (97, 25, 41)]))
    swept = volume.evaluate(u, v, t).position
    low, high = np.array(street.FREE_ZONE)
    assert (swept.min(axis=1)[:2] > low[:2]).all() and (swept.max(axis=1) < high).all()
    # It starts above the road and ends in the car, or below the floor.
    assert swept[2, t == 0].min() > low[2]
    ends = np.abs(swept[:2, t == 1])
    assert ends[0].max() < car.car_body.HALF_WIDTH and ends[1].max() < 2.2


def test_every_shot_is_of_a_preset_that_ships():
    assert all(path.is_file() for path in render_demo.preset_files().values())
    assert render_demo.OPENING_SCENE in render_demo.SHOTS


def test_the_file_keeps_a_scene_with_its_camera_for_every_shot(scene, tmp_path):
    files = render_demo.preset_files()
    stems = ("perspective", "around_the_car")
    for own, stem in zip((scene, render_demo.another_scene(scene)), stems, strict=True):
        render_demo.add_shot(own, files[stem].read_text(encoding="utf-8"), render_demo.SHOTS[stem])
    render_demo.open_on(bpy.data.scenes["Around the Car"])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "demo.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "demo.blend"))
    assert {own.name for own in bpy.data.scenes} == {"Perspective", "Around the Car"}
    street_objects = None
    for own in bpy.data.scenes:
        assert (
            own.camera.name == own.name and own.camera.scfpf.enabled and len(own.camera.scfpf.surfaces) >= 2
        )
        assert own.view_layers[0].objects.active == own.camera
        assert own.world.name == "Sky" and own.view_settings.view_transform == "AgX"
        shared = {
            obj.name
            for group in own.collection.children
            if "camera" not in group.name
            for obj in group.objects
        }
        assert street_objects in (None, shared) and "Car body" in shared
        street_objects = shared
    assert all(window.scene.name == "Around the Car" for window in bpy.context.window_manager.windows)


def test_the_picture_round_the_car_shows_its_back_at_both_borders(scene, tmp_path):
    text = render_demo.preset_files()["around_the_car"].read_text(encoding="utf-8")
    camera = render_demo.add_shot(scene, text, render_demo.SHOTS["around_the_car"])
    camera.scfpf.samples, camera.scfpf.pixel_error = 1, 1.0
    scene.render.resolution_x, scene.render.resolution_y = 300, 100
    report = render_demo.render(scene, tmp_path / "around.png")
    assert report.startswith("300×100")
    picture = bpy.data.images.load(str(tmp_path / "around.png"))
    pixels = np.array(picture.pixels[:]).reshape(100, 300, 4)
    red, green, blue = np.moveaxis(pixels[..., :3], -1, 0)
    tail_lights = (red > 0.5) & (green < 0.4 * red) & (blue < 0.4 * red)
    assert tail_lights[:, :60].any() and tail_lights[:, -60:].any()
    # At one sample a pixel, a single reflection on the paint may be as red as the lights.
    assert (
        tail_lights[:, 60:-60].sum() <= 2 and min(tail_lights[:, :60].sum(), tail_lights[:, -60:].sum()) > 30
    )
    paint = (red < 0.6 * green) & (red < 0.6 * blue) & (blue > 0.2)
    assert paint.any(axis=0).all()
