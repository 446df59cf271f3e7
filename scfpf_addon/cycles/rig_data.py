# SPDX-License-Identifier: GPL-3.0-or-later
"""The datablocks of a Cycles rig: made when it is switched on, all removed when it is switched off.

They live in the scene itself, in a collection of their own that viewports do not show. A driver hides the
sheets from the renders of all cameras except the rig's own, with or without the add-on.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..bridge.blender import versions
from ..bridge.blender.all_or_nothing import PLACE, Kept, all_or_nothing, put_back
from ..bridge.blender.drivers import follow_property, new_driver
from ..bridge.blender.modifier_inputs import input_identifiers, renew_relations, set_inputs
from ..bridge.blender.rig_mark import HIDDEN_RAYS, MARK_KEY, RIG_KEY, add_mark
from ..bridge.blender.scene_objects import holds, is_in_event
from ..bridge.camera.flexible_camera import sync_volume_object
from ..bridge.render.image_size import image_size
from ..bridge.surfaces import lattice_object
from ..projection.presets.preset import MAXIMUM_SURFACES
from ..projection.typing import Array
from ..projection.user_error import Message, UserError
from ..scanline.generated_collection import (
    follow_image_size,
    is_complete,
    linked_text,
    remove_generated,
    remove_replaced_groups,
    remove_unused_groups,
)
from ..scanline.nodes.geometry_nodes import has_all_groups, is_current
from ..scanline.table.table_object import release_pointers as release_table_pointers
from ..scanline.table.table_object import table_group_of, table_object
from . import aov_passes
from .chords.chord_plan import ChordPlan
from .portals import lens_nodes, pass_nodes, portal_nodes
from .portals.mapped_positions import mapped_positions
from .portals.paths import Faces
from .portals.portal_nodes import DEPTH, ONWARD
from .portals.screen import Screen, is_about, screen_for
from .portals.sheets import Portals, portals, sheet_shape
from .rig_cameras import new_camera, place_camera, place_dicing_camera, screen_of

MODIFIER = "SCFPF Portals"
# The camera's custom property that points to the rig's table; the nodes preview has a table of its own.
RIG_TABLE_KEY = "scfpf_rig_table"
# That for a rig of one render, which leaves the camera's other rig alone.
PASSING_TABLE_KEY = "scfpf_passing_table"
# Ray visibilities that are off: by the object, not by its material, at no cost.
UNSEEN_BY = tuple(ray for ray in HIDDEN_RAYS if ray != "visible_camera")
# Transparent bounces in addition to the chords: the screen, the far sheet, and one to spare.
MORE_BOUNCES = 3
MOST_BOUNCES = 1024
# Cycles' offscreen scale of subdivision that is as fine outside the view as inside.
SAME_OFFSCREEN = 1.0
# The present layout of rigs, whose screens fit the pixels; those of other versions have 0.
LAYOUT = 1
# Screens that differ by this factor less than e are left alone when the volume is edited.
SAME_SCREEN = 0.1
CYCLES = "CYCLES"
# Settings of Cycles that depend on the chords.
BOUNCES = "transparent_max_bounces", "min_transparent_bounces"
# Inputs of the modifier that depend on the sheets.
WRITTEN_INPUTS = ("Straight", "Chords", "Skip", "Probe", "Passes", "Along Axis")
# Those that place the screen.
SCREEN_INPUTS = ("Width", "Distance", "Away", "Parallel")
# The rigs to which handlers have given a node group, by session id, and the inputs of those whose group is
# released for undo or redo.
_given: set[int] = set()
_kept_inputs: dict[int, dict[str, object]] = {}
NO_CYCLES = "Cycles is switched off: enable its add-on in the Preferences"


def rigs() -> list:
    """The collections of all rigs in the file."""
    return [c for c in bpy.data.collections if c.scfpf_rig.is_rig and c.library is None]


def rig_of(scene):
    """The collection of a scene's rig, or None."""
    return next((rig for rig in rigs() if rig.scfpf_rig.scene == scene and is_whole(rig)), None)


def is_whole(rig) -> bool:
    """Return whether a rig has all its parts, and its camera is a flexible one of its scene."""
    settings = rig.scfpf_rig
    if settings.portals is None or settings.portals.modifiers.get(MODIFIER) is None:
        return False
    return is_complete(settings, rig, (settings.portals, settings.view_camera))


