# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels and menus, drawn into a recording layout: their names exist, and both places agree."""

import types

import bpy
import numpy as np
import pytest
from recorded_layout import FakePanel, RecordingLayout, drawn, texts

SECTIONS = ("", "_blend", "_surfaces", "_projectors", "_mappings", "_quality", "_display")


@pytest.fixture
def camera():
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.scfpf.camera_add()
    return bpy.context.object


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("place", ["data", "view"])
@pytest.mark.parametrize(
    "preset", ["perspective", "cylindrical_panorama", "around_the_car", "angular_fisheye"]
)
def test_every_section_draws_what_exists(camera, section, place, preset):
    bpy.ops.scfpf.preset_apply(preset=preset)
    for index in range(len(camera.scfpf.surfaces)):
        camera.scfpf.active_surface = index
        assert drawn(getattr(bpy.types, f"SCFPF_PT_{place}{section}"))


@pytest.mark.parametrize("section", SECTIONS[1:])
def test_both_places_draw_the_same(camera, section):
    data, view = (drawn(getattr(bpy.types, f"SCFPF_PT_{place}{section}")) for place in ("data", "view"))
    assert data == view


@pytest.mark.usefixtures("built_groups")
def test_the_panel_says_what_the_preview_leaves_out_and_what_is_wrong(camera, addon, monkeypatch):
    section = bpy.types.SCFPF_PT_view
    assert ("operator", "scfpf.preview_show") not in drawn(section)
    bpy.ops.scfpf.preview_toggle()
    remap_nodes = addon("scanline.remap.remap_nodes")
    for counts, told in (
        ({"unreachable": 0, "folded": 0}, []),
        ({"unreachable": 1234, "folded": 0}, ["1,234 faces are cut or left out"]),
        ({"unreachable": 0, "folded": 7}, ["7 samples of the volume are folded"]),
    ):
        monkeypatch.setattr(remap_nodes, "remap_counts", lambda _evaluated, counts=counts: counts)
        every = texts(drawn(bpy.types.SCFPF_PT_messages))
        for phrase in ("left out", "are folded"):
            assert (phrase in every) == any(phrase in text for text in told)
        assert all(text in every for text in told)
    source = addon("scanline.preview.preview_data").previews()[0]
    source.scfpf_preview.problem = "It is broken"
    assert "It is broken" in texts(drawn(section))
    # Nothing shows it here: the viewport can be asked for.
    assert ("operator", "scfpf.preview_show") in drawn(bpy.types.SCFPF_PT_messages)


def test_tooltips_say_in_what_the_ways_to_a_picture_differ():
    for name, phrases in {
        "preview_toggle": ("lights have no effect", "hidden objects", "hair", "linked to objects"),
        "cycles_rig": ("passes of t and depth", "motion is not blurred"),
        "cycles_use": ("passes of t and depth", "motion is not blurred"),
        "view_live": ("Solid or Material Preview",),
        "view_rendered": ("light and the materials of F12",),
        "engine_use": ("F12 and animations",),
    }.items():
        tooltip = " ".join(getattr(bpy.ops.scfpf, name).get_rna_type().description.split())
        assert all(phrase in tooltip for phrase in phrases), name


def test_no_line_is_cut_off_by_the_sidebar(camera, addon):
    base, layout = addon("panels.base"), RecordingLayout()
    base.draw_text(layout, "The rig works only in Cycles: choose it as the Render Engine", "ERROR")
    lines = [*addon("panels.messages").ABSENT.values(), *(entry[1] for entry in layout.record)]
    assert max(map(len, lines)) <= base.LINE + 2


def test_parameters_of_the_active_surface_are_drawn(camera):
    for kind in ("PLANE", "CYLINDER", "SPHERE", "GRID", "UV_MESH", "POINT"):
        bpy.ops.scfpf.surface_add(kind=kind)
        labels = {entry[3] for entry in drawn(bpy.types.SCFPF_PT_view_surfaces) if entry[0] == "prop"}
        wanted = {
            "PLANE": {"Width", "Height"},
            "CYLINDER": {"Radius", "Arc", "Height"},
            "SPHERE": {"Radius", "Arc", "Latitude Start", "Latitude End"},
        }.get(kind, set())
        assert wanted <= labels, kind


