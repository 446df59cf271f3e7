# SPDX-License-Identifier: GPL-3.0-or-later
"""The recipes of docs/recipes: their steps are performed, and the view is the one that the page promises."""

import math
import pathlib
import re

import bpy
import numpy as np
import pytest
from recorded_layout import read_words

from demo.recipes.jobs import RECIPES
from demo.recipes.steps import begin, perform, prepare

pytestmark = pytest.mark.usefixtures("kept_street")

RECIPE = {recipe.stem: recipe for recipe in RECIPES}
# Of the resolution, in percent.
SMALL = 10


@pytest.fixture
def seen(addon):
    """Points of the projectors (3, N) at two t, in world space, for image positions (N,)."""
    module = addon("bridge.camera.read_projection")
    size = addon("bridge.render.image_size")

    def evaluate(camera, x, y, times=(0.0, 1.0)):
        bpy.context.view_layer.update()
        aspect = size.image_aspect(bpy.context.scene)
        projection = module.read_projection(camera, bpy.context.evaluated_depsgraph_get(), aspect)
        x, y = np.broadcast_arrays(np.atleast_1d(x).astype(float), y)
        image = projection.parameters(x, y)
        assert image.mask.all()
        return [projection.volume.evaluate(image.u, image.v, np.full(len(x), t)).position for t in times]

    return evaluate


@pytest.fixture
def way(seen):
    """Directions (3, N) from near to far."""

    def directions(camera, x, y):
        near, far = seen(camera, x, y)
        return (far - near) / np.linalg.norm(far - near, axis=0)

    return directions


def performed(stem):
    """The camera after the steps of a recipe; its render shows more than one color."""
    camera = perform(RECIPE[stem], SMALL, samples=1)
    assert camera.scfpf.enabled and bpy.context.scene.camera == camera and camera.scfpf.report
    image = bpy.data.images["SCFPF Render"]
    pixels = np.array(image.pixels[:]).reshape(-1, 4)
    assert pixels[:, :3].std() > 0.03
    return camera


def color_of(camera):
    """The image of the button Render, (H, W, 3)."""
    assert bpy.ops.scfpf.render(camera=camera.name) == {"FINISHED"}
    image = bpy.data.images["SCFPF Render"]
    width, height = image.size
    return np.array(image.pixels[:]).reshape(height, width, 4)[..., :3]


def test_views_of_a_quilt_go_from_left_to_right():
    """The fist, nearer than the focus, moves to the left from the first view to the last."""
    performed("light-field")
    image = bpy.data.images["SCFPF Render"]
    width, height = image.size[0] // 8, image.size[1] // 6
    assert abs(width - 7.5) < 1 and height == 10
    pixels = np.array(image.pixels[:]).reshape(6, height, 8, width, 4)[..., :3]
    # In the upper rows no other red thing is to the right of it.
    red = pixels[..., 0] > 2.5 * np.maximum(pixels[..., 1], pixels[..., 2]) + 0.05
    place = [(red[r, :, c].any(axis=0) * np.arange(width)).max() for r in (3, 4, 5) for c in range(8)]
    assert place[0] - place[-1] >= 2 and np.polyfit(np.arange(len(place)), place, 1)[0] < 0.0


def test_the_head_looks_round_the_wall():
    """The shot sees nothing of it, and the picture nearly all; half of the rest stays within two pixels."""
    camera = performed("behind-a-wall")
    (target,) = camera.scfpf.aim_targets
    assert target.object.name == "Head" and target.whole_95 < 2.0
    assert 0.0 <= camera.scfpf.aim.background_median < 2.0
    row = next(row for row in camera.scfpf.hidden_things if row.name == "Head")
    assert row.hidden > 0.99 and row.hider == "Wall"
    bpy.data.objects["Head"].select_set(True)
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.look_behind() == {"FINISHED"}
    after = {row.name: row.hidden for row in camera.scfpf.hidden_things}
    assert after.get("Head", 0.0) < 0.2