def check(scene, camera) -> None:
    """Raise UserError if a camera cannot have a rig in a scene."""
    if problem := linked_text(scene, camera, Message("render it there")):
        raise UserError(problem)
    require_cycles(scene)


def has_cycles(scene) -> bool:
    """Return whether the add-on Cycles is switched on, and its settings exist."""
    return hasattr(scene, "cycles")


def require_cycles(scene) -> None:
    """Raise UserError if Cycles is switched off."""
    if not has_cycles(scene):
        raise UserError(NO_CYCLES)


def check_surfaces(camera) -> None:
    """Raise UserError if the control surfaces have no table of projectors."""
    for slot in camera.scfpf.surfaces:
        if slot.object is not None and slot.object.scfpf_surface.kind == lattice_object.KIND:
            raise UserError(
                "Cycles cannot follow the lattice '{0}': use control surfaces instead of it, or "
                "render with Flexible Projection",
                slot.object.name,
            )
    count = len(camera.scfpf.surfaces)
    if not 2 <= count <= MAXIMUM_SURFACES:
        raise UserError(
            "'{0}' has too few control surfaces: a volume needs at least two; add one in the camera's "
            "properties or load a preset"
            if count < 2
            else "'{0}' has more than {1} control surfaces, the most that a volume may have: remove some",
            camera.name,
            MAXIMUM_SURFACES,
        )


def build_groups(camera) -> list[str]:
    """Build the node groups of a camera's rig, which takes long; return the names of the new ones."""
    before = {group.name for group in bpy.data.node_groups}
    with all_or_nothing():
        table_group_of(camera, with_inverse=False)
        portal_nodes.portal_group()
    return [group.name for group in bpy.data.node_groups if group.name not in before]


def remove_groups(names: list[str]) -> None:
    """Remove groups that ``build_groups`` has made and nothing uses."""
    groups = (bpy.data.node_groups.get(name) for name in names)
    remove_unused_groups([group for group in groups if group is not None])


def make_rig(scene, camera, chords: ChordPlan, passing: bool = False, passes: bool = False):
    """Make all datablocks of a camera's rig; return its collection. The scene then renders through it.

    Call it within ``all_or_nothing``. passing: whether the rig is made for one render: it does not follow
    the camera. passes: whether its portals write into AOVs.
    """
    sync_volume_object(camera)
    rig = bpy.data.collections.new(f"{camera.name} Cycles Rig")
    mark = _own_mark()
    portal_object = _new_portals(camera, scene, mark)
    view_camera = new_camera(f"{camera.name} Cycles")
    view_camera[MARK_KEY] = mark
    assert chords.cone is not None
    place_camera(view_camera, screen_for(chords.cone))
    dicing_camera = new_camera(f"{camera.name} Cycles Dicing")
    place_dicing_camera(dicing_camera, camera, chords.cone)
    for part in (portal_object, view_camera, dicing_camera):
        rig.objects.link(part)
        part.hide_select = True
        part.hide_viewport = True
        part[RIG_KEY] = camera
    rig.hide_viewport = rig.hide_select = True
    rig.color_tag = "COLOR_05"
    settings = rig.scfpf_rig
    settings.is_rig, settings.passing, settings.passes = True, passing, passes
    settings.layout = LAYOUT
    settings.camera, settings.scene = camera, scene
    settings.portals, settings.view_camera = portal_object, view_camera
    settings.dicing_camera = dicing_camera
    settings.is_own_view = chords.is_own_view
    update_nodes(rig)
    scene.collection.children.link(rig)
    _take_over(rig)
    write_sheets(rig, chords)
    return rig


def _own_mark() -> int:
    """The number of a new rig, which no other rig has."""
    taken = {rig.scfpf_rig.view_camera.get(MARK_KEY) for rig in rigs() if rig.scfpf_rig.view_camera}
    return next(number for number in range(1, len(taken) + 2) if number not in taken)


