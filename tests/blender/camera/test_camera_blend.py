# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras between two others: both ends, the middle, beyond; keyframes; files; what cannot be blended."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

ASPECT = 16 / 9


@pytest.fixture
def camera():
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 90, 100
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    made = bpy.context.object
    made.location, made.rotation_euler = (1, -2, 3), (1.2, 0.1, 0.4)
    return made


@pytest.fixture
def seen(addon):
    """Return Q at random image positions and t, (3, N) in world space, and which of them the image shows."""
    read = addon("bridge.camera.read_projection").read_projection

    def sample(camera, seed=5):
        x, y, t = np.random.default_rng(seed).uniform(0.02, 0.98, size=(3, 400))
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
        image = projection.parameters(x, y)
        return projection.volume.evaluate(image.u, image.v, t).position, image.mask

    return sample


def at(camera, factor):
    camera.scfpf.blend_factor = factor
    bpy.context.view_layer.update()
    return camera


def is_near(found, wanted, mask, share):
    size = np.ptp(wanted[:, mask], axis=1).max()
    return np.linalg.norm(found - wanted, axis=0)[mask].max() <= share * size


def check_blend(seen, blend, ends, share, factors=(-0.5, 0.3, 1.0, 1.5)):
    (first, mask), (second, other_mask) = ends
    mask = mask & other_mask
    for factor in (0.0, *factors):
        found, _ = seen(at(blend, factor))
        wanted = (1 - factor) * first + factor * second
        scale = share * (1 + 2 * abs(factor))
        assert is_near(found, wanted, mask, scale), factor


# Straight; bent with straight; grids of curved kinds; polar with polar; polar with flat.
PAIRS = {
    ("perspective", "orthographic"): 1e-6,
    ("perspective", "inverted_perspective"): 1e-6,
    ("perspective", "curved_convergence"): 1e-6,
    ("perspective", "angular_fisheye"): 4e-4,
    ("sample_rate_lens", "orthographic"): 4e-4,
}


@pytest.mark.parametrize(("pair", "share"), PAIRS.items(), ids=lambda each: str(each))
def test_a_camera_and_a_preset_are_blended_and_beyond(camera, seen, pair, share):
    assert bpy.ops.scfpf.preset_apply(preset=pair[1], fit=False) == {"FINISHED"}
    end = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset=pair[0], fit=False) == {"FINISHED"}
    start = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset=pair[1]) == {"FINISHED"}
    blend = bpy.context.object
    assert blend != camera and blend == bpy.context.scene.camera
    check_blend(seen, blend, (start, end), share)


def test_two_cameras_are_blended_in_space(camera, seen):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    other = bpy.context.object
    other.location, other.rotation_euler = (4, 1, 2), (1.0, 0.0, 0.9)
    assert bpy.ops.scfpf.preset_apply(preset="deep_curvy_volume", fit=False) == {"FINISHED"}
    assert not bpy.ops.scfpf.camera_blend.poll()
    camera.select_set(True)
    bpy.context.view_layer.update()
    ends = seen(camera), seen(other)
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    check_blend(seen, bpy.context.object, ends, 4e-4)


