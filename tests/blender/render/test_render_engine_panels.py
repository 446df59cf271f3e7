# SPDX-License-Identifier: GPL-3.0-or-later
"""The Properties editor under the engine: no needed panel is hidden, and disabling leaves nothing behind."""

import bpy
import pytest

NEEDED = (
    "RENDER_PT_format",
    "RENDER_PT_frame_range",
    "RENDER_PT_output",
    "RENDER_PT_color_management",
    "WORLD_PT_context_world",
    "EEVEE_WORLD_PT_surface",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "DATA_PT_context_light",
    "DATA_PT_EEVEE_light",
    "DATA_PT_lens",
    "DATA_PT_camera",
    "OBJECT_PT_visibility",
    "VIEWLAYER_PT_layer",
    "PARTICLE_PT_render",
)


def engines():
    return {
        panel.__name__: set(panel.COMPAT_ENGINES)
        for panel in bpy.types.Panel.__subclasses__()
        if hasattr(panel, "COMPAT_ENGINES") and not panel.__name__.startswith("SCFPF")
    }


@pytest.mark.parametrize("name", NEEDED)
def test_blenders_panel_is_shown(name):
    assert "SCFPF" in engines()[name]


def test_panels_that_would_promise_too_much_are_not(extension):
    shown = {name for name, compatible in engines().items() if "SCFPF" in compatible}
    assert not [name for name in shown if "freestyle" in name or "eevee_" in name or "CYCLES" in name]


def test_engine_is_taken_back_from_every_panel(addon):
    panels = addon("panels.engine_panels")
    with_engine = engines()
    panels.unregister()
    try:
        without = engines()
        assert not [name for name, compatible in without.items() if "SCFPF" in compatible]
    finally:
        panels.register()
    assert engines() == with_engine
    assert {name: compatible - {"SCFPF"} for name, compatible in with_engine.items()} == without


class Layout:
    """Records the contents of a panel."""

    def __init__(self, drawn):
        self.__dict__["drawn"] = drawn

    def __setattr__(self, name, value):
        pass

    def prop(self, owner, name, **_options):
        assert name in owner.bl_rna.properties, name
        self.drawn.append(name)

    def operator(self, name, **_options):
        self.drawn.append(name)

    def label(self, text="", **_options):
        self.drawn.append(text)

    def column(self, **_options):
        return self

    row = column


def draw(addon, name):
    from types import SimpleNamespace

    drawn = []
    getattr(addon("panels.engine_panels"), name).draw(SimpleNamespace(layout=Layout(drawn)), bpy.context)
    return drawn


def test_settings_are_those_of_the_scenes_camera(addon, engine_scene):
    assert {"camera", "samples", "pixel_error"} <= set(draw(addon, "SCFPF_PT_engine_camera"))
    engine_scene.camera = None
    assert "scfpf.camera_add" in draw(addon, "SCFPF_PT_engine_camera")
    film = set(draw(addon, "SCFPF_PT_engine_film"))
    assert {"film_exposure", "film_transparent", "pixel_filter", "filter_size"} <= film
    layer = set(draw(addon, "SCFPF_PT_engine_filter"))
    assert {"use_sky", "use_solid", "use_motion_blur", "material_override", "world_override"} <= layer
    assert {"pattern", "use_adaptive"} <= set(draw(addon, "SCFPF_PT_engine_pattern"))
    assert {"motion_steps", "motion_blur_shutter"} <= set(draw(addon, "SCFPF_PT_engine_motion_blur"))
    assert "transparent_max_bounces" in draw(addon, "SCFPF_PT_engine_light_paths")
    assert "threads" in draw(addon, "SCFPF_PT_engine_performance")
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    assert {"visible_camera", "visible_shadow"} <= set(draw(addon, "SCFPF_PT_engine_ray_visibility"))
    bpy.context.view_layer.objects.active = bpy.data.objects["Sun"]
    assert draw(addon, "SCFPF_PT_engine_ray_visibility") == ["visible_diffuse", "visible_glossy"]


def test_a_world_has_a_switch_for_projectors(addon, engine_scene):
    from types import SimpleNamespace

    panel = addon("panels.engine_panels").SCFPF_PT_engine_world_visibility
    drawn = []
    context = SimpleNamespace(engine="SCFPF", world=bpy.data.worlds.new("World"), layout=Layout(drawn))
    assert panel.poll(context)
    panel.draw(context, context)
    assert drawn == ["camera"]
    assert not panel.poll(SimpleNamespace(engine="SCFPF", world=None))


def test_beams_are_those_of_area_lamps(addon, engine_scene):
    from types import SimpleNamespace

    panel = addon("panels.engine_panels").SCFPF_PT_engine_beam
    drawn, area = [], bpy.data.lights.new("Area", "AREA")
    context = SimpleNamespace(engine="SCFPF", light=area, layout=Layout(drawn))
    assert panel.poll(context)
    panel.draw(context, context)
    assert drawn == ["spread", "is_portal"]
    for other in (None, bpy.data.lights.new("Point", "POINT")):
        assert not panel.poll(SimpleNamespace(engine="SCFPF", light=other))


def test_passes_panel_has_a_switch_for_every_pass(addon, engine_scene):
    listed = addon("bridge.render.render_passes").list_render_passes
    view_layer = engine_scene.view_layers[0]
    for name in draw(addon, "SCFPF_PT_engine_passes"):
        owner = view_layer if name in view_layer.bl_rna.properties else view_layer.scfpf
        if name.startswith("use_pass"):
            setattr(owner, name, False)
            before = len(list(listed(view_layer)))
            setattr(owner, name, True)
            # Cryptomattes have two of the six names in a layer.
            assert len(list(listed(view_layer))) == before + (3 if "crypto" in name else 1), name
    assert len(list(listed(view_layer))) == 25