def _new_portals(camera, scene, mark: int):
    name = f"{camera.name} Portals"
    mesh = bpy.data.meshes.new(name)
    _give_materials(mesh, scene, camera)
    made = bpy.data.objects.new(name, mesh)
    made.modifiers.new(MODIFIER, "NODES")
    for name in UNSEEN_BY:
        setattr(made, name, False)
    # Sheets stay where they are in the middle of the frame: their directions would not be blurred with them.
    made.cycles.use_motion_blur = False
    _hide_from_others(made, mark)
    return made


def _hide_from_others(portal_object, mark: int) -> None:
    """Hide a rig's sheets from the renders of all cameras but its own."""
    # The scene is the rendered one: several may share the rig.
    add_mark(new_driver(portal_object, "hide_render", f"mark != {mark}"))


def _give_materials(mesh, scene, camera) -> None:
    """Give a rig's mesh new materials."""

    def follow(socket, path: str) -> None:
        follow_property(socket, "default_value", camera, path)

    mesh.materials.clear()
    for material in portal_nodes.new_materials(scene, follow):
        mesh.materials.append(material)


def renew_materials(rig) -> set:
    """Replace a rig's materials and its mark: another version of the add-on may have made them.

    Returns the materials that it had before, to be removed once nothing uses them.
    """
    settings = rig.scfpf_rig
    _hide_from_others(settings.portals, settings.view_camera[MARK_KEY])
    settings.layout = LAYOUT
    mesh = settings.portals.data
    before = set(mesh.materials) - {None}
    _give_materials(mesh, settings.scene, settings.camera)
    return before


def _take_over(rig) -> None:
    """Have the scene rendered through the rig with Cycles; the rig's settings keep the previous state."""
    settings = rig.scfpf_rig
    scene, camera, view_camera = settings.scene, settings.camera, settings.view_camera
    settings.camera_before, settings.engine_before = scene.camera, scene.render.engine
    settings.bounces_before = settings.bounces = scene.cycles.transparent_max_bounces
    scene.camera = view_camera
    scene.render.engine = CYCLES
    for marker in scene.timeline_markers:
        if marker.camera == camera:
            marker.camera = view_camera
    if scene.cycles.dicing_camera is None:
        # Adaptive subdivision would see the scene from where the rig's camera is. It is as fine outside the
        # view of its own camera as inside: projectors go anywhere.
        scene.cycles.dicing_camera = settings.dicing_camera
        settings.offscreen_before = scene.cycles.offscreen_dicing_scale
        scene.cycles.offscreen_dicing_scale = SAME_OFFSCREEN


def give_back(rig) -> None:
    """Restore the state before ``_take_over``, unless the artist has changed it."""
    settings = rig.scfpf_rig
    scene, camera, view_camera = settings.scene, settings.camera, settings.view_camera
    if scene is None:
        return
    for user in bpy.data.scenes:
        # Linked copies of the scene render through the rig as well.
        if view_camera is not None and user.camera == view_camera:
            user.camera = settings.camera_before or camera
    if settings.engine_before and scene.render.engine == CYCLES:
        scene.render.engine = settings.engine_before
    for marker in scene.timeline_markers:
        if view_camera is not None and marker.camera == view_camera:
            marker.camera = camera
    if not has_cycles(scene):
        return
    if scene.cycles.transparent_max_bounces == settings.bounces:
        scene.cycles.transparent_max_bounces = settings.bounces_before
    if scene.cycles.min_transparent_bounces == settings.least_bounces:
        scene.cycles.min_transparent_bounces = settings.least_before
    # Rigs of other versions had the flexible camera itself.
    if scene.cycles.dicing_camera == (settings.dicing_camera or camera):
        scene.cycles.dicing_camera = None
    if settings.offscreen_before and scene.cycles.offscreen_dicing_scale == SAME_OFFSCREEN:
        scene.cycles.offscreen_dicing_scale = settings.offscreen_before


