# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the file that a version leaves to later ones, and read its values and images.

The version in a file's name has run `make` once, in Blender 4.5: Blender 5 opens that file too. `make` uses
operators and properties only, so that the next version can run it as well.
"""

import json
import math
import pathlib

import bpy
import numpy as np
from engine_images import button

FOLDER = pathlib.Path(__file__).parent / "files"
# Resolution of the images, and the frame at which keyframes are halfway.
WIDTH, HEIGHT, FRAME = 32, 18, 6
# Groups of properties by the kind of datablock that has them.
GROUPS = {"objects": ("scfpf", "scfpf_surface"), "scenes": ("scfpf_sampling", "scfpf_drawn")}


def make(version):
    """Save the file, its values and its images. version: as in "0_1"."""
    _set_the_stage()
    for build in (_kinds, _meshes, _round, _polar, _lattice, _blend, _map, _layered, _aimed):
        build(_camera(build.__name__.strip("_").title()))
    _drawn_scene()
    _rigged_scene()
    for scene in reversed(bpy.data.scenes):
        bpy.context.window.scene = scene
        scene.frame_set(FRAME)
    bpy.context.window.scene = bpy.data.scenes["Scene"]
    path = FOLDER / f"version_{version}.blend"
    path.unlink(missing_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    path.with_suffix(".json").write_text(json.dumps(values(), indent=0) + "\n")
    np.savez_compressed(path.with_suffix(".npz"), **images())


def values():
    """The extension's own properties that have a value: {"objects/Kinds/scfpf.basis": value}."""
    found = {}
    for kind, groups in GROUPS.items():
        for owner in getattr(bpy.data, kind):
            for name in groups:
                if kind == "scenes" or owner.type == "CAMERA" or owner.scfpf_surface.kind != "NONE":
                    _collect(getattr(owner, name), f"{kind}/{owner.name}/{name}", found)
    return found


def _collect(group, path, found):
    for prop in group.bl_rna.properties:
        name, value = prop.identifier, getattr(group, prop.identifier)
        if name in {"rna_type", "report", "statistics"} or not group.is_property_set(name):
            continue
        if prop.type == "COLLECTION":
            for number, item in enumerate(value):
                _collect(item, f"{path}.{name}[{number}]", found)
        elif isinstance(value, bpy.types.PropertyGroup):
            _collect(value, f"{path}.{name}", found)
        elif isinstance(value, bpy.types.ID):
            found[f"{path}.{name}"] = value.name
        else:
            found[f"{path}.{name}"] = list(value) if getattr(prop, "is_array", False) else value


def images():
    """The Render button's images by scene and camera, (H, W, 3) float16."""
    found = {}
    for scene in bpy.data.scenes:
        bpy.context.window.scene = scene
        names = sorted(o.name for o in scene.objects if o.type == "CAMERA" and o.scfpf.enabled)
        for name in names if scene.name == "Scene" else names[:1]:
            found[f"{scene.name} {name}"] = button(camera=name)[..., :3].astype(np.float16)
    return found


def _set_the_stage():
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    world = scene.world = bpy.data.worlds.new("World")
    _shader(world, "World", "Background", (0.2, 0.3, 0.4))
    for name, color, location, size in (
        ("Red", (0.8, 0.1, 0.05), (-2, 9, 0.5), 1.5),
        ("Green", (0.1, 0.7, 0.1), (1.5, 12, 1), 2.0),
        ("Blue", (0.1, 0.2, 0.8), (0.2, 7, -0.8), 1.0),
    ):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=6, radius=size, location=location)
        _paint(bpy.context.object, name, color)
    bpy.ops.mesh.primitive_plane_add(size=80, location=(0, 0, -2))
    _paint(bpy.context.object, "Ground", (0.5, 0.45, 0.4))
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.5, 0.2))
    bpy.context.object.data.energy = 2.0


def _paint(obj, name, color):
    obj.name = obj.data.name = name
    material = bpy.data.materials.new(name)
    _shader(material, "Material", "BsdfDiffuse", color)
    obj.data.materials.append(material)


def _shader(owner, output, kind, color):
    """Make a material or a world of one node."""
    owner.use_nodes = True
    tree = owner.node_tree
    tree.nodes.clear()
    node, end = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new(f"ShaderNodeOutput{output}")
    node.inputs["Color"].default_value = (*color, 1)
    tree.links.new(node.outputs[0], end.inputs["Surface"])


