# SPDX-License-Identifier: GPL-3.0-or-later
"""The gallery: its page is up to date and complete, its scenes and one panel can be made."""

import json

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from demo import gallery_animation, gallery_plates, gallery_scenes, render_demo, render_gallery
from demo.recipes import pages as recipes

PAGE = render_gallery.ROOT / "docs" / "gallery.md"
PANELS = [
    (stem, panel)
    for plate in gallery_plates.PLATES
    for stem, panel in zip(render_gallery.stems(plate), plate.panels, strict=True)
]


def test_the_page_shows_every_plate_and_preset():
    folder = PAGE.with_suffix("")
    shown, times = render_gallery.with_cycles(folder), render_gallery.cycles_times(folder)
    page = render_gallery.page(gallery_plates.PLATES, "gallery", shown, times)
    assert PAGE.read_text(encoding="utf-8") == page
    pictures = {path.name for path in folder.iterdir()} - {render_gallery.CYCLES_TIMES}
    assert pictures == {
        f"{stem}-{part}.{kind}" for stem, _ in PANELS for part, kind in render_gallery.PARTS.items()
    } | {f"{stem}-cycles.jpg" for stem in shown} | {f"{gallery_animation.STEM}.webp"}
    presets = {path.stem for path in (render_gallery.ROOT / "presets").glob("*.json")}
    in_plates = {panel.preset for _, panel in PANELS}
    told = "".join(recipes.pages().values())
    assert in_plates <= presets
    for stem in presets - in_plates:
        name = json.loads((render_gallery.ROOT / "presets" / f"{stem}.json").read_text(encoding="utf-8"))[
            "name"
        ]
        assert name in told, f"neither a plate nor a recipe shows {name}"


@pytest.mark.parametrize("name", gallery_scenes.SCENES)
def test_scenes_stand_alone(empty_file, name):
    """Lit, not empty, and with the collections that set-ups leave out."""
    scene = render_gallery.build(name)
    assert any(obj.type == "MESH" for obj in scene.objects)
    assert any(obj.type == "LIGHT" for obj in scene.objects) and scene.world
    hidden = {hidden for _, panel in PANELS if panel.scene == name for hidden in panel.hidden}
    assert hidden <= {collection.name for collection in scene.collection.children}


def test_a_panel_has_three_pictures_and_the_set_up_sees_the_whole_volume(empty_file, tmp_path, monkeypatch):
    monkeypatch.setattr(render_demo, "MODULE", "bl_ext.checkout.scfpf")
    stem, panel = next(one for one in PANELS if one[1].preset == "nonlinear_twist")
    files = render_gallery.render_panel(render_gallery.build(panel.scene), panel, tmp_path / stem, 10)
    assert sorted(tmp_path.iterdir()) == sorted(files)
    spread = []
    for file in files:
        image = bpy.data.images.load(str(file))
        spread.append(np.std(np.array(image.pixels[:]).reshape(-1, 4)[:, :3]))
    assert min(spread) > 0.05, "a picture is all of one colour"
    set_up = next(scene for scene in bpy.data.scenes if scene.camera and scene.camera.name == "Set-up")
    rims = [obj for obj in set_up.objects if obj.name.startswith(("Rim", "Projector"))]
    seen = np.array(
        [
            world_to_camera_view(set_up, set_up.camera, Vector(vertex.co))
            for obj in rims
            for vertex in obj.data.vertices
        ]
    )
    assert seen[:, :2].min() > 0 and seen[:, :2].max() < 1
    assert (seen[:, :2].max(axis=0) - seen[:, :2].min(axis=0)).max() > 0.85