def adopt(rig) -> None:
    """Assign a rig that was copied with its scene to the copy, with a table of its own."""
    settings = rig.scfpf_rig
    if settings.scene is None or not holds(settings.scene.collection.children, rig):
        # It may have been moved into another collection of its scene.
        holders = [scene for scene in bpy.data.scenes if rig in scene.collection.children_recursive]
        if holders and settings.scene not in holders:
            settings.scene = holders[0]
    scene, camera, portal_object = settings.scene, settings.camera, settings.portals
    if None in (scene, camera, portal_object, settings.table) or settings.table.parent == camera:
        return
    if portal_object.animation_data is None or not camera.is_editable:
        return
    try:
        update_nodes(rig)
    except UserError:
        return  # again as soon as the camera has surfaces; the panel says so
    for curve in portal_object.animation_data.drivers:
        for variable in curve.driver.variables:
            target = variable.targets[0]
            if variable.type == "SINGLE_PROP" and target.id_type == "SCENE":
                target.id = scene


def has_old_nodes(rig) -> bool:
    """Return whether another version of the add-on has made a rig's node group."""
    return not is_current(rig.scfpf_rig.portals.modifiers[MODIFIER].node_group)


def has_new_materials(rig) -> bool:
    """Return whether a rig's materials can turn rays that skip chords."""
    materials = rig.scfpf_rig.portals.data.materials
    return len(materials) > portal_nodes.PLAIN and pass_nodes.writes_place(materials[portal_nodes.JUMP])


def update_nodes(rig) -> None:
    """Bring the table and the modifier in step with the camera's surfaces and settings. Raises UserError."""
    settings = rig.scfpf_rig
    check_surfaces(settings.camera)
    of_rig = {"key": table_key(settings), "label": "Cycles Table", "scene": settings.scene}
    settings.table = table_object(settings.camera, **of_rig, with_inverse=False)
    settings.table[RIG_KEY] = settings.camera
    modifier = settings.portals.modifiers[MODIFIER]
    before = modifier.node_group
    # The present group if it is current, whatever its name.
    group = before if is_current(before) and has_all_groups(before) else portal_nodes.portal_group()
    if before != group:
        modifier.node_group = group
        if is_in_event():
            _given.add(rig.session_uid)
        set_inputs(modifier, _kept_inputs.pop(rig.session_uid, {}))
        follow_image_size(modifier, ("Aspect",), settings.scene)
        lens_nodes.follow_lens(modifier, settings.camera, settings.view_camera.data)
        remove_replaced_groups([before])
    focus = settings.camera.data.dof.focus_object
    values = {"Table": settings.table, "Focus Object": focus, "Has Focus Object": focus is not None}
    values |= _screen_inputs(screen_of(settings.view_camera)) | {"Passes": settings.passes}
    values["Along Axis"] = settings.is_own_view
    set_inputs(modifier, values)
    renew_relations(modifier)
    settings.portals.update_tag()


def write_passes(rig, on: bool) -> None:
    """Let the portals of a rig write passes, or not, without a look at anything else."""
    set_inputs(rig.scfpf_rig.portals.modifiers[MODIFIER], {"Passes": on})


def _screen_inputs(screen: Screen) -> dict[str, object]:
    """The inputs of the nodes that place a screen."""
    return {
        "Width": screen.width,
        "Distance": screen.distance,
        "Away": screen.away,
        "Parallel": screen.is_parallel,
    }


def fit_screen(rig, chords: ChordPlan, tolerance: float = 0.0) -> None:
    """Place a rig's camera and its screen for the pixels of a plan, unless they are about there.

    Rigs of other versions keep theirs until they are planned again.
    """
    settings = rig.scfpf_rig
    if chords.cone is None or settings.layout != LAYOUT:
        return
    if settings.spread != chords.cone.spread:
        settings.spread = chords.cone.spread
    screen = screen_for(chords.cone)
    if not is_about(screen, screen_of(settings.view_camera), tolerance):
        place_camera(settings.view_camera, screen)
        if settings.dicing_camera is not None:
            place_dicing_camera(settings.dicing_camera, settings.camera, chords.cone)
        # As float32 has them.
        values = _screen_inputs(screen_of(settings.view_camera))
        set_inputs(settings.portals.modifiers[MODIFIER], values)
        settings.portals.update_tag()


def follow_view(rig, is_own_view: bool) -> None:
    """Have the depth of a rig's passes measured along the camera's axis, or else along the projectors."""
    settings = rig.scfpf_rig
    if settings.is_own_view == is_own_view:
        return
    settings.is_own_view = is_own_view
    set_inputs(settings.portals.modifiers[MODIFIER], {"Along Axis": is_own_view})
    settings.portals.update_tag()


