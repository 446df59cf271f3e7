# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken, odd or absurd scenes give an image by F12 and by the Render button, never a traceback."""

import bpy
import numpy as np
import pytest
from engine_images import button, f12

NAN, INF = float("nan"), float("inf")


def add_mesh(vertices, faces, edges=(), name="Odd"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, edges, faces)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def cube():
    return bpy.data.objects["Cube"]


def add_material(name="Material"):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    return material


def principled(material):
    return material.node_tree.nodes["Principled BSDF"]


def not_finite_vertices():
    square = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    for number, value in enumerate((NAN, INF, -INF, 1e30, 3e38)):
        add_mesh([*square, (value, 0, 0)], [(0, 1, 2, 3), (0, 1, 4)], name=f"Odd{number}")
    add_mesh([(NAN, NAN, NAN)] * 3, [(0, 1, 2)], name="Nothing left")


def zero_area_faces():
    add_mesh([(0, 0, 0)] * 4, [(0, 1, 2, 3)])
    add_mesh([(-1, 0, 0), (0, 0, 0), (1, 0, 0)], [(0, 1, 2)])
    add_mesh([(-1, 0, 0), (0, 1e-30, 0), (1, 0, 0)], [(0, 1, 2)])


def only_zero_area_faces():
    bpy.data.objects.remove(cube())
    zero_area_faces()


def loose_parts():
    add_mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1)])
    add_mesh([], [])
    add_mesh([(0, 0, 1), (1, 0, 1), (1, 1, 1), (5, 5, 5), (6, 6, 6)], [(0, 1, 2)], [(3, 4)])


def bad_indices_of_materials():
    cube().data.materials.clear()
    cube().data.materials.append(None)
    cube().data.materials.append(add_material())
    index = cube().data.attributes.new("material_index", "INT", "FACE")
    index.data.foreach_set("value", [-5, 0, 1, 2, 32767, -(2**31)])
    bare = add_mesh([(0, 0, 2), (1, 0, 2), (1, 1, 2)], [(0, 1, 2)])
    bare.data.attributes.new("material_index", "INT", "FACE").data[0].value = 7


def thousands_of_slots():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=50, y_subdivisions=40, location=(0, 0, 1.5))
    mesh = bpy.context.object.data
    made = [bpy.data.materials.new(f"Material {number}") for number in range(200)]
    for number in range(2000):
        mesh.materials.append(made[number % 200] if number % 3 else None)
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons)))


def odd_materials():
    image = bpy.data.images.new("Empty", 1, 1)
    image.source, image.filepath = "FILE", "//nowhere.png"
    for number, value in enumerate((NAN, INF, -1e30, 1e30)):
        material = add_material()
        node = principled(material)
        node.inputs["Base Color"].default_value = (value, value, value, 1.0)
        node.inputs["Roughness"].default_value = value
        node.inputs["IOR"].default_value = value
        node.inputs["Emission Strength"].default_value = value if number == 2 else 0.0
        cube().data.materials.append(material)
    nodes = add_material()
    texture = nodes.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    nodes.node_tree.links.new(texture.outputs["Color"], principled(nodes).inputs["Base Color"])
    cube().data.materials.append(nodes)
    bare = add_material()
    bare.node_tree.nodes.clear()
    cube().data.materials.append(bare)
    cube().data.polygons.foreach_set("material_index", range(6))


def odd_texture_coordinates():
    material = add_material()
    image = bpy.data.images.new("Chequered", 4, 4)
    image.pixels.foreach_set(np.linspace(0, 1, 64, dtype=np.float32))
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.links.new(texture.outputs["Color"], principled(material).inputs["Base Color"])
    cube().data.materials.append(material)
    layer = cube().data.uv_layers.active.uv
    layer.foreach_set("vector", np.resize([NAN, INF, -INF, 1e30, 3e38, -1e10], 2 * len(layer)))


def odd_scales():
    for number, scale in enumerate(
        [
            (0, 0, 0),
            (1, 1, 0),
            (-1, 1, 1),
            (-1, -1, -1),
            (NAN, 1, 1),
            (INF, 1, 1),
            (1e20, 1e20, 1e20),
            (1e-30,) * 3,
        ]
    ):
        copy = cube().copy()
        bpy.context.scene.collection.objects.link(copy)
        copy.location = number - 3, 1, 0
        copy.scale = scale