def test_settings_of_the_camera_are_all_drawn(camera):
    names = set()
    for section in SECTIONS[1:]:
        record = drawn(getattr(bpy.types, f"SCFPF_PT_data{section}"))
        names |= {entry[2] for entry in record if entry[0] == "prop" and entry[1] == "SCFPF_CameraSettings"}
    hidden = {"name", "rna_type", "enabled", "surfaces", "active_surface", "volume_object"}
    hidden |= {"report", "statistics", "frame_sizes", "anchor_plan", "anchor_times"}
    hidden |= {"pick", "pick_t", "pick_distance", "pick_object", "edit_volume", "found_box", "found_object"}
    hidden |= {"mappings", "active_mapping", "blend_factor", "blend_ends", "blend_field"}
    # With Developer Extras.
    hidden |= {"iso_surfaces", "iso_t"}
    hidden |= {"blend_more", "active_blend"}
    hidden |= {"aim", "aim_targets", "active_aim", "layers", "active_layer", "layer_image"}
    hidden |= {"hidden_things", "active_hidden", "hidden_message"}
    # An operator switches it, which also looks through the camera.
    hidden |= {"show_live"}
    assert names == set(camera.scfpf.bl_rna.properties.keys()) - hidden


def test_main_section_without_a_camera_with_an_ordinary_and_with_a_flexible_one():
    main = bpy.types.SCFPF_PT_view
    assert ("operator", "scfpf.camera_add") in drawn(main)
    bpy.ops.object.camera_add()
    record = drawn(main)
    assert ("operator", "scfpf.camera_toggle") in record and ("operator", "scfpf.render") not in record
    for section, operator in (("aim", "aim_view_add"), ("layers", "layer_add")):
        panel = getattr(bpy.types, f"SCFPF_PT_view_{section}")
        assert panel.poll(bpy.context) and ("operator", f"scfpf.{operator}") in drawn(panel)
    assert not bpy.types.SCFPF_PT_view_surfaces.poll(bpy.context)
    bpy.ops.scfpf.camera_toggle()
    record = drawn(main)
    assert ("operator", "scfpf.render") in record
    assert ("operator", "scfpf.result_show") not in record


def test_fit_is_offered_while_the_resolution_has_another_shape(camera):
    assert ("operator", "scfpf.volume_fit_picture") not in drawn(bpy.types.SCFPF_PT_view)
    bpy.context.scene.render.resolution_x = 500
    assert ("operator", "scfpf.volume_fit_picture") in drawn(bpy.types.SCFPF_PT_view)
    bpy.ops.scfpf.volume_fit_picture()
    assert ("operator", "scfpf.volume_fit_picture") not in drawn(bpy.types.SCFPF_PT_view)


def test_report_and_picture_are_offered_after_a_render(camera):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = 32, 18
    bpy.ops.scfpf.render()
    record = drawn(bpy.types.SCFPF_PT_view)
    assert ("operator", "scfpf.result_show") in record
    assert "32×18" in texts(record) and " s" in texts(record) and "rays" not in texts(record)
    for place in ("data", "view"):
        statistics = getattr(bpy.types, f"SCFPF_PT_{place}_statistics")
        assert statistics.bl_parent_id == f"SCFPF_PT_{place}" and "DEFAULT_CLOSED" in statistics.bl_options
        told = texts(drawn(statistics))
        assert "rays" in told and "projector" in told and "memory" in told and "32×18" not in told


def test_statistics_are_for_developer_extras_after_a_render(camera):
    view, panel = bpy.context.preferences.view, bpy.types.SCFPF_PT_view_statistics
    camera.scfpf.statistics = "1 rays"
    assert not panel.poll(bpy.context)
    view.show_developer_ui = True
    try:
        assert panel.poll(bpy.context)
        camera.scfpf.statistics = ""
        assert not panel.poll(bpy.context)
        assert {"iso_surfaces", "iso_t"} <= {
            entry[2] for entry in drawn(bpy.types.SCFPF_PT_view_display) if entry[0] == "prop"
        }
    finally:
        view.show_developer_ui = False


