# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools for surfaces, mappings, layers, pins and cameras that fail at any step leave the file as it was.

Volumes here have keyframes and a driver in their lists, which go with the items that tools move and remove.
"""

import os
import sys

import bpy
import numpy as np
import pytest
from file_state import called_functions, differences, fault_in, settled_state

sys.path.append(os.path.join(os.path.dirname(__file__), "..", "aim", "support"))

from aim_scenes import box_scene

OPERATORS = bpy.ops.scfpf


def select(*names):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[-1]]


def at(depth, x=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, 0.0, -depth
    return matrix


def grid(depth):
    x, y = np.meshgrid(np.linspace(-3, 3, 4), np.linspace(-2, 2, 3))
    return np.stack([x, y, 0.2 * x - depth], axis=2)


SURFACES = {
    "Near": ("PLANE", at(2.0), {"width": 2.0, "height": 1.5}, None),
    "Middle": ("CYLINDER", at(5.0), {}, None),
    "Grid": ("GRID", at(0.0), None, grid(8.0)),
    "Far": ("PLANE", at(12.0, 1.0), {"width": 9.0, "height": 6.0}, None),
}


def volume(addon, active=0, kinds=SURFACES):
    """A camera with a bent, keyframed volume, two mappings and two layers, and a cube."""
    flexible = addon("bridge.camera.flexible_camera")
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -6))
    bpy.ops.object.camera_add()
    camera = bpy.context.object
    camera.name = "Camera"
    for name in kinds:
        kind, matrix, parameters, points = SURFACES[name]
        flexible.add_surface(camera, kind, name, matrix, parameters, points)
    flexible.make_flexible(camera)
    settings = camera.scfpf
    settings.basis = "NURBS"
    for kind in ("GRID", "LENS"):
        assert OPERATORS.mapping_add(kind=kind) == {"FINISHED"}
    for number, slot in enumerate(settings.surfaces):
        slot.weight = 1.0 + number
        slot.keyframe_insert("weight", frame=1)
    camera.driver_add(f"scfpf.surfaces[{len(kinds) - 1}].weight").driver.expression = "3.0"
    settings.mappings[1].keyframe_insert("influence", frame=1)
    settings.active_surface = active
    bpy.context.view_layer.update()
    return camera


def middle(addon):
    volume(addon, 1)


def first_mapping(addon):
    volume(addon, 1).scfpf.active_mapping = 0


def on_grid(addon):
    volume(addon, 2)


def on_patch(addon):
    volume(addon, 2)
    assert OPERATORS.surface_to_patch() == {"FINISHED"}
    select("Camera")


def polyline(addon):
    volume(addon, 1).scfpf.basis = "POLYLINE"


def shared(addon):
    volume(addon, 1)
    bpy.ops.object.duplicate(linked=True)
    bpy.context.object.name = "Other"
    select("Camera")


def scaled(addon):
    camera = volume(addon, 1)
    camera.scfpf.surfaces[1].object.scale = 2.0, 2.0, 2.0
    bpy.context.view_layer.update()


def with_cube(addon):
    volume(addon, 1)
    select("Cube", "Camera")


def cube_active(addon):
    volume(addon, 1)
    bpy.context.scene.camera = bpy.data.objects["Camera"]
    select("Camera", "Cube")


def framed(addon):
    camera = volume(addon, 0, ("Near", "Far"))
    camera.scfpf.fit, camera.scfpf.fitted_aspect = "WIDTH", 1.0
    camera.data.sensor_fit = "HORIZONTAL"


def attachable(addon):
    volume(addon, 0)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=2)
    bpy.context.object.name = "Sheet"
    select("Sheet", "Camera")


def layered(addon):
    camera = volume(addon, 0)
    for name in ("One", "Two"):
        bpy.ops.mesh.primitive_cube_add(location=(0, 0, -8))
        bpy.context.object.name = name
        assert OPERATORS.layer_add(camera="Camera") == {"FINISHED"}
    camera.scfpf.layers[1].keyframe_insert("is_on", frame=1)
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 16, 12
    select("Camera")


def pinned(_addon):
    box_scene(bpy.context.scene)
    for place in ((1, 0, 1), (0, 0, 1)):
        assert OPERATORS.aim_pin_add(camera="Camera", point=place) == {"FINISHED"}


def plain(_addon):
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -6))
    bpy.ops.object.camera_add()
    bpy.context.object.name = "Camera"


def empty(_addon):
    pass


def in_viewport(operator):
    """Call an operator in a 3D viewport, which a file without a window has as well."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator()


