# SPDX-License-Identifier: GPL-3.0-or-later
"""The datablocks of a live preview: made when it is switched on, all removed when it is switched off.

They live in the artist's own scene: only there do they follow its frame changes. A collection
that the view layer hides holds picture objects, whose node modifiers turn what is in the source's
collections, one each, into the picture, and the orthographic camera that frames them.
"""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...bridge.blender.scene_objects import absent_text, delete_with_data, holds
from ...bridge.camera.flexible_camera import sync_volume_object
from ...bridge.surfaces.lattice_object import KIND as LATTICE_KIND
from ...projection.presets.preset import MAXIMUM_SURFACES
from ..remap import remap_nodes
from ..table import table_object
from ..table.table_object import TABLE_KEY

MODIFIER = "SCFPF Preview"
# The constraint that takes a scaled camera's scale away.
UNSCALED = "SCFPF Unscaled"
# The viewbox of remap_nodes: one wide, between these distances of the camera that frames it.
FRAME_WIDTH, FRAME_NEAR, FRAME_FAR = 1.0, 1.0, 2.0
# The clip range is wider than the viewbox by this share of its depth: float32 must not clip its ends.
CLIP_MARGIN = 1e-3
# What the modifier's inputs follow, by name of the input: an expression and its variables.
_SIZE = {
    "width": "render.resolution_x",
    "height": "render.resolution_y",
    "across": "render.pixel_aspect_x",
    "up": "render.pixel_aspect_y",
    "percentage": "render.resolution_percentage",
}
FOLLOWED = {
    "Aspect": "width * across / (height * up)",
    "Picture Width": "width * percentage / 100",
}


class PreviewError(ValueError):
    """The preview cannot be switched on; the message says what to do."""


def previews() -> list:
    """The source collections of all previews in the file."""
    return [c for c in bpy.data.collections if c.scfpf_preview.is_source and c.library is None]


def preview_of(camera, scene):
    """The source collection of a camera's preview in a scene, or None."""
    for source in previews():
        if source.scfpf_preview.camera == camera and source.scfpf_preview.scene == scene:
            return source
    return None


def is_whole(source) -> bool:
    """Whether all parts of a preview are there and its camera is a flexible one of its scene."""
    settings = source.scfpf_preview
    scene, shelf, camera = settings.scene, settings.shelf, settings.camera
    if None in (scene, shelf, camera, settings.table) or camera.type != "CAMERA":
        return False
    if not camera.scfpf.enabled:
        return False
    if not settings.parts or any(part.members is None for part in settings.parts):
        return False
    for thing in (*pictures_of(source), settings.view_camera):
        if thing is None or shelf.objects.get(thing.name) != thing:
            return False
    if shelf not in scene.collection.children_recursive:
        return False
    return holds(scene.objects, camera)


def pictures_of(source) -> list:
    """The objects that make up a preview's picture; None for one that is lost."""
    return [part.picture for part in source.scfpf_preview.parts]


def make_preview(scene, view_layer, camera):
    """All datablocks of a camera's preview; returns its source collection, which is still empty.

    Raises PreviewError; nothing is left behind.
    """
    if not scene.is_editable:
        raise PreviewError("The scene is linked from another file: preview it there")
    if not camera.is_editable:
        raise PreviewError(
            f"'{camera.name}' is linked from another file: make a library override of it first"
        )
    if lost := absent_text(camera, scene, "choose another camera"):
        raise PreviewError(lost)
    _check_surfaces(camera)
    sync_volume_object(camera)
    table = table_object.table_object(camera, scene=scene)
    source = bpy.data.collections.new(f"{camera.name} Preview Source")
    shelf = bpy.data.collections.new(f"{camera.name} Preview")
    view_camera = _new_view_camera(camera)
    _shelve(shelf, view_camera, camera)
    shelf.hide_render = shelf.hide_select = True
    shelf.scfpf_preview.source = source
    settings = source.scfpf_preview
    settings.is_source = True
    settings.camera, settings.scene, settings.view_layer = camera, scene, view_layer.name
    settings.view_camera, settings.table, settings.shelf = view_camera, table, shelf
    add_parts(source, 1)
    _keep_size(table)
    scene.collection.children.link(shelf)
    settle_in_layers(source)
    return source


def _check_surfaces(camera) -> None:
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    if any(surface is not None and surface.scfpf_surface.kind == LATTICE_KIND for surface in surfaces):
        raise PreviewError(
            f"'{camera.name}' holds a lattice, which the live preview cannot follow: render it with SCFPF"
        )
    if len(surfaces) < 2 or None in surfaces:
        raise PreviewError(f"'{camera.name}' needs at least two control surfaces before it can be previewed")
    if len(surfaces) > MAXIMUM_SURFACES:
        raise PreviewError(f"'{camera.name}' has more than {MAXIMUM_SURFACES} control surfaces: remove some")


