# SPDX-License-Identifier: GPL-3.0-or-later
"""Perspective by Distance: things at each distance have the size that the field of view there says."""

import math

import bpy
import numpy as np
import pytest

# Of float32 sizes and drivers.
ROUNDED = 2e-6


def new_camera(**lens):
    bpy.ops.object.camera_add(location=(3, -2, 1), rotation=(1.2, 0.1, 0.4))
    camera = bpy.context.object
    for name, value in lens.items():
        setattr(camera.data, name, value)
    bpy.context.scene.camera = camera
    assert bpy.ops.scfpf.by_distance() == {"FINISHED"}
    return camera


def planes(camera):
    return [slot.object.scfpf_surface for slot in camera.scfpf.surfaces]


def give(camera, views):
    """Distances, fields of view in degrees, shifts."""
    while len(camera.scfpf.surfaces) < len(views):
        bpy.ops.scfpf.distance_add()
    for own, (distance, angle, shift) in zip(planes(camera), views, strict=True):
        own.angle, own.shift = math.radians(angle), shift
        own["distance"] = distance  # all at once, so that none overtakes another
    planes(camera)[0].distance = views[0][0]
    bpy.context.view_layer.update()


def aspect():
    render = bpy.context.scene.render
    return render.resolution_x * render.pixel_aspect_x / (render.resolution_y * render.pixel_aspect_y)


