# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of lamps, worlds, layers and the film against Cycles: the same light, or a warning."""

import bpy
import numpy as np
import pytest
from engine_images import f12
from shown_materials import add, both, new_material, scene_with_camera, show

SIZE, BLOCK = 24, 6
# The noise that so few samples leave in the mean, and in blocks of pixels, which a beam's edge may cross.
SAMPLES, MEAN, IN_BLOCKS = 128, 0.015, 0.08
# Only so bright are blocks compared by share.
DARK = 0.1
# What Cycles' fit of the Blackbody and what the world is hidden by make.
BLACKBODY, HIDDEN = 0.02, 0.03


@pytest.fixture
def stage():
    """A matte ground and a cube in the dark, seen from above; Cycles with direct light alone."""
    scene = scene_with_camera(SIZE)
    scene.camera.scfpf.samples = 64
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.filter_width = SAMPLES, 0, 1.5
    shine(scene.world, (0.0, 0.0, 0.0))
    matt = colored((0.8, 0.7, 0.6))
    for thing in (lambda: bpy.ops.mesh.primitive_plane_add(size=4), cube):
        thing()
        bpy.context.object.data.materials.append(matt)
    return scene


def cube():
    bpy.ops.mesh.primitive_cube_add(size=0.4, location=(0.3, 0.2, 0.2))


def colored(color, kind="BsdfDiffuse"):
    material = new_material()
    show(material.node_tree, add(material.node_tree, f"ShaderNode{kind}", Color=color).outputs[0])
    return material


def shine(world, color):
    if world.node_tree is None:
        world.use_nodes = True
    background = next(each for each in world.node_tree.nodes if each.type == "BACKGROUND")
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (*color, 1.0), 1.0


def lamp(kind, scale=(1, 1, 1), height=1.5, energy=50.0, **settings):
    """A lamp above the ground, turned a little."""
    made = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", kind))
    made.location, made.rotation_euler, made.scale = (-0.3, 0.2, height), (0.1, -0.2, 0.3), scale
    for name, value in {"energy": energy, **settings}.items():
        setattr(made.data, name, value)
    bpy.context.scene.collection.objects.link(made)
    return made.data


def sun():
    return lamp("SUN", energy=2.0)


def blocks(picture):
    """Means of squares of BLOCK pixels."""
    many = SIZE // BLOCK
    return picture[..., :3].reshape(many, BLOCK, many, BLOCK, 3).mean(axis=(1, 3))


def assert_alike(scene, folder, mean=MEAN, in_blocks=IN_BLOCKS):
    ours, cycles = both(scene, folder)
    assert ours[..., 3].mean() == pytest.approx(cycles[..., 3].mean(), abs=0.005)
    ours, cycles = blocks(ours), blocks(cycles)
    assert ours.mean() == pytest.approx(cycles.mean(), rel=mean)
    off = np.abs(ours - cycles) / np.maximum(cycles, DARK * cycles.max())
    assert off.max() < in_blocks


LAMPS = {
    "spot, scaled unevenly": lambda: lamp("SPOT", (0.4, 1.6, 1.0), spot_size=1.0, spot_blend=0.3),
    "spot, flattened": lambda: lamp("SPOT", (1, 1, 0.5), spot_size=0.8, spot_blend=0.3),
    "point, flattened to nothing": lambda: lamp("POINT", (1, 0, 1)),
    "sun, flattened to nothing": lambda: lamp("SUN", (0, 1, 1), energy=2.0),
    "square, spread": lambda: lamp("AREA", spread=1.0, size=1.0),
    "rectangle, narrow": lambda: lamp("AREA", (2, 1, 1), spread=0.3, shape="RECTANGLE", size=0.6, size_y=0.8),
    "square, parallel": lambda: lamp("AREA", spread=0.0, size=1.0),
    "disc, spread": lambda: lamp("AREA", spread=1.0, shape="DISK", size=1.0),
    "ellipse, wide": lambda: lamp("AREA", spread=2.4, shape="ELLIPSE", size=1.2, size_y=0.6),
    "point, soft": lambda: lamp("POINT", height=0.8, shadow_soft_size=0.5),
    "point, hard": lambda: lamp("POINT", height=0.8, shadow_soft_size=0.5, use_soft_falloff=False),
    "point, hard, in the ground": lambda: lamp(
        "POINT", height=0.3, shadow_soft_size=0.8, use_soft_falloff=False
    ),
    "spot, hard": lambda: lamp(
        "SPOT", height=0.8, spot_size=1.4, shadow_soft_size=0.4, use_soft_falloff=False
    ),
}


