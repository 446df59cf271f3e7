# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of one material, as SCFPF and as Cycles show them."""

import bpy
import numpy as np
from engine_images import passes, write_multilayer

# Pixels across a picture.
SIZE = 48
# Cycles' filter as narrow as it goes, so that it sees what a pixel's centre does.
NARROW = 0.01
# Attributes of edges: data type, property of an item, and its numbers.
EDGES = (
    ("FLOAT", "value", 1),
    ("INT", "value", 1),
    ("BOOLEAN", "value", 1),
    ("FLOAT_VECTOR", "vector", 3),
    ("BYTE_COLOR", "color", 4),
)


def new_material(name="Material"):
    """A material with an empty tree."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material


def add(tree, kind, settings=(), **inputs):
    """A node: its settings by name, and its inputs by place or name ('_0', 'Base_Color'), linked or set."""
    node = tree.nodes.new(kind)
    for name, value in dict(settings).items():
        setattr(node, name, value)
    for name, value in inputs.items():
        plain = name.lstrip("_")
        socket = node.inputs[int(plain)] if plain.isdigit() else node.inputs[plain.replace("_", " ")]
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        elif socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value
    return node


def emit(tree, color, surface=None):
    """Let the surface glow in what an output socket gives."""
    show(tree, add(tree, "ShaderNodeEmission", Color=color).outputs[0])


def show(tree, shader):
    """Link a shader to the output."""
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader, output.inputs["Surface"])


def wavy_sheet(columns=7, rows=5):
    """A curved sheet over [-1, 1]² that faces +Z, smooth, with two UV maps and colours of four kinds."""
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    z = 0.2 * np.sin(2 * x) + 0.15 * np.cos(3 * y)
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.stack([first, first + 1, first + columns + 1, first + columns], 1)
    mesh = bpy.data.meshes.new("Sheet")
    mesh.from_pydata(np.stack([x, y, z], -1).reshape(-1, 3).tolist(), [], faces.tolist())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
    corner = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    flat = np.stack([x, y], -1).reshape(-1, 2)[corner]
    for name, scale in (("First", 0.5), ("Second", 0.8)):
        layer = mesh.uv_layers.new(name=name)
        layer.uv.foreach_set("vector", (flat * scale + 0.5).astype(np.float32).ravel())
    generator = np.random.default_rng(3)
    for kind in ("BYTE_COLOR", "FLOAT_COLOR"):
        for domain in ("POINT", "CORNER"):
            layer = mesh.color_attributes.new(f"{kind} {domain}", kind, domain)
            colors = generator.random((len(layer.data), 4)).astype(np.float32)
            layer.data.foreach_set("color", colors.ravel())
    height = mesh.attributes.new("Height", "FLOAT", "POINT")
    height.data.foreach_set("value", z.astype(np.float32).ravel())
    face = mesh.attributes.new("Face", "FLOAT_VECTOR", "FACE")
    face.data.foreach_set("vector", generator.random((len(faces), 3)).astype(np.float32).ravel())
    for kind, key, channels in EDGES:
        edge = mesh.attributes.new(f"{kind} EDGE", kind, "EDGE")
        values = generator.random(channels * len(mesh.edges)).astype(np.float32)
        values = {"INT": (4 * values).astype(np.int32), "BOOLEAN": values < 0.4}.get(kind, values)
        edge.data.foreach_set(key, values)
    sheet = bpy.data.objects.new("Sheet", mesh)
    bpy.context.scene.collection.objects.link(sheet)
    return sheet


def scene_with_camera(size=SIZE):
    """The present scene with a camera above that looks down on [-1, 1]² askew; view transform off."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.9, -1.3, 3.2), (0.4, 0.25, 0.1)
    camera.data.lens = 40
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.scfpf.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = size
    if scene.world is None:
        scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = next(each for each in scene.world.node_tree.nodes if each.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.05, 0.1, 0.2, 1.0)
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 1, False, False
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", NARROW
    return scene


def picture(scene, engine, folder):
    """The scene by an engine, (H, W, 4) float32."""
    scene.render.engine = engine
    write_multilayer(scene, folder / engine)
    path = folder / f"{engine}.exr"
    path.unlink(missing_ok=True)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    found = passes(path)
    return next(values for name, values in found.items() if name.endswith("Combined"))


def both(scene, folder):
    """The scene by SCFPF and by Cycles."""
    return picture(scene, "SCFPF", folder), picture(scene, "CYCLES", folder)


def differing(a, b, step=1 / 255):
    """Share of pixels that differ by more than a step."""
    return float((np.abs(a - b).max(axis=2) > step).mean())