def test_messages_have_a_place_of_one_height_and_a_popover_has_all(camera):
    """Whatever is wrong, the panel has as many lines: what is below the messages stays where it is."""
    main, scene = bpy.types.SCFPF_PT_view, bpy.context.scene

    def lines():
        record = drawn(main)
        menu = record.index(("menu", "SCFPF_MT_presets"))
        found = record[menu + 1 :]
        # A button and the popover share a row.
        return len(found) - (len(found) == 4)

    assert lines() == 3 and "Straight so far" in texts(drawn(main))
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert lines() == 3 and "Straight so far" not in texts(drawn(main))
    scene.render.resolution_x = 500
    assert lines() == 3 and ("operator", "scfpf.volume_fit_picture") in drawn(main)
    bpy.data.objects.remove(camera.scfpf.surfaces[0].object)
    assert lines() == 3 and "deleted" in texts(drawn(main))
    assert ("popover", "SCFPF_PT_messages") in drawn(main)
    every = drawn(bpy.types.SCFPF_PT_messages)
    assert ("operator", "scfpf.volume_fit_picture") in every and "deleted" in texts(every)


def test_a_popover_is_never_empty(addon, camera, monkeypatch):
    """That everything is ready may be longer than its lines in another language."""
    module = addon("panels.messages")
    monkeypatch.setattr(module, "READY", "All is ready " * 20)
    bpy.context.scene.render.engine = "SCFPF"
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert ("popover", "SCFPF_PT_messages") in drawn(bpy.types.SCFPF_PT_view)
    assert texts(drawn(bpy.types.SCFPF_PT_messages)).count("ready") > 15


def test_a_hint_goes_when_it_is_not_true(camera):
    """A view of Aim or a layer makes the picture another one, as a surface does."""
    for kind in ("aim_targets", "layers", "mappings"):
        items = getattr(camera.scfpf, kind)
        assert "Straight so far" in texts(drawn(bpy.types.SCFPF_PT_view))
        items.add()
        assert "Straight so far" not in texts(drawn(bpy.types.SCFPF_PT_view)), kind
        items.clear()


def test_edit_volume_says_what_comes_next(camera):
    main = bpy.types.SCFPF_PT_view
    bpy.ops.scfpf.edit_volume()
    said = texts(drawn(main))
    assert "press G, R or S" in said.replace("  ", " ") and "Straight so far" not in said
    bpy.ops.scfpf.edit_volume()
    said = texts(drawn(main))
    assert "press G, R or S" not in said and "Straight so far" in said


def test_the_menu_of_surfaces_has_four_kinds_and_the_rest_under_more(addon, camera):
    first = drawn(bpy.types.SCFPF_MT_surface_add)
    more = drawn(bpy.types.SCFPF_MT_surface_add_more)
    assert first == [("operator", "scfpf.surface_add")] * 4 + [("menu", "SCFPF_MT_surface_add_more")]
    assert len(more) == len(addon("bridge.surfaces.kinds").BLENDER_KINDS) - 4


def test_the_tab_of_the_sidebar_has_the_name_of_the_panel():
    names = [name for name in dir(bpy.types) if name.startswith("SCFPF_PT_view")]
    assert len(names) > 6
    assert {getattr(bpy.types, name).bl_category for name in names} == {"Flexible Projection"}


def test_progress_replaces_the_button_while_a_render_runs(addon, camera):
    jobs = addon("bridge.render.render_job")
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 2048
    camera.scfpf.samples = 64
    job = jobs.start(
        addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    )
    try:
        record = drawn(bpy.types.SCFPF_PT_view)
        job.cancel()
        cancelling = drawn(bpy.types.SCFPF_PT_view)
    finally:
        jobs.stop()
    assert ("operator", "scfpf.render_cancel") in record and ("operator", "scfpf.render") not in record
    assert any(entry[0] == "progress" and entry[1].startswith("Rendering") for entry in record)
    assert ("progress", "Canceling") in cancelling


def test_what_is_missing_is_said(camera):
    main = bpy.types.SCFPF_PT_view
    bpy.context.scene.render.engine = "SCFPF"
    assert texts(drawn(main)).startswith(f"{camera.name} In Viewports With F12 Straight so far:")
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert texts(drawn(main)).startswith(f"{camera.name} In Viewports With F12 Ready:")
    bpy.ops.scfpf.surface_remove()
    camera.scfpf.active_surface = 0
    bpy.data.objects.remove(camera.scfpf.surfaces[0].object)
    assert "deleted" in texts(drawn(main))
    assert "Remove it" in texts(drawn(bpy.types.SCFPF_PT_view_surfaces))
    bpy.ops.scfpf.surface_remove()
    assert "two control surfaces" in texts(drawn(main))