def odd_lamps():
    for value in (NAN, INF, -100.0, 1e38, 0.0):
        for kind in ("POINT", "SUN", "SPOT", "AREA"):
            lamp = bpy.data.lights.new("Lamp", kind)
            lamp.energy = value
            bpy.context.scene.collection.objects.link(bpy.data.objects.new("Lamp", lamp))
    for scale in ((0, 0, 0), (NAN, 1, 1)):
        lamp = bpy.data.objects.new("Flat lamp", bpy.data.lights.new("Lamp", "AREA"))
        lamp.scale = scale
        bpy.context.scene.collection.objects.link(lamp)


def inside_a_mesh():
    cube().scale = 0.3, 0.3, 0.3
    cube().location = bpy.context.scene.camera.matrix_world.translation


def custom_normals_that_are_none():
    mesh = cube().data
    for polygon in mesh.polygons:
        polygon.use_smooth = True
    corners = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
    if corners is not None:
        corners.data.foreach_set("vector", np.resize([NAN, 0, INF, 1e30, 0, 0, 0], 3 * len(mesh.loops)))
    short = add_mesh([(0, 0, 2), (1, 0, 2), (1, 1, 2)], [(0, 1, 2)])
    # What Blender keeps custom normals as, with values that its own tools never write.
    raw = short.data.attributes.new("custom_normal", "INT16_2D", "CORNER")
    raw.data.foreach_set("value", [-32768, 32767, 0, -32768, 32767, -1])


def modifiers_that_err():
    cube().modifiers.new("Boolean", "BOOLEAN").object = None
    bpy.ops.mesh.primitive_cube_add(location=(2, 0, 0))
    own = bpy.context.object
    own.modifiers.new("Deform", "SURFACE_DEFORM").target = cube()
    own.modifiers.new("Screw", "SCREW").screw_offset = NAN
    own.modifiers.new("Remesh", "REMESH").voxel_size = 0.3
    own.modifiers.new("Nodes", "NODES")
    own.modifiers.new("Cache", "MESH_CACHE").filepath = "//nowhere.mdd"
    own.modifiers.new("Multires", "MULTIRES")
    driver = own.driver_add("location", 0).driver
    driver.expression = "no_such_name / 0"


def what_is_no_mesh():
    for kind in ("CURVE", "SURFACE", "META", "FONT"):
        {
            "CURVE": lambda: bpy.ops.curve.primitive_bezier_circle_add(),
            "SURFACE": lambda: bpy.ops.surface.primitive_nurbs_surface_sphere_add(),
            "META": lambda: bpy.ops.object.metaball_add(),
            "FONT": lambda: bpy.ops.object.text_add(),
        }[kind]()
        bpy.context.object.scale = 0.5, 0.5, 0.5
    bpy.ops.object.text_add()
    bpy.context.object.data.body = ""
    for data in (
        bpy.data.pointclouds.new("Points"),
        bpy.data.volumes.new("Volume"),
        bpy.data.hair_curves.new("Hair"),
        bpy.data.lattices.new("Lattice"),
        bpy.data.armatures.new("Armature"),
        bpy.data.speakers.new("Speaker"),
        bpy.data.lightprobes.new("Probe", "SPHERE"),
        None,
    ):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Thing", data))
    bpy.context.view_layer.objects.active = cube()
    cube().modifiers.new("Hair", "PARTICLE_SYSTEM")
    cube().particle_systems[0].settings.type = "HAIR"
    cube().particle_systems[0].settings.count = 20


def instances_of_instances():
    inner, outer = (bpy.data.collections.new(name) for name in ("Inner", "Outer"))
    inner.objects.link(cube())
    for target, source in ((outer, inner), (bpy.context.scene.collection, outer)):
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", source
        empty.scale = -1, 0.5, 0
        target.objects.link(empty)


def odd_world():
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1e38
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1e30, NAN, 1, 1)


