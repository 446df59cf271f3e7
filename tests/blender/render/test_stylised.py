# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn Style from its settings to images: F12, button, viewport, borders, files, command line."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from engine_images import button, f12

COMBINED = "ViewLayer.Combined"


@pytest.fixture
def options(engine_scene):
    """The style's settings."""
    engine_scene.camera.scfpf.samples = 1
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = 48, 28
    return engine_scene.scfpf_drawn


def names(options):
    return [name for name in options.bl_rna.properties.keys() if name not in ("rna_type", "name")]


def test_a_drawn_image_has_the_passes_of_a_plain_one(engine_scene, options):
    bpy.context.view_layer.objects.active = engine_scene.camera
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist") == {"FINISHED"}
    layer = engine_scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_object_index = True
    plain = f12(engine_scene)
    assert bpy.ops.scfpf.drawn_style(style="PAPER") == {"FINISHED"}
    assert engine_scene.view_settings.view_transform == "Standard"
    drawn = f12(engine_scene)
    assert set(drawn) == set(plain) and len(drawn) == 4
    for name, picture in plain.items():
        assert np.array_equal(picture, drawn[name]) == (name != COMBINED), name
    assert (drawn[COMBINED] == 1).all(axis=2).any() and drawn[COMBINED][..., :3].min() < 0.1
    assert np.array_equal(button(), drawn[COMBINED])
    # A part of it.
    render = engine_scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = (
        0.25,
        0.75,
        0.25,
        0.75,
    )
    assert np.array_equal(f12(engine_scene)[COMBINED], drawn[COMBINED][7:21, 12:36])
    render.use_border = False
    options.use_drawn = False
    assert np.array_equal(f12(engine_scene)[COMBINED], plain[COMBINED])


def test_paper_and_flat_colours_know_no_world(engine_scene, options):
    world = engine_scene.world = bpy.data.worlds.new("Gradient")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = next(node for node in nodes if node.type == "BACKGROUND")
    gradient, place = nodes.new("ShaderNodeTexGradient"), nodes.new("ShaderNodeTexCoord")
    links.new(place.outputs["Generated"], gradient.inputs["Vector"])
    links.new(gradient.outputs["Color"], background.inputs["Color"])
    bpy.ops.scfpf.drawn_style(style="LINES")
    options.fill = "FLAT"
    pictures = []
    for strength in (0.0, 5.0):
        background.inputs["Strength"].default_value = strength
        pictures.append(button())
    assert (pictures[0][0, 0] == 1).all() and pictures[0].min() < 0.1
    assert np.array_equal(*pictures)


def test_a_viewport_shows_it_coarse_ones_too(addon, engine_scene, options):
    bpy.ops.scfpf.drawn_style(style="LINES")
    coarse_image, job = (
        addon("bridge.render.coarse_image"),
        addon("bridge.render.render_inputs"),
    )
    inputs = job.read_inputs(bpy.context.evaluated_depsgraph_get(), engine_scene.camera, (480, 280))
    # Ten times the picture's size, in which a line has ten times the pixels.
    assert inputs.settings.stylised.lines.width == pytest.approx(20)
    widths = [step.settings.stylised.lines.width for step in coarse_image.coarse_inputs(inputs)]
    assert widths == pytest.approx([2.5, 10])
    frame = addon("shading.frame")
    coarse = next(iter(coarse_image.coarse_inputs(inputs)))
    pixels = frame.render_frame(coarse.projection, coarse.scene, coarse.settings).pixels
    assert pixels.shape[:2] == (35, 60) and pixels.max() == 1 and pixels[..., 0].min() < 0.1
    options.use_drawn = False
    inputs = job.read_inputs(bpy.context.evaluated_depsgraph_get(), engine_scene.camera, (48, 28))
    assert inputs.settings.stylised is None
    assert all(step.settings.stylised is None for step in coarse_image.coarse_inputs(inputs))


def test_lines_have_their_share_of_the_image_at_any_percentage(engine_scene, options):
    bpy.ops.scfpf.drawn_style(style="LINES")
    options.line_width = options.inner_width = 4.0
    shares = []
    for percentage in (100, 200):
        engine_scene.render.resolution_percentage = percentage
        shares.append(1 - button()[..., 0].mean())
    assert shares[0] > 0.02 and np.allclose(shares, shares[0], rtol=0.1)