def add_parts(source, count: int) -> list:
    """Make pictures, and the collections that they show, until a preview has so many; the new ones."""
    settings = source.scfpf_preview
    camera, new = settings.camera, []
    while len(settings.parts) < count:
        name = f"{camera.name} Preview"
        members = bpy.data.collections.new(f"{name} Source Part")
        source.children.link(members)
        picture = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        _shelve(settings.shelf, picture, camera)
        part = settings.parts.add()
        part.members, part.picture = members, picture
        _set_modifier(source, part, remap_nodes.preview_group())
        new.append(picture)
    return new


def _shelve(shelf, thing, camera) -> None:
    """Put a part of the preview where it belongs."""
    shelf.objects.link(thing)
    thing.parent = camera
    thing.hide_render = True
    _keep_size(thing)


def _keep_size(part) -> None:
    """Let an object not take its parent's scale: a view camera cannot, so the picture must not."""
    if part.constraints.get(UNSCALED) is not None:
        return
    limit = part.constraints.new("LIMIT_SCALE")
    limit.name = UNSCALED
    for bound in ("min", "max"):
        for axis in "xyz":
            setattr(limit, f"use_{bound}_{axis}", True)
            setattr(limit, f"{bound}_{axis}", 1.0)


def _new_view_camera(camera):
    name = f"{camera.name} Preview View"
    lens = bpy.data.cameras.new(name)
    lens.type = "ORTHO"
    lens.sensor_fit = "HORIZONTAL"
    lens.ortho_scale = FRAME_WIDTH
    lens.clip_start = FRAME_NEAR - CLIP_MARGIN
    lens.clip_end = FRAME_FAR + CLIP_MARGIN
    lens.show_passepartout = True
    lens.passepartout_alpha = 1.0
    return bpy.data.objects.new(name, lens)


def update_pictures(source) -> None:
    """The table and the modifiers as the camera's list of surfaces and settings now ask for.

    Raises PreviewError; the picture is then as it was.
    """
    settings = source.scfpf_preview
    camera = settings.camera
    _check_surfaces(camera)
    if camera.get(TABLE_KEY) is None:
        # Library overrides lose custom properties when a file is loaded.
        camera[TABLE_KEY] = settings.table
    before = [modifier.node_group for modifier in settings.table.modifiers]
    settings.table = table_object.table_object(camera, scene=settings.scene)
    _keep_size(settings.table)
    group = remap_nodes.preview_group()
    before += [_set_modifier(source, part, group) for part in settings.parts]
    remove_unused_groups([old for old in before if old is not None])


def _set_modifier(source, part, group):
    """Let a part's picture be made by a node group; returns the group that made it before, if another."""
    settings, picture = source.scfpf_preview, part.picture
    modifier = picture.modifiers.get(MODIFIER) or picture.modifiers.new(MODIFIER, "NODES")
    before = modifier.node_group if modifier.node_group != group else None
    if modifier.node_group != group:
        picture.animation_data_clear()
        modifier.node_group = group
        for name, expression in FOLLOWED.items():
            follow_scene(modifier, group_input(group, name), expression, settings.scene)
    for name, value in (
        ("Collection", part.members),
        ("Table", settings.table),
        ("Pixel Error", settings.camera.scfpf.pixel_error),
    ):
        identifier = group_input(group, name)
        if versions.modifier_input(modifier, identifier) != value:
            versions.set_modifier_input(modifier, identifier, value)
    # Assigning the group once more rebuilds the depsgraph's relations; setting an input does not in 4.5.
    modifier.node_group = group
    picture.update_tag()
    return before


def release_pointers(source) -> None:
    """Take from a preview what handlers have it point to, before another step of undo; see ``table_object``.

    Following the scene afterwards brings all of it back.
    """
    settings = source.scfpf_preview
    if settings.table is not None:
        table_object.release_pointers(settings.table)
    for part in settings.parts:
        for member in list(part.members.objects) if part.members is not None else ():
            part.members.objects.unlink(member)
        if part.picture is not None:
            part.picture.animation_data_clear()
            modifier = part.picture.modifiers.get(MODIFIER)
            if modifier is not None:
                part.picture.modifiers.remove(modifier)
    for number in reversed(range(1, len(settings.parts))):
        members, picture = settings.parts[number].members, settings.parts[number].picture
        settings.parts.remove(number)
        if members is not None:
            bpy.data.collections.remove(members)
        if picture is not None:
            delete_with_data(picture)


def left_out(source, depsgraph) -> dict[str, int]:
    """The counts of the faces and samples that a preview has left out, as in ``remap_counts``."""
    counts = [remap_nodes.remap_counts(picture.evaluated_get(depsgraph)) for picture in pictures_of(source)]
    # Faces are each picture's own, the volume's folds are the same in all of them.
    return {
        "unreachable": sum(count["unreachable"] for count in counts),
        "folded": max(count["folded"] for count in counts),
    }