# By name: the scene, and the action.
CASES = {
    "Add Control Surface": (middle, lambda: OPERATORS.surface_add(kind="SPHERE", select=True)),
    "Use Selected as Control Surface": (attachable, OPERATORS.surface_attach),
    "Remove Control Surface": (middle, OPERATORS.surface_remove),
    "Move Control Surface": (middle, lambda: OPERATORS.surface_move(direction="DOWN")),
    "Select Control Surface": (middle, OPERATORS.surface_select),
    "Edit Volume": (middle, OPERATORS.edit_volume),
    "Insert Control Surface": (middle, OPERATORS.surface_insert),
    "Insert in a polyline": (polyline, OPERATORS.surface_insert),
    "Duplicate Control Surface": (middle, OPERATORS.surface_duplicate),
    "Swap Near and Far": (middle, OPERATORS.volume_swap),
    "Mirror": (middle, OPERATORS.volume_mirror),
    "Mirror a patch": (on_patch, lambda: OPERATORS.volume_mirror(axis="V")),
    "Near Surface to View": (middle, lambda: in_viewport(OPERATORS.surface_snap_to_view)),
    "Align to Active Object": (cube_active, OPERATORS.surface_align),
    "Make Surfaces Single-User": (shared, OPERATORS.volume_single_user),
    "Fit Volume Around Selection": (with_cube, OPERATORS.volume_fit),
    "Fit to Resolution": (framed, OPERATORS.volume_fit_picture),
    "Frame Picture": (middle, lambda: OPERATORS.volume_frame(pan=0.2, zoom=1.2)),
    "Convert to Grid": (middle, OPERATORS.surface_to_grid),
    "Convert to Surface Patch": (middle, OPERATORS.surface_to_patch),
    "Convert a patch to a grid": (on_patch, OPERATORS.surface_to_grid),
    "Subdivide a grid": (on_grid, OPERATORS.surface_subdivide),
    "Subdivide a patch": (on_patch, OPERATORS.surface_subdivide),
    "Equalize by Arc Length": (on_grid, OPERATORS.surface_equalise),
    "Apply Scale to Sizes": (scaled, OPERATORS.surface_apply_scale),
    "Convert Volume to Lattice": (middle, OPERATORS.volume_to_lattice),
    "Add Image Mapping": (middle, lambda: OPERATORS.mapping_add(kind="GRID")),
    "Remove Image Mapping": (middle, OPERATORS.mapping_remove),
    "Remove a deformed grid": (first_mapping, OPERATORS.mapping_remove),
    "Move Image Mapping": (middle, lambda: OPERATORS.mapping_move(direction="UP")),
    "Select Grid": (first_mapping, OPERATORS.mapping_grid_select),
    "Write ST Map": (middle, OPERATORS.st_map_write),
    "Remove Layer": (layered, OPERATORS.layer_remove),
    "Move Layer": (layered, lambda: OPERATORS.layer_move(direction="UP")),
    "Check Layers": (layered, OPERATORS.layer_check),
    "Plan Renders": (middle, OPERATORS.joined_plan),
    "Add Straight Line": (pinned, lambda: OPERATORS.aim_line_add(**ends())),
    "Add Stay": (with_cube, lambda: OPERATORS.aim_stay_add(object="Cube")),
    "Remove Target": (pinned, OPERATORS.aim_remove),
    "Move Target": (pinned, lambda: OPERATORS.aim_move(direction="UP")),
    "Live Aim": (pinned, OPERATORS.aim_live),
    "Flexible Projection, on": (plain, OPERATORS.camera_toggle),
    "Flexible Projection, off": (middle, OPERATORS.camera_toggle),
    "Duplicate Flexible Camera": (middle, OPERATORS.camera_duplicate),
    "Drawn Style": (empty, OPERATORS.drawn_style),
    "Tutorial Scene": (empty, OPERATORS.tutorial_scene),
    "Use Flexible Projection for F12": (middle, OPERATORS.engine_use),
    "Pick Projector": (middle, lambda: OPERATORS.pick(camera="Camera")),
    "Find in Picture": (with_cube, OPERATORS.find_in_image),
}
# So many of the functions that an action calls fail, each in turn.
STEPS = 12