def test_preferences_say_where_to_begin(addon):
    """The labels name menus, panels and tabs that are there."""
    entry = addon("panels.menus").SCFPF_Preferences
    text = texts(drawn(entry))
    for operator in ("camera_add", "tutorial_scene"):
        assert getattr(bpy.ops.scfpf, operator).get_rna_type().name.removeprefix("Add ") in text
    for panel in (bpy.types.SCFPF_PT_view, bpy.types.SCFPF_PT_data):
        assert panel.bl_label in text
    assert f"tab {bpy.types.SCFPF_PT_view.bl_category}" in text
    assert entry.bl_idname in bpy.context.preferences.addons


def test_surfaces_of_another_scene_are_not_said_to_be_deleted(camera):
    surface, scene = camera.scfpf.surfaces[0].object, bpy.context.scene
    scene.collection.objects.unlink(surface)
    bpy.data.collections.new("Assets").objects.link(surface)
    assert "A control surface is in no scene" in texts(drawn(bpy.types.SCFPF_PT_view))
    bpy.data.scenes.new("Other").collection.objects.link(surface)
    assert "A control surface is in another scene" in texts(drawn(bpy.types.SCFPF_PT_view))
    assert "Link it to the scene" in texts(drawn(bpy.types.SCFPF_PT_view_surfaces))
    layout = RecordingLayout()
    slots = camera.scfpf
    bpy.types.SCFPF_UL_surfaces.draw_item(
        None, bpy.context, layout, slots, slots.surfaces[0], 0, slots, "active_surface", 0
    )
    assert texts(layout.record) == f"{surface.name} (in another scene)"


def test_surface_whose_node_group_is_gone_is_said_and_the_rest_drawn(camera):
    camera.scfpf.surfaces[0].object.modifiers.clear()
    assert "node group" in texts(drawn(bpy.types.SCFPF_PT_view_surfaces))


def test_list_items_are_named_marked_and_selectable(camera):
    kind = bpy.types.SCFPF_UL_surfaces
    camera.scfpf.surfaces[0].object.name = "Lens"
    slots = camera.scfpf.surfaces
    layout = RecordingLayout()
    for index, slot in enumerate(slots):
        kind.draw_item(
            None, bpy.context, layout, camera.scfpf, slot, 0, camera.scfpf, "active_surface", index
        )
    assert texts(layout.record) == "Near", "the near end is marked, and the far one by its own name"
    assert layout.record.count(("operator", "scfpf.surface_select")) == 2


@pytest.mark.parametrize(
    "menu",
    ["SCFPF_MT_surface_add", "SCFPF_MT_presets", "SCFPF_MT_camera_add_preset", "SCFPF_MT_surface_specials"],
)
def test_menus_draw_what_exists(camera, menu):
    assert drawn(getattr(bpy.types, menu))


@pytest.mark.parametrize(
    ("menu", "operator"),
    [("SCFPF_MT_presets", "scfpf.preset_apply"), ("SCFPF_MT_camera_add_preset", "scfpf.camera_add")],
)
def test_every_preset_is_in_one_group_of_few(addon, menu, operator):
    groups = addon("operators.camera.presets").preset_groups()
    menus = [entry[1] for entry in drawn(getattr(bpy.types, menu)) if entry[0] == "menu"]
    menus = [name for name in menus if name != "SCFPF_MT_presets_own"]
    assert [getattr(bpy.types, name).bl_label for name in menus] == [group for group, _items in groups]
    for name, (_group, items) in zip(menus, groups, strict=True):
        assert drawn(getattr(bpy.types, name)) == [("operator", operator)] * len(items)
        assert len(items) <= 10
    listed = [identifier for _group, items in groups for identifier, _name, _description in items]
    assert sorted(listed) == sorted(
        path.stem for path in addon("operators.camera.presets").FOLDER.glob("*.json")
    )