def is_flat(source, depsgraph) -> bool:
    """Whether all rays of the previewed volume lie in one surface, so that there is nothing to show."""
    return remap_nodes.is_flat(source.scfpf_preview.table.evaluated_get(depsgraph))


def is_asleep(source) -> bool:
    """Whether a preview computes nothing, since no viewport shows it."""
    return not all(_works(picture) for picture in pictures_of(source))


def _works(thing) -> bool:
    return all(modifier.show_viewport for modifier in thing.modifiers)


def set_asleep(source, asleep: bool) -> None:
    """Stop a preview's computing, or let it go on."""
    table, pictures = source.scfpf_preview.table, pictures_of(source)
    # The preview itself, the camera and each picture use it; others may be the artist's own modifiers.
    others = table.users > len(pictures) + 2
    for thing in pictures if others and asleep else (*pictures, table):
        for modifier in thing.modifiers:
            if modifier.show_viewport == asleep:
                modifier.show_viewport = not asleep


def group_input(group, name: str) -> str:
    """The identifier of a group's input."""
    return next(
        item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name
    )


def follow_scene(modifier, identifier: str, expression: str, scene) -> None:
    """Drive an input by the size of a scene's picture. Such simple expressions need no Python."""
    owner, name = versions.modifier_input_property(modifier, identifier)
    driver = owner.driver_add(name).driver
    driver.expression = expression
    for old in list(driver.variables):
        driver.variables.remove(old)
    for variable_name, path in _SIZE.items():
        if variable_name in expression:
            variable = driver.variables.new()
            variable.name = variable_name
            target = variable.targets[0]
            target.id_type = "SCENE"
            target.id = scene
            target.data_path = path


def layer_of(view_layer, collection):
    """Where a collection stands in a view layer, or None."""
    pending = [view_layer.layer_collection]
    while pending:
        layer = pending.pop()
        if layer.collection == collection:
            return layer
        pending.extend(layer.children)
    return None


def settle_in_layers(source) -> None:
    """Hide a preview in its own view layer; exclude it from all others, and from other scenes.

    There it would only cost. A linked copy of its scene, for one, has it too.
    """
    settings = source.scfpf_preview
    for view_layer in settings.scene.view_layers:
        layer = layer_of(view_layer, settings.shelf)
        wanted = {"hide_viewport": True, "exclude": view_layer.name != settings.view_layer}
        for name, value in wanted.items() if layer is not None else ():
            if getattr(layer, name) != value:
                setattr(layer, name, value)
    for scene in bpy.data.scenes:
        children = scene.collection.children
        if (
            scene != settings.scene
            and scene.is_editable
            and children.get(settings.shelf.name) == settings.shelf
        ):
            children.unlink(settings.shelf)


def copied_shelves() -> list:
    """Shelves that came into the file with a full copy of their scene; they show another preview's source."""
    return [
        c
        for c in bpy.data.collections
        if c.library is None
        and c.scfpf_preview.source is not None
        and c.scfpf_preview.source.scfpf_preview.shelf != c
    ]


def remove_copy(shelf) -> None:
    """Remove a copied shelf and what was copied with it."""
    _remove_parts(shelf, list(shelf.objects))


def remove_preview(source) -> None:
    """Remove a preview and every datablock that was made for it, whatever is missing of it."""
    settings = source.scfpf_preview
    parts = [p for p in (*pictures_of(source), settings.view_camera, settings.table) if p is not None]
    members = [part.members for part in settings.parts if part.members is not None]
    shelf = settings.shelf
    for guest in set(shelf.objects) - set(parts) if shelf is not None else ():
        # What the artist has put here stays.
        if len(guest.users_collection) == 1 and settings.scene is not None:
            settings.scene.collection.objects.link(guest)
    if settings.camera is not None:
        settings.camera.pop(TABLE_KEY, None)
    _remove_parts(shelf, parts)
    bpy.data.batch_remove([source, *members])


def _remove_parts(shelf, parts) -> None:
    groups = [
        modifier.node_group
        for part in parts
        for modifier in part.modifiers
        if modifier.type == "NODES" and modifier.node_group is not None
    ]
    data = {part.data for part in parts} - {None}
    bpy.data.batch_remove(parts)
    bpy.data.batch_remove([one for one in data if one.users == 0])
    if shelf is not None:
        bpy.data.collections.remove(shelf)
    remove_unused_groups(groups)


def remove_unused_groups(groups) -> None:
    """Remove node groups that nothing uses, and then those that only they used."""
    pending = list(dict.fromkeys(groups))
    while pending:
        group = pending.pop()
        if group.users > 0:
            continue
        inner = {node.node_tree for node in group.nodes if getattr(node, "node_tree", None) is not None}
        bpy.data.node_groups.remove(group)
        # One that is still used by another in the list is met again when that one goes.
        pending = [other for other in pending if other not in inner] + list(inner)