def place_in_picture(addon, camera, points):
    """(x, y) in [0, 1] at which the picture shows points (3, N) of camera space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_own_projection(camera, depsgraph, aspect())
    found = addon("projection.volume.inverse").invert(projection.volume, points)
    assert found.found.all()
    return np.array([found.u, found.v])


def corners_at(distance, angle, shift):
    """Points at (0.2, 0.3) and (0.9, 0.6) of the picture by the definition of a field of view, (3, 2)."""
    width = 2 * distance * math.tan(math.radians(angle) / 2)
    x, y = np.array([0.2, 0.9]), np.array([0.3, 0.6])
    return np.array(
        [(x - 0.5 + shift[0]) * width, (y - 0.5) * width / aspect() + shift[1] * width, [-distance] * 2]
    )


VIEWS = {
    "wide hands": [(0.5, 100, (0, 0)), (2.0, 40, (0, 0)), (30.0, 35, (0, 0))],
    "telling backgrounds": [
        (0.1, 40, (0, 0)),
        (5.0, 40, (0.2, 0)),
        (9.0, 20, (0.1, -0.1)),
        (1e4, 70, (0, 0.3)),
    ],
    "near together": [(1.0, 60, (0, 0)), (1.01, 61, (0, 0)), (50.0, 30, (0, 0)), (60.0, 90, (0, 0))],
}


@pytest.mark.parametrize("basis", ["SMOOTH", "POLYLINE"])
@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize("size", [(640, 360), (300, 500)])
def test_each_distance_has_its_field_of_view(addon, name, basis, size):
    camera = new_camera()
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = size
    give(camera, VIEWS[name])
    camera.scfpf.basis = basis
    bpy.context.view_layer.update()
    inner = VIEWS[name]
    for distance, angle, shift in inner:
        # Planes at the ends lie on the border of the volume.
        distance = min(max(distance, inner[0][0] * (1 + 1e-6)), inner[-1][0] * (1 - 1e-6))
        seen = place_in_picture(addon, camera, corners_at(distance, angle, shift))
        assert np.allclose(seen, [[0.2, 0.9], [0.3, 0.6]], atol=20 * ROUNDED), (distance, seen)


@pytest.mark.parametrize("name", VIEWS)
def test_between_distances_things_keep_their_order(addon, name):
    """Depth rises along each projector, so that nothing is mirrored or twice in the picture."""
    camera = new_camera()
    give(camera, VIEWS[name])
    depsgraph = bpy.context.evaluated_depsgraph_get()
    volume = addon("bridge.camera.read_projection").read_own_projection(camera, depsgraph, aspect()).volume
    t = np.linspace(0, 1, 500)
    depth = -volume.evaluate(np.full(500, 0.3), np.full(500, 0.8), t).position[2]
    assert (np.diff(depth) > 0).all()


def test_a_new_one_is_the_lens(addon):
    """At each distance it shows what the ordinary camera shows, with shift."""
    camera = new_camera(lens=35, shift_x=0.2, shift_y=-0.1, clip_start=0.2, clip_end=80)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    ordinary = addon("bridge.camera.ordinary_camera").frustum_projection(
        camera.evaluated_get(depsgraph), depsgraph, aspect()
    )
    flexible = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, aspect())
    random = np.random.default_rng(3)
    u, v = random.uniform(size=(2, 200))
    for t in (0.0, 0.3, 1.0):
        shown = ordinary.volume.evaluate(u, v, np.full(200, t)).position
        found = addon("projection.volume.inverse").invert(flexible.volume, shown)
        inside = found.found
        assert inside.mean() > 0.9 or t in (0.0, 1.0)
        assert np.allclose(found.u[inside], u[inside], atol=1e-5)
        assert np.allclose(found.v[inside], v[inside], atol=1e-5)


def test_fields_of_view_move_with_keyframes(addon):
    camera = new_camera()
    give(camera, VIEWS["wide hands"])
    own = planes(camera)[1]
    surface = own.id_data
    for frame, angle in ((1, 40), (11, 80)):
        own.angle = math.radians(angle)
        surface.keyframe_insert("scfpf_surface.angle", frame=frame)
    for frame, angle in ((1, 40), (11, 80)):
        bpy.context.scene.frame_set(frame)
        seen = place_in_picture(addon, camera, corners_at(2.0, angle, (0, 0)))
        assert np.allclose(seen, [[0.2, 0.9], [0.3, 0.6]], atol=20 * ROUNDED)


@pytest.mark.parametrize("distance", [0.03, 0.7, 3.0, 500.0])
def test_an_added_distance_shows_what_it_showed(addon, distance):
    camera = new_camera()
    give(camera, [(0.1, 50, (0.1, 0)), (5.0, 50, (0.1, 0)), (100.0, 50, (0.1, 0))])
    assert bpy.ops.scfpf.distance_add(distance=distance) == {"FINISHED"}
    bpy.context.view_layer.update()
    distances = [own.distance for own in planes(camera)]
    assert distances == sorted(distances) and len(distances) == 4
    new = next(own for own in planes(camera) if own.distance == pytest.approx(distance))
    assert math.degrees(new.angle) == pytest.approx(50, rel=1e-5)
    assert tuple(new.shift) == pytest.approx((0.1, 0), abs=1e-6)
    assert camera.scfpf.surfaces[camera.scfpf.active_surface].object == new.id_data


def test_planes_stay_in_the_order_of_distance():
    camera = new_camera()
    give(camera, VIEWS["telling backgrounds"])
    camera.scfpf.active_surface = 1
    moved = planes(camera)[1]
    surface = moved.id_data
    surface.scfpf_surface.distance = 5000.0
    distances = [own.distance for own in planes(camera)]
    assert distances == sorted(distances)
    assert camera.scfpf.surfaces[camera.scfpf.active_surface].object == surface
    assert surface.name == "At 5000"
    places = [slot.weight for slot in camera.scfpf.surfaces]
    assert places == sorted(places) and len(set(places)) == len(places)
    surface.name = "Mine"
    surface.scfpf_surface.distance = 2.0
    assert surface.name == "Mine"


def test_released_planes_stay_where_they_are(addon):
    camera = new_camera()
    give(camera, VIEWS["telling backgrounds"])
    depsgraph = bpy.context.evaluated_depsgraph_get()
    read = addon("bridge.camera.read_projection").read_own_projection
    corners = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.5, 1.0]])
    before = read(camera, depsgraph, aspect()).volume.evaluate(*corners).position
    assert bpy.ops.scfpf.distance_release() == {"FINISHED"}
    bpy.context.view_layer.update()
    after = read(camera, bpy.context.evaluated_depsgraph_get(), aspect()).volume.evaluate(*corners).position
    assert np.allclose(after, before, rtol=1e-6)
    surface = camera.scfpf.surfaces[1].object
    surface.location.x += 1.0
    bpy.context.view_layer.update()
    assert surface.matrix_local.translation.x == pytest.approx(surface.location.x)
    with pytest.raises(RuntimeError, match="Choose Perspective by Distance first"):
        bpy.ops.scfpf.distance_add()


def test_the_width_at_a_distance_as_a_handle_sets_it(addon):
    camera = new_camera()
    widths = addon("bridge.camera.by_distance")
    own = planes(camera)[1]
    widths.set_half_width(own.id_data, own.distance)
    assert math.degrees(own.angle) == pytest.approx(90, rel=1e-6)
    own.angle = math.radians(60)
    expected = own.distance * math.tan(math.radians(30))
    assert widths.half_width(own.id_data) == pytest.approx(expected, rel=1e-6)


def test_what_is_refused_is_explained():
    camera = new_camera()
    with pytest.raises(RuntimeError, match="already"):
        bpy.ops.scfpf.distance_add(distance=planes(camera)[1].distance)
    bpy.ops.object.camera_add()
    bpy.context.object.data.type = "ORTHO"
    with pytest.raises(RuntimeError, match="orthographic lens"):
        bpy.ops.scfpf.by_distance()
    assert len(bpy.context.object.scfpf.surfaces) == 0


def test_a_saved_file_keeps_it(addon, tmp_path):
    give(new_camera(), VIEWS["wide hands"])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "one.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "one.blend"))
    camera = bpy.context.scene.camera
    planes(camera)[1].angle = math.radians(70)
    bpy.context.view_layer.update()
    seen = place_in_picture(addon, camera, corners_at(2.0, 70, (0, 0)))
    assert np.allclose(seen, [[0.2, 0.9], [0.3, 0.6]], atol=20 * ROUNDED)