def test_a_character_turns_and_the_background_stays():
    """The picture is the shot's but for the head, which is as an ordinary camera sees it from its best side.

    Pixels beside the heads equal the shot's, and most of those in a head the other view's.
    """
    camera = performed("best-side")
    layer, head = camera.scfpf.layers[0], bpy.data.objects["Head"]
    assert layer.camera.name == "Head Layer" and list(layer.collection.all_objects) == [head]
    shot, eye = bpy.data.objects["Camera"], layer.camera
    way = [np.array(one.matrix_world.translation - head.location) for one in (shot, eye)]
    angle = np.arctan2(way[1][1], way[1][0]) - np.arctan2(way[0][1], way[0][0])
    assert np.degrees(angle) % 360 == pytest.approx(50, abs=0.01)
    assert np.linalg.norm(way[0]) == pytest.approx(np.linalg.norm(way[1]))
    turned = color_of(camera)
    layer.is_on = False
    plain = color_of(camera)
    ordinary = bpy.data.objects.new("Other View", eye.data)
    bpy.context.scene.collection.objects.link(ordinary)
    ordinary.matrix_world = eye.matrix_world
    bpy.context.view_layer.objects.active = ordinary
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    other = color_of(ordinary)
    changed = np.abs(turned - plain).max(axis=2) > 1e-3
    assert 0.01 < changed.mean() < 0.25
    # Beyond the heads, and the head's shadow, which stays where it was.
    rows, columns = np.nonzero(changed)
    assert columns.min() > 0.4 * plain.shape[1] and rows.min() > 0.05 * plain.shape[0]
    # Their random samples of the sun and the sky differ.
    alike = [(np.abs(turned - one).max(axis=2) < 0.1)[changed].mean() for one in (other, plain)]
    assert alike[0] > 0.65 and alike[1] < 0.4


def test_the_fist_and_the_body_have_their_fields_of_view(addon):
    camera = performed("big-fist")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    read = addon("bridge.camera.read_projection").read_own_projection
    for distance, angle in ((1.2, 43.0), (2.8, 76.0)):
        half = distance * math.tan(math.radians(angle / 2))
        points = np.array([[-0.8 * half, 0.8 * half], [0.0, 0.0], [-distance, -distance]])
        found = addon("projection.volume.inverse").find_in_image(read(camera, depsgraph, 16 / 9), points)
        assert found.x == pytest.approx([0.1, 0.9], abs=1e-4)


def test_each_row_of_the_propeller_is_taken_at_its_own_time():
    camera = performed("rolling-shutter")
    image, scene = bpy.data.images["SCFPF Render"], bpy.context.scene
    width, height = image.size
    rolled = np.array(image.pixels[:]).reshape(height, width, 4)[..., :3]
    for row in (5, height // 2, height - 8):
        time = 1 + 9.0 * (1 - (row + 0.5) / height)
        scene.frame_set(int(time), subframe=time % 1)
        still = color_of(camera)
        # Samples of sun and sky are random.
        assert np.median(np.abs(rolled[row] - still[row])) < 1e-3
        others = [np.abs(rolled[one] - still[one]).mean() for one in (row - 4, row + 4)]
        assert np.abs(rolled[row] - still[row]).mean() < min(others)


def test_the_world_falls_away_with_the_squared_distance(seen):
    camera = performed("curved-world")
    # The highest of three points of the middle projector lies on a parabola over the way ahead.
    near, middle, far = seen(camera, 0.5, 0.5, (0.0, 0.5, 1.0))
    to_camera = np.array(camera.matrix_world.inverted())
    own = to_camera[:3, :3] @ np.hstack([near, middle, far]) + to_camera[:3, 3:]
    ahead, up = -own[2], own[1]
    assert up == pytest.approx(ahead**2 / 120, rel=1e-4, abs=1e-5)


def test_the_car_is_seen_from_all_round(way):
    ahead = way(performed("unwrapped-car"), [0.5, 0.75, 0.5, 0.5], [0.5, 0.5, 0.999, 0.001])
    inwards = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, -1], [0, 0, 1]]).T
    turned = np.abs((ahead[:, :2] * inwards[:, :2]).sum(axis=0))
    # The camera looks along one of the world's axes.
    assert (
        np.allclose(turned, turned[0], atol=1e-4)
        and (ahead[:, 2:] * inwards[:, 2:]).sum(axis=0).min() > 0.999
    )