def _camera(name):
    assert bpy.ops.scfpf.camera_add(preset="perspective") == {"FINISHED"}
    camera = bpy.context.object
    camera.name = name
    camera.location, camera.rotation_euler = (0.0, -1.0, 0.5), (math.radians(88), 0.0, 0.0)
    camera.scfpf.samples, camera.scfpf.pixel_error = 3, 0.05
    return camera


def _add(camera, kind, place=None, **parameters):
    """Add a control surface after the active one, with inputs of its node group by their names."""
    assert bpy.ops.scfpf.surface_add(kind=kind) == {"FINISHED"}
    surface = camera.scfpf.surfaces[camera.scfpf.active_surface].object
    if place is not None:
        surface.location = place
    modifier = next((m for m in surface.modifiers if m.type == "NODES"), None)
    for name, value in parameters.items():
        modifier[modifier.node_group.interface.items_tree[name.replace("_", " ")].identifier] = value
    surface.update_tag()
    return surface


def _key(owner, path, values):
    for frame, value in zip((1, 11), values, strict=True):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def _kinds(camera):
    """All parametric kinds in one list of weighted surfaces, with keyframes."""
    settings = camera.scfpf
    settings.active_surface = 0
    _add(camera, "CYLINDER", (0, 0, 0), Radius=3.0, Height=3.0, Arc=1.2)
    _add(camera, "CONE", (0, 0, 0), Radius_Start=5.0, Radius_End=6.0, Height=4.0, Arc=1.0)
    _add(camera, "SPHERE", (0.5, 0, 0), Radius=9.0, Arc=1.1, Latitude_Start=-0.4, Latitude_End=0.5)
    _add(camera, "PATCH", (0, 0.5, -12)).scale = 0.1, 0.1, 1
    settings.basis = "NURBS"
    for number, slot in enumerate(settings.surfaces):
        _key(slot, "weight", [1.0 + 0.5 * number, 1.5])
    far = settings.surfaces[len(settings.surfaces) - 1].object
    far.scale = 0.3, 0.3, 1
    _key(far, "location", [(0, 0, -30), (2, 0, -26)])
    settings.u_range, settings.v_range = (0.05, 0.9), (0.1, 1.0)
    settings.keyframe_insert("u_range", frame=1)
    settings.iso_surfaces, settings.iso_t, settings.show_folds, settings.projector_count = 1, 0.25, False, 9
    cylinder = settings.surfaces[1].object
    modifier = cylinder.modifiers[0]
    key = f'["{modifier.node_group.interface.items_tree["Radius"].identifier}"]'
    for frame, value in ((1, 3.0), (11, 3.6)):
        modifier[key[2:-2]] = value
        modifier.keyframe_insert(key, frame=frame)


def _meshes(camera):
    """Mesh kinds and a surface object; every kind of image mapping."""
    settings = camera.scfpf
    settings.active_surface = 0
    grid = _add(camera, "GRID")
    grid.shape_key_add(name="Basis")
    bump = grid.shape_key_add(name="Bump")
    for number, point in enumerate(bump.data):
        point.co.z += 0.3 * math.sin(number)
    _key(bump, "value", [0.0, 1.0])
    _add(camera, "NURBS")
    _add(camera, "UV_MESH")
    settings.basis, settings.edit_volume = "POLYLINE", True
    image = bpy.data.images.new("ST", 8, 6, float_buffer=True, is_data=True)
    x, y = np.meshgrid((np.arange(8) + 0.5) / 8, (np.arange(6) + 0.5) / 6)
    image.pixels.foreach_set(
        np.stack([x + 0.02 * y, y - 0.03 * x * y, 0 * x, 0 * x + 1], -1).astype(np.float32).ravel()
    )
    image.pack()
    for number, kind in enumerate(("RADIAL_CURVE", "LENS", "DISTORTION", "ST_MAP", "GRID", "DISPLAY")):
        assert bpy.ops.scfpf.mapping_add(kind=kind) == {"FINISHED"}
        mapping = settings.mappings[number]
        mapping.name, mapping.influence = f"Mapping {number}", 0.4 + 0.1 * number
        if kind == "ST_MAP":
            mapping.image = image
        if kind == "GRID":
            mapping.grid.data.vertices[17].co.x += 0.05
    settings.mappings[1].centre, settings.mappings[1].radius = (0.6, 0.4), 0.4
    settings.mappings[1].magnification, settings.mappings[1].falloff = 1.5, 0.7
    settings.mappings[2].numerator, settings.mappings[2].denominator = (0.1, 0.02, 0.0), (0.05, 0.0, 0.01)
    settings.mappings[2].backwards = True
    settings.mappings[5].enabled, settings.mappings[5].arc = False, 1.25
    _key(settings.mappings[1], "magnification", [1.5, 1.9])


