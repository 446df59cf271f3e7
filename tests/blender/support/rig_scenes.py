# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes with objects in them, and their images by Cycles, for tests of the rig."""

import importlib.util
import pathlib
import tempfile

import bpy
import numpy as np
from engine_images import f12, write_multilayer
from mathutils import Euler, Matrix

spec = importlib.util.spec_from_file_location(
    "cycles_reference", pathlib.Path(__file__).parents[1] / "cycles" / "test_cycles_reference.py"
)
reference = importlib.util.module_from_spec(spec)
spec.loader.exec_module(reference)


# Of the session: the node groups for the next module's tests.
FOLDER = tempfile.TemporaryDirectory(prefix="scfpf-rigs-", ignore_cleanup_errors=True)
GROUPS = pathlib.Path(FOLDER.name, "groups.blend")


def rectangle(half_width, half_height, depth, x=0.0, turn=0.0):
    """A plane for VOLUMES, described as add_surface takes it."""
    matrix = Matrix.Translation((x, 0, -depth)) @ Euler((0, 0, turn)).to_matrix().to_4x4()
    return "PLANE", matrix, {"width": 2 * half_width, "height": 2 * half_height}, None


def grid(height, shift):
    """A wavy grid of 9 × 7 points, 12 wide."""
    x, y = np.meshgrid(np.linspace(-6, 6, 9), np.linspace(-4, 4, 7))
    points = np.stack([x + shift, y, height + 0.5 * np.sin(x) * np.cos(0.7 * y)], axis=-1)
    return "GRID", Matrix(), None, points


def tilted(y, z, turn):
    """A plane turned about the x axis, in the middle between left and right."""
    matrix = Matrix.Translation((0, y, z)) @ Euler((turn, 0, 0)).to_matrix().to_4x4()
    return "PLANE", matrix, {"width": 3.0, "height": 2.0}, None


def folded(depth):
    """A grid whose columns go forth, back and forth again, so that rays to some meet others before."""
    x, y = np.meshgrid(np.array([-3.0, -1.0, 1.0, 0.0, -1.0, 1.0, 3.0]), np.linspace(-2, 2, 5))
    z = np.broadcast_to(np.array([0.0, 0.0, 0.0, 0.8, 1.6, 1.6, 1.6]), x.shape)
    return "GRID", Matrix(), None, np.stack([x, y, z - depth], axis=-1)


# Volumes made here, by basis and surfaces from near to far.
VOLUMES = {
    "bent cubic": ("BEZIER", [(1, 0.7, 1), (3, 2, 6, 2.0), (5, 3, 14, -6.0, 0.6), (8, 5, 24, 4.0)]),
    "polyline": ("POLYLINE", [(1, 0.7, 1), (3, 2, 6, 2.0), (5, 3, 14, -4.0)]),
    "B-spline": ("B_SPLINE", [(1, 0.7, 1), (2, 1.4, 4), (4, 3, 9, 3.0), (5, 3, 15, -2.0), (8, 5, 24)]),
    "NURBS": ("NURBS", [(1, 0.7, 1), (3, 2, 6, 3.0), (5, 3, 14, -4.0, 0.4), (8, 5, 24, 2.0)]),
    "smooth": ("SMOOTH", [(1, 0.7, 1), (2, 1.4, 4), (4, 3, 9, 2.0), (5, 3, 15, -2.0), (8, 5, 24)]),
    # Forward, up, back, and down through where it came from.
    "loop": ("BEZIER", [tilted(0, 0, 0.0), tilted(0, -30, 1.7), tilted(22, 2, 3.4), tilted(-18, -14, 5.1)]),
    "folded": ("POLYLINE", [(1, 0.7, 1), folded(6.0), (6, 4, 14)]),
    "grids": ("BEZIER", [(1, 0.7, 1), grid(-10.0, 3.0), grid(-20.0, 0.0)]),
}


def make_volume(addon, camera, name):
    if name not in VOLUMES:
        reference.preset(addon, camera, name)
        return
    flexible = addon("bridge.camera.flexible_camera")
    flexible.make_flexible(camera)
    flexible.clear_surfaces(camera)
    basis, surfaces = VOLUMES[name]
    for described in surfaces:
        kind, matrix, parameters, points = (
            rectangle(*described) if len(described) != 4 or not isinstance(described[0], str) else described
        )
        flexible.add_surface(camera, kind, matrix=matrix, parameters=parameters, points=points)
    camera.scfpf.basis = basis
    for number, slot in enumerate(camera.scfpf.surfaces):
        slot.weight = 1.0 + 2.0 * (number % 2)


