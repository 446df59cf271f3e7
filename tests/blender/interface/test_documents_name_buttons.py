# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator that a document names can be read on a button of a panel or of a menu."""

import pathlib
import re

import bpy
import pytest
from recorded_layout import read_words

ROOT = pathlib.Path(__file__).resolve().parents[3]
# The page of settings lists every operator, with those that only keys and handlers call.
PAGES = [path for path in (ROOT / "docs").rglob("*.md") if path.name != "settings.md"]
QUOTED = re.compile(r"(?<![\w*])\*([^*\n]+)\*(?!\w)")


def operator_names():
    """The names of the add-on's operators."""
    return {getattr(bpy.ops.scfpf, name).get_rna_type().name for name in dir(bpy.ops.scfpf)}


def named():
    """The names of operators in the documents, each with a page."""
    names, found = operator_names(), {}
    for page in (ROOT / "README.md", *PAGES):
        for quoted in QUOTED.findall(page.read_text(encoding="utf-8")):
            for part in quoted.split("›"):
                if part.strip() in names:
                    found[part.strip()] = page.name
    return found


def ordinary():
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.camera_add(location=(0, -8, 0), rotation=(1.57, 0, 0))
    bpy.context.scene.camera = bpy.context.object


def flexible():
    ordinary()
    bpy.ops.scfpf.camera_from_camera()


def aimed():
    flexible()
    camera = bpy.context.scene.camera
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Cube") == {"FINISHED"}


def layered():
    flexible()
    camera = bpy.context.scene.camera
    bpy.data.objects["Cube"].select_set(True)
    assert bpy.ops.scfpf.layer_add(camera=camera.name) == {"FINISHED"}
    assert bpy.ops.scfpf.layer_check(camera=camera.name) == {"FINISHED"}


def blended():
    cameras = []
    for _ in range(3):
        flexible()
        cameras.append(bpy.context.object)
    for camera in cameras:
        camera.select_set(True)
    assert bpy.ops.scfpf.camera_blend() == {"FINISHED"}
    bpy.context.object.scfpf.blend_field.kind = "RADIAL"
    bpy.context.object.scfpf.blend_field.keyframe_insert("border")


def scaled():
    flexible()
    camera = bpy.context.scene.camera
    camera.scfpf.surfaces[0].object.scale = (2, 2, 2)
    camera.scfpf.active_surface = 0
    bpy.ops.scfpf.mapping_add(kind="LENS")
    bpy.ops.object.duplicate()
    bpy.context.scene.render.resolution_x = 400
    bpy.context.view_layer.update()


def by_cycles():
    flexible()
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}


def rendered():
    flexible()
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 16
    assert bpy.ops.scfpf.render() == {"FINISHED"}


def stereoscopic():
    flexible()
    bpy.context.scene.render.use_multiview = True


STATES = (ordinary, flexible, aimed, layered, blended, scaled, by_cycles, rendered, stereoscopic)


@pytest.mark.usefixtures("built_groups")
def test_every_operator_that_a_document_names_is_read_in_a_panel_or_a_menu(addon):
    wanted = named()
    assert len(wanted) > 30
    for state in STATES:
        for obj in list(bpy.data.objects):
            bpy.data.objects.remove(obj)
        state()
        for word in read_words(addon):
            wanted.pop(word, None)
    assert not wanted


def test_no_document_sends_its_reader_to_the_search_for_one_button():
    for page in PAGES:
        assert "(F3)" not in page.read_text(encoding="utf-8"), page.name
