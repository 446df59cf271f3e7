# SPDX-License-Identifier: GPL-3.0-or-later
"""The weights of NURBS projectors: property, animation, files, tools, presets, drawing, panel."""

import json

import bpy
import numpy as np
import pytest
from mathutils import Matrix

FRAMES = (1, 6, 11)
WEIGHTS = (1.0, 3.0, 0.25, 2.0)
U, V, T = np.random.default_rng(3).random((3, 200))
# Objects are float32; coordinates here are about 20.
FLOAT32 = 3e-5


@pytest.fixture
def pure(addon):
    return addon("projection.volume.viewing_volume")


@pytest.fixture
def read(addon):
    reading = addon("bridge.camera.read_projection")

    def read_volume(camera):
        return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.5).volume

    return read_volume


@pytest.fixture
def camera(bridge):
    """A flexible camera, active, with four planes A to D and their weights."""
    bpy.ops.object.camera_add(location=(1, -2, 0.5), rotation=(1.2, 0.1, 0.4))
    made = bpy.context.object
    made.name = "Camera"
    for number, name in enumerate("ABCD"):
        matrix = Matrix.Translation((number % 2, 0.3 * number, -1 - 4 * number))
        size = {"width": 1.0 + number, "height": 1.0}
        bridge.add_surface(made, "PLANE", name, matrix, size)
    bridge.make_flexible(made)
    made.scfpf.basis = "NURBS"
    for slot, weight in zip(made.scfpf.surfaces, WEIGHTS, strict=True):
        slot.weight = weight
    bpy.context.view_layer.update()
    return made


def weights(camera):
    return {slot.object.name: round(slot.weight, 6) for slot in camera.scfpf.surfaces}


def curves(camera):
    """data paths and values of the camera's F-curves, by the surface that they are of."""
    data = camera.animation_data
    bag = data.action.layers[0].strips[0].channelbag(data.action_slot)
    found = {}
    for curve in bag.fcurves:
        slot = camera.path_resolve(curve.data_path.rpartition(".")[0])
        found[slot.object.name] = [tuple(p.co) for p in curve.keyframe_points]
    return found


def positions(volume):
    return volume.evaluate(U, V, T).position


def test_the_property(camera):
    prop = camera.scfpf.surfaces[0].bl_rna.properties["weight"]
    assert prop.is_animatable and prop.is_overridable and prop.description
    assert prop.default == 1.0
    slot = camera.scfpf.surfaces[0]
    slot.weight = 0.0
    assert 0.001 <= slot.weight < 0.00101
    slot.weight = 1e9
    assert slot.weight == 1000.0


def test_weights_are_read_for_nurbs_projectors_only(camera, read, pure):
    volume = read(camera)
    assert volume.basis == "NURBS" and volume.weights == WEIGHTS
    plain = pure.ViewingVolume(volume.surfaces, "BEZIER")
    assert np.abs(positions(volume) - positions(plain)).max() > 0.5
    # Rational Bézier curves by their definition.
    t, w = T, np.array(WEIGHTS)[:, None]
    shares = w * np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    controls = np.stack([s.evaluate(U, V).position for s in volume.surfaces])
    exact = np.einsum("kn,kcn->cn", shares, controls) / shares.sum(axis=0)
    np.testing.assert_allclose(positions(volume), exact, atol=1e-12)
    camera.scfpf.basis = "B_SPLINE"
    assert read(camera).weights is None
    np.testing.assert_allclose(positions(read(camera)), positions(plain), atol=1e-12)


def test_an_edit_from_python_reaches_the_projection_and_its_drawing(camera, read, addon):
    drawing = addon("projection.diagrams.diagram")
    projection = addon("projection.volume.viewing_volume").Projection
    before = read(camera)
    camera.scfpf.surfaces[1].weight = 9.0
    after = read(camera)
    assert after.weights == (1.0, 9.0, 0.25, 2.0)
    signatures = [drawing.volume_signature(projection(v)) for v in (before, after)]
    assert signatures[0] != signatures[1]
    projector_lines = addon("projection.diagrams.projector_lines").projector_lines
    lines = [projector_lines(projection(v), 3, 3, 8) for v in (before, after)]
    assert np.abs(lines[0] - lines[1]).max() > 0.1


def keyed(camera, index=1):
    for frame in FRAMES:
        camera.scfpf.surfaces[index].weight = frame / 2
        assert camera.scfpf.surfaces[index].keyframe_insert("weight", frame=frame)


def test_an_animated_weight_is_seen_at_every_frame(camera, read, tmp_path):
    keyed(camera)
    path = str(tmp_path / "weights.blend")
    for reload in (False, True):
        if reload:
            bpy.ops.wm.save_as_mainfile(filepath=path)
            bpy.ops.wm.open_mainfile(filepath=path)
            camera = bpy.data.objects["Camera"]
        for frame in FRAMES:
            bpy.context.scene.frame_set(frame)
            volume = read(camera)
            assert volume.basis == "NURBS"
            assert volume.weights == pytest.approx((1.0, frame / 2, 0.25, 2.0))