@pytest.mark.parametrize("case", CASES)
def test_a_fault_at_any_step_leaves_everything_as_it_was(addon, extension, empty_file, case):
    """Steps are spread over the functions that the action calls, from its first to its last."""
    setup, action = CASES[case]
    setup(addon)
    functions = called_functions(extension.__path__[0], action)
    start_again(setup, addon)
    before, traces, failed = settled_state(), [], 0
    for number in np.unique(np.linspace(0, len(functions) - 1, STEPS).astype(int)):
        function = functions[number]
        with fault_in(function) as happened:
            try:
                outcome = str(action())
            except RuntimeError as error:
                outcome = str(error)
        failed += bool(happened)  # a few keep what they have computed, and are called once
        changed = differences(before, settled_state())
        if "Traceback" in outcome:
            traces.append((function.__qualname__, outcome))
        elif "FINISHED" not in outcome and changed:
            traces.append((function.__qualname__, [text[:200] for text in changed[:6]]))
        if changed:
            start_again(setup, addon)
            before = settled_state()
    assert traces == [] and failed >= min(len(functions), STEPS) - 3


def start_again(setup, addon):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    setup(addon)


def ends():
    """The handles of two pins, as arguments."""
    names = [target.handle.name for target in bpy.data.objects["Camera"].scfpf.aim_targets]
    return {"first": names[0], "second": names[1]}


def test_the_way_back_of_a_surface_that_the_edit_has_removed(addon):
    """Blender would crash if a modifier that is gone were set."""
    module, kept = addon("bridge.surfaces.surface_object"), addon("bridge.blender.all_or_nothing")
    surfaces = [module.new_surface(name, "PLANE", {"width": 2.0}) for name in ("Stays", "Goes", "Bare")]
    for surface in surfaces:
        bpy.context.scene.collection.objects.link(surface)
    stays, goes, bare = surfaces
    with pytest.raises(ZeroDivisionError), kept.all_or_nothing():
        for surface in surfaces:
            module.set_surface_parameters(surface, {"width": 5.0})
        bpy.data.objects.remove(goes)
        bare.modifiers.clear()
        raise ZeroDivisionError
    bpy.context.view_layer.update()
    evaluated = stays.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert max(vertex.co.x for vertex in evaluated.data.vertices) == pytest.approx(1.0)
    assert len(bare.modifiers) == 0


def test_what_a_block_has_removed_has_no_way_back(addon, empty_file):
    """Of a temporary object that the block has changed: its groups and custom properties as well."""
    module = addon("bridge.blender.all_or_nothing")
    scene = bpy.context.scene
    before, scene.frame_start = scene.frame_start, 5
    with pytest.raises(KeyError, match="of the test"), module.all_or_nothing() as kept:
        module.keep(scene, "frame_start")
        scene.frame_start = 9
        passing = bpy.data.objects.new("Passing", bpy.data.cameras.new("Passing"))
        module.keep(passing, "location", "scale")
        module.keep(passing.scfpf, "basis")
        module.keep(passing.data)
        kept.keep_keys(passing)
        module.keep_whole(passing.data)
        passing.location, passing.scfpf.basis, passing["scfpf_test"] = (1, 2, 3), "POLYLINE", 1
        bpy.data.cameras.remove(passing.data)
        raise KeyError("of the test")
    assert scene.frame_start == 5 and not bpy.data.objects and not bpy.data.cameras
    scene.frame_start = before


def test_an_object_in_edit_mode_does_not_go_with_its_kept_mesh(addon, empty_file):
    """Blender gives it no other mesh: removing its own would delete it."""
    module = addon("bridge.blender.all_or_nothing")
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    mesh, count = cube.data, len(bpy.data.meshes)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(KeyError, match="of the test"), module.all_or_nothing():
        module.keep_whole(mesh)
        raise KeyError("of the test")
    assert cube.name in bpy.data.objects and cube.data == mesh and len(bpy.data.meshes) == count
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(mesh.vertices) == 8