def test_add_menus_have_our_entries(addon):
    menus = addon("panels.menus")
    for menu, entries in (
        ("VIEW3D_MT_camera_add", menus._camera_entries),
        ("VIEW3D_MT_add", menus._surface_entries),
    ):
        assert entries in getattr(bpy.types, menu)._dyn_ui_initialize()
        fake = FakePanel(menus.SCFPF_MT_surface_add)
        entries(fake, bpy.context)
        assert fake.layout.record


def test_panels_show_for_a_camera_and_the_sidebar_always(camera):
    data, view = bpy.types.SCFPF_PT_data, bpy.types.SCFPF_PT_view
    with bpy.context.temp_override(object=camera, camera=camera.data):
        assert data.poll(bpy.context) and bpy.types.SCFPF_PT_data_surfaces.poll(bpy.context)
    other = bpy.data.cameras.new("Pinned")
    with bpy.context.temp_override(object=camera, camera=other):
        assert not data.poll(bpy.context), "a pinned camera's data with another object beside it"
    assert view.poll(bpy.context) and bpy.types.SCFPF_PT_view_surfaces.poll(bpy.context)
    camera.scfpf.enabled = False
    assert not bpy.types.SCFPF_PT_view_surfaces.poll(bpy.context)


def test_every_operator_has_a_description_and_every_property_too():
    for name in dir(bpy.ops.scfpf):
        rna = getattr(bpy.ops.scfpf, name).get_rna_type()
        assert rna.description, name
        for prop in rna.properties:
            if prop.identifier not in {"rna_type", "filter_glob"}:
                assert prop.description, f"{name}.{prop.identifier}"


def test_shared_surfaces_are_said_and_a_button_parts_them(camera):
    assert "shared" not in texts(drawn(bpy.types.SCFPF_PT_data))
    bpy.ops.object.duplicate()
    bpy.context.view_layer.update()
    record = drawn(bpy.types.SCFPF_PT_data)
    assert f"Surfaces shared with '{camera.name}'" in texts(record)
    assert ("operator", "scfpf.volume_single_user") in record
    bpy.ops.scfpf.volume_single_user()
    bpy.context.view_layer.update()
    assert "shared" not in texts(drawn(bpy.types.SCFPF_PT_data))


@pytest.mark.usefixtures("built_groups")
def test_the_cycles_section_tells_what_chords_cost_and_what_is_in_the_way(addon, camera):
    section = bpy.types.SCFPF_PT_view_cycles
    bpy.ops.scfpf.preset_apply(preset="nonlinear_twist")
    bpy.context.view_layer.update()
    assert not section.poll(bpy.context), "the button Cycles is its only place before"
    prices, depsgraph = addon("cycles.prices"), bpy.context.evaluated_depsgraph_get()
    known = prices.compute(camera, bpy.context.scene, depsgraph)
    bpy.ops.scfpf.cycles_rig()
    assert section.poll(bpy.context)
    told = texts(drawn(section))
    assert "chord" not in told and "portals" not in told and "× an ordinary camera" in told
    view = bpy.context.preferences.view
    view.show_developer_ui = True
    try:
        assert " chords, off by 0.0" in texts(drawn(section))
    finally:
        view.show_developer_ui = False
    # The price that is shown before is that of the rig.
    rig = addon("cycles.rig_data").rig_of(bpy.context.scene)
    there = addon("cycles.prices").price_of_rig(rig)
    assert 0 < there.passed < known.portals
    assert known == there._replace(error=known.error, passed=0.0, vertices=known.vertices)
    assert there.error == pytest.approx(known.error, rel=1e-6)
    assert ("operator", "scfpf.cycles_render") in drawn(section)
    assert ("operator", "scfpf.cycles_passes") in drawn(section)
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    assert "works only in Cycles" in texts(drawn(section))


def test_a_blend_shows_what_it_goes_between_and_how_to_look_again(camera):
    main = bpy.types.SCFPF_PT_data_blend
    assert drawn(main) == [("operator", "scfpf.camera_blend"), ("menu", "SCFPF_MT_blend_presets")]
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    record = drawn(main)
    shown = [entry[2] for entry in record if entry[0] == "prop"]
    assert shown[shown.index("blend_factor") :][:3] == ["blend_factor", "first", "second"]
    assert any("To the preset Orthographic" in str(entry) for entry in record)
    assert any("scfpf.blend_update" in str(entry) for entry in record)
    assert ("list", "SCFPF_UL_blend") not in record
    bpy.context.object.scfpf.blend_more.add().camera = camera
    record = drawn(main)
    assert ("list", "SCFPF_UL_blend") in record and ("operator", "scfpf.blend_camera_remove") in record
    assert [entry[1] for entry in record].count("scfpf.blend_map") == 2