def bend_at_random(camera, generator):
    """Move and turn the surfaces of a camera a little, but for the near one."""
    for slot in list(camera.scfpf.surfaces)[1:]:
        size = np.linalg.norm(np.array(slot.object.location)) + 0.1
        slot.object.location = np.array(slot.object.location) + generator.normal(size=3) * 0.04 * size
        slot.object.rotation_euler.z += generator.normal() * 0.1
    bpy.context.view_layer.update()


def project(addon, camera):
    """The camera's projection as it is, world space."""
    render = bpy.context.scene.render
    return addon("bridge.camera.read_projection").read_projection(
        camera, bpy.context.evaluated_depsgraph_get(), render.resolution_x / render.resolution_y
    )


def fill_volume(addon, camera, count=24):
    """Objects on projectors of the camera, as large as their place."""
    projection = project(addon, camera)
    sample = projection.volume.evaluate(np.full(9, 0.5), np.full(9, 0.5), np.linspace(0, 1, 9)).position
    largest, sizes = np.ptp(sample, axis=1).max() / 20, []

    def place(generator):
        while True:
            x, y, t = generator.random((3, 1))
            image = projection.parameters(x, y)
            if image.mask[0]:
                t = 0.15 + 0.8 * t
                # The place, and two that tell how wide the volume is there.
                u, v = np.append(image.u, (0.25, 0.75)), np.append(image.v, (0.5, 0.5))
                found, left, right = projection.volume.evaluate(u, v, t.repeat(3)).position.T
                sizes.append(min(largest, 0.15 * np.linalg.norm(right - left)))
                return found

    reference.populate(np.random.default_rng(5), count, place)
    bpy.data.objects.remove(bpy.data.objects["Ground"])
    for obj in bpy.context.scene.objects:
        if obj.pass_index:
            obj.scale *= sizes[obj.pass_index - 1]
    bpy.context.view_layer.update()


def volume_scene(addon, name, width=72, height=48):
    """A volume with objects in it; returns its camera."""
    clear_scene()
    camera = reference.add_camera(width, height)
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.4, 0.1, 0.5))
    make_volume(addon, camera, name)
    camera.scfpf.pixel_error = 0.3
    bpy.context.view_layer.update()
    fill_volume(addon, camera)
    return camera


def show_whole_sheets(addon, rig):
    """Let rays travel all chords, through sheets with the same cells. Keep ``renew`` from undoing it."""
    scene, settings, data = bpy.context.scene, rig.scfpf_rig, addon("cycles.rig_data")
    addon("cycles.skipping.refresh").stop_skipping(rig)
    size = scene.render.resolution_x, scene.render.resolution_y
    breaks, shifts = data.present_chords(rig)
    cells = addon("cycles.skipping.skip_chords").fine_cells(tuple(settings.cells), size)
    polar = settings.sheet_vertices == np.prod(np.array(settings.cells) + 1)
    plan = addon("cycles.chords.chord_plan").ChordPlan(breaks, shifts, cells, 0.0, 0.0, bool(polar))
    data.write_sheets(rig, plan)


def switch(camera):
    bpy.context.view_layer.objects.active = camera
    return bpy.ops.scfpf.cycles_rig()


def start_anew():
    """A new scene, as in an empty file, but with the node groups, which take long to build."""
    if "SCFPF Portals" not in bpy.data.node_groups:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        if GROUPS.exists():
            with bpy.data.libraries.load(str(GROUPS)) as (there, here):
                here.node_groups = list(there.node_groups)
            keep_groups()
        return
    kept = [group for group in bpy.data.node_groups if group.bl_idname == "GeometryNodeTree"]
    before = bpy.data.scenes[:]
    bpy.ops.scene.new(type="NEW")
    bpy.data.batch_remove([*before, *bpy.data.collections, *bpy.data.worlds, *bpy.data.lights])
    clear_scene()
    bpy.data.batch_remove([*bpy.data.materials, *(g for g in bpy.data.node_groups if g not in kept)])