def test_tiles_of_the_town_are_twice_as_wide_as_high(addon, seen):
    camera = performed("game-tiles")
    middle = sum(seen(camera, 0.5, 0.5))[:, 0] / 2
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_projection(camera, depsgraph, 16 / 9)
    points = (middle + np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])).T
    found = addon("projection.volume.inverse").find_in_image(projection, points)
    place = np.array([found.x * 960, found.y * 540]) * SMALL / 100
    first, second = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    # One unit along an axis is half a tile across and a quarter of its width up or down.
    assert np.abs(first) == pytest.approx([12, 6], rel=1e-3)
    assert np.abs(second) == pytest.approx([12, 6], rel=1e-3)


def test_the_long_pan_turns_by_a_hundred_degrees(way):
    ahead = way(performed("long-pan"), [0.0, 0.5, 1.0], 0.5)
    assert np.degrees(np.arctan2(ahead[0], ahead[1])) == pytest.approx([-50, 0, 50], abs=0.01)


def test_the_panorama_map_looks_from_above_near_by_and_from_the_front_far_away(seen):
    near, far = seen(performed("panorama-map"), 0.5, np.array([0.0, 0.5, 1.0]))
    step = far - near
    pitch = np.degrees(np.arctan2(-2 * step[2], step[1]))
    assert pitch == pytest.approx([60, 26, -8], abs=0.01)


@pytest.mark.parametrize("stem", ["led-wall", "dome", "anamorphic-billboard"])
def test_projectors_of_screens_go_straight_away_from_the_eye(seen, stem):
    camera = performed(stem)
    turn = np.linspace(0.3, 6, 20)
    near, far = seen(camera, 0.5 + 0.4 * np.sin(turn), 0.5 + 0.4 * np.cos(turn))
    screen, eye = bpy.data.objects["Screen"], np.array(bpy.data.objects["Eye"].location)[:, None]
    for point in near.T:
        way = point - eye[:, 0]
        found, place, _, _ = screen.ray_cast(eye[:, 0], way)
        # Projectors begin between the eye and the screen, for what pops out.
        assert found and np.linalg.norm(np.array(place) - eye[:, 0]) > 10 * np.linalg.norm(way)
    rays = [(end - eye) / np.linalg.norm(end - eye, axis=0) for end in (near, far)]
    # The float32 coordinates near the eye, a hundredth of the way to the screen.
    assert np.allclose(*rays, rtol=0, atol=3e-5)


def test_panini_is_150_degrees_wide(way):
    ahead = way(performed("panini"), [0.0, 1.0], 0.5)
    assert math.degrees(math.acos(ahead[:, 0] @ ahead[:, 1])) == pytest.approx(150, abs=1e-3)


def test_the_oblique_view_is_parallel_and_halves_the_right_angle_of_heights_and_depths(way):
    ahead = way(performed("oblique"), np.array([0.1, 0.5, 0.9]), np.array([0.2, 0.5, 0.7]))
    assert np.allclose(ahead, ahead[:, :1], atol=1e-6)
    assert ahead[2, 0] == pytest.approx(-math.sqrt(0.5), abs=1e-6)


def test_the_tiny_planet_has_straight_down_in_its_middle(way):
    camera = performed("tiny-planet")
    assert way(camera, 0.5, 0.5)[:, 0] == pytest.approx([0, 0, -1], abs=1e-6)
    assert way(camera, 0.5, 0.95)[1, 0] > 0


def test_the_fulldome_master_has_the_zenith_in_its_middle_and_the_horizon_at_its_rim(way):
    up = way(performed("fulldome-master"), np.array([0.501, 0.5, 0.999]), np.array([0.5, 0.001, 0.5]))
    assert up[2] == pytest.approx([1, 0, 0], abs=0.01)
    assert up[1, 1] > 0.99 and up[0, 2] > 0.99


def test_all_sides_of_the_car_are_looked_at(seen):
    """From the front in the middle, from both sides beside it, from behind at the borders."""
    camera = performed("all-sides")
    before, end = seen(camera, np.array([0.0, 0.25, 0.5, 0.75, 1.0]), 0.5, (0.9, 1.0))
    x, y, _ = (end - before) / np.linalg.norm(end - before, axis=0)
    assert y[2] > 0.9 and y[0] < 0 and y[4] < 0 and x[1] > 0.3 and x[3] < -0.3