def mark_camera(rig) -> None:
    """Give the camera of a rig by another version its mark."""
    view_camera = rig.scfpf_rig.view_camera
    if view_camera is not None and MARK_KEY not in view_camera:
        view_camera[MARK_KEY] = _own_mark()


def table_key(settings) -> str:
    """The camera's custom property that points to a rig's table."""
    return PASSING_TABLE_KEY if settings.passing else RIG_TABLE_KEY


def release_pointers(rig) -> int:
    """Clear the pointers that handlers set, as is necessary before undo and redo; see ``table_object``.

    Returns the session id of the table for ``restore_pointers``, 0 if no pointer to one was cleared.
    """
    settings = rig.scfpf_rig
    table, camera, taken = settings.table, settings.camera, 0
    if table is not None:
        release_table_pointers(table)
        # A handler may have made it: see ``adopt``.
        if camera is not None and camera.is_editable and camera.get(table_key(settings)) == table:
            taken = table.session_uid
            del camera[table_key(settings)]
            settings.table = None
    modifier = _modifier(settings)
    if modifier is not None and modifier.node_group is not None:
        for item in modifier.node_group.interface.items_tree:
            if getattr(item, "socket_type", "") == "NodeSocketObject" and item.in_out == "INPUT":
                versions.set_modifier_input(modifier, item.identifier, None)
        if rig.session_uid in _given:
            # A modifier without a group loses its inputs.
            places = input_identifiers(modifier.node_group)
            _kept_inputs[rig.session_uid] = {
                name: versions.modifier_input(modifier, places[name]) for name in WRITTEN_INPUTS
            }
            modifier.node_group = None
    return taken


def _modifier(settings):
    """The modifier that places a rig's sheets, or None."""
    return None if settings.portals is None else settings.portals.modifiers.get(MODIFIER)


def restore_pointers(rig, table: int) -> None:
    """Set the pointers of a rig and its camera to their table again, a session id, if it exists.

    A rig that undo has brought back has its table; its camera may have lost the pointer to it.
    """
    settings = rig.scfpf_rig
    camera, modifier = settings.camera, _modifier(settings)
    if modifier is None or modifier.node_group is not None:
        _kept_inputs.pop(rig.session_uid, None)  # undo has brought back others
    if camera is None or not camera.is_editable:
        return
    if settings.table is None:
        settings.table = next((obj for obj in bpy.data.objects if obj.session_uid == table), None)
    if settings.table is not None and camera.get(table_key(settings)) is None:
        camera[table_key(settings)] = settings.table


def write_sheets(rig, chords: ChordPlan, faces: Faces | None = None) -> None:
    """Write a plan's sheets into the rig's mesh, and the plan's figures into its settings.

    faces: of sheets whose rays skip chords, None if they skip none. Raises UserError without Cycles.
    """
    settings = rig.scfpf_rig
    require_cycles(settings.scene)
    fit_screen(rig, chords)
    size = image_size(settings.scene)
    arrays = portals(chords.breaks, chords.shifts, chords.cells, size, chords.disc, faces)
    mapped = mapped_positions(settings.camera, settings.scene, arrays.places, chords.disc)
    _fill(settings.portals.data, arrays, mapped)
    settings.error, settings.cost, settings.missing = chords.error, chords.cost, chords.missing
    rows, columns = sheet_shape(chords.cells, chords.disc)
    settings.sheet_vertices = rows * columns
    settings.cells, settings.passed = chords.cells, 0.0 if faces is None else faces.passed
    values = {"Straight": chords.count == 1, "Chords": float(chords.count), "Skip": faces is not None}
    values |= {"Probe": False, "Passes": settings.passes}
    set_inputs(settings.portals.modifiers[MODIFIER], values)
    cycles = settings.scene.cycles
    if cycles.transparent_max_bounces != settings.bounces:
        settings.bounces_before = cycles.transparent_max_bounces  # the artist has chosen another
    settings.chords = chords.count
    wanted = settings.bounces_before + chords.count + MORE_BOUNCES
    settings.bounces = cycles.transparent_max_bounces = min(wanted, MOST_BOUNCES)
    # Portals count as transparent. Up to 5.1 Cycles does not make up for the paths that it ends at random
    # at portals in smoke, which then takes the light of half as much again.
    if cycles.min_transparent_bounces != settings.least_bounces:
        settings.least_before = cycles.min_transparent_bounces
    least = settings.least_before + chords.count + MORE_BOUNCES
    settings.least_bounces = cycles.min_transparent_bounces = min(least, MOST_BOUNCES)


