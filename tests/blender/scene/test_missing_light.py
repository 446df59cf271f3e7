# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings about light that the engine lacks, against what Cycles adds; and each warning once a job."""

import bpy
import numpy as np
import pytest
from shown_materials import add, new_material, picture, scene_with_camera, show

GLOW, INDOORS = "Glowing materials light no other objects here, and", "Light does not bounce here"


def paint(kind, **inputs):
    material = new_material(kind)
    show(material.node_tree, add(material.node_tree, f"ShaderNode{kind}", **inputs).outputs[0])
    return material


def lamp(kind, power, place=(0, 0, 1.5)):
    made = bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind))
    made.data.energy, made.location = power, place
    bpy.context.scene.collection.objects.link(made)


def part(make, material, **where):
    make(**where)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def sky():
    tree = bpy.context.scene.world.node_tree
    return next(each for each in tree.nodes if each.type == "BACKGROUND")


def floor():
    return part(bpy.ops.mesh.primitive_plane_add, paint("BsdfDiffuse", Color=(0.7,) * 3), size=40)


def walls():
    return part(bpy.ops.mesh.primitive_cube_add, paint("BsdfDiffuse", Color=(0.7,) * 3), size=8)


def tube(strength):
    """A glowing bar over the floor."""
    glow = paint("Emission", Color=(1.0, 0.9, 0.8), Strength=strength)
    part(bpy.ops.mesh.primitive_cube_add, glow, size=1, location=(0, 0, 0.5), scale=(1, 0.1, 0.1))


def yard():
    floor()
    lamp("SUN", 3.0)


def room():
    walls()
    lamp("POINT", 200.0)


def sign_by_night():
    yard()
    bpy.data.lights["SUN"].energy = 0.05
    tube(20.0)


def sign_by_day():
    yard()
    tube(1.0)


def sign_under_the_sky():
    floor()
    sky().inputs["Color"].default_value = (10.0, 10.0, 10.0, 1.0)
    tube(0.5)


def night_lamp(**shade):
    """A glowing ball by night, within a shade if one is given."""
    yard()
    bpy.data.lights["SUN"].energy = 0.05
    glow = paint("Emission", Color=(1.0, 0.9, 0.8), Strength=40.0)
    part(bpy.ops.mesh.primitive_uv_sphere_add, glow, radius=0.2, location=(0, 0, 0.8))
    if shade:
        cover = paint("BsdfDiffuse", Color=(0.7,) * 3)
        part(bpy.ops.mesh.primitive_uv_sphere_add, cover, radius=0.3, location=(0, 0, 0.8), **shade)


def bare_lamp():
    night_lamp()


def shaded_lamp():
    """Of so many faces that they are not among the largest."""
    night_lamp(segments=256, ring_count=128)


def lamp_behind_a_wall():
    night_lamp()
    bpy.data.objects["Sphere"].location = (0, 4.0, 0.8)
    wall = paint("BsdfDiffuse", Color=(0.7,) * 3)
    part(bpy.ops.mesh.primitive_cube_add, wall, size=1, location=(0, 3.0, 2.0), scale=(30, 0.1, 4.0))


def glowing_dome():
    """A sky as a sphere, through which the sun shines."""
    yard()
    dome = part(bpy.ops.mesh.primitive_uv_sphere_add, paint("Emission", Strength=0.03), radius=100)
    dome.visible_shadow = False


# What is named in each scene.
SCENES = {
    yard: set(),
    room: {INDOORS},
    sign_by_night: {GLOW},
    sign_by_day: set(),
    sign_under_the_sky: set(),
    glowing_dome: set(),
    bare_lamp: {GLOW},
    shaded_lamp: set(),
    lamp_behind_a_wall: set(),
    walls: set(),
    floor: set(),
}


@pytest.fixture
def scene():
    """A scene whose camera looks down at its middle, in the dark."""
    made = scene_with_camera(24)
    camera = made.camera
    camera.location, camera.rotation_euler = (0, -3.0, 2.0), (0.9, 0.0, 0.0)
    sky().inputs["Color"].default_value = (0, 0, 0, 1)
    return made


@pytest.fixture
def named(addon):
    """The light that is named before the render."""
    prepare = addon("bridge.render.render_inputs").prepare

    def of_scene(scene):
        lines = [str(line) for line in prepare(scene, bpy.context.view_layer, scene.camera).scene.warnings]
        return {text for text in (GLOW, INDOORS) for line in lines if line.startswith(text)}

    return of_scene


@pytest.mark.parametrize("make", SCENES)
def test_light_is_named_where_cycles_adds_much_of_it(make, scene, named, tmp_path):
    """Cycles' light on what does not glow is at least a tenth more there, and hardly more elsewhere."""
    make()
    scene.scfpf_sampling.world_shadows = True
    assert named(scene) == SCENES[make]
    scene.camera.scfpf.samples, scene.cycles.samples = 8, 64
    scene.cycles.sample_clamp_indirect = 0.0
    ours, cycles = (picture(scene, engine, tmp_path)[..., :3].mean(axis=2) for engine in ("SCFPF", "CYCLES"))
    glowing = np.isclose(ours, cycles, rtol=1e-3) & (ours > 0.0)
    more = (cycles - ours)[~glowing].sum() / max(cycles[~glowing].sum(), 1e-9)
    print(make.__name__, more)
    assert (more > 0.1) == bool(SCENES[make])


def test_bounces_that_are_off_are_not_missed(scene, named):
    room()
    for name in ("diffuse_bounces", "max_bounces"):
        before = getattr(scene.cycles, name)
        setattr(scene.cycles, name, 0)
        assert named(scene) == set()
        setattr(scene.cycles, name, before)
    scene.scfpf_drawn.use_drawn = True
    assert named(scene) == set(), "drawn"


def test_an_animation_says_each_warning_once_and_new_ones_when_they_come(scene, capfd, tmp_path):
    room()
    scene.frame_start, scene.frame_end, scene.render.engine = 1, 3, "SCFPF"
    scene.render.resolution_percentage, scene.render.filepath = 30, str(tmp_path / "frame")
    shader = add(bpy.data.materials[0].node_tree, "ShaderNodeBsdfPrincipled")
    show(bpy.data.materials[0].node_tree, shader.outputs[0])
    bpy.data.materials[0].node_tree.nodes[-1].is_active_output = True
    coat = shader.inputs["Coat Weight"]
    for frame, value in ((1, 0.0), (2, 0.5), (3, 0.5)):
        coat.default_value = value
        coat.keyframe_insert("default_value", frame=frame)
    for _ in range(2):
        capfd.readouterr()
        assert bpy.ops.render.render(animation=True) == {"FINISHED"}
        told = "".join(capfd.readouterr())
        assert told.count(INDOORS) == told.count("Coat Weight") == 1
        assert told.index(INDOORS) < told.index("Coat Weight")