def test_it_is_saved_animated_and_undone(engine_scene, options, tmp_path):
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.scfpf.drawn_style(style="INK")
    bpy.ops.ed.undo_push(message="Style")
    bpy.ops.ed.undo()
    assert not bpy.context.scene.scfpf_drawn.use_drawn
    bpy.ops.ed.redo()
    options = bpy.context.scene.scfpf_drawn
    assert options.use_drawn and options.hatching == "TONE"
    for frame, width in ((1, 1.0), (3, 6.0)):
        options.line_width = width
        options.keyframe_insert("line_width", frame=frame)
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    assert scene.scfpf_drawn.hatching == "TONE" and scene.scfpf_drawn.paper_color[2] < 0.7
    ink = []
    for frame in (1, 3):
        scene.frame_set(frame)
        ink.append(1 - f12(scene)[COMBINED][..., 0].mean())
    assert ink[1] > ink[0] + 0.02


def test_every_setting_counts(addon, engine_scene, options):
    stylised_of = addon("bridge.settings.stylised_properties").stylised_of
    assert stylised_of(engine_scene, 48) is None
    for name in names(options):
        assert options.bl_rna.properties[name].description, name
        looks = set()
        for hatching in ("TONE", "DEPTH"):
            bpy.ops.scfpf.drawn_style(style="PAPER")
            options.hatching = hatching
            before = repr(stylised_of(engine_scene, 48))
            value = getattr(options, name)
            if isinstance(value, bool):
                setattr(options, name, not value)
            elif isinstance(value, str):
                items = options.bl_rna.properties[name].enum_items.keys()
                setattr(options, name, next(item for item in items if item != value))
            elif isinstance(value, (int, float)):
                setattr(options, name, value + 1 if value == int(value) and value >= 1 else value + 0.1)
            else:
                setattr(options, name, (0.5, 0.25, 0.125))
            looks.add(before != repr(stylised_of(engine_scene, 48)))
        assert True in looks, name


def test_every_style_is_made_of_settings(addon, engine_scene, options):
    styles = addon("bridge.settings.stylised_styles").STYLES
    options.steps, options.fade = 9, 0.9
    for identifier, style in styles.items():
        assert set(style.values) <= set(names(options))
        assert bpy.ops.scfpf.drawn_style(style=identifier, plain_view=False) == {"FINISHED"}
        assert options.use_drawn and options.steps != 9 and options.fade != pytest.approx(0.9)
    assert engine_scene.view_settings.view_transform != "Standard"


class Layout:
    """Records the contents of a panel."""

    def __init__(self, drawn):
        self.__dict__["drawn"] = drawn

    def __setattr__(self, name, value):
        pass

    def prop(self, owner, name, **_options):
        assert name in owner.bl_rna.properties, name
        self.drawn.add(name)

    def operator_menu_enum(self, *_arguments, **_options):
        pass

    label = operator_menu_enum

    def panel(self, _name, **_options):
        return self, self

    def column(self, **_options):
        return self

    row = column


def test_panels_have_every_setting(addon, engine_scene, options):
    panels, shown = addon("panels.stylised"), set()
    for hatching, fill in (("NONE", "RENDERED"), ("DEPTH", "TOON"), ("TONE", "PAPER")):
        options.hatching, options.fill = hatching, fill
        for panel in (
            panels.SCFPF_PT_engine_drawn,
            bpy.types.SCFPF_PT_data_drawn,
            bpy.types.SCFPF_PT_view_drawn,
        ):
            layout = SimpleNamespace(layout=Layout(shown))
            if panel is panels.SCFPF_PT_engine_drawn:
                panel.draw(layout, bpy.context)
            else:
                panel.draw_settings(layout, bpy.context, engine_scene.camera, engine_scene.camera.scfpf)
            panel.draw_header(layout, bpy.context)
    assert set(names(options)) <= shown


def test_the_command_line_takes_a_style(addon, engine_scene, options, tmp_path):
    run = addon("bridge.render.command_line").run
    blend = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    pictures = []
    for style in ("lines", "none"):
        out = str(tmp_path / f"{style}.png")
        assert run(["render", blend, "-o", out, "--style", style]) == 0
        image = bpy.data.images.load(out)
        pictures.append(np.array(image.pixels).reshape(-1, 4)[:, :3])
    grey = np.ptp(pictures[0], axis=1).max() < 0.02
    assert grey and (pictures[0] == 1).all(axis=1).mean() > 0.5
    assert not (pictures[1] == 1).all(axis=1).any()
    assert run(["render", blend, "-o", out, "--style", "crayon"]) == 1