@contextmanager
def sheets_kept(rig) -> Iterator[None]:
    """Restore the sheets, the materials and the figures of a rig if the block raises."""
    settings = rig.scfpf_rig
    portal_object, modifier = settings.portals, settings.portals.modifiers[MODIFIER]
    mesh = portal_object.data
    identifiers = input_identifiers(modifier.node_group)
    # Nodes of another version may lack some.
    present = [name for name in WRITTEN_INPUTS + SCREEN_INPUTS if name in identifiers]
    inputs = {name: versions.modifier_input(modifier, identifiers[name]) for name in present}
    backup = mesh.copy()
    try:
        with Kept() as kept:
            kept.keep(settings)
            for part in settings.view_camera, settings.dicing_camera:
                if part is not None:
                    kept.keep(part, *PLACE)
                    kept.keep(part.data)
            if has_cycles(settings.scene):
                kept.keep(settings.scene.cycles, *BOUNCES)
            yield
            kept.pop_all()
    except BaseException:
        put_back(backup, mesh)
        set_inputs(modifier, inputs)
        raise
    bpy.data.meshes.remove(backup)


def probe_mesh(rig, chords: ChordPlan, cells: tuple[int, int]) -> None:
    """Fill a rig's mesh so that its evaluated vertices are the ends of all chords, for ``read_ends``.

    cells: across and up a sheet. ``write_sheets`` restores the sheets.
    """
    settings = rig.scfpf_rig
    arrays = portals(chords.breaks, chords.shifts, cells, image_size(settings.scene), chords.disc)
    points = arrays._replace(triangles=arrays.triangles[:0], slots=arrays.slots[:0])
    _fill(settings.portals.data, points, np.zeros_like(arrays.places))
    values = {"Chords": float(chords.count), "Skip": False, "Passes": False, "Probe": True}
    set_inputs(settings.portals.modifiers[MODIFIER], values)
    settings.portals.update_tag()


def present_chords(rig):
    """The breaks and shifts of the chords in a rig's mesh, (n+1,) each."""
    settings = rig.scfpf_rig
    mesh = settings.portals.data
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", values)
    ends = values.reshape(-1, 3)[: settings.chords + 1].astype(np.float64)
    return ends[:, 0], ends[:, 1]


def _fill(mesh, arrays: Portals, mapped: Array) -> None:
    """Replace a mesh' geometry and attributes by those of a rig's sheets."""
    mesh.clear_geometry()
    count = len(arrays.triangles)
    mesh.vertices.add(arrays.places.shape[1])
    mesh.vertices.foreach_set("co", arrays.places.T.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", arrays.triangles.ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    slots = mesh.attributes.new("material_index", "INT", "FACE")
    slots.data.foreach_set("value", arrays.slots)
    attributes = (ONWARD, arrays.onward), (pass_nodes.LENGTH, arrays.length), (DEPTH, arrays.depth)
    for name, values in attributes:
        made = mesh.attributes.new(name, "FLOAT", "POINT")
        made.data.foreach_set("value", values.astype(np.float32))
    attribute = mesh.attributes.new(pass_nodes.MAPPED, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", mapped.T.astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    mesh.update_tag()


def remove_rig(rig, gives_back: bool = True) -> None:
    """Remove a rig and every datablock that was made for it, even if some are lost.

    gives_back: False if the scene's settings are those of another rig.
    """
    settings = rig.scfpf_rig
    if gives_back:
        give_back(rig)
    if settings.scene is not None and not settings.passing:
        aov_passes.remove(settings.scene)
    own = settings.portals, settings.view_camera, settings.dicing_camera, settings.table
    parts = [part for part in own if part is not None]
    meshes = {part.data for part in parts if part.type == "MESH"}
    materials = {material for mesh in meshes for material in mesh.materials} - {None}
    remove_generated(settings, rig, parts, table_key(settings), materials)
