# SPDX-License-Identifier: GPL-3.0-or-later
"""The datablocks of a Cycles rig: made when it is switched on, all removed when it is switched off.

They live in the scene itself, in a collection of their own that viewports do not show. A driver
hides the sheets from the renders of all cameras but the rig's own, with or without the add-on.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..bridge.blender import versions
from ..bridge.blender.rig_mark import RIG_KEY, WIDTH
from ..bridge.blender.scene_objects import absent_text, holds
from ..bridge.camera.flexible_camera import sync_volume_object
from ..bridge.render.image_size import image_size
from ..bridge.surfaces import lattice_object
from ..projection.presets.preset import MAXIMUM_SURFACES
from ..projection.typing import Array
from ..scanline.nodes.field_nodes import is_current
from ..scanline.preview.preview_data import FOLLOWED, follow_scene, group_input, remove_unused_groups
from ..scanline.table.table_object import follow_property, table_group_of, table_object
from ..scanline.table.table_object import release_pointers as release_table_pointers
from . import aov_passes
from .chords.chord_plan import ChordPlan
from .portals import lens_nodes, pass_nodes, portal_nodes
from .portals.mapped_places import seen_places
from .portals.portal_nodes import AWAY, BEFORE_SCREEN, END, START, TO_SCREEN
from .portals.sheets import SURROUND_CORNERS, Portals, portals

MODIFIER = "SCFPF Portals"
# The camera's custom property that names the rig's table; the live preview has one of its own.
RIG_TABLE_KEY = "scfpf_rig_table"
# All other rays pass the rig by, at no cost: told by the object, not by its material.
UNSEEN_BY = (
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)
# Transparent bounces beside the chords: the screen, the far sheet, and one to spare.
MORE_BOUNCES = 3
MOST_BOUNCES = 1024
CYCLES = "CYCLES"
NO_CYCLES = "Cycles is switched off: enable its add-on in the Preferences"


class RigError(ValueError):
    """The rig cannot be made; the message says what to do."""


def rigs() -> list:
    """The collections of all rigs in the file."""
    return [c for c in bpy.data.collections if c.scfpf_rig.is_rig and c.library is None]


def rig_of(scene):
    """The collection of a scene's rig, or None."""
    return next((rig for rig in rigs() if rig.scfpf_rig.scene == scene and is_whole(rig)), None)


def is_whole(rig) -> bool:
    """Whether all parts of a rig are there and its camera is a flexible one of its scene."""
    settings = rig.scfpf_rig
    scene, camera = settings.scene, settings.camera
    if None in (scene, camera, settings.table) or camera.type != "CAMERA" or not camera.scfpf.enabled:
        return False
    if settings.portals is None or settings.portals.modifiers.get(MODIFIER) is None:
        return False
    for part in (settings.portals, settings.view_camera):
        if part is None or rig.objects.get(part.name) != part:
            return False
    if rig not in scene.collection.children_recursive:
        return False
    return holds(scene.objects, camera)


def check(scene, camera) -> None:
    """Raises RigError where a rig cannot be made."""
    if not scene.is_editable:
        raise RigError("The scene is linked from another file: render it there")
    if not camera.is_editable:
        raise RigError(f"'{camera.name}' is linked from another file: make a library override of it first")
    if lost := absent_text(camera, scene, "choose another camera"):
        raise RigError(lost)
    require_cycles(scene)


def has_cycles(scene) -> bool:
    """Whether the add-on Cycles is switched on, without which its settings are out of reach."""
    return hasattr(scene, "cycles")


def require_cycles(scene) -> None:
    """Raises RigError while Cycles is switched off, as it may be where a file is opened."""
    if not has_cycles(scene):
        raise RigError(NO_CYCLES)


def check_surfaces(camera) -> None:
    """Raises RigError where no table of projectors can be made of the control surfaces."""
    for slot in camera.scfpf.surfaces:
        if slot.object is not None and slot.object.scfpf_surface.kind == lattice_object.KIND:
            raise RigError(
                f"Cycles cannot follow the lattice '{slot.object.name}': use control surfaces instead of it, "
                "or render with SCFPF"
            )
    count = len(camera.scfpf.surfaces)
    if not 2 <= count <= MAXIMUM_SURFACES:
        raise RigError(
            f"'{camera.name}' has {count or 'no'} control surface{'s' * (count != 1)}: a volume needs at "
            f"least two and may have {MAXIMUM_SURFACES}; add one in the camera's properties or load a preset"
        )


