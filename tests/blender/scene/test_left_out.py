# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a scene that are not read (hidden, broken, without faces, too many), and the warnings.

The notes on parts of materials that are shown otherwise than by Cycles.
"""

import math

import bpy
import numpy as np
import pytest
from shown_materials import add, emit, new_material, show, wavy_sheet
from small_scenes import corners, cube_mesh, link, shown, triangle_mesh, triangles_of


def collection(name, parent=None):
    made = bpy.data.collections.new(name)
    (parent or bpy.context.scene.collection).children.link(made)
    return made


def test_objects_hidden_in_renders_are_left_out(read, read_render):
    mesh = triangle_mesh()
    link("Shown", mesh)
    link("Hidden", mesh).hide_render = True
    unseen = link("Unseen", mesh)
    for ray in ("camera", "shadow", "glossy", "transmission"):
        setattr(unseen, f"visible_{ray}", False)
    link("In excluded", mesh, collection("Excluded"))
    link("In hidden", mesh, collection("Hidden"))
    link("Deep in hidden", mesh, collection("Deep", bpy.data.collections["Hidden"]))
    link("In indirect", mesh, collection("Indirect"))
    link("In both", mesh, bpy.data.collections["Excluded"])
    bpy.context.scene.collection.objects.link(bpy.data.objects["In both"])
    layers = bpy.context.view_layer.layer_collection.children
    layers["Excluded"].exclude = True
    layers["Indirect"].indirect_only = True
    bpy.data.collections["Hidden"].hide_render = True
    instanced = bpy.data.collections.new("Instanced")
    link("Leaf", mesh, instanced)
    link("Hidden leaf", mesh, instanced).hide_render = True
    for name in ("Empty", "Hidden empty"):
        empty = link(name, None)
        empty.instance_type, empty.instance_collection = "COLLECTION", instanced
    empty.hide_render = True
    expected = {"Shown", "In both", "Leaf"}
    for scene in (read(), read_render()):
        assert shown(scene) == expected
        # What mirrors show and what casts shadows is there, but no projector meets it.
        assert len(scene.geometry.triangles) == 4


def test_a_render_depsgraph_has_objects_hidden_in_the_viewport_only(read, read_render):
    mesh = triangle_mesh()
    link("Shown", mesh)
    link("Eye", mesh).hide_set(True)
    link("Monitor", mesh).hide_viewport = True
    link("In eye", mesh, collection("Eye"))
    link("In monitor", mesh, collection("Monitor"))
    bpy.context.view_layer.layer_collection.children["Eye"].hide_viewport = True
    bpy.data.collections["Monitor"].hide_viewport = True
    assert shown(read_render()) == {"Shown", "Eye", "Monitor", "In eye", "In monitor"}
    assert "Shown" in shown(read())


def test_control_surfaces_are_left_out(addon, read_render):
    camera = link("Camera", bpy.data.cameras.new("Camera"))
    flexible = addon("bridge.camera.flexible_camera")
    for z in (-1.0, -5.0):
        flexible.add_surface(camera, "PLANE", matrix=np.diag([1, 1, 1, 1.0]) + np.eye(4, k=3) * z)
    flexible.make_flexible(camera)
    link("Shown", triangle_mesh())
    for obj in bpy.data.objects:
        obj.hide_render = False
    assert shown(read_render()) == {"Shown"}


def test_objects_that_are_not_finite_are_left_out_with_a_warning(read):
    link("Good", triangle_mesh())
    mesh = cube_mesh("Broken")
    # Of flat faces no normals are read.
    mesh.shade_smooth()
    mesh.vertices[0].co = (math.nan, 0, 0)
    # Blender stores this as the largest float32.
    mesh.vertices[1].co = (math.inf, 0, 0)
    link("Broken", mesh)
    lost = link("Lost", triangle_mesh())
    lost.location.x = math.nan
    scene = read()
    assert shown(scene) == {"Good", "Broken"}
    assert np.isfinite(scene.geometry.vertices).all()
    assert np.isfinite(scene.geometry.corner_normals).all()
    whole = sum(not {0, 1} & set(face.vertices) for face in mesh.polygons)
    assert 2 * whole <= len(triangles_of(scene, "Broken")) < 12
    assert np.abs(corners(scene, triangles_of(scene, "Broken"))).max() == 1
    assert len(scene.warnings) == 2
    assert any("Lost" in line for line in scene.warnings) and any("Broken" in line for line in scene.warnings)


def test_kinds_without_faces_are_named_in_a_warning(read):
    link("Shown", triangle_mesh())
    link("Cloud", bpy.data.volumes.new("Cloud"))
    assert any("Cloud" in line for line in read().warnings)


def test_an_empty_scene_is_one_clear_error(addon):
    module = addon("bridge.scene.read_scene")
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    link("No faces", bpy.data.meshes.new("No faces"))
    with pytest.raises(module.UserError, match="nothing to render"):
        module.read_scene(bpy.context.evaluated_depsgraph_get())


def test_too_many_instances_are_one_clear_error(addon, monkeypatch):
    module = addon("bridge.scene.read_scene")
    monkeypatch.setattr(addon("bridge.scene.join_meshes"), "MAXIMUM_TRIANGLES", 100)
    mesh = cube_mesh()
    for _ in range(9):
        link("Cube", mesh)
    with pytest.raises(module.UserError, match="108 triangles"):
        module.read_scene(bpy.context.evaluated_depsgraph_get())


def output_of(tree):
    return next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")


def displaced(tree):
    show(tree, add(tree, "ShaderNodeBsdfDiffuse").outputs[0])
    node = add(tree, "ShaderNodeDisplacement", Height=add(tree, "ShaderNodeTexNoise").outputs[0])
    tree.links.new(node.outputs[0], output_of(tree).inputs["Displacement"])


def absorbing(tree):
    show(tree, add(tree, "ShaderNodeBsdfGlass", Roughness=0.0).outputs[0])
    volume = add(tree, "ShaderNodeVolumeAbsorption")
    tree.links.new(volume.outputs[0], output_of(tree).inputs["Volume"])


def lone(kind, **inputs):
    return lambda tree: show(tree, add(tree, f"ShaderNodeBsdf{kind}", **inputs).outputs[0])


LEFT_OUT = {
    "Material Output: Displacement": displaced,
    "Material Output: Volume": absorbing,
    "Principled BSDF: Diffuse Roughness": lone("Principled", Diffuse_Roughness=0.5),
    "Principled BSDF: Anisotropic": lone("Principled", Anisotropic=0.5),
    "Principled BSDF: Specular Tint": lone("Principled", Specular_Tint=(1, 0.5, 0.5)),
    "Principled BSDF: Alpha, whose shadow is opaque": lone("Principled", Alpha=0.5),
    "Principled BSDF: Roughness of what is behind it": lone("Principled", Transmission_Weight=1.0),
    "Diffuse BSDF: Roughness": lone("Diffuse", Roughness=0.5),
    "Glossy BSDF: Anisotropy": lone("Glossy", Anisotropy=0.5),
    "Glass BSDF: Roughness": lone("Glass", Roughness=0.5),
    "Refraction BSDF: Roughness": lone("Refraction", Roughness=0.5),
    "Transparent BSDF, whose shadow is opaque": lone("Transparent"),
}


def test_unsupported_parts_of_a_surface_are_named(read):
    """Shaders that are shown as they are give no note."""
    plain = {"principled": lone("Principled"), "glossy": lone("Glossy"), "glass": lone("Glass", Roughness=0)}
    sheet = wavy_sheet()
    for name, make in {**plain, **LEFT_OUT}.items():
        sheet.data.materials.append(new_material(name))
        make(sheet.data.materials[-1].node_tree)
    lines = [f"Not shown as it is: {note} (in {note})" for note in LEFT_OUT]
    assert sorted(read().warnings) == sorted(lines)


def test_vertex_groups_as_attributes_are_named(read):
    sheet = wavy_sheet()
    for name in ("Asked for", "Other"):
        sheet.vertex_groups.new(name=name).add([0, 1], 1.0, "REPLACE")
    sheet.data.materials.append(new_material())
    tree = sheet.data.materials[0].node_tree
    emit(tree, add(tree, "ShaderNodeAttribute", {"attribute_name": "Asked for"}).outputs[0])
    (line,) = read().warnings
    assert line.startswith("Vertex groups") and line.endswith(": Asked for")