def test_the_factor_is_animated_without_handlers_and_survives_a_file(camera, seen, tmp_path):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    for frame, value in ((1, 0.0), (11, 1.0)):
        blend.scfpf.blend_factor = value
        blend.keyframe_insert("scfpf.blend_factor", frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "blend.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "blend.blend"))
    blend = bpy.context.scene.camera
    widths = []
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        far = blend.scfpf.surfaces[-1].object.evaluated_get(bpy.context.evaluated_depsgraph_get())
        widths.append(np.ptp([vertex.co.x for vertex in far.data.vertices]))
        assert blend.scfpf.surfaces[0].object.data.shape_keys.key_blocks[1].value == pytest.approx(
            blend.scfpf.blend_factor
        )
    assert widths[0] > widths[1] > widths[2]
    assert widths[1] == pytest.approx((widths[0] + widths[2]) / 2, rel=1e-5)


def test_what_has_holes_is_not_blended_and_nothing_is_left(camera):
    camera.scfpf.mappings.add().kind = "DISTORTION"
    camera.scfpf.mappings[0].numerator = 0.5, 0, 0
    before = set(bpy.data.objects)
    with pytest.raises(RuntimeError, match="empty parts"):
        bpy.ops.scfpf.camera_blend_preset(preset="orthographic")
    assert set(bpy.data.objects) == before


def test_a_blend_shows_its_factor(addon, camera):
    is_blend = addon("bridge.camera.camera_blend").is_blend
    assert not is_blend(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    assert is_blend(bpy.context.object)


def key_factor(blend):
    for frame, value in ((1, 0.0), (11, 1.0)):
        blend.scfpf.blend_factor = value
        blend.keyframe_insert("scfpf.blend_factor", frame=frame)


def keyed(blend):
    """The factor at three frames."""
    values = []
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        values.append(blend.scfpf.blend_factor)
    return values


def ends_as_seen(seen, first, second):
    return seen(first), seen(second)


@pytest.fixture
def two(camera):
    """Two flexible cameras, the second one active, both selected."""
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    other = bpy.context.object
    other.location, other.rotation_euler = (4, 1, 2), (1.0, 0.0, 0.9)
    assert bpy.ops.scfpf.preset_apply(preset="orthographic", fit=False) == {"FINISHED"}
    camera.select_set(True)
    bpy.context.view_layer.update()
    return camera, other


def test_a_blend_is_brought_up_to_date_in_place_with_its_keyframes(camera, two, seen, tmp_path):
    """Both cameras moved, one surface edited: the same objects, the same keys; after a file too."""
    first, second = two
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    key_factor(blend)
    keys = keyed(blend)
    objects = [slot.object for slot in blend.scfpf.surfaces]
    first.location.x += 2
    second.rotation_euler.z -= 0.4
    blend.location.y += 1
    first.scfpf.surfaces[1].object.scale = 2, 1.5, 1
    bpy.context.view_layer.update()
    ends = ends_as_seen(seen, first, second)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert [slot.object for slot in blend.scfpf.surfaces] == objects
    assert keyed(blend) == keys and keys[0] == 0 and keys[2] == 1
    blend.animation_data_clear()
    check_blend(seen, blend, ends, 1e-6)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "blend.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "blend.blend"))
    blend = bpy.context.scene.camera
    blend.scfpf.blend_ends.first.location.z += 3
    bpy.context.view_layer.update()
    ends = ends_as_seen(seen, blend.scfpf.blend_ends.first, blend.scfpf.blend_ends.second)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    check_blend(seen, blend, ends, 1e-6)


def test_other_kinds_and_another_resolution_make_other_surfaces(camera, two, seen):
    """Straight ones become bent, then a fisheye's; keyframes stay, and the drivers act."""
    first, second = two
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    key_factor(blend)
    for preset, share, count in (("deep_curvy_volume", 4e-4, 3), ("angular_fisheye", 4e-4, 2)):
        bpy.context.view_layer.objects.active = second
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        bpy.context.view_layer.objects.active = blend
        ends = ends_as_seen(seen, first, second)
        assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
        assert len(blend.scfpf.surfaces) == count
        check_blend(seen, blend, ends, share)
    widths = []
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        widths.append(seen(blend)[0])
    assert is_near(widths[0], ends[0][0], ends[1][1], 4e-4) and is_near(
        widths[1], ends[1][0], ends[1][1], 4e-4
    )


def test_a_preset_s_end_follows_the_first_camera_or_gives_way_to_a_camera(camera, seen):
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    camera.location.x += 5
    bpy.context.view_layer.update()
    start = seen(camera)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    at(blend, 0.0)
    assert is_near(seen(blend)[0], *start, 1e-6)
    shifted = seen(at(blend, 1.0))[0]
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset="orthographic", fit=False) == {"FINISHED"}
    assert is_near(shifted, *seen(camera), 1e-6)
    other = camera.copy()
    bpy.context.scene.collection.objects.link(other)
    other.location.x -= 2
    bpy.context.view_layer.objects.active = blend
    blend.scfpf.blend_ends.second = other
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert is_near(seen(at(blend, 1.0))[0], *seen(other), 1e-6)


def test_updates_say_what_is_missing_and_undo_takes_them_back(camera, two, seen):
    _, second = two
    assert not bpy.ops.scfpf.blend_update.poll()
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    blend = bpy.context.object
    before = seen(at(blend, 1.0))[0]
    bpy.ops.ed.undo_push(message="Blend")
    second.location.x += 7
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Move")
    name = blend.name
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert np.abs(seen(blend)[0] - before).max() > 1
    bpy.ops.ed.undo_push(message="Update Blend")
    bpy.ops.ed.undo()
    blend = bpy.data.objects[name]
    assert np.allclose(seen(blend)[0], before, rtol=0, atol=1e-6)
    bpy.data.objects.remove(bpy.data.objects["Flexible Camera"])
    bpy.context.view_layer.objects.active = blend
    assert not bpy.ops.scfpf.blend_update.poll()
    blend.scfpf.blend_ends.first = blend.scfpf.blend_ends.second
    gone = blend.scfpf.blend_ends.second
    bpy.context.scene.collection.objects.unlink(gone)
    with pytest.raises(RuntimeError, match="was deleted: undo that"):
        bpy.ops.scfpf.blend_update()
    blend.scfpf.blend_ends.preset = "../nothing"
    bpy.context.scene.collection.objects.link(gone)
    blend.scfpf.blend_ends.second = None
    with pytest.raises(RuntimeError, match="no preset"):
        bpy.ops.scfpf.blend_update()


def test_a_map_mixes_the_cameras_place_by_place(camera, seen, tmp_path):
    """Q is the mean of both by the map's weight; a file keeps it, and without a map all is as before."""
    assert bpy.ops.scfpf.preset_apply(preset="curved_convergence", fit=False) == {"FINISHED"}
    second, _ = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    first, mask = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    blend = bpy.context.object
    x = np.random.default_rng(5).uniform(0.02, 0.98, size=(3, 400))[0]
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert blend.scfpf.blend_factor == 1.0
    blend.scfpf.blend_field.border = 0.5
    blend.scfpf.blend_field.center = 0.4, 0.5
    share = np.clip(0.5 + (x - 0.4) / 0.5, 0, 1)
    weight = share**2 * (3 - 2 * share)
    wanted = (1 - weight) * first + weight * second
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], wanted, mask, 1e-3)
    # Half of it.
    assert is_near(seen(at(blend, 0.5))[0], 0.5 * (wanted + first), mask, 1e-3)
    at(blend, 1.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "map.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "map.blend"))
    blend = bpy.context.scene.camera
    assert is_near(seen(blend)[0], wanted, mask, 1e-3)
    bpy.context.view_layer.objects.active = blend
    assert bpy.ops.scfpf.blend_map(kind="NONE") == {"FINISHED"}
    assert is_near(seen(at(blend, 1.0))[0], second, mask, 1e-3)


def test_a_painted_map_with_a_seam_shows_one_camera_on_either_side(camera, seen):
    assert bpy.ops.scfpf.preset_apply(preset="orthographic", fit=False) == {"FINISHED"}
    second, _ = seen(camera)
    assert bpy.ops.scfpf.preset_apply(preset="perspective", fit=False) == {"FINISHED"}
    first, mask = seen(camera)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    image = bpy.data.images.new("Painted", 64, 64)
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[:, 32:] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    blend.scfpf.blend_field.image = image
    assert bpy.ops.scfpf.blend_map(kind="IMAGE") == {"FINISHED"}
    found, _ = seen(blend)
    x = np.random.default_rng(5).uniform(0.02, 0.98, size=(3, 400))[0]
    seam = 1 / 64 + 1 / 128
    left, right = mask & (x < 0.5 - seam), mask & (x > 0.5 + seam)
    assert is_near(found, first, left, 1e-6) and is_near(found, second, right, 1e-6)
    blend.scfpf.blend_field.is_inverted = True
    bpy.context.view_layer.update()
    found, _ = seen(blend)
    assert is_near(found, second, left, 1e-6) and is_near(found, first, right, 1e-6)


def test_a_blend_of_a_blend_has_weights_that_add_up_to_one(camera, seen):
    """Three cameras: the third one in a circle, the other two beside a line."""
    ends = []
    for preset in ("orthographic", "curved_convergence", "perspective"):
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        end, mask = seen(camera)
        ends.append(end)
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    assert bpy.ops.scfpf.blend_map(kind="LINEAR") == {"FINISHED"}
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    assert bpy.ops.scfpf.blend_map(kind="RADIAL") == {"FINISHED"}
    x, y, _ = np.random.default_rng(5).uniform(0.02, 0.98, size=(3, 400))

    def smooth(inside):
        share = np.clip(0.5 + inside / 0.2, 0, 1)
        return share**2 * (3 - 2 * share)

    line, circle = smooth(x - 0.5), smooth(0.25 - np.hypot(x - 0.5, (y - 0.5) / ASPECT))
    wanted = (1 - circle) * ((1 - line) * ends[2] + line * ends[0]) + circle * ends[1]
    assert is_near(seen(bpy.context.object)[0], wanted, mask, 3e-3)


def test_an_image_without_pixels_is_refused_and_the_map_stays(camera):
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "//is-not-there.png"
    blend.scfpf.blend_field.image = image
    with pytest.raises(RuntimeError, match="has no pixels: paint or load it"):
        bpy.ops.scfpf.blend_map(kind="IMAGE")
    assert blend.scfpf.blend_field.kind == "NONE" and blend.scfpf.blend_factor == 0.0


@pytest.mark.parametrize("kind", ["RADIAL", "RECTANGLE"])
def test_a_map_is_put_around_objects_as_the_first_camera_sees_them(camera, kind):
    """The corners of a cube by Blender's own camera lie where the map is 1; beyond its border it is 0."""
    from bpy_extras.object_utils import world_to_camera_view

    bpy.ops.mesh.primitive_cube_add(size=1.0)
    cube = bpy.context.object
    cube.matrix_world = camera.matrix_world @ cube.matrix_world
    cube.location += camera.matrix_world.to_3x3() @ Vector((0.5, 0.3, -8.0))
    bpy.context.view_layer.objects.active = camera
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    places = [
        world_to_camera_view(bpy.context.scene, camera, cube.matrix_world @ v.co) for v in cube.data.vertices
    ]
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    assert bpy.ops.scfpf.blend_map(kind=kind) == {"FINISHED"}
    blend.scfpf.blend_field.border = 0.1
    assert not bpy.ops.scfpf.blend_map_around.poll()
    cube.select_set(True)
    assert bpy.ops.scfpf.blend_map_around() == {"FINISHED"}
    field = blend.scfpf.blend_field
    x, y = np.array([(p.x, p.y) for p in places]).T
    middle = (x.min() + x.max()) / 2, (y.min() + y.max()) / 2
    assert np.allclose(field.center, middle, atol=2e-3)
    wide, high = np.ptp(x), np.ptp(y)
    if kind == "RECTANGLE":
        assert np.allclose(field.size, (wide + 0.1, high + 0.1 * ASPECT), atol=4e-3)
    else:
        assert field.size[0] == pytest.approx(np.hypot(wide, high / ASPECT) + 0.1, abs=4e-3)


def test_sharp_seams_of_nested_blends_are_exact(camera, seen, addon, tmp_path):
    """Three cameras, two turned rectangles without borders: each point is one camera's. Files keep it."""
    ends = []
    for preset in ("orthographic", "curved_convergence", "perspective"):
        assert bpy.ops.scfpf.preset_apply(preset=preset, fit=False) == {"FINISHED"}
        end, mask = seen(camera)
        ends.append(end)
    x, y, _ = np.random.default_rng(5).uniform(0.02, 0.98, size=(3, 400))
    boxes, off = [], []
    for preset, center, angle in (
        ("orthographic", (0.4, 0.5), 0.3),
        ("curved_convergence", (0.6, 0.6), -0.5),
    ):
        assert bpy.ops.scfpf.camera_blend_preset(preset=preset) == {"FINISHED"}
        field = bpy.context.object.scfpf.blend_field
        field.center, field.angle, field.border, field.size = center, angle, 0.0, (0.5, 0.4)
        assert bpy.ops.scfpf.blend_map(kind="RECTANGLE") == {"FINISHED"}
        # A turn by complex numbers.
        place = (x - center[0] + 1j * (y - center[1]) / ASPECT) * np.exp(-1j * angle)
        sides = np.stack([0.25 - np.abs(place.real), 0.2 / ASPECT - np.abs(place.imag)])
        boxes.append(sides.min(axis=0) > 0)
        off.append(np.abs(sides).min(axis=0))
    blend = bpy.context.object
    away = mask & (np.min(off, axis=0) > 1e-4)
    assert away.sum() > 350 and boxes[0].sum() > 50 and boxes[1].sum() > 50
    wanted = np.where(boxes[1], ends[1], np.where(boxes[0], ends[0], ends[2]))
    assert is_near(seen(blend)[0], wanted, away, 1e-3)
    assert not addon("bridge.camera.camera_blend").is_too_coarse(blend)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "seams.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "seams.blend"))
    blend = bpy.context.scene.camera
    assert is_near(seen(blend)[0], wanted, away, 1e-3)
    # Half way between the cameras within, the first one beyond.
    below = np.where(boxes[0], ends[0], ends[2])
    assert is_near(seen(at(blend, 0.5))[0], 0.5 * (wanted + below), away, 1e-3)
    bpy.context.view_layer.objects.active = at(blend, 1.0)
    blend.scfpf.blend_field.is_inverted = True
    bpy.context.view_layer.update()
    assert is_near(seen(blend)[0], np.where(boxes[1], below, ends[1]), away, 1e-3)
    # Another place needs other cuts: the panel says so, and Update Blend makes them.
    blend.scfpf.blend_field.is_inverted, blend.scfpf.blend_field.center = False, (0.55, 0.6)
    assert addon("bridge.camera.camera_blend").is_too_coarse(blend)
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert not addon("bridge.camera.camera_blend").is_too_coarse(blend)
    blend.scfpf.blend_field.border = 0.3
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert not addon("bridge.camera.camera_blend").is_too_coarse(blend)