def build_groups(camera) -> list[str]:
    """Build the node groups of a camera's rig, which takes long; returns the names of those that are new."""
    before = {group.name for group in bpy.data.node_groups}
    table_group_of(camera)
    portal_nodes.portal_group()
    return [group.name for group in bpy.data.node_groups if group.name not in before]


def remove_groups(names: list[str]) -> None:
    """Remove those of ``build_groups`` that nothing uses."""
    groups = (bpy.data.node_groups.get(name) for name in names)
    remove_unused_groups([group for group in groups if group is not None])


def make_rig(scene, camera, chords: ChordPlan):
    """All datablocks of a camera's rig; returns its collection. The scene then renders through it."""
    sync_volume_object(camera)
    rig = bpy.data.collections.new(f"{camera.name} Cycles Rig")
    width = _own_width()
    portal_object = _new_portals(camera, scene, width)
    view_camera = _new_view_camera(camera, width)
    for part in (portal_object, view_camera):
        rig.objects.link(part)
        part.hide_select = True
        part.hide_viewport = True
        part[RIG_KEY] = camera
    rig.hide_viewport = rig.hide_select = True
    rig.color_tag = "COLOR_05"
    settings = rig.scfpf_rig
    settings.is_rig = True
    settings.camera, settings.scene = camera, scene
    settings.portals, settings.view_camera = portal_object, view_camera
    update_nodes(rig)
    scene.collection.children.link(rig)
    _take_over(rig)
    write_sheets(rig, chords)
    return rig


def _own_width() -> float:
    """A width of the screen that no other rig has: by it the sheets know their camera."""
    taken = {rig.scfpf_rig.view_camera.data.ortho_scale for rig in rigs() if rig.scfpf_rig.view_camera}
    return next(WIDTH + number for number in range(len(taken) + 1) if WIDTH + number not in taken)


def _new_view_camera(camera, width: float):
    name = f"{camera.name} Cycles"
    lens = bpy.data.cameras.new(name)
    lens.type = "ORTHO"
    lens.sensor_fit = "HORIZONTAL"
    lens.ortho_scale = width
    view_camera = bpy.data.objects.new(name, lens)
    _place(view_camera)
    return view_camera


def _place(view_camera) -> None:
    """Where the nodes have the screen before a rig's camera; other versions had it elsewhere."""
    view_camera.location.z = -AWAY
    lens = view_camera.data
    lens.clip_start, lens.clip_end = TO_SCREEN - BEFORE_SCREEN, 2.0 * TO_SCREEN
    # Eyes apart would look past the screen.
    lens.stereo.interocular_distance = 0.0


def _new_portals(camera, scene, width: float):
    name = f"{camera.name} Portals"
    mesh = bpy.data.meshes.new(name)
    _give_materials(mesh, scene, camera)
    made = bpy.data.objects.new(name, mesh)
    made.modifiers.new(MODIFIER, "NODES")
    for name in UNSEEN_BY:
        setattr(made, name, False)
    # Its sheets stand where they are in the middle of the frame; directions would not be blurred along.
    made.cycles.use_motion_blur = False
    driver = made.driver_add("hide_render").driver
    # Such simple expressions need no Python. The scene is the one that is rendered: others may share the rig.
    driver.expression = f"width != {width:.0f}"
    variable = driver.variables.new()
    variable.name, variable.type = "width", "CONTEXT_PROP"
    target = variable.targets[0]
    target.context_property, target.data_path = "ACTIVE_SCENE", "camera.data.ortho_scale"
    return made


def _give_materials(mesh, scene, camera) -> None:
    """Let a rig's mesh have new materials."""

    def follow(socket, path: str) -> None:
        follow_property(socket, "default_value", camera, path)

    mesh.materials.clear()
    for material in portal_nodes.new_materials(portal_nodes.can_gate(), scene, follow):
        mesh.materials.append(material)