def test_a_blend_shows_the_settings_of_its_map(camera):
    main = bpy.types.SCFPF_PT_data_blend
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    field = bpy.context.object.scfpf.blend_field
    wanted = {
        "NONE": set(),
        "LINEAR": {"center", "angle", "border", "is_inverted"},
        "RADIAL": {"center", "size", "border", "is_inverted"},
        "RECTANGLE": {"center", "size", "angle", "border", "is_inverted"},
        "IMAGE": {"is_sharp", "is_inverted"},
        "VIEWS": {"border", "is_inverted"},
    }
    view = bpy.data.objects["Flexible Camera"]
    view.scfpf.aim_targets.add()
    bpy.context.object.scfpf.blend_ends.second = view
    for kind, names in wanted.items():
        assert bpy.ops.scfpf.blend_map(kind=kind) == {"FINISHED"}
        record = drawn(main)
        assert {entry[2] for entry in record if entry[0] == "prop" and entry[1] == "SCFPF_BlendMap"} == names
        assert "makes it finer" not in texts(record), kind
    field.kind, field.border = "LINEAR", 0.0
    assert bpy.ops.scfpf.blend_map(kind="NONE") == {"FINISHED"}
    field.kind = "LINEAR"
    assert "makes it finer" in texts(drawn(main))
    assert bpy.ops.scfpf.blend_update() == {"FINISHED"}
    assert "makes it finer" not in texts(drawn(main))
    field.border = 0.3
    for frame, x in ((1, 0.3), (4, 0.6)):
        field.center = x, 0.5
        field.keyframe_insert("center", frame=frame)
    assert "act once baked" in texts(drawn(main))
    assert bpy.ops.scfpf.blend_map_bake(start=1, end=4) == {"FINISHED"}
    record = drawn(main)
    assert "act once baked" not in texts(record) and "scfpf.blend_map_bake" in str(record)


class Column:
    """A layout that records its items: (item, height in rows)."""

    def __init__(self, items):
        self.items, self.scale_y = items, 1.0

    def row(self):
        return Column(self.items)

    column = row

    def template_icon(self, icon_value, scale):
        self.items.append(("picture", scale))

    def operator(self, _operator, text, **_options):
        self.items.append(("name", self.scale_y))
        return types.SimpleNamespace()


def test_preset_menus_fit_a_small_screen(addon):
    """Images stand in one column and names in the next, equally high; otherwise a menu drifts aside."""
    for _group, entries in addon("operators.camera.presets").preset_groups():
        items = []
        addon("panels.thumbnails").draw_entries(
            Column(items), "scfpf.preset_apply", entries, lambda _preset: 1
        )
        what, heights = zip(*items, strict=True)
        assert what == ("picture",) * len(entries) + ("name",) * len(entries)
        pictures, names = np.split(np.array(heights), 2)
        assert (pictures == names).all() and pictures.min() >= 1.5 * 2.4
        # A row is 20 pixels high, and 2 pixels are between two; the title and the borders are two rows.
        assert (20 * pictures + 2).sum() + 40 < 1000 - 200


def test_blenders_panel_of_the_lens_says_what_it_is_for(addon):
    """Only the panel of a flexible camera says it, not that of other, pinned camera data."""
    bpy.ops.object.camera_add()
    camera = bpy.context.object
    pinned = bpy.data.cameras.new("Pinned")

    def said(data):
        record = []
        context = types.SimpleNamespace(object=camera, camera=data)
        panel = types.SimpleNamespace(layout=RecordingLayout(record))
        addon("panels.camera_panels")._lens_note(panel, context)
        return [entry for entry in record if entry[0] == "label"]

    assert not said(camera.data)
    bpy.ops.scfpf.camera_from_camera()
    assert "Pictures show the volume." in str(said(camera.data)) and not said(pinned)