@pytest.mark.parametrize("name", LAMPS)
def test_lamps_shine_as_in_cycles(stage, tmp_path, name):
    LAMPS[name]()
    assert_alike(stage, tmp_path)


def test_a_portal_gives_no_light(stage, tmp_path, read):
    sun()
    lamp("AREA").cycles.is_portal = True
    assert len(read().lights) == 1
    assert_alike(stage, tmp_path)


def emission(made):
    """The tree of a lamp and its Emission node."""
    if made.node_tree is None:
        made.use_nodes = True
    return made.node_tree, next(each for each in made.node_tree.nodes if each.type == "EMISSION")


def feed(made, socket, kind, output, settings=(), **inputs):
    """Link a new node to an input of a lamp's emission."""
    tree, shader = emission(made)
    node = add(tree, f"ShaderNode{kind}", settings, **inputs)
    tree.links.new(node.outputs[output], shader.inputs[socket])
    return tree, node


TINTS = {
    "Blackbody": lambda made: feed(made, "Color", "Blackbody", 0, Temperature=2700.0),
    "Math": lambda made: feed(made, "Strength", "Math", 0, {"operation": "MULTIPLY"}, _0=3.0, _1=0.5),
    "Light Falloff": lambda made: feed(made, "Strength", "LightFalloff", "Quadratic", Strength=2.0),
}


@pytest.mark.parametrize("name", TINTS)
def test_nodes_that_tint_lamps_do_as_in_cycles(stage, tmp_path, read, name):
    TINTS[name](lamp("POINT"))
    assert read().warnings == ()
    assert_alike(stage, tmp_path, BLACKBODY if name == "Blackbody" else MEAN)


def test_lamps_whose_light_is_uneven_are_named(stage, read):
    tree, checker = feed(lamp("SPOT"), "Color", "TexChecker", "Color")
    tree.links.new(add(tree, "ShaderNodeNewGeometry").outputs["Incoming"], checker.inputs["Vector"])
    bpy.data.objects["Lamp"].name = "Gobo"
    feed(lamp("POINT"), "Strength", "LightFalloff", "Constant", Strength=2.0)
    smooth = lamp("POINT")
    feed(smooth, "Strength", "LightFalloff", "Quadratic", Smooth=1.0)
    uneven, falloff = read().warnings
    assert "direction or distance" in uneven and uneven.endswith("(in Gobo)")
    assert falloff == "Not shown as it is: Light Falloff (in Lamp, Lamp.001)"


@pytest.mark.parametrize("transparent", [False, True])
def test_a_layer_without_environment_has_none(stage, tmp_path, transparent):
    sun()
    shine(stage.world, (0.5, 0.6, 0.8))
    stage.render.film_transparent = transparent
    bpy.context.view_layer.use_sky = False
    assert_alike(stage, tmp_path)


def test_a_layer_without_surfaces_shows_the_world_alone(addon, stage, tmp_path, read_render):
    shine(stage.world, (0.5, 0.6, 0.8))
    bpy.context.view_layer.use_solid = False
    assert_alike(stage, tmp_path)
    with pytest.raises(addon("projection.user_error").UserError, match="Surfaces"):
        read_render()


def test_hair_that_a_layer_leaves_out_is_not_missed(stage, read):
    volume = bpy.data.objects.new("Fog", bpy.data.volumes.new("Fog"))
    stage.collection.objects.link(volume)
    sun()
    assert any("Fog" in line for line in read().warnings)
    bpy.context.view_layer.use_volumes = False
    assert read().warnings == ()


def test_a_layers_material_takes_the_place_of_all(stage, tmp_path, read):
    sun()
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(-0.4, -0.3, 0.2))
    bpy.context.view_layer.material_override = colored((0.1, 0.7, 0.2))
    assert read().material_names == ("default_surface", "Material.001")
    assert_alike(stage, tmp_path)


def test_a_layers_world_takes_the_place_of_the_scenes(stage, tmp_path):
    sun()
    shine(stage.world, (0.1, 0.2, 0.9))
    other = bpy.data.worlds.new("Other")
    shine(other, (0.2, 0.05, 0.02))
    bpy.context.view_layer.world_override = other
    # The cube hides a part of Cycles' world.
    assert_alike(stage, tmp_path, HIDDEN)