def hidden_surfaces():
    for number, slot in enumerate(bpy.context.scene.camera.scfpf.surfaces):
        slot.object.hide_viewport = slot.object.hide_render = True
        if number == 0:
            slot.object.hide_set(True)
    collection = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(collection)
    surface = bpy.context.scene.camera.scfpf.surfaces[1].object
    for each in list(surface.users_collection):
        each.objects.unlink(surface)
    collection.objects.link(surface)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True


def folded_volume():
    scene = bpy.context.scene
    far = scene.camera.scfpf.surfaces[-1].object
    far.scale.x = -far.scale.x
    middle = bpy.ops.scfpf.surface_add
    with bpy.context.temp_override(object=scene.camera, active_object=scene.camera):
        middle(kind="SPHERE")


def touching_surfaces():
    first, second = (slot.object for slot in bpy.context.scene.camera.scfpf.surfaces)
    second.location = first.location
    second.scale = first.scale = (1, 1, 1)


def far_away():
    for thing in (cube(), bpy.context.scene.camera):
        thing.location.x += 1e9


# Of which nothing is to be seen, or the dark inside.
EMPTY = {only_zero_area_faces, touching_surfaces, inside_a_mesh}

SPOILERS = (
    not_finite_vertices,
    zero_area_faces,
    only_zero_area_faces,
    loose_parts,
    bad_indices_of_materials,
    thousands_of_slots,
    odd_materials,
    odd_texture_coordinates,
    odd_scales,
    odd_lamps,
    inside_a_mesh,
    custom_normals_that_are_none,
    modifiers_that_err,
    what_is_no_mesh,
    instances_of_instances,
    odd_world,
    hidden_surfaces,
    folded_volume,
    touching_surfaces,
    far_away,
)


@pytest.mark.parametrize("spoil", SPOILERS, ids=lambda spoil: spoil.__name__)
def test_there_is_an_image(engine_scene, spoil, capfd):
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = 32, 18
    spoil()
    picture = f12(engine_scene)["ViewLayer.Combined"]
    assert np.array_equal(button(), picture)
    assert np.isfinite(picture).all()
    assert (np.ptp(picture[..., :3]) > 0.01) == (spoil not in EMPTY)
    assert "Traceback" not in "".join(capfd.readouterr())


@pytest.mark.parametrize("overridden", [False, True])
def test_a_camera_and_surfaces_of_another_file(engine_scene, tmp_path, overridden):
    picture = f12(engine_scene)["ViewLayer.Combined"]
    rig = bpy.data.collections.new("Rig")
    camera = engine_scene.camera
    for thing in (camera, *camera.children_recursive):
        rig.objects.link(thing)
    bpy.data.libraries.write(str(tmp_path / "rig.blend"), {rig})
    path = engine_scene.render.filepath
    for thing in list(rig.objects):
        bpy.data.objects.remove(thing)
    with bpy.data.libraries.load(str(tmp_path / "rig.blend"), link=True) as (_, wanted):
        wanted.collections = ["Rig"]
    linked = wanted.collections[0]
    engine_scene.collection.children.link(linked)
    if overridden:
        linked.override_hierarchy_create(engine_scene, bpy.context.view_layer, do_fully_editable=True)
    things = [thing for thing in engine_scene.objects if thing.type == "CAMERA"]
    engine_scene.camera = next(thing for thing in things if bool(thing.override_library) == overridden)
    assert engine_scene.camera.library or engine_scene.camera.override_library
    assert engine_scene.render.filepath == path
    assert np.array_equal(f12(engine_scene)["ViewLayer.Combined"], picture)
    assert np.array_equal(button(), picture)


def test_instances_that_memory_does_not_hold(addon, engine_scene, monkeypatch):
    before = button()
    joining = addon("bridge.scene.join_meshes")
    monkeypatch.setattr(joining, "shortage", lambda _needed: ("2 GB", "1 GB"))
    for press in (button, lambda: f12(engine_scene)):
        with pytest.raises(RuntimeError, match=r"12 triangles once every instance .* hide instances"):
            press()
    monkeypatch.undo()
    assert np.array_equal(button(), before)
