# SPDX-License-Identifier: GPL-3.0-or-later
"""Invalid values that a .blend may hold of the extension's properties, each a function of a small scene.

They come from other versions, scripts, and damaged or missing files, not from Blender's interface.
"""

import contextlib
import os

import bpy

NAN, INFINITE = float("nan"), float("inf")
# What any property may be set to behind Blender's back; whatever is of another type Blender resets.
WRONG = (
    -3,
    0,
    77,
    2**31 - 1,
    -1.0,
    NAN,
    INFINITE,
    -INFINITE,
    1e38,
    "",
    "no such thing",
    [NAN] * 2,
    [0.0] * 7,
)
# Made of arrays so long that the machine would only be slow.
LONG = {"samples", "projector_count", "iso_surfaces", "motion_steps", "detail"}


def raw(owner):
    """A property group's or an ID's properties as the file has them, without limits."""
    if hasattr(owner, "bl_system_properties_get"):  # from 5.0
        return owner.bl_system_properties_get(do_create=True)
    return owner


def put(owner, name: str, value) -> None:
    """Store a value under a property's name, whatever the property is."""
    stored = raw(owner)
    if name in stored:
        del stored[name]
    with contextlib.suppress(TypeError):  # what no file can hold
        stored[name] = value
    owner.id_data.update_tag()


def put_inputs(obj, socket_type: str | None, value) -> None:
    """Set the inputs of one type in an object's node modifiers, or all inputs without a type."""
    for modifier in obj.modifiers:
        for item in modifier.node_group.interface.items_tree if modifier.type == "NODES" else ():
            if item.item_type != "SOCKET" or item.in_out != "INPUT":
                continue
            if socket_type not in (None, item.socket_type):
                continue
            if bpy.app.version < (5, 2, 0):
                modifier.pop(item.identifier, None)
                modifier[item.identifier] = value
            else:
                with contextlib.suppress(TypeError, AttributeError, ValueError):  # it has a type
                    getattr(modifier.properties.inputs, item.identifier).value = value
    obj.update_tag()


def take_from_a_lost_library(s, objects) -> None:
    """Let the scene have objects of a file that is not there any more, and what they need."""
    path = os.path.join(bpy.app.tempdir, "lost.blend")
    names = [obj.name for obj in objects]
    collection = bpy.data.collections.new("Linked")
    for obj in objects:
        collection.objects.link(obj)
    bpy.data.libraries.write(path, {collection})
    needed = {*objects, *(child for obj in objects for child in obj.children)}
    bpy.data.batch_remove([collection, *needed])
    with bpy.data.libraries.load(path, link=True) as (_, here):
        here.collections = ["Linked"]
    s.scene.collection.children.link(here.collections[0])
    linked = [next(o for o in bpy.data.objects if o.library and o.name == name) for name in names]
    if len(linked) > 1:
        for slot, obj in zip(s.settings.surfaces, linked, strict=True):
            slot.object = obj
    else:
        s.camera = s.scene.camera = linked[0]
    os.remove(path)


class Scene:
    """A cube before a flexible camera whose volume is bent."""

    def __init__(self):
        bpy.ops.mesh.primitive_cube_add(location=(0, 0, -3))
        self.cube = bpy.context.object
        bpy.ops.scfpf.camera_add(preset="linear_twist")
        self.scene, self.camera = bpy.context.scene, bpy.context.object
        self.settings = self.camera.scfpf
        self.surfaces = [slot.object for slot in self.settings.surfaces]
        render = self.scene.render
        render.resolution_x, render.resolution_y, render.engine = 16, 9, "SCFPF"
        self.settings.samples = 1
        self.scene.cycles.samples = 1

    def activate(self, obj) -> None:
        for other in bpy.context.view_layer.objects:
            other.select_set(other == obj)
        bpy.context.view_layer.objects.active = obj


def all_settings_are(value):
    def spoil(s: Scene) -> None:
        groups = [s.settings, s.scene.scfpf_sampling, s.scene.scfpf_drawn, *s.settings.surfaces]
        for kind in ("LENS", "DISTORTION", "DISPLAY"):
            s.activate(s.camera)
            bpy.ops.scfpf.mapping_add(kind=kind)
        groups += list(s.settings.mappings)
        for group in groups:
            for prop in group.bl_rna.properties:
                is_value = prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING")
                if prop.is_readonly or not is_value or prop.identifier in ("enabled", "name"):
                    continue
                if prop.identifier not in LONG or value not in (77, 2**31 - 1):
                    put(group, prop.identifier, value)

    return spoil


def enums_are_out_of_range(s):
    put(s.settings, "basis", 77)
    put(s.settings, "reparameterisation", -3)
    put(s.settings, "fit", 9)
    put(s.surfaces[0].scfpf_surface, "kind", 99)


def a_thousand_million_samples(s):
    put(s.settings, "samples", 2**31 - 1)


