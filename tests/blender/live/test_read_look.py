# SPDX-License-Identifier: GPL-3.0-or-later
"""Looks read from Blender: lights, colours, images, backgrounds and selection, as Blender has them."""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

# float32 in Blender.
CLOSE = 1e-6


@pytest.fixture
def shown(addon):
    """Read the scene's objects and its look: shown() is (objects, look, reader)."""
    look_module, objects_module = addon("bridge.live.read_look"), addon("bridge.live.live_objects")
    state = objects_module.LiveObjects(), look_module.LookReader()

    def read(overlay=None, **changes):
        objects, reader = state
        depsgraph = bpy.context.evaluated_depsgraph_get()
        shading = bpy.context.scene.display.shading
        for name, value in changes.items():
            setattr(shading, name, value)
        reader.mark_edited()
        objects.mark(None)
        objects.read(depsgraph)
        return objects, reader.read(objects, shading, overlay, depsgraph, bpy.context.scene.camera), reader

    return read


class Overlay:
    """The part of a viewport's overlays that is read."""

    show_overlays = True
    show_outline_selected = True


def cube(name, *materials, **settings):
    bpy.ops.mesh.primitive_cube_add()
    obj = bpy.context.object
    obj.name = name
    for material in materials:
        obj.data.materials.append(material)
    for key, value in settings.items():
        setattr(obj, key, value)
    return obj


def material(name, color, metallic=0.0, roughness=0.4):
    made = bpy.data.materials.new(name)
    made.diffuse_color, made.metallic, made.roughness = color, metallic, roughness
    return made


def row(objects, obj, slot=0):
    """The row of a slot of an object in the table of looks."""
    table = objects.table
    pairs = zip(table.look_object, table.look_slot, strict=True)
    return [(table.objects[number].uid, index) for number, index in pairs].index((obj.session_uid, slot))


def test_material_colours_are_those_of_viewport_display(shown):
    red, blue = material("red", (0.7, 0.1, 0.1, 0.5), 0.3, 0.6), material("blue", (0.1, 0.1, 0.9, 1.0))
    both, none, linked = cube("both", red, blue), cube("none"), cube("linked", red)
    linked.material_slots[0].link = "OBJECT"
    linked.material_slots[0].material = blue
    objects, look, _ = shown()
    surfaces = look.surfaces
    for obj, slot, expected in (
        (both, 0, (0.7, 0.1, 0.1, 0.5, 0.3, 0.6)),
        (both, 1, (0.1, 0.1, 0.9, 1.0, 0.0, 0.4)),
        (none, 0, (0.8, 0.8, 0.8, 1.0, 0.0, 0.4)),
        (linked, 0, (0.1, 0.1, 0.9, 1.0, 0.0, 0.4)),
    ):
        number = row(objects, obj, slot)
        found = *surfaces.color[:, number], *(getattr(surfaces, n)[number] for n in ("alpha", "metallic"))
        assert np.allclose((*found, surfaces.roughness[number]), expected, atol=CLOSE)
    assert not look.wants_uv and not look.wants_color


def test_object_single_and_attribute_colours(shown):
    green = material("green", (0.1, 0.6, 0.2, 1.0), 0.5, 0.9)
    plain, painted = cube("plain", green, color=(0.2, 0.4, 0.6, 0.8)), cube("painted", green)
    painted.data.color_attributes.new("Color", "BYTE_COLOR", "CORNER")
    objects, look, _ = shown(color_type="OBJECT")
    number = row(objects, plain)
    assert np.allclose(look.surfaces.color[:, number], (0.2, 0.4, 0.6), atol=CLOSE)
    assert look.surfaces.alpha[number] == np.float32(0.8) and look.surfaces.metallic[number] == 0
    objects, look, _ = shown(color_type="SINGLE", single_color=(0.3, 0.2, 0.1))
    assert np.allclose(look.surfaces.color.T, (0.3, 0.2, 0.1), atol=CLOSE)
    objects, look, _ = shown(color_type="VERTEX")
    assert look.wants_color
    assert look.surfaces.uses_attribute[[row(objects, plain), row(objects, painted)]].tolist() == [0, 1]
    assert np.allclose(look.surfaces.color[:, row(objects, plain)], (0.1, 0.6, 0.2), atol=CLOSE)


