# SPDX-License-Identifier: GPL-3.0-or-later
"""The datablocks of a nodes preview: made when it is switched on, all removed when it is switched off.

They live in the artist's own scene: only there do they follow its frame changes. A collection that the view
layer hides, the shelf, holds picture objects and the orthographic camera that frames them. The node modifier
of each picture object turns one of the source's collections into a picture.
"""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...bridge.blender.modifier_inputs import input_identifiers, renew_relations, set_inputs
from ...bridge.blender.scene_objects import delete_with_data
from ...bridge.camera.flexible_camera import sync_volume_object
from ...bridge.surfaces.lattice_object import KIND as LATTICE_KIND
from ...projection.presets.preset import MAXIMUM_SURFACES
from ...projection.user_error import Message, UserError
from ..generated_collection import (
    follow_image_size,
    is_complete,
    linked_text,
    new_orthographic_camera,
    remove_generated,
    remove_parts,
    remove_replaced_groups,
)
from ..remap import remap_nodes
from ..remap.remap_nodes import DRAFT
from ..table import table_object
from ..table.table_object import TABLE_KEY

MODIFIER = "SCFPF Preview"
# A preview's error as a multiple of the camera's pixel error. The usual tenth of a pixel would take two to
# three times as many faces as half a pixel, which nobody sees on a screen.
COARSER = 5.0
# The constraint that removes a scaled camera's scale.
UNSCALED = "SCFPF Unscaled"
# The viewbox of remap_nodes: one wide, between these distances of the camera that frames it.
FRAME_WIDTH, FRAME_NEAR, FRAME_FAR = 1.0, 1.0, 2.0
# The clip range is wider than the viewbox by this share of its depth: float32 must not clip its ends.
CLIP_MARGIN = 1e-4


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
    """Return whether a preview has all its parts, and its camera is a flexible one of its scene."""
    settings = source.scfpf_preview
    if not settings.parts or any(part.members is None for part in settings.parts):
        return False
    return is_complete(settings, settings.shelf, (*pictures_of(source), settings.view_camera))


def pictures_of(source) -> list:
    """The picture objects of a preview; None for one that is lost."""
    return [part.picture for part in source.scfpf_preview.parts]


def make_preview(scene, view_layer, camera):
    """Make all datablocks of a camera's preview; return its source collection, which is still empty.

    Raises UserError; nothing is left behind then.
    """
    if problem := linked_text(scene, camera, Message("preview it there")):
        raise UserError(problem)
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
    hide_in_layers(source)
    return source


def _check_surfaces(camera) -> None:
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    if any(surface is not None and surface.scfpf_surface.kind == LATTICE_KIND for surface in surfaces):
        raise UserError(
            "'{0}' holds a lattice, which the nodes preview cannot follow: "
            "render it with Flexible Projection",
            camera.name,
        )
    if len(surfaces) < 2 or None in surfaces:
        raise UserError("'{0}' needs at least two control surfaces before it can be previewed", camera.name)
    if len(surfaces) > MAXIMUM_SURFACES:
        raise UserError(
            "'{0}' has more than {1} control surfaces: remove some", camera.name, MAXIMUM_SURFACES
        )


def add_parts(source, count: int) -> list:
    """Make picture objects, and their collections, up to a number; return the new objects."""
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
    """Put a generated object into the shelf, as a child of the camera."""
    shelf.objects.link(thing)
    thing.parent = camera
    thing.hide_render = True
    _keep_size(thing)


def _keep_size(part) -> None:
    """Keep an object from taking its parent's scale: a camera cannot, so the pictures must not."""
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
    view_camera = new_orthographic_camera(name, FRAME_WIDTH)
    lens = view_camera.data
    lens.clip_start = FRAME_NEAR - CLIP_MARGIN
    lens.clip_end = FRAME_FAR + CLIP_MARGIN
    lens.show_passepartout = True
    lens.passepartout_alpha = 1.0
    return view_camera