def thousands_of_lines(s):
    put(s.settings, "projector_count", 2**31 - 1)
    put(s.settings, "iso_surfaces", 2**31 - 1)


def pointers_lead_to_other_types(s):
    put(s.settings.surfaces[0], "object", s.camera)
    put(s.settings.surfaces[1], "object", s.scene)
    put(s.settings, "volume_object", s.camera)


def a_surface_is_an_empty(s):
    put(s.settings.surfaces[0], "object", bpy.data.objects.new("Nothing", None))


def a_surface_is_a_lamp(s):
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    s.scene.collection.objects.link(lamp)
    lamp.scfpf_surface.kind = "PLANE"
    put(s.settings.surfaces[1], "object", lamp)


def the_volume_object_is_a_surface(s):
    put(s.settings, "volume_object", s.surfaces[0])


def a_surface_is_removed(s):
    bpy.data.objects.remove(s.surfaces[0])


def all_objects_but_the_camera_are_removed(s):
    bpy.data.batch_remove([obj for obj in bpy.data.objects if obj != s.camera])


def the_camera_s_data_is_removed(s):
    bpy.data.cameras.remove(s.camera.data)


def a_surface_is_on_the_list_twice(s):
    put(s.settings.surfaces[1], "object", s.surfaces[0])


def surfaces_wait_for_each_other(s):
    for first, second in ((s.camera, s.surfaces[0]), (s.surfaces[0], s.surfaces[1])):
        first.constraints.new("COPY_LOCATION").target = second
    s.surfaces[1].constraints.new("CHILD_OF").target = s.camera


def the_camera_is_its_surface_s_child(s):
    first = s.surfaces[0]
    first.parent = None
    s.camera.parent = first


def modifiers_are_gone(s):
    for obj in bpy.data.objects:
        obj.modifiers.clear()


def node_groups_are_gone(s):
    for group in list(bpy.data.node_groups):
        bpy.data.node_groups.remove(group)


def node_groups_have_no_sockets(s):
    for group in bpy.data.node_groups:
        group.interface.clear()


def node_groups_have_no_nodes(s):
    for group in bpy.data.node_groups:
        group.nodes.clear()


def node_groups_have_other_sockets(s):
    for group in bpy.data.node_groups:
        for item in list(group.interface.items_tree):
            item.name = "Odd"
            if item.in_out == "INPUT":
                item.socket_type = "NodeSocketString"


def meshes_are_empty(s):
    for surface in s.surfaces:
        surface.modifiers.clear()
        surface.data.clear_geometry()
    for surface, kind in zip(s.surfaces, ("GRID", "UV_MESH", "PATCH"), strict=False):
        surface.scfpf_surface.kind = kind
        surface.modifiers.clear()
        surface.data.clear_geometry()


def meshes_are_no_grids(s):
    for surface, kind in zip(s.surfaces, ("GRID", "UV_MESH"), strict=False):
        surface.modifiers.clear()
        surface.scfpf_surface.kind = kind
        surface.data.clear_geometry()
        surface.data.from_pydata([(0, 0, 0), (NAN, 0, 0), (0, INFINITE, 0)], [], [(0, 1, 2)])


def surfaces_have_no_size(s):
    s.surfaces[0].scale = (0, 0, 0)
    s.surfaces[1].scale = (1, 0, 1)


def surfaces_are_nowhere(s):
    s.surfaces[0].location = (NAN, 1e38, -INFINITE)
    s.camera.matrix_world = [[NAN] * 4] * 4


def the_camera_has_no_size(s):
    s.camera.scale = (0, 0, 0)


def parameters_are_no_numbers(s):
    for surface in s.surfaces:
        put_inputs(surface, "NodeSocketFloat", NAN)


def texts_are_long(s):
    s.settings.report = "ä" * 100_000
    s.settings.found_object = s.settings.pick_object = "<b>%s{}" * 14_000
    put(s.settings.blend_ends, "preset", "../" * 30_000)


def several_cameras_share_surfaces(s):
    for _ in range(3):
        s.activate(s.camera)
        bpy.ops.object.duplicate(linked=True)
        put(bpy.context.object.scfpf, "volume_object", s.settings.volume_object)


def a_camera_blends_with_itself(s):
    put(s.settings.blend_ends, "first", s.camera)
    put(s.settings.blend_ends, "second", s.cube)


def mappings_lack_what_they_need(s):
    for kind in ("RADIAL_CURVE", "GRID", "ST_MAP"):
        s.activate(s.camera)
        bpy.ops.scfpf.mapping_add(kind=kind)
    curve, grid, image = s.settings.mappings
    put(curve, "curve", bpy.data.node_groups.new("Shader", "ShaderNodeTree"))
    put(grid, "grid", s.camera)
    put(image, "image", bpy.data.images.new("Thin", 1, 1))
    put(s.settings, "active_mapping", 99)