@pytest.mark.parametrize("adaptive", [False, True])
def test_the_films_exposure_brightens_images_and_passes_of_light(stage, tmp_path, adaptive):
    sun()
    shine(stage.world, (0.05, 0.06, 0.08))
    stage.camera.scfpf.samples, stage.scfpf_sampling.use_adaptive = 16, adaptive
    stage.cycles.film_exposure = 3.0
    assert_alike(stage, tmp_path, HIDDEN, 3 * IN_BLOCKS)
    layer = bpy.context.view_layer
    layer.scfpf.use_pass_diffuse = layer.use_pass_environment = layer.use_pass_shadow = True
    layer.use_pass_z = True
    made = []
    for exposure in (1.0, 3.0):
        stage.cycles.film_exposure = exposure
        stage.render.engine, stage.render.filepath = "SCFPF", str(tmp_path / "SCFPF")
        made.append({name.split(".", 1)[1]: values for name, values in f12(stage).items()})
    plain, bright = made
    assert np.allclose(bright["Combined"][..., :3], 3 * plain["Combined"][..., :3], rtol=1e-6)
    assert np.array_equal(bright["Combined"][..., 3], plain["Combined"][..., 3])
    for name, values in plain.items():
        if name != "Combined":
            scale = 1.0 if name in {"Shadow", "Depth"} else 3.0
            assert np.allclose(bright[name], scale * values, rtol=1e-6), name


def test_layers_may_be_without_motion_blur(addon, stage):
    sun()
    moved = bpy.data.objects["Cube"]
    for frame in (0, 2):
        moved.location.z = frame
        moved.keyframe_insert("location", frame=frame)
    stage.render.use_motion_blur = True
    layer = bpy.context.view_layer
    assert addon("bridge.render.render_inputs").prepare(stage, layer, stage.camera).moments
    layer.use_motion_blur = False
    assert addon("bridge.render.render_inputs").prepare(stage, layer, stage.camera).moments == ()


def gradient(world):
    """Make a world vary by direction."""
    tree = world.node_tree
    background = next(each for each in tree.nodes if each.type == "BACKGROUND")
    place = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    shades = add(tree, "ShaderNodeTexGradient", Vector=place)
    tree.links.new(shades.outputs["Color"], background.inputs["Color"])


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("transparent", [False, True])
def test_a_world_can_be_hidden_from_the_camera(stage, tmp_path, read, even, transparent):
    """It is visible in mirrors and glass, and through transparent surfaces where the film is black."""
    shine(stage.world, (0.5, 0.6, 0.8))
    stage.world.cycles.sampling_method = "NONE"
    if not even:
        gradient(stage.world)
    stage.cycles.max_bounces, stage.cycles.diffuse_bounces, stage.render.film_transparent = 4, 0, transparent
    bpy.ops.mesh.primitive_plane_add(size=0.8, location=(-0.8, -0.7, -0.3))
    bpy.context.object.data.materials.append(colored((0.5, 0.7, 0.6), "BsdfTransparent"))
    mirror = new_material()
    glossy = add(mirror.node_tree, "ShaderNodeBsdfGlossy", Color=(0.9, 0.8, 0.7), Roughness=0.0)
    show(mirror.node_tree, glossy.outputs[0])
    bpy.data.objects["Cube"].data.materials[0] = mirror
    # Nothing hides the world from the ground: an even one is not hidden by anything here.
    bpy.data.objects["Plane"].scale, bpy.data.objects["Cube"].location = (0.3, 0.3, 1), (0.8, 0.7, -0.3)
    stage.world.cycles_visibility.camera = False
    assert not any("Ray Visibility" in line for line in read().warnings)
    assert_alike(stage, tmp_path, HIDDEN, 2 * IN_BLOCKS)


def test_settings_of_a_world_besides_its_surface_are_named(stage, read):
    shine(stage.world, (0.5, 0.6, 0.8))
    gradient(stage.world)
    assert read().warnings == ()
    stage.world.cycles_visibility.diffuse = False
    tree = stage.world.node_tree
    scatter = add(tree, "ShaderNodeVolumeScatter")
    output = next(each for each in tree.nodes if each.type == "OUTPUT_WORLD")
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    rays, volume = read().warnings
    assert "Ray Visibility" in rays and "Volume" in volume
    bpy.context.view_layer.use_sky = False
    assert read().warnings == ()