def test_a_driven_weight_is_seen(camera, read):
    curve = camera.scfpf.surfaces[2].driver_add("weight")
    curve.driver.expression = "frame / 4"
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        assert read(camera).weights[2] == pytest.approx(frame / 4)


def test_saved_and_reloaded(camera, read, tmp_path):
    before = positions(read(camera))
    path = str(tmp_path / "weights.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects["Camera"]
    assert weights(camera) == dict(zip("ABCD", WEIGHTS, strict=True))
    assert np.array_equal(positions(read(camera)), before)


def test_a_library_override_keeps_its_own_weights(camera, read, tmp_path):
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    for obj in (camera, *camera.children):
        if obj.name not in rig.objects:
            rig.objects.link(obj)
    library, shot = str(tmp_path / "library.blend"), str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, target):
        target.collections = ["Rig"]
    linked = target.collections[0]
    bpy.context.scene.collection.children.link(linked)
    linked.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)

    def overridden():
        return next(o for o in bpy.context.scene.objects if o.type == "CAMERA" and o.override_library)

    overridden().scfpf.surfaces[1].weight = 6.0
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    assert read(overridden()).weights == (1.0, 6.0, 0.25, 2.0)


def test_a_duplicate_of_the_camera_has_its_weights(camera):
    bpy.ops.object.select_all(action="DESELECT")
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.object.duplicate()
    assert [s.weight for s in bpy.context.object.scfpf.surfaces] == list(WEIGHTS)


# Tools


def test_moving_swapping_duplicating_and_removing_take_weights_and_animation_along(camera, bridge):
    keyed(camera, 1)
    keys = [(f, f / 2) for f in FRAMES]
    driver = camera.scfpf.surfaces[2].driver_add("weight")
    driver.driver.expression = "0.25"
    bpy.context.scene.frame_set(6)
    expected = dict(zip("ABCD", (1.0, 3.0, 0.25, 2.0), strict=True))
    assert weights(camera) == expected and curves(camera) == {"B": keys}

    def check():
        bpy.context.view_layer.update()
        assert {n: w for n, w in weights(camera).items() if n in expected} == expected
        assert curves(camera) == {"B": keys}
        (driven,) = camera.animation_data.drivers
        assert camera.path_resolve(driven.data_path.rpartition(".")[0]).object.name == "C"

    bridge.move_surface(camera, 1, 2)
    assert [s.object.name for s in camera.scfpf.surfaces] == list("ACDB")
    check()
    assert bpy.ops.scfpf.volume_swap() == {"FINISHED"}
    assert [s.object.name for s in camera.scfpf.surfaces] == list("BDCA")
    check()
    camera.scfpf.active_surface = 1
    assert bpy.ops.scfpf.surface_duplicate() == {"FINISHED"}
    assert [s.object.name for s in camera.scfpf.surfaces] == ["B", "D", "D.001", "C", "A"]
    assert camera.scfpf.surfaces[2].weight == 2.0
    check()
    bridge.remove_surface(camera, 2)
    check()
    bridge.remove_surface(camera, 0)
    del expected["B"]
    assert not curves(camera) and len(camera.animation_data.drivers) == 1
    assert weights(camera) == expected
    bridge.clear_surfaces(camera)
    assert not camera.animation_data.drivers


def test_two_animated_weights_change_places(camera, bridge):
    keyed(camera, 1)
    keyed(camera, 2)
    camera.scfpf.surfaces[2].keyframe_insert("weight", frame=21)
    before = curves(camera)
    assert set(before) == {"B", "C"} and before["B"] != before["C"]
    bridge.move_surface(camera, 1, 1)
    assert [s.object.name for s in camera.scfpf.surfaces] == list("ACBD")
    assert curves(camera) == before
    bridge.add_surface(camera, "POINT", "E", index=0)
    bridge.remove_surface(camera, 2)
    assert curves(camera) == {"B": before["B"]}


def test_animation_in_nla_strips_goes_along(camera, bridge, read):
    keyed(camera, 1)
    data = camera.animation_data
    action, slot = data.action, data.action_slot
    strip = data.nla_tracks.new().strips.new("Weights", 1, action)
    strip.action_slot = slot
    data.action = None
    bridge.move_surface(camera, 1, -1)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        assert read(camera).weights == pytest.approx((frame / 2, 1.0, 0.25, 2.0))


def test_swapping_the_ends_turns_the_volume_round(camera, read):
    before = read(camera).evaluate(U, V, T).position
    bpy.ops.scfpf.volume_swap()
    after = read(camera).evaluate(U, V, 1 - T).position
    assert np.abs(before - after).max() < FLOAT32


@pytest.mark.parametrize("basis", ["NURBS", "B_SPLINE"])
def test_inserting_leaves_the_volume_as_it_is_while_it_can(camera, bridge, read, basis):
    for _ in range(2):
        bridge.remove_surface(camera, 1)
    camera.scfpf.basis = basis
    before = positions(read(camera))
    for count in (3, 4, 5):
        assert bpy.ops.scfpf.surface_insert() == {"FINISHED"}
        assert len(camera.scfpf.surfaces) == count
        assert np.abs(positions(read(camera)) - before).max() < FLOAT32
    held, objects = weights(camera), len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="more than four surfaces"):
        bpy.ops.scfpf.surface_insert()
    assert weights(camera) == held and len(bpy.data.objects) == objects