def _round(camera):
    """A point and a disc with polar parameters."""
    settings = camera.scfpf
    settings.active_surface = 0
    _add(camera, "POINT", (0, 0, 0))
    _add(camera, "DISC", (0, 0, -20), Radius=12.0)
    for index in (3, 0):
        settings.active_surface = index
        assert bpy.ops.scfpf.surface_remove() == {"FINISHED"}
    settings.reparameterisation, settings.fit = "POLAR", "NONE"


def _polar(camera):
    """A preset with a re-parameterisation."""
    assert bpy.ops.scfpf.preset_apply(preset="angular_fisheye") == {"FINISHED"}


def _lattice(camera):
    """One lattice as the volume."""
    assert bpy.ops.scfpf.volume_to_lattice() == {"FINISHED"}
    lattice = camera.scfpf.surfaces[0].object.data
    for number, point in enumerate(lattice.points):
        point.co_deform.x += 0.02 * math.cos(number)


def _blend(camera):
    """A camera between another one and a preset, its factor with keyframes."""
    camera.name = "First"
    assert bpy.ops.scfpf.camera_blend_preset(preset="orthographic") == {"FINISHED"}
    blend = bpy.context.object
    blend.name = "Blend"
    _key(blend.scfpf, "blend_factor", [0.0, 1.0])


def _map(camera):
    """A camera that goes over into a preset within a circle."""
    camera.name = "Second"
    assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
    blend = bpy.context.object
    blend.name = "Map"
    assert bpy.ops.scfpf.blend_map(kind="RADIAL") == {"FINISHED"}
    blend.scfpf.blend_field.border = 0.3


def _layered(camera):
    """A ball that the image shows as another camera sees it."""
    things = bpy.data.collections.new("Things")
    bpy.context.scene.collection.children.link(things)
    things.objects.link(bpy.data.objects["Blue"])
    side = _camera("Side")
    side.location.x = 1.5
    given = {"camera": camera.name, "collection": things.name, "seen_by": side.name, "front": "DEPTH"}
    assert bpy.ops.scfpf.layer_add(**given) == {"FINISHED"}


def _aimed(camera):
    """A volume that shows a ball from farther to the left."""
    aim = camera.scfpf.aim
    aim.columns, aim.rows, aim.degree = 8, 6, 2
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Red") == {"FINISHED"}
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, left=math.radians(10)) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.aim_solve(camera=camera.name) == {"FINISHED"}


def _rigged_scene():
    """The same objects in a scene that Cycles renders through the rig of a bent volume."""
    bpy.context.window.scene = bpy.data.scenes["Scene"]
    camera = _camera("Bent")
    camera.scfpf.active_surface = 0
    _add(camera, "PLANE", (1.0, 0.0, -8.0), Width=5.0, Height=3.0)
    assert bpy.ops.scene.new(type="LINK_COPY") == {"FINISHED"}
    scene = bpy.context.scene
    scene.name, scene.camera = "Rigged", camera
    camera.scfpf.pixel_error = 0.5
    scene.cycles.samples, scene.cycles.max_bounces = 64, 0
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}


def _drawn_scene():
    """The same objects in a scene with Drawn Style and other sampling."""
    assert bpy.ops.scene.new(type="LINK_COPY") == {"FINISHED"}
    scene = bpy.context.scene
    scene.name = "Drawn"
    assert bpy.ops.scfpf.drawn_style(style="INK") == {"FINISHED"}
    _key(scene.scfpf_drawn, "line_width", [1.5, 3.0])
    sampling = scene.scfpf_sampling
    sampling.pixel_filter, sampling.pattern, sampling.use_adaptive = "GAUSSIAN", "SCRAMBLED", True
    sampling.adaptive_threshold, sampling.adaptive_least, sampling.motion_steps = 0.02, 4, 5