def test_random_colours_depend_on_the_name(shown, addon):
    """One hue a name, at Workbench's saturation and value; the same after another object is added."""
    made = [cube(f"thing {number}") for number in range(12)]
    objects, look, _ = shown(color_type="RANDOM")
    colors = look.surfaces.color.T[[row(objects, obj) for obj in made]]
    assert np.allclose(colors.max(axis=1), 0.8, atol=1e-5) and np.allclose(colors.min(axis=1), 0.4, atol=1e-5)
    assert len(np.unique(colors.round(4), axis=0)) == 12
    cube("another")
    objects, again, _ = shown()
    assert np.array_equal(again.surfaces.color.T[[row(objects, obj) for obj in made]], colors)


def textured(name, width, height, active=True):
    image = bpy.data.images.new(name, width, height, alpha=True)
    values = np.random.default_rng(1).random((height, width, 4)).astype(np.float32)
    values[..., 3] = 1.0
    image.pixels.foreach_set(values.ravel())
    image.update()
    image.pack()
    made = material(name, (0.5, 0.5, 0.5, 1.0))
    made.use_nodes = True
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image, node.extension, node.interpolation = image, "EXTEND", "Closest"
    if active:
        made.node_tree.nodes.active = node
    return made, image, node


def test_images_are_those_of_active_texture_nodes_at_reduced_size(shown):
    made, image, _ = textured("wide", 4096, 16)
    with_uv, without = cube("with", made), cube("without", made)
    while without.data.uv_layers:
        without.data.uv_layers.remove(without.data.uv_layers[0])
    objects, look, _ = shown(color_type="TEXTURE")
    assert look.wants_uv
    rows = look.surfaces.image[[row(objects, with_uv), row(objects, without)]]
    assert rows.tolist() == [0, -1]
    textures = look.textures
    assert (textures.width[0, 0], textures.height[0, 0]) == (1024, 4)
    assert textures.extension[0] == 1 and not textures.is_smooth[0]
    # Means of squares of 4 × 4, linear: within the steps of bytes and the bend of sRGB over noise.
    pixels = np.empty(4096 * 16 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    mean = pixels.reshape(4, 4, 1024, 4, 4).mean(axis=(1, 3))[..., :3]
    linear = np.where(mean <= 0.04045, mean / 12.92, ((mean + 0.055) / 1.055) ** 2.4)
    assert np.abs(textures.texels[: 4 * 1024, :3].reshape(4, 1024, 3) - linear).max() < 0.01


def test_material_preview_shows_base_colours_and_their_images(addon):
    """Nodes decide: the base colour of a Principled BSDF, or the image behind it; else Viewport Display."""
    by_image, _, node = textured("by image", 8, 8, active=False)
    principled = by_image.node_tree.nodes["Principled BSDF"]
    by_image.node_tree.links.new(node.outputs["Color"], principled.inputs["Base Color"])
    constant = material("constant", (0.9, 0.9, 0.9, 1.0))
    constant.use_nodes = True
    principled = constant.node_tree.nodes["Principled BSDF"]
    principled.inputs["Base Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    principled.inputs["Roughness"].default_value = 0.25
    first, second = cube("first", by_image), cube("second", constant)
    objects, reader = (
        addon("bridge.live.live_objects").LiveObjects(),
        addon("bridge.live.read_look").LookReader(),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    preview = SimpleNamespace(type="MATERIAL", show_specular_highlight=True)
    assert addon("bridge.live.read_look").wanted_attributes(preview) == (True, False)
    objects.read(depsgraph)
    look = reader.read(objects, preview, None, depsgraph)
    surfaces = look.surfaces
    assert surfaces.image[[row(objects, first), row(objects, second)]].tolist() == [0, -1]
    assert np.allclose(surfaces.color[:, row(objects, second)], (0.1, 0.2, 0.3), atol=CLOSE)
    assert surfaces.roughness[row(objects, second)] == 0.25
    assert look.wants_uv and look.light.direction.shape[1] > 0


def test_an_image_is_read_once_and_again_if_it_changes(shown, addon, monkeypatch):
    module = addon("bridge.live.live_images")
    count = []
    read = module.read_image
    monkeypatch.setattr(module, "read_image", lambda image: count.append(image.name) or read(image))
    made, image, _ = textured("image", 8, 8)
    cube("cube", made)
    *_, reader = shown(color_type="TEXTURE")
    for _ in range(3):
        _, look, _ = shown()
    serial = look.textures.serial
    assert len(count) == 1 and reader.is_complete
    image.pixels.foreach_set(np.zeros(256, np.float32))
    image.update()
    _, look, _ = shown()
    assert len(count) == 2 and look.textures.serial != serial
    assert look.textures.texels.max() == 0


def test_images_that_take_long_wait_for_further_calls(shown, addon, monkeypatch):
    monkeypatch.setattr(addon("bridge.live.live_images"), "PATIENCE", -1.0)
    made = [textured(f"image {number}", 8, 8)[0] for number in range(3)]
    things = [cube(each.name, each) for each in made]
    complete, seen = [], []
    for _ in range(3):
        objects, look, reader = shown(color_type="TEXTURE")
        complete.append(reader.is_complete)
        images = look.surfaces.image
        seen.append(sum(images[row(objects, thing)] >= 0 for thing in things))
    assert complete == [False, False, True] and seen == [1, 2, 3]


def test_studio_lights_are_those_of_the_preferences(shown):
    cube("cube")
    _, look, _ = shown(light="STUDIO")
    expected = [lamp for lamp in bpy.context.preferences.studio_lights["Default"].solid_lights if lamp.use]
    assert look.light.direction.shape == (3, len(expected))
    for number, lamp in enumerate(expected):
        assert np.allclose(look.light.direction[:, number], lamp.direction, atol=CLOSE)
        assert np.allclose(look.light.diffuse[:, number], lamp.diffuse_color, atol=CLOSE)
        assert np.allclose(look.light.specular[:, number], lamp.specular_color, atol=CLOSE)
        assert abs(look.light.wrap[number] - lamp.smooth) < CLOSE
    assert look.highlights and not shown(show_specular_highlight=False)[1].highlights
    assert shown(light="FLAT")[1].light is None


def test_lights_in_the_world_turn_about_the_vertical(shown):
    cube("cube")
    before = shown(light="STUDIO", use_world_space_lighting=True)[1].light
    after = shown(studiolight_rotate_z=math.pi / 2)[1].light
    assert before.in_world and after.in_world
    lamps = shown(use_world_space_lighting=False)[1].light.direction
    # The studio's up is the world's; a quarter turn takes x to -y and y to x.
    assert np.allclose(before.direction[2], lamps[1], atol=CLOSE)
    assert np.allclose(after.direction[0], before.direction[1], atol=CLOSE)
    assert np.allclose(after.direction[1], -before.direction[0], atol=CLOSE)


def test_a_matcap_leaves_no_image_behind(shown):
    """Without a window there is no graphics card to read it by: the studio light stays, and no datablock."""
    cube("cube")
    before = set(bpy.data.images.keys())
    _, look, reader = shown(light="MATCAP")
    assert look.light.direction.shape[0] == 3 and not reader.is_complete
    assert set(bpy.data.images.keys()) == before


def test_backgrounds(shown):
    cube("cube")
    world = bpy.context.scene.world = bpy.data.worlds.new("world")
    world.color = (1.0, 0.0, 0.214041)
    assert np.allclose(shown(background_type="WORLD")[1].background.color, (1, 0, 0.5), atol=1e-4)
    look = shown(background_type="VIEWPORT", background_color=(0.0, 0.214041, 1.0))[1]
    assert np.allclose(look.background.color, (0, 0.5, 1), atol=1e-4)
    look = shown(background_type="THEME")[1]
    gradients = bpy.context.preferences.themes[0].view_3d.space.gradients
    assert np.allclose(look.background.color, gradients.high_gradient, atol=CLOSE)


def test_outlines_follow_the_selection(shown):
    first, second, third = cube("first"), cube("second"), cube("third")
    for obj, selected in ((first, True), (second, True), (third, False)):
        obj.select_set(selected)
    bpy.context.view_layer.objects.active = second
    objects, look, _ = shown(Overlay)
    names = [key.name for key in objects.table.objects]
    states = dict(zip(names, look.overlays.states.tolist(), strict=True))
    assert states == {"first": 1, "second": 2, "third": 0}
    theme = bpy.context.preferences.themes[0].view_3d
    red = theme.object_selected[0]
    assert abs(look.overlays.selected[0] - ((red + 0.055) / 1.055) ** (2.4 / 2.2)) < 1e-5
    assert look.overlays.fold is not None
    assert shown(None)[1].overlays.states is None and shown(None)[1].overlays.fold is None


def test_an_instance_is_outlined_with_its_instancer(shown):
    collection = bpy.data.collections.new("parts")
    part = cube("part")
    collection.objects.link(part)
    empty = bpy.data.objects.new("instancer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(empty)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    empty.select_set(True)
    bpy.context.view_layer.objects.active = empty
    objects, look, _ = shown(Overlay)
    owners = [key.owner_name for key in objects.table.objects]
    assert sorted(owners) == ["instancer", "part"]
    assert look.overlays.states[owners.index("instancer")] == 2
    assert look.overlays.states[owners.index("part")] == 0


def test_the_key_changes_with_everything_that_is_shown(shown):
    made = material("made", (0.5, 0.5, 0.5, 1.0))
    thing = cube("thing", made)
    keys = {shown(Overlay)[1].key}
    assert shown(Overlay)[1].key in keys

    def changed(**settings):
        key = shown(Overlay, **settings)[1].key
        assert key not in keys, f"{settings} or what was done before it changes nothing"
        keys.add(key)

    made.diffuse_color = (0.5, 0.6, 0.5, 1.0)
    changed()
    thing.select_set(False)
    changed()
    for settings in (
        {"light": "FLAT"},
        {"light": "STUDIO", "show_specular_highlight": False},
        {"use_world_space_lighting": True},
        {"studiolight_rotate_z": 1.0},
        {"background_type": "VIEWPORT"},
        {"background_color": (0.1, 0.2, 0.3)},
        {"show_cavity": True},
        {"cavity_ridge_factor": 2.0},
        {"color_type": "RANDOM"},
    ):
        changed(**settings)


def test_axes_of_a_scaled_camera_have_unit_length(shown):
    cube("cube")
    data = bpy.data.cameras.new("camera")
    camera = bpy.context.scene.camera = bpy.data.objects.new("camera", data)
    bpy.context.scene.collection.objects.link(camera)
    camera.rotation_euler, camera.scale = (0.4, 0.7, 0.1), (2.0, 3.0, 4.0)
    bpy.context.view_layer.update()
    axes = shown()[1].camera_axes
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-5)
    assert np.allclose(axes, np.array(camera.rotation_euler.to_matrix()), atol=1e-5)


def test_viewports_of_two_kinds_do_not_read_materials_by_turns(shown, addon, monkeypatch):
    """Two viewports share a reader: each kind of color is read once as long as nothing is edited."""
    cube("first", material("red", (0.9, 0.1, 0.1, 1.0)))
    objects, _, reader = shown()
    module, asked = addon("bridge.live.read_look"), []
    read = module.read_material_looks

    def counted(uids, kind):
        asked.append((kind, len(uids)))
        return read(uids, kind)

    monkeypatch.setattr(module, "read_material_looks", counted)
    depsgraph, shading = bpy.context.evaluated_depsgraph_get(), bpy.context.scene.display.shading
    reader.mark_edited()
    for color_type in 3 * ("MATERIAL", "TEXTURE"):
        shading.color_type = color_type
        reader.read(objects, shading, None, depsgraph)
    assert asked == [("VIEWPORT", 1), ("TEXTURE", 1)]
    # Objects that come or move read no material anew; one that is new is read alone.
    second = cube("second", material("blue", (0.1, 0.1, 0.9, 1.0)))
    second.location.x = 2.0
    for _ in range(2):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        objects.mark(set())
        objects.read(depsgraph)
        look = reader.read(objects, shading, None, depsgraph)
        second.location.x = 3.0
    assert asked[2:] == [("TEXTURE", 1)]
    assert np.allclose(look.surfaces.color[:, row(objects, second)], (0.1, 0.1, 0.9), atol=CLOSE)