def keep_groups():
    """Let node groups stay when nothing uses them."""
    for group in bpy.data.node_groups:
        group.use_fake_user = group.bl_idname == "GeometryNodeTree"
    if "SCFPF Portals" in bpy.data.node_groups and not GROUPS.exists():
        bpy.data.libraries.write(str(GROUPS), {g for g in bpy.data.node_groups if g.use_fake_user})


def clear_scene():
    """Remove all objects."""
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.cameras, *bpy.data.curves])
    bpy.context.view_layer.update()


def exact_passes(addon, camera, pixel_error=0.0):
    """Return the data passes of the exact caster by name, (H, W, channels)."""
    shading = addon("shading.passes.data_passes")
    frames = addon("shading.frame")
    settings = addon("shading.settings.frame_settings")
    scene = bpy.context.scene
    contents = addon("bridge.scene.render_depsgraph").with_render_depsgraph(
        scene, bpy.context.view_layer, addon("bridge.scene.read_scene").read_scene
    )
    wanted = shading.DataPasses(("OBJECT_INDEX", "POSITION", "PARAMETERS", "DEPTH", "NORMAL"))
    settings = settings.FrameSettings(
        scene.render.resolution_x, scene.render.resolution_y, 1, pixel_error, passes=wanted
    )
    return frames.render_frame(project(addon, camera), contents, settings).passes


def compose_passes():
    """Let the compositor's image be (u, v, t) and, in alpha, depth."""
    scene = bpy.context.scene
    tree = getattr(scene, "compositing_node_group", None) or scene.node_tree
    end = next(node for node in tree.nodes if node.type in {"COMPOSITE", "GROUP_OUTPUT"})
    passes = tree.nodes["SCFPF Passes"]
    parts, picture = tree.nodes.new("ShaderNodeSeparateXYZ"), tree.nodes.new("CompositorNodeCombineColor")
    tree.links.new(passes.outputs["UVT"], parts.inputs[0])
    for number in range(3):
        tree.links.new(parts.outputs[number], picture.inputs[number])
    tree.links.new(passes.outputs["Depth"], picture.inputs["Alpha"])
    tree.links.new(picture.outputs[0], end.inputs[0])


def render_passes(path, samples=1):
    """Cycles' passes of the present scene by name, (H, W, channels); the compositor's is "Composite"."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    layer.use_pass_position = layer.use_pass_object_index = True
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = (
        samples,
        False,
        False,
    )
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", reference.JITTER
    write_multilayer(scene, path)
    found = f12(scene)
    result = {name.split(".", 1)[1]: values for name, values in found.items()}
    result["Object Index"] = next(v for n, v in result.items() if "Index" in n)[..., 0].astype(int)
    composite = [values for name, values in found.items() if name.startswith("Composite.")]
    return result | ({"Composite": composite[0]} if composite else {})


def glowing(name, color):
    """Let an object shine in one colour, without noise."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (*color, 1)
    tree.links.new(emission.outputs[0], output.inputs[0])
    bpy.data.objects[name].data.materials.append(material)


def add_box(name, location, color):
    """A cube that shines in one colour."""
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=location)
    box = bpy.context.object
    box.name = name
    glowing(box.name, color)
    return box


def render(path):
    """Render with one sample per pixel, in its middle; (H, W, 4), row 0 at the bottom."""
    scene = bpy.context.scene
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return pixels_of(path)


def pixels_of(path):
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def prepare_cycles():
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"


def bent_camera(addon):
    """A flexible camera with bent projectors before three boxes."""
    scene = bpy.context.scene
    for name, location, color in (
        ("Red", (-2, 0.5, -8), (1, 0, 0)),
        ("Green", (1, -0.5, -12), (0, 1, 0)),
        ("Blue", (0, 2, -5), (0, 0, 1)),
    ):
        add_box(name, location, color)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 60, 40
    flexible = addon("bridge.camera.flexible_camera")
    flexible.make_flexible(camera)
    flexible.clear_surfaces(camera)
    for depth, height, x in ((1, 1.0, 0), (6, 4.0, 2.5), (16, 9.0, 0)):
        surface = flexible.add_surface(camera, "PLANE", parameters={"width": 1.5 * height, "height": height})
        surface.location = (x, 0, -depth)
    bpy.context.view_layer.update()
    prepare_cycles()
    bpy.context.view_layer.objects.active = camera
    return camera