def update_pictures(source) -> None:
    """Bring the table and the modifiers in step with the camera's surfaces and settings.

    Raises UserError; nothing is changed then.
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
    remove_replaced_groups(before)


def _set_modifier(source, part, group):
    """Give a picture object a node group; return the group that it had before, if it was another."""
    settings, picture = source.scfpf_preview, part.picture
    modifier = picture.modifiers.get(MODIFIER) or picture.modifiers.new(MODIFIER, "NODES")
    before = modifier.node_group if modifier.node_group != group else None
    if modifier.node_group != group:
        picture.animation_data_clear()
        modifier.node_group = group
        follow_image_size(modifier, ("Aspect", "Picture Width"), settings.scene)
    error = settings.camera.scfpf.pixel_error * COARSER
    set_inputs(modifier, {"Collection": part.members, "Table": settings.table, "Pixel Error": error})
    renew_relations(modifier)
    picture.update_tag()
    return before


def set_draft(source, numbers, is_draft: bool) -> None:
    """Let parts of a preview, by their numbers, show drafts, or have them whole."""
    for number in numbers:
        picture = source.scfpf_preview.parts[number].picture
        modifier = picture.modifiers.get(MODIFIER) if picture is not None else None
        group = modifier.node_group if modifier is not None else None
        identifier = input_identifiers(group).get(DRAFT) if group is not None else None
        if identifier is not None and bool(versions.modifier_input(modifier, identifier)) != is_draft:
            versions.set_modifier_input(modifier, identifier, is_draft)
            picture.update_tag()


def release_pointers(source) -> None:
    """Clear the pointers that handlers set, as is necessary before undo and redo; see ``table_object``.

    ``sync`` sets them again afterwards.
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
    """The numbers of faces and samples that a preview leaves out, as in ``remap_counts``."""
    counts = [remap_nodes.remap_counts(picture.evaluated_get(depsgraph)) for picture in pictures_of(source)]
    # Each picture object has its own faces; the folds of the volume are the same for all.
    return {
        "unreachable": sum(count["unreachable"] for count in counts),
        "folded": max(count["folded"] for count in counts),
    }


def is_flat(source, depsgraph) -> bool:
    """Return whether all rays of the previewed volume lie in one surface, which leaves nothing to show."""
    return remap_nodes.is_flat(source.scfpf_preview.table.evaluated_get(depsgraph))


def is_asleep(source) -> bool:
    """Return whether a preview computes nothing, since no viewport shows it."""
    return not all(
        modifier.show_viewport for picture in pictures_of(source) for modifier in picture.modifiers
    )


def set_asleep(source, asleep: bool) -> None:
    """Make a preview sleep, which computes nothing, or wake it."""
    table, pictures = source.scfpf_preview.table, pictures_of(source)
    # The preview itself, the camera and each picture object use the table; the artist's modifiers may, too.
    has_other_users = table.users > len(pictures) + 2
    for obj in pictures if has_other_users and asleep else (*pictures, table):
        for modifier in obj.modifiers:
            if modifier.show_viewport == asleep:
                modifier.show_viewport = not asleep


def layer_of(view_layer, collection):
    """The layer collection of a collection in a view layer, or None."""
    pending = [view_layer.layer_collection]
    while pending:
        layer = pending.pop()
        if layer.collection == collection:
            return layer
        pending.extend(layer.children)
    return None


def hide_in_layers(source) -> None:
    """Hide a preview in its own view layer, and exclude it from all others.

    Unlink it from other scenes, such as linked copies of its own, where it would take time for nothing.
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
    """The shelves that were copied with their scene: their source has another shelf."""
    return [
        c
        for c in bpy.data.collections
        if c.library is None
        and c.scfpf_preview.source is not None
        and c.scfpf_preview.source.scfpf_preview.shelf != c
    ]


def remove_copy(shelf) -> None:
    """Remove a copied shelf and the objects that were copied with it."""
    remove_parts(shelf, list(shelf.objects))


def remove_preview(source) -> None:
    """Remove a preview and every datablock that was made for it, even if some are lost."""
    settings = source.scfpf_preview
    parts = [p for p in (*pictures_of(source), settings.view_camera, settings.table) if p is not None]
    members = [part.members for part in settings.parts if part.members is not None]
    remove_generated(settings, settings.shelf, parts, TABLE_KEY)
    bpy.data.batch_remove([source, *members])