def test_a_weighted_volume_of_four_takes_a_fifth(camera, read):
    before = positions(read(camera))
    assert bpy.ops.scfpf.surface_insert() == {"FINISHED"}
    assert [round(s.weight, 6) for s in camera.scfpf.surfaces] == [1.0, 2.0, 1.625, 1.125, 2.0]
    assert np.abs(positions(read(camera)) - before).max() < FLOAT32


def test_a_preset_brings_weights_and_a_plain_one_takes_them_away(camera, bridge, read, addon):
    preset = addon("projection.presets.preset")
    plane = {"kind": "PLANE", "width": 2, "height": 1}
    data = {
        "format": 1,
        "name": "Weighted",
        "description": "",
        "source": "",
        "basis": "NURBS",
        "reparameterisation": "RECTANGLE",
        "u_range": [0, 1],
        "v_range": [0, 1],
        "aspect": 2,
        "fit": "WIDTH",
        "surfaces": [
            plane | {"name": "Near", "location": [0, 0, -1]},
            plane | {"name": "Middle", "location": [3, 0, -5], "weight": 4.5},
            plane | {"name": "Far", "location": [0, 0, -9], "weight": 0.5},
        ],
    }
    keyed(camera)
    loaded = preset.load_preset(json.dumps(data))
    bridge.apply_preset(camera, loaded, 1.5)
    bpy.context.view_layer.update()
    assert camera.scfpf.basis == "NURBS"
    assert weights(camera) == {"Near": 1.0, "Middle": 4.5, "Far": 0.5} and not curves(camera)
    inverse = np.linalg.inv(np.array(camera.matrix_world, np.float64))
    exact = loaded.fitted(1.5).volume()
    assert np.abs(positions(read(camera).transformed(inverse)) - positions(exact)).max() < FLOAT32
    bridge.apply_preset(camera, preset.load_preset(json.dumps(data | {"basis": "BEZIER"})), 1.5)
    assert camera.scfpf.basis == "BEZIER" and read(camera).weights is None


def test_an_image_is_rendered_through_arcs_of_circles(addon, bridge):
    """Three planes hinged on one axis: a wall across every arc at 45° fills the image."""
    casting = addon("casting.cast")
    reading = addon("bridge.camera.read_projection")
    scenes = addon("casting.scene.cast_scene")
    bpy.ops.object.camera_add(location=(0, 0, 0))
    camera = bpy.context.object
    half = np.radians(45)
    for angle, scale in ((0, 1), (half, 1 / np.cos(half)), (2 * half, 1)):
        matrix = Matrix.Rotation(angle, 4, "X") @ Matrix.Translation((0, 2 * scale, 0))
        bridge.add_surface(camera, "PLANE", None, matrix, {"width": 1.0, "height": 1.5 * scale})
    bridge.make_flexible(camera)
    camera.scfpf.basis = "NURBS"
    camera.scfpf.surfaces[1].weight = np.cos(half)
    bpy.context.view_layer.update()
    projection = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 1.0)
    corners = np.array([[-9.0, 0, 0], [9, 0, 0], [9, 9, 9], [-9, 9, 9]])
    scene = scenes.CastScene(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    x, y = (a.ravel() for a in np.meshgrid((np.arange(20) + 0.5) / 20, (np.arange(20) + 0.5) / 20))
    hits = casting.cast(scene, projection.transformed(scene.matrix), x, y, (1 / 20, 1 / 20))
    np.testing.assert_allclose(hits.t, 0.5, atol=1e-6)
    back = np.linalg.inv(scene.matrix)
    place = back[:3, :3] @ hits.position + back[:3, 3:]
    np.testing.assert_allclose(np.hypot(place[1], place[2]), 2 + (y - 0.5) * 1.5, atol=1e-5)


# The panel


class Layout:
    """Notes the properties that are drawn."""

    def __init__(self, drawn):
        self.__dict__["drawn"] = drawn

    def __setattr__(self, name, value):
        pass

    def prop(self, owner, name, **_options):
        self.drawn.append((owner, name))

    def __getattr__(self, _name):
        def call(*_arguments, **_options):
            return Layout(self.drawn)

        return call


@pytest.mark.parametrize("basis", ["NURBS", "B_SPLINE"])
def test_the_list_shows_weights_of_nurbs_projectors(camera, addon, basis):
    camera.scfpf.basis = basis
    drawn = []
    kind = addon("panels.surface_list").SCFPF_UL_surfaces
    slot = camera.scfpf.surfaces[1]
    kind.draw_item(None, bpy.context, Layout(drawn), camera.scfpf, slot, 0, None, "", 1)
    assert ((slot, "weight") in drawn) == (basis == "NURBS")