def renew_materials(rig) -> None:
    """Make a rig's materials anew: another version of the add-on may have made them otherwise."""
    settings = rig.scfpf_rig
    mesh = settings.portals.data
    before = set(mesh.materials) - {None}
    _give_materials(mesh, settings.scene, settings.camera)
    bpy.data.batch_remove([material for material in before if material.users == 0])


def _take_over(rig) -> None:
    """Let the scene render through the rig with Cycles; what was before is noted."""
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
        # Adaptive subdivision would see the scene from where the rig's camera is.
        scene.cycles.dicing_camera = camera


def _give_back(rig) -> None:
    """What ``_take_over`` has changed becomes as it was, unless the artist has changed it since."""
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
    if scene.cycles.dicing_camera == camera:
        scene.cycles.dicing_camera = None


def adopt(rig) -> None:
    """Let a rig that came with a full copy of its scene be that scene's, with a table of its own."""
    settings = rig.scfpf_rig
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
    except RigError:
        return  # again as soon as the camera has surfaces; the panel says so
    for curve in portal_object.animation_data.drivers:
        for variable in curve.driver.variables:
            target = variable.targets[0]
            if variable.type == "SINGLE_PROP" and target.id_type == "SCENE":
                target.id = scene


def has_old_nodes(rig) -> bool:
    """Whether another version of the add-on has made what a rig is computed by."""
    return not is_current(rig.scfpf_rig.portals.modifiers[MODIFIER].node_group)


def update_nodes(rig) -> None:
    """The table and the modifier as the camera's list of surfaces and its settings now ask for.

    Raises RigError.
    """
    settings = rig.scfpf_rig
    check_surfaces(settings.camera)
    settings.table = table_object(settings.camera, RIG_TABLE_KEY, "Cycles Table", settings.scene)
    settings.table[RIG_KEY] = settings.camera
    _place(settings.view_camera)
    modifier = settings.portals.modifiers[MODIFIER]
    before = modifier.node_group
    # The present one, whatever the artist calls it.
    group = before if is_current(before) else portal_nodes.portal_group()
    if before != group:
        modifier.node_group = group
        follow_scene(modifier, group_input(group, "Aspect"), FOLLOWED["Aspect"], settings.scene)
        lens_nodes.follow_lens(modifier, group, settings.camera, settings.view_camera.data, TO_SCREEN)
        if before is not None:
            remove_unused_groups([before])
    identifier = group_input(group, "Table")
    if versions.modifier_input(modifier, identifier) != settings.table:
        versions.set_modifier_input(modifier, identifier, settings.table)
    width = settings.view_camera.data.ortho_scale
    versions.set_modifier_input(modifier, group_input(group, "Width"), width)
    versions.set_modifier_input(modifier, group_input(group, "Passes"), settings.passes)
    lens_nodes.set_focus(modifier, group, settings.camera)
    # Assigning the group once more rebuilds the depsgraph's relations; setting an input does not in 4.5.
    modifier.node_group = group
    settings.portals.update_tag()


def release_pointers(rig) -> int:
    """Take from a rig what handlers have it point to, before another step of undo; see ``table_object``.

    Returns the session id of its table, 0 if it has none that can be taken; for ``restore_pointers``.
    """
    settings = rig.scfpf_rig
    table, camera, taken = settings.table, settings.camera, 0
    if table is not None:
        release_table_pointers(table)
        # A handler may have made it: see ``adopt``.
        if camera is not None and camera.is_editable and camera.get(RIG_TABLE_KEY) == table:
            taken = table.session_uid
            del camera[RIG_TABLE_KEY]
            settings.table = None
    modifier = None if settings.portals is None else settings.portals.modifiers.get(MODIFIER)
    if modifier is not None and modifier.node_group is not None:
        for item in modifier.node_group.interface.items_tree:
            if getattr(item, "socket_type", "") == "NodeSocketObject" and item.in_out == "INPUT":
                versions.set_modifier_input(modifier, item.identifier, None)
    return taken


def restore_pointers(rig, table: int) -> None:
    """Give a rig and its camera back the table that ``release_pointers`` took, a session id, if it exists.

    A rig that undo has brought back has its table; its camera may have lost the pointer to it.
    """
    settings = rig.scfpf_rig
    camera = settings.camera
    if camera is None or not camera.is_editable:
        return
    if settings.table is None:
        settings.table = next((obj for obj in bpy.data.objects if obj.session_uid == table), None)
    if settings.table is not None and camera.get(RIG_TABLE_KEY) is None:
        camera[RIG_TABLE_KEY] = settings.table