def test_the_unrolled_street_is_seen_square_on(way):
    x, y, _ = way(performed("street-unrolled"), np.linspace(0, 1, 9), 0.4)
    assert np.allclose(y, 0, atol=1e-6) and (x > 0.9).all()


def test_the_street_rises_between_two_cameras(way):
    """Below, the lower camera's directions; above, the upper one's; between, ever steeper."""
    blend = performed("rising-street")
    for name, y in (("Level", 0.02), ("From Above", 0.98)):
        own = bpy.data.objects[name]
        lens, shift = own.data.sensor_width / own.data.lens, np.array([[-0.4], [0.0], [0.4]])[:, 0]
        wanted = np.stack([shift * lens, np.full(3, (y - 0.5) / 2 * lens), np.full(3, -1.0)])
        wanted = np.array(own.matrix_world.to_3x3()) @ wanted
        found = way(blend, 0.5 + shift, y)
        assert np.allclose(found, wanted / np.linalg.norm(wanted, axis=0), atol=2e-3), name
    down = -way(blend, 0.5, np.linspace(0.4, 0.7, 7))[2]
    assert (np.diff(down) > 0).all()


def test_the_cartoon_background_is_the_rising_street_in_ink(way):
    """The volume of the other recipe; each thing has a hull inside out, of a material seen from the front."""
    prepare(RECIPE["rising-street"], SMALL)
    y = np.linspace(0.05, 0.95, 9)
    wanted = way(bpy.context.scene.camera, 0.3, y)
    prepare(RECIPE["toon-rising-street"], SMALL)
    assert np.allclose(way(bpy.context.scene.camera, 0.3, y), wanted, atol=1e-6)
    inked = [obj for obj in bpy.context.scene.objects if "Ink" in obj.modifiers]
    assert len(inked) > 50
    for obj in inked:
        hull = obj.modifiers["Ink"]
        last = obj.data.materials[len(obj.data.materials) - 1]
        assert hull.use_flip_normals and hull.offset == 1.0 and hull.thickness > 0.0
        assert last.use_backface_culling and hull.material_offset >= len(obj.data.materials) - 1
    assert not any("SCFPF" in obj.name for obj in inked)


def assert_few_renders(camera, addon):
    """Up to six renders from the camera's place, smaller ones elsewhere for things thinner than pixels."""
    assert bpy.ops.scfpf.joined_plan(camera=camera.name, engine="EEVEE") == {"FINISHED"}
    plan = addon("anchors.kept_plan").KeptPlan.read(camera.scfpf.anchor_plan)
    assert plan.is_one_eye and plan.shown > 0.99
    own = [each for each in plan.anchors if np.allclose(each.eye, camera.matrix_world.translation, atol=0.01)]
    assert 1 <= len(own) <= 6
    assert sum(each.count for each in own) > 0.5 * sum(each.count for each in plan.anchors)


def test_the_toon_panorama_is_150_degrees_of_flat_tones_in_few_renders(way, addon):
    prepare(RECIPE["toon-panorama"], SMALL)
    camera = bpy.context.scene.camera
    ahead = way(camera, [0.0, 1.0], 0.5)
    assert math.degrees(math.acos(ahead[:, 0] @ ahead[:, 1])) == pytest.approx(150.0, abs=0.5)
    trees = [each.node_tree for each in bpy.data.materials if each.node_tree is not None]
    toned = [tree for tree in trees if any(node.type == "SHADERTORGB" for node in tree.nodes)]
    assert len(toned) > 10
    for tree in toned:
        ramp = next(node for node in tree.nodes if node.type == "VALTORGB")
        assert ramp.color_ramp.interpolation == "CONSTANT"
    assert_few_renders(camera, addon)


