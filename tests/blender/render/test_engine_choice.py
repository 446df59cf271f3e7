# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and reports say that F12 ignores a flexible camera, and offer the switch."""

from types import SimpleNamespace

import bpy
import pytest
from recorded_layout import RecordingLayout, drawn, texts

from demo import render_demo

IGNORED = "ignores the volume"
OTHERS = {"BLENDER_EEVEE": "EEVEE", "BLENDER_WORKBENCH": "Workbench", "CYCLES": "Cycles"}


@pytest.fixture
def scene():
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.scfpf.camera_add()
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.resolution_percentage = 100
    return scene


def set_engine(scene, engine):
    items = scene.render.bl_rna.properties["engine"].enum_items
    scene.render.engine = "BLENDER_EEVEE_NEXT" if f"{engine}_NEXT" in items else engine


@pytest.fixture
def text(addon):
    return addon("cycles.engine_choice").f12_warning


@pytest.mark.parametrize("engine", OTHERS)
def test_every_other_engine_is_named(scene, text, engine):
    set_engine(scene, engine)
    assert text(scene).startswith(f"{OTHERS[engine]} {IGNORED} of 'Flexible Camera'")
    for panel in (bpy.types.SCFPF_PT_view, bpy.types.SCFPF_PT_data):
        record = drawn(panel)
        assert f"F12 ({OTHERS[engine]}) {IGNORED}" in texts(record)
        assert ("operator", "scfpf.engine_use") in record and ("operator", "scfpf.cycles_use") in record


def test_the_switch_ends_the_warning(scene, text):
    assert text(scene)
    assert bpy.ops.scfpf.engine_use() == {"FINISHED"}
    assert scene.render.engine == "SCFPF" and not text(scene)
    assert IGNORED not in texts(drawn(bpy.types.SCFPF_PT_view))


@pytest.mark.usefixtures("built_groups")
def test_ordinary_cameras_and_rigs_are_not_warned_of(scene, text):
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    assert not text(scene)
    scene.render.engine = "BLENDER_WORKBENCH"
    assert text(scene)
    # The button uses the rig that is there; the one that would remove it is elsewhere.
    assert ("operator", "scfpf.cycles_rig") not in drawn(bpy.types.SCFPF_PT_view)
    assert bpy.ops.scfpf.cycles_use() == {"FINISHED"}
    assert not text(scene)
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    assert text(scene)
    scene.camera.scfpf.enabled = False
    assert not text(scene)
    scene.camera = None
    assert not text(scene)


def test_panel_of_another_camera_is_silent(scene):
    """F12 renders the scene's camera, not the panel's."""
    bpy.ops.object.camera_add()
    scene.camera, bpy.context.view_layer.objects.active = bpy.context.object, scene.camera
    assert IGNORED not in texts(drawn(bpy.types.SCFPF_PT_view))


def test_render_properties_say_it_below_the_engine(scene, addon, monkeypatch):
    """The button of the rig is for the scene's camera, whatever is active."""
    pointers = []
    monkeypatch.setattr(
        RecordingLayout,
        "context_pointer_set",
        lambda _self, *pointer: pointers.append(pointer),
        raising=False,
    )

    def record():
        layout = RecordingLayout()
        addon("panels.engine_panels").draw_engine(SimpleNamespace(layout=layout), bpy.context)
        return layout.record

    assert bpy.types.RENDER_PT_context.is_extended()
    set_engine(scene, "BLENDER_EEVEE")
    assert "F12 (EEVEE)" in texts(record()) and ("operator", "scfpf.engine_use") in record()
    assert pointers[0] == ("object", scene.camera)
    scene.render.engine = "SCFPF"
    assert not record()


def test_f12_prints_a_warning(scene, capfd):
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    bpy.ops.render.render()
    assert (
        f"Flexible Projection: warning: Cycles {IGNORED} of 'Flexible Camera': choose Flexible"
        in capfd.readouterr().err
    )
    scene.render.engine = "SCFPF"
    bpy.ops.render.render()
    scene.render.engine, scene.camera.scfpf.enabled = "CYCLES", False
    bpy.ops.render.render()
    assert IGNORED not in capfd.readouterr().err


def test_demo_renders_flexible_cameras_by_f12(empty_file):
    stem, path = next(iter(render_demo.preset_files().items()))
    shot = bpy.data.scenes.new("Shot")
    render_demo.add_shot(shot, path.read_text(encoding="utf-8"), render_demo.SHOTS[stem])
    assert shot.render.engine == "SCFPF" and shot.camera.scfpf.enabled