def write_sheets(rig, chords: ChordPlan) -> None:
    """Make the rig's mesh that of a plan, and note what the plan promises. Raises RigError without Cycles."""
    settings = rig.scfpf_rig
    require_cycles(settings.scene)
    size = image_size(settings.scene)
    arrays = portals(chords.breaks, chords.shifts, chords.cells, size, chords.disc)
    seen = seen_places(settings.camera, settings.scene, arrays.places, chords.disc)
    _fill(settings.portals.data, arrays, seen)
    settings.error, settings.cost, settings.missing = chords.error, chords.cost, chords.missing
    settings.cells = chords.cells
    modifier = settings.portals.modifiers[MODIFIER]
    straight = group_input(modifier.node_group, "Straight")
    versions.set_modifier_input(modifier, straight, chords.count == 1)
    cycles = settings.scene.cycles
    if cycles.transparent_max_bounces != settings.bounces:
        settings.bounces_before = cycles.transparent_max_bounces  # the artist has chosen another
    settings.chords = chords.count
    wanted = settings.bounces_before + chords.count + MORE_BOUNCES
    settings.bounces = cycles.transparent_max_bounces = min(wanted, MOST_BOUNCES)


def present_chords(rig):
    """Breaks and shifts of the chords as a rig's mesh has them, (n+1,) each."""
    settings = rig.scfpf_rig
    mesh = settings.portals.data
    sheet = (len(mesh.vertices) - SURROUND_CORNERS) // (settings.chords + 1)
    ends = []
    for name in (START, END):
        values = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.attributes[name].data.foreach_get("vector", values)
        ends.append(values.reshape(-1, 3)[:-SURROUND_CORNERS:sheet, :2].astype(np.float64))
    # The far sheet has both ends of the last chord.
    chords = np.concatenate([ends[0][:-1], ends[1][-1:]])
    return chords[:, 0], chords[:, 1]


def _fill(mesh, arrays: Portals, seen: Array) -> None:
    mesh.clear_geometry()
    count = len(arrays.triangles)
    mesh.vertices.add(arrays.places.shape[1])
    mesh.vertices.foreach_set("co", arrays.places.T.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", arrays.triangles.ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    slots = mesh.attributes.new("material_index", "INT", "FACE")
    owners = {portal_nodes.SCREEN: arrays.screen, portal_nodes.FAR: arrays.far}
    owners[portal_nodes.SURROUND] = arrays.surround
    values = np.select([*owners.values()], [*owners], portal_nodes.SHEET)
    slots.data.foreach_set("value", values.astype(np.int32))
    for name, values in ((START, arrays.start), (END, arrays.end), (pass_nodes.SEEN, seen)):
        attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
        attribute.data.foreach_set("vector", values.T.astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    mesh.update_tag()


def remove_rig(rig) -> None:
    """Remove a rig and every datablock that was made for it, whatever is missing of it."""
    settings = rig.scfpf_rig
    _give_back(rig)
    if settings.scene is not None:
        aov_passes.remove(settings.scene)
    parts = [p for p in (settings.portals, settings.view_camera, settings.table) if p is not None]
    for guest in set(rig.objects) - set(parts):
        # What the artist has put here stays.
        if len(guest.users_collection) == 1 and settings.scene is not None:
            settings.scene.collection.objects.link(guest)
    if settings.camera is not None:
        settings.camera.pop(RIG_TABLE_KEY, None)
    _remove_parts(rig, parts)


def _remove_parts(rig, parts) -> None:
    """Remove objects of a rig, what only they use, and the collection."""
    groups = [
        modifier.node_group
        for part in parts
        for modifier in part.modifiers
        if modifier.type == "NODES" and modifier.node_group is not None
    ]
    data = {part.data for part in parts} - {None}
    materials = {m for one in data if isinstance(one, bpy.types.Mesh) for m in one.materials} - {None}
    bpy.data.batch_remove(parts)
    bpy.data.batch_remove([one for one in data if one.users == 0])
    bpy.data.batch_remove([one for one in materials if one.users == 0])
    bpy.data.collections.remove(rig)
    remove_unused_groups(groups)
