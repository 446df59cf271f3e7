# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements in the gallery's figures and animation, with their cameras and scenes."""

import bpy
import numpy as np
import pytest

from demo import gallery_animation, gallery_plates, render_demo, render_gallery
from demo.gallery_panels import preset_text


def panel_of(stem):
    return next(
        panel
        for plate in gallery_plates.PLATES
        for own, panel in zip(render_gallery.stems(plate), plate.panels, strict=True)
        if own == stem
    )


@pytest.fixture
def set_up(empty_file, addon, monkeypatch):
    """The scene and the camera of a panel, its projection in world space, and its depsgraph."""
    monkeypatch.setattr(render_demo, "MODULE", "bl_ext.checkout.scfpf")

    def make(stem, without=()):
        panel = panel_of(stem)
        scene = render_gallery.build(panel.scene)
        for name in without:
            scene.collection.children.unlink(bpy.data.collections[name])
        camera = render_demo.add_shot(scene, preset_text(panel.preset, panel.changed), panel.shot)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        width, height = panel.shot.size
        read = addon("bridge.camera.read_projection").read_projection
        return scene, read(camera, depsgraph, width / height), depsgraph

    return make


def parts_of(mask):
    """Return the number of connected parts of the True pixels of (H, W), connected by their sides."""
    count, left = 0, mask.copy()
    while left.any():
        part = np.zeros_like(left)
        part.flat[left.argmax()] = True
        while True:
            grown = part.copy()
            grown[1:] |= part[:-1]
            grown[:-1] |= part[1:]
            grown[:, 1:] |= part[:, :-1]
            grown[:, :-1] |= part[:, 1:]
            grown &= left
            if (grown == part).all():
                break
            part = grown
        left &= ~part
        count += 1
    return count


def test_figure_1_shows_front_sides_and_back_in_one_silhouette(set_up, addon):
    """Every labelled part of the car is seen, in its order, and all of the car's pixels hang together."""
    _, projection, depsgraph = set_up("figure-1", ("Houses", "Street furniture", "Parked cars"))
    contents = addon("bridge.scene.read_scene").read_scene(depsgraph)
    geometry = contents.geometry
    cast_scene = addon("casting.scene.cast_scene").CastScene(geometry.vertices, geometry.triangles)
    hits = addon("casting.frame").cast_frame(cast_scene, projection, 300, 100, 0.5)
    seen = np.where(hits.triangle >= 0, geometry.object_index[hits.triangle], -1).reshape(100, 300)
    names = list(geometry.object_names)
    own = [names.index(obj.name) for obj in bpy.data.collections["Car"].all_objects if obj.name in names]
    assert parts_of(np.isin(seen, own)) == 1
    columns = {
        name: np.flatnonzero((seen == names.index(f"Car {name}")).any(axis=0))
        for name in ("front", "right side", "left side", "rear")
    }
    assert all(len(found) for found in columns.values())
    middle = {name: np.median(found) for name, found in columns.items()}
    assert 130 < middle["front"] < 170
    sides = sorted((middle["left side"], middle["right side"]))
    assert sides[0] < columns["front"].min() and columns["front"].max() < sides[1]
    # The back at both borders, and nowhere between the sides.
    assert columns["rear"].min() < sides[0] and columns["rear"].max() > sides[1]
    assert not ((columns["rear"] > sides[0]) & (columns["rear"] < sides[1])).any()


def test_figure_9_bends_what_runs_straight_away(set_up, addon):
    """Boards' edges on the floor deviate by more than 5 px from a straight line in the gallery's image."""
    _, projection, _ = set_up("figure-9")
    find = addon("projection.volume.inverse").find_in_image
    width, height = (75 * size // 100 for size in panel_of("figure-9").shot.size)
    bows = []
    for x in (-1.5, -1.0, 1.0, 1.5):
        points = np.stack([np.full(80, x), np.linspace(6.0, 36.0, 80), np.zeros(80)])
        place = find(projection, points)
        shown = place.found
        assert shown.sum() > 40
        across, up = place.x[shown] * width, place.y[shown] * height
        chord = np.array([across[-1] - across[0], up[-1] - up[0]])
        away = (across - across[0]) * chord[1] - (up - up[0]) * chord[0]
        bows.append(np.abs(away).max() / np.hypot(*chord))
    assert min(bows) > 5


def test_the_animation_is_eased_and_goes_from_perspective_through_orthographic_beyond(
    empty_file, addon, monkeypatch
):
    """The front keeps its width, what is behind it does not; the factor starts and ends slowly."""
    monkeypatch.setattr(render_demo, "MODULE", "bl_ext.checkout.scfpf")
    scene = render_gallery.build("house")
    blend = gallery_animation.make_blend(scene)
    read = addon("bridge.camera.read_projection").read_projection
    factors, front, behind = [], [], []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        factors.append(blend.scfpf.blend_factor)
        projection = read(blend, bpy.context.evaluated_depsgraph_get(), 16 / 9)
        near, far = gallery_animation.ENDS
        for distance, widths in ((gallery_animation.DISTANCE, front), (30.0, behind)):
            t = np.full(2, (distance - near) / (far - near))
            left, right = projection.volume.evaluate(np.array([0.0, 1.0]), np.full(2, 0.5), t).position.T
            widths.append(np.linalg.norm(right - left))
    factors, behind = np.array(factors), np.array(behind)
    assert np.allclose(front, gallery_animation.WIDTH, rtol=1e-5)
    wanted = gallery_animation.WIDTH * (1 + (1 - factors) * (30.0 / gallery_animation.DISTANCE - 1))
    assert np.allclose(behind, wanted, rtol=1e-5)
    steps = np.diff(factors)
    assert (steps > 0).all() and factors[0] == 0 and factors[-1] == pytest.approx(1.6)
    assert max(steps[0], steps[-1]) < steps.max() / 4, "no easing"
    assert np.isclose(factors, 1.0).any()


def test_the_animation_s_file_is_small_and_has_all_its_pictures():
    from PIL import Image

    path = render_gallery.ROOT / "docs" / "gallery" / f"{gallery_animation.STEM}.webp"
    assert path.stat().st_size < 2**20
    with Image.open(path) as picture:
        frames = max(gallery_animation.KEYS) - min(gallery_animation.KEYS) + 1
        # There, back without both ends, which are held.
        assert picture.n_frames > 2 * frames - 4 and picture.info["loop"] == 0
        first = np.array(picture.convert("RGB"), np.int16)
        picture.seek(picture.n_frames // 2)
        assert np.abs(np.array(picture.convert("RGB"), np.int16) - first)[:270].mean() > 10
