# SPDX-License-Identifier: GPL-3.0-or-later
"""A session for test_crashes.py: undo of what the preview and the Cycles rig have followed.

They follow after Blender has stored the step. What two stored steps agree on Blender keeps as it is in
memory when it goes back: what that then pointed to was freed, and Blender crashed.
"""

import importlib
import os
import pathlib
import sys

import bpy

sys.path.append(str(pathlib.Path(__file__).parent))

from stored_edit import dangling


def _operator(name: str):
    """An operator, called so that its step is stored before anything is evaluated, as in a window."""
    module, function = name.split(".")
    return lambda **given: getattr(getattr(bpy.ops, module), function)("EXEC_DEFAULT", True, **given)


def _another_surface(camera):
    old = camera.scfpf.surfaces[0].object
    new = old.copy()
    bpy.context.scene.collection.objects.link(new)
    camera.scfpf.surfaces[0].object = new


def _select(obj):
    bpy.ops.object.select_all(action="DESELECT")
    obj.hide_select = False
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def _rename_groups(_camera):
    for group in list(bpy.data.node_groups):
        group.name = f"Renamed {group.name}"


def _free_tables(camera):
    """Tables without a parent: handlers must not make new ones, which a later step of undo removes."""
    for obj in bpy.data.objects:
        if obj.parent == camera and TABLE in obj.modifiers:
            obj.parent = None
    camera.scfpf.basis = "B_SPLINE"


def _select_surface(camera):
    _select(camera.scfpf.surfaces[0].object)


def _groupless_rig(camera):
    """A rig without its node group, which returns only when the camera has all its surfaces again."""
    camera["removed"] = camera.scfpf.surfaces[0].object
    camera.scfpf.surfaces[0].object = None
    for rig in bpy.data.collections:
        if rig.scfpf_rig.is_rig:
            bpy.data.node_groups.remove(rig.scfpf_rig.portals.modifiers[0].node_group)


def _surface_again(camera):
    camera.scfpf.surfaces[0].object = camera["removed"]


# The modifier of a table.
TABLE = "SCFPF Table"

# What is done before the steps, and the edit itself, by name.
EDITS = {
    "basis": (None, lambda camera: setattr(camera.scfpf, "basis", "NURBS")),
    "re-parameterisation": (None, lambda camera: setattr(camera.scfpf, "reparameterisation", "POLAR")),
    "kind": (
        None,
        lambda camera: setattr(camera.scfpf.surfaces[0].object.scfpf_surface, "kind", "SPHERE"),
    ),
    "another surface": (None, _another_surface),
    "other names of node groups": (None, _rename_groups),
    "tables without a parent": (None, _free_tables),
    "a surface more": (_select, "scfpf.surface_add"),
    "a thing more": (None, "mesh.primitive_cube_add"),
    "a surface's copy": (_select_surface, "object.duplicate"),
    "a surface less": (_select_surface, "object.delete"),
    "the camera's copy": (_select, "object.duplicate"),
    "no camera": (_select, "object.delete"),
    "the rig's node group again": (_groupless_rig, _surface_again),
}


def _few_nodes():
    """The preview's two largest groups pass the mesh on: Blender relinks every node at each undo."""
    package = "bl_ext.checkout.scfpf.scfpf_addon.scanline"
    nodes = importlib.import_module(f"{package}.nodes.geometry_nodes")
    remap = importlib.import_module(f"{package}.remap.remap_nodes")
    for name in ("whole_group", "draft_group"):
        title = f"SCFPF {name.partition('_')[0].title()}"
        define = nodes.defines_group(title, remap.REFINE_INPUTS, {"Mesh": "Geometry"})
        setattr(remap, name, define(lambda _nodes, given: {"Mesh": given["Mesh"]}))


class SCFPF_OT_test_edit(bpy.types.Operator):
    """Does one of EDITS to the camera named."""

    bl_idname = "scfpf.test_edit"
    bl_label = "Edit"
    bl_options = {"UNDO"}  # noqa: RUF012

    edit: bpy.props.StringProperty()
    camera: bpy.props.StringProperty()

    def execute(self, _context):
        EDITS[self.edit][1](bpy.data.objects[self.camera])
        return {"FINISHED"}


def _is_placed(rig):
    """Return whether the sheets of a rig are placed for its number of chords, if it has its node group."""
    modifier = rig.portals.modifiers[0]
    package = "bl_ext.checkout.scfpf.scfpf_addon.bridge.blender"
    if modifier.node_group is None:
        return True
    place = importlib.import_module(f"{package}.modifier_inputs").input_identifiers(modifier.node_group)
    chords = importlib.import_module(f"{package}.versions").modifier_input(modifier, place["Chords"])
    return chords == rig.chords


def _facts(name: str):
    """Names of objects that handlers make for cameras: tables, members of previews and parts of rigs."""
    camera = bpy.data.objects.get(name)
    tables = {}
    for obj in bpy.data.objects:
        if obj.parent is not None and TABLE in obj.modifiers:
            group = obj.modifiers[TABLE].node_group
            tables[obj.name] = (group.name, obj.parent.name)
    members = sorted(
        obj.name
        for source in bpy.data.collections
        if source.scfpf_preview.is_source
        for part in source.scfpf_preview.parts
        for obj in part.members.objects
    )
    rigs = sorted((c.name, _is_placed(c.scfpf_rig)) for c in bpy.data.collections if c.scfpf_rig.is_rig)
    listed = None if camera is None else [s.object and s.object.name for s in camera.scfpf.surfaces]
    if listed and None in listed:
        tables = {}  # handlers make none again before the camera has all its surfaces
    return tables, members, rigs, listed


@bpy.app.handlers.persistent
def _look(*_):
    """Right after Blender has gone back, before anything follows a pointer."""
    lost = dangling()
    if lost:
        print(f"These point to what is gone: {lost}", file=sys.stderr, flush=True)
        os._exit(1)


def main() -> None:
    """All edits one after the other: preview and rig take seconds to make."""
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=sys.argv[-1], remote_url=""
    )
    assert bpy.ops.preferences.addon_enable(module="bl_ext.checkout.scfpf") == {"FINISHED"}
    bpy.utils.register_class(SCFPF_OT_test_edit)
    _few_nodes()
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.insert(0, _look)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.context.scene.render.resolution_percentage = 10
    bpy.ops.scfpf.camera_add(preset="curved_convergence")
    name = bpy.context.object.name
    # Few chords: to plan them took most of the time.
    bpy.context.object.scfpf.pixel_error = 2.0
    bpy.ops.scfpf.cycles_rig()
    bpy.context.view_layer.objects.active = bpy.data.objects[name]
    bpy.ops.scfpf.preview_toggle()
    for edit, (prepare, act) in EDITS.items():
        if prepare is not None:
            prepare(bpy.data.objects[name])
        bpy.context.view_layer.update()
        for number in range(2):
            bpy.ops.ed.undo_push(message=f"before {edit} {number}")
        before = _facts(name)
        if isinstance(act, str):
            _operator(act)()
        else:
            bpy.ops.scfpf.test_edit("EXEC_DEFAULT", True, edit=edit, camera=name)
        bpy.context.view_layer.update()
        after = _facts(name)
        for move, expected in (("undo", before), ("redo", after), ("undo", before)):
            getattr(bpy.ops.ed, move)()
            bpy.context.view_layer.update()
            assert _facts(name) == expected, (edit, move)
    print("SURVIVED", flush=True)
    os._exit(0)  # Blender 4.5's module may wait for itself at its own end


main()