def test_settings_for_cycles_that_change_images_are_named(stage, read_render):
    sun()
    assert read_render().warnings == ()
    cycles, render = stage.cycles, stage.render
    cycles.sample_clamp_direct = 1.0
    (line,) = read_render().warnings
    assert line.startswith("Not shown as it is: Clamping of Direct Light")
    cycles.film_transparent_glass, cycles.rolling_shutter_type, cycles.use_camera_cull = True, "TOP", True
    cycles.use_fast_gi, cycles.fast_gi_method = True, "REPLACE"
    assert read_render().warnings == (line,), "each of them is without effect"
    bpy.data.objects["Cube"].cycles.use_camera_cull = True
    render.film_transparent = render.use_motion_blur = render.use_simplify = True
    cycles.fast_gi_method = "ADD"
    words = "Direct Light", "Transparent Glass", "Rolling Shutter", "Culling", "Fast GI"
    found = read_render().warnings
    assert len(found) == len(words)
    assert all(word in text for word, text in zip(words, found, strict=True))


@pytest.mark.parametrize("clamp", [0.0, 1.0])
def test_clamping_limits_what_reflections_show_as_in_cycles(clamp, stage, tmp_path):
    """A mirror before a wall in bright sun, which is limited, and before a glow, which is seen directly."""
    mirror = colored((0.9, 0.9, 0.9), "BsdfGlossy")
    mirror.node_tree.nodes["Glossy BSDF"].inputs["Roughness"].default_value = 0.0
    for thing in bpy.data.objects:
        if thing.type == "MESH":
            thing.data.materials[0] = mirror
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    for place, made in ((-0.5, colored((0.8, 0.4, 0.2))), (0.5, colored((3.0, 6.0, 9.0), "Emission"))):
        bpy.ops.mesh.primitive_plane_add(size=1, location=(place, 0.8, 0.5), rotation=(np.pi / 2, 0, 0))
        bpy.context.object.data.materials.append(made)
    lamp("POINT", height=0.5, energy=80.0)
    camera = stage.camera
    camera.location, camera.rotation_euler = (0.0, -2.5, 1.2), (1.2, 0, 0)
    camera.scfpf.samples, stage.cycles.samples, stage.cycles.max_bounces = 16, 64, 2
    stage.cycles.diffuse_bounces, stage.cycles.sample_clamp_indirect = 0, clamp
    # In the middle the lamp's own highlight is on the mirror, which Cycles has none of.
    columns = np.r_[:8, 13:SIZE]
    ours, cycles = (image[: SIZE * 2 // 5, columns, :3] for image in both(stage, tmp_path))
    assert ours.mean(axis=(0, 1)) == pytest.approx(cycles.mean(axis=(0, 1)), rel=0.03)
    wall, glow = ours[:, :8].max(axis=(0, 1)), ours[:, 8:].max(axis=(0, 1))
    assert glow == pytest.approx([2.7, 5.4, 8.1], rel=0.02)
    assert wall.mean() == pytest.approx(1.0, abs=0.06) if clamp else wall.mean() > 1.5


def test_a_scene_that_only_glowing_objects_light_is_named(stage, read):
    def dark():
        return [line for line in read().warnings if line.startswith("Nothing lights the scene")]

    assert not dark(), "in Cycles it is as black"
    glow = colored((1.0, 0.8, 0.6), "Emission")
    bpy.data.objects["Cube"].data.materials[0] = glow
    assert len(dark()) == 1
    principled = new_material()
    node = add(principled.node_tree, "ShaderNodeBsdfPrincipled", Emission_Strength=2.0, Alpha=0.5)
    show(principled.node_tree, node.outputs[0])
    bpy.data.objects["Cube"].data.materials[0] = principled
    assert len(dark()) == 1
    node.inputs["Emission Strength"].default_value = 0.0
    assert not dark()
    bpy.data.objects["Cube"].data.materials[0] = bpy.data.objects["Plane"].data.materials[0] = glow
    assert not dark(), "nothing is there to be lit"
    bpy.data.objects["Plane"].data.materials[0] = principled
    assert len(dark()) == 1
    lit = sun()
    assert not dark()
    lit.energy = 0.0
    assert len(dark()) == 1
    shine(stage.world, (0.1, 0.1, 0.1))
    assert not dark()
