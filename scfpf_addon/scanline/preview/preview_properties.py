# SPDX-License-Identifier: GPL-3.0-or-later
"""``Collection.scfpf_preview``: what makes a collection the live preview of a flexible camera.

It is on the *source* collection, which is linked to no scene and so is not copied with one, not on
the camera: a duplicate of the camera then has no preview. The *shelf*, the collection in the
scene that holds the pictures, points back to its source; a copied shelf is not its source's.
"""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty, StringProperty


def _changed(owner, context):
    """Nothing to do: having a callback at all makes edits from Python reach the depsgraph."""


def _is_camera(_settings, candidate) -> bool:
    return candidate.type == "CAMERA"


class SCFPF_PreviewPart(bpy.types.PropertyGroup):
    """One picture of a live preview: an edit makes only the picture anew that shows what was edited."""

    members: PointerProperty(
        name="Members",
        description="The collection, inside of the source, with the objects that the picture shows",
        type=bpy.types.Collection,
        update=_changed,
    )
    picture: PointerProperty(
        name="Picture",
        description="The object whose modifier makes the picture",
        type=bpy.types.Object,
        update=_changed,
    )


class SCFPF_Preview(bpy.types.PropertyGroup):
    """The parts of a live preview, and whose it is."""

    is_source: BoolProperty(
        name="Is Source",
        description="The objects in this collection are what a live preview shows",
        default=False,
        update=_changed,
    )
    camera: PointerProperty(
        name="Flexible Camera",
        description="The flexible camera whose picture this collection shows",
        type=bpy.types.Object,
        poll=_is_camera,
        update=_changed,
    )
    scene: PointerProperty(
        name="Scene",
        description="The scene that the preview was switched on in",
        type=bpy.types.Scene,
        update=_changed,
    )
    view_layer: StringProperty(
        name="View Layer",
        description="Name of the view layer that the preview shows",
        default="",
        update=_changed,
    )
    parts: CollectionProperty(
        name="Parts",
        description="The pictures that make up the preview, each with what it shows",
        type=SCFPF_PreviewPart,
    )
    view_camera: PointerProperty(
        name="View Camera",
        description="The orthographic camera that frames the picture",
        type=bpy.types.Object,
        poll=_is_camera,
        update=_changed,
    )
    table: PointerProperty(
        name="Table",
        description="The object with the table of projectors that the modifier reads",
        type=bpy.types.Object,
        update=_changed,
    )
    shelf: PointerProperty(
        name="Shelf",
        description="The collection in the scene that holds the pictures",
        type=bpy.types.Collection,
        update=_changed,
    )
    source: PointerProperty(
        name="Source",
        description="Of a shelf: the collection, linked to no scene, with the objects that the pictures show",
        type=bpy.types.Collection,
        update=_changed,
    )
    problem: StringProperty(
        name="Problem",
        description="Why the preview does not follow the camera at present; empty when it does",
        default="",
        update=_changed,
    )


CLASSES = (SCFPF_PreviewPart, SCFPF_Preview)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Collection.scfpf_preview = PointerProperty(name="Live Preview", type=SCFPF_Preview)


def unregister():
    del bpy.types.Collection.scfpf_preview
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