def a_mapping_s_curve_is_empty(s):
    s.activate(s.camera)
    bpy.ops.scfpf.mapping_add(kind="RADIAL_CURVE")
    s.settings.mappings[0].curve.nodes.clear()


def a_mapping_s_grid_is_empty(s):
    s.activate(s.camera)
    bpy.ops.scfpf.mapping_add(kind="GRID")
    s.settings.mappings[0].grid.data.clear_geometry()


def an_image_is_missing(s):
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "//nowhere/lost.exr"
    s.activate(s.camera)
    bpy.ops.scfpf.mapping_add(kind="ST_MAP")
    put(s.settings.mappings[0], "image", image)


def tables_are_no_objects(s):
    for key in ("scfpf_table", "scfpf_rig_table", "scfpf_rig_of"):
        s.camera[key] = s.surfaces[0][key] = "text"


def rig_of(s):
    """The settings of a new Cycles rig of the camera."""
    s.activate(s.camera)
    bpy.ops.scfpf.cycles_rig()
    return next(c for c in bpy.data.collections if c.scfpf_rig.is_rig).scfpf_rig


def preview_of(s):
    """The settings of a new nodes preview of the camera."""
    s.activate(s.camera)
    bpy.ops.scfpf.preview_toggle()
    return next(c for c in bpy.data.collections if c.scfpf_preview.is_source).scfpf_preview


def a_rig_has_lost_its_numbers(s):
    settings = rig_of(s)
    for name in ("chords", "bounces", "bounces_before"):
        put(settings, name, -1)
    put(settings, "cells", [0, -5])
    for name in ("error", "cost", "missing"):
        put(settings, name, NAN)
    put(settings, "engine_before", "NO_ENGINE")
    put(settings, "camera_before", s.cube)


def a_rig_has_lost_its_parts(s):
    settings = rig_of(s)
    settings.portals.modifiers.clear()
    settings.portals.data.clear_geometry()
    settings.portals.data.materials.clear()
    settings.portals.animation_data_clear()


def a_rig_is_of_something_else(s):
    settings = rig_of(s)
    put(settings, "camera", s.cube)
    put(settings, "portals", s.camera)


def a_preview_has_lost_its_parts(s):
    settings = preview_of(s)
    settings.parts[0].picture.modifiers.clear()
    settings.table.modifiers.clear()
    put(settings, "view_layer", "none")


def a_preview_is_of_something_else(s):
    settings = preview_of(s)
    put(settings, "camera", s.cube)
    put(settings, "table", s.camera)


def a_preview_divides_for_ever(s):
    put_inputs(preview_of(s).parts[0].picture, "NodeSocketInt", 2**30)


def a_preview_s_table_is_endless(s):
    put_inputs(preview_of(s).table, "NodeSocketInt", 2**30)


def surfaces_have_more_faces_than_can_be(s):
    for surface in s.surfaces:
        put_inputs(surface, "NodeSocketInt", 2**30)


def parameters_are_of_other_types(s):
    for surface, value in zip(s.surfaces, ("text", [1.0, 2.0], {"a": 1}), strict=False):
        put_inputs(surface, None, value)


def groups_are_other_things(s):
    for owner in (s.camera, s.surfaces[0], s.scene, s.scene.collection, *bpy.data.collections):
        for value in ("text", 5, [1.0, 2.0], {"a": 1}):
            for prop in owner.bl_rna.properties:
                if prop.identifier.startswith("scfpf"):
                    put(owner, prop.identifier, value)


def collections_are_other_things(s):
    put(s.settings, "mappings", "text")
    put(s.settings, "blend_ends", [1.0, 2.0])
    put(s.settings, "surfaces", [{"object": 5, "weight": "text"}, {}])


def the_library_of_surfaces_is_missing(s):
    take_from_a_lost_library(s, s.surfaces)


def the_library_of_the_camera_is_missing(s):
    take_from_a_lost_library(s, [s.camera])


def everything_is_on(s):
    collection = bpy.data.collections.new("Odd")
    collection.scfpf_rig.is_rig = collection.scfpf_preview.is_source = True
    for obj in (s.cube, s.surfaces[0]):
        put(obj.scfpf, "enabled", True)
        put(obj.scfpf_surface, "is_volume", True)


HELPERS = {
    all_settings_are,
    put,
    put_inputs,
    raw,
    take_from_a_lost_library,
    rig_of,
    preview_of,
    Scene,
}
SPOILED = {
    name: made
    for name, made in list(globals().items())
    if getattr(made, "__module__", "") == __name__ and made not in HELPERS
} | {f"all settings are {value!r}": all_settings_are(value) for value in WRONG}
# Those that need the nodes of the Cycles rig or the nodes preview, which take seconds to build.
WITH_NODES = {name for name in SPOILED if name.startswith(("a_rig_", "a_preview_"))}
