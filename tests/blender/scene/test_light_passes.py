# SPDX-License-Identifier: GPL-3.0-or-later
"""Light passes in Blender: their names, their sum in materials of nodes, and Cycles' own."""

import bpy
import numpy as np
import pytest
from engine_images import f12, passes, write_multilayer
from shown_materials import add, new_material, scene_with_camera, show

SIZE = 48
ROUNDING = 2e-6


def switch_on(view_layer):
    view_layer.scfpf.use_pass_diffuse = view_layer.scfpf.use_pass_specular = True
    view_layer.use_pass_emit = view_layer.use_pass_environment = view_layer.use_pass_shadow = True
    for name in ("z", "position", "normal"):
        setattr(view_layer, f"use_pass_{name}", False)


def parts_of(addon, made):
    """The light passes by the names of ``shading.passes``."""
    emission, environment = addon("bridge.blender.versions").light_pass_names()
    names = {"emission": emission, "environment": environment}
    names |= {name.lower(): name for name in ("Combined", "Diffuse", "Specular", "Shadow")}
    return {name: made[f"ViewLayer.{its}"] for name, its in names.items()}


def thing(kind, shader, location, **inputs):
    {"plane": bpy.ops.mesh.primitive_plane_add, "ball": bpy.ops.mesh.primitive_uv_sphere_add}[kind](
        location=location, **({"size": 6} if kind == "plane" else {"radius": 0.45})
    )
    bpy.ops.object.shade_smooth()
    material = new_material(shader)
    show(material.node_tree, add(material.node_tree, f"ShaderNode{shader}", **inputs).outputs[0])
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


@pytest.fixture
def still_life():
    """A matte ground, a mirror, a glass ball, a glowing ball and a veil, under a high lamp."""
    scene = scene_with_camera(SIZE)
    thing("plane", "BsdfPrincipled", (0, 0, -0.5), Base_Color=(0.7, 0.5, 0.3), Roughness=0.6)
    thing("ball", "BsdfGlossy", (-0.6, -0.5, 0), Color=(0.9, 0.9, 0.9), Roughness=0.0)
    thing("ball", "BsdfGlass", (0.6, -0.5, 0))
    thing("ball", "Emission", (-0.6, 0.6, 0), Color=(0.9, 0.3, 0.1), Strength=2.0)
    thing("ball", "BsdfPrincipled", (0.6, 0.6, 0), Base_Color=(0.2, 0.6, 0.3), Alpha=0.5)
    bpy.ops.object.light_add(type="POINT", location=(2, 1, 4))
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 600, 0.3
    scene.camera.scfpf.samples = 4
    return scene


def test_parts_of_nodes_add_up_to_the_image(addon, still_life, tmp_path):
    switch_on(still_life.view_layers[0])
    still_life.render.engine = "SCFPF"
    write_multilayer(still_life, tmp_path / "out")
    # A corner without a ground, to see the environment.
    still_life.camera.location.x += 1.5
    made = f12(still_life)
    parts = parts_of(addon, made)
    assert len(made) == len(parts) and parts["shadow"].shape[2] == 3
    names = ("diffuse", "specular", "emission", "environment")
    total = sum(parts[name] for name in names)
    picture = parts["combined"][..., :3]
    assert np.abs(total - picture).max() < ROUNDING * picture.max()
    assert all(parts[name].max() > 0.02 for name in names)
    assert parts["shadow"].min() == 0.0 and parts["shadow"].max() == 1.0
    switch = still_life.view_layers[0]
    switch.scfpf.use_pass_specular = switch.use_pass_shadow = False
    fewer = f12(still_life)
    assert len(fewer) == 4 and all(np.array_equal(values, made[name]) for name, values in fewer.items())
    still_life.render.film_transparent = True
    clear = parts_of_film(addon, f12(still_life))
    assert np.array_equal(clear, parts["environment"])


def parts_of_film(addon, made):
    return made["ViewLayer." + addon("bridge.blender.versions").light_pass_names()[1]]


def test_matte_glossy_and_glowing_objects_are_those_of_cycles(addon, tmp_path):
    """Cycles' light times its colour, its emission and its world."""
    scene = scene_with_camera(SIZE)
    plane = thing("plane", "BsdfDiffuse", (0, 0, -0.5), Color=(0.7, 0.5, 0.3))
    thing("ball", "BsdfGlossy", (-0.6, 0, 0), Color=(0.9, 0.7, 0.5), Roughness=0.5)
    # What is reflected belongs to the highlights here, and is another pass in Cycles.
    plane.visible_glossy = False
    glowing = thing("ball", "Emission", (0.6, 0, 0), Color=(0.9, 0.3, 0.1), Strength=2.0)
    # In Cycles it would be a lamp.
    glowing.active_material.cycles.emission_sampling = "NONE"
    glowing.visible_diffuse = glowing.visible_glossy = False
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.5, 0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 3, 0.0
    for node in scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0.0
    layer = scene.view_layers[0]
    switch_on(layer)
    for name in ("diffuse_direct", "diffuse_color", "glossy_direct", "glossy_color"):
        setattr(layer, f"use_pass_{name}", True)
    scene.render.engine = "SCFPF"
    write_multilayer(scene, tmp_path / "ours")
    ours = parts_of(addon, f12(scene))
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = 16, 0
    write_multilayer(scene, tmp_path / "cycles")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    made = passes(tmp_path / "cycles.exr")

    def theirs(*names):
        return next(made[f"ViewLayer.{name}"] for name in names if f"ViewLayer.{name}" in made)

    diffuse = theirs("Diffuse Direct", "DiffDir") * theirs("Diffuse Color", "DiffCol")
    glossy = theirs("Glossy Direct", "GlossDir") * theirs("Glossy Color", "GlossCol")
    emission = theirs("Emission", "Emit")
    # Only edges of things and of shadows differ: Cycles looks at a pixel's middle.
    off = np.abs(ours["diffuse"] - diffuse).max(axis=2)
    assert np.quantile(off, 0.97) < 1e-3 * diffuse.max() and diffuse.max() > 0.3
    off = np.abs(ours["emission"] - emission).max(axis=2)
    assert np.quantile(off, 0.97) < 1e-4 and emission.max() == pytest.approx(1.8, rel=1e-3)
    assert glossy.max() > 0.3
    assert abs(ours["specular"].sum() / glossy.sum() - 1.0) < 0.03
    assert not ours["diffuse"][glossy.max(axis=2) > 0.01].any()