def test_manga_perspective_keeps_shapes_of_small_things_in_few_renders(way, addon):
    """Stereographic: the tangent of half the angle grows as the distance from the middle. All is grey."""
    prepare(RECIPE["manga-perspective"], SMALL)
    camera = bpy.context.scene.camera
    ahead = way(camera, [0.5, 0.5, 0.5, 0.5, 1.0], [0.5, 0.0, 0.25, 1.0, 0.5])
    angles = np.arccos(np.clip(ahead[:, 0] @ ahead, -1.0, 1.0))
    far = np.tan(angles / 2.0)
    assert np.degrees(angles[1]) > 55.0
    assert far / far[1] == pytest.approx([0.0, 1.0, 0.5, 1.0, 0.8], abs=1e-3)
    assert ahead[2, 0] == pytest.approx(math.sin(math.radians(17.0)), abs=1e-3)
    for tree in (each.node_tree for each in bpy.data.materials if each.node_tree is not None):
        for socket in (socket for node in tree.nodes for socket in node.inputs if socket.type == "RGBA"):
            assert len({round(value, 5) for value in socket.default_value[:3]}) == 1
    # Lines are two pixels wide at the figure, and 15 m away in the town, where corners of hulls go equally
    # far along three axes. The picture is 800 pixels high.
    pixel = 2.0 * far[1] / 400.0
    hulls = {name: bpy.data.objects[name].modifiers["Ink"].thickness for name in ("Coat", "Tower 00")}
    body = np.linalg.norm(np.array(camera.location) - (0.0, 0.0, 1.2))
    assert hulls["Coat"] / body > 2.0 * pixel
    assert hulls["Tower 00"] / math.sqrt(3.0) / 15.0 > 2.0 * pixel
    assert_few_renders(camera, addon)


def test_the_fulldome_master_from_eevee_has_the_zenith_in_its_middle_and_few_renders(way, addon):
    prepare(RECIPE["fulldome-eevee"], SMALL)
    camera = bpy.context.scene.camera
    up = way(camera, np.array([0.501, 0.5, 0.999]), np.array([0.5, 0.001, 0.5]))
    assert up[2] == pytest.approx([1, 0, 0], abs=0.01)
    assert up[1, 1] > 0.99 and up[0, 2] > 0.99
    assert_few_renders(camera, addon)


def test_the_calibrated_lens_sees_where_its_polynomial_says(way):
    """Kannala and Brandt's polynomial, with the numbers of the file."""
    camera = performed("calibrated-lens")
    angle = np.array([0.2, 0.7, 1.1])
    radius = angle * (1 + 0.0412 * angle**2 - 0.0187 * angle**4 + 0.0079 * angle**6 - 0.0013 * angle**8)
    x = (517.3 + 406.7 * radius) / 1024
    found = np.array(camera.matrix_world.to_3x3()).T @ way(camera, x, 1 - 281.8 / 576)
    wanted = np.stack([np.sin(angle), np.zeros(3), -np.cos(angle)])
    assert np.allclose(found, wanted, atol=1e-6)


def test_any_preset_is_two_clicks_away(way):
    """A mirror ball: what is behind is at the rim."""
    ahead = way(performed("any-preset"), np.array([0.501, 0.501]), np.array([0.5, 0.999]))
    assert ahead[:, 0] @ ahead[:, 1] < -0.9


@pytest.mark.parametrize("stem", RECIPE)
def test_the_buttons_of_each_step_are_there_when_its_reader_comes_to_it(addon, stem):
    begin(RECIPE[stem], SMALL)
    for step in RECIPE[stem].steps:
        bpy.context.view_layer.update()
        for panel in re.findall(r"in the panel \*([^*]+)\*", step.text):
            (button,) = re.findall(r"Press \*([^*]+)\*", step.text)
            assert button in read_words(addon, panel), step.text
        for path, enumeration in re.findall(
            r"(?:Press|Choose) \*([^*]+)\*(?: under \*([^*]+)\*)?", step.text
        ):
            if enumeration:
                assert any(word.startswith(enumeration) for word in read_words(addon)), step.text
            elif path != "3D Cursor":
                assert path.split(" › ")[-1] in read_words(addon), step.text
        # Renders by EEVEE take their time: tests/blender/engines has some of smaller scenes.
        if "EEVEE" not in step.text:
            step.act()


def test_no_recipe_is_left_out():
    text = pathlib.Path(__file__).read_text(encoding="utf-8")
    assert not [stem for stem in RECIPE if f'"{stem}"' not in text]
    assert len(RECIPE) >= 10
