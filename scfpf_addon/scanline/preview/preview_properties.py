# SPDX-License-Identifier: GPL-3.0-or-later
"""``Collection.scfpf_preview``: the properties that make a collection the nodes preview of a flexible camera.

They belong to the *source* collection, which is linked to no scene and so is not copied with one. They do not
belong to the camera: a duplicate of the camera then has no preview. The *shelf*, the collection in the scene
that holds the pictures, points back to its source; a copied shelf is not its source's.
"""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty

from ..tracked_properties import camera_pointer, pointer, text, tracked


class SCFPF_PreviewPart(bpy.types.PropertyGroup):
    """A part of a nodes preview: an edit has only the part recomputed that shows the edited object."""

    members: pointer(
        "Members",
        "The collection, inside of the source, with the objects that the picture shows",
        bpy.types.Collection,
    )
    picture: pointer("Picture", "The object whose modifier makes the picture")


class SCFPF_Preview(bpy.types.PropertyGroup):
    """The parts of a nodes preview, its camera and its scene."""

    is_source: tracked(
        BoolProperty,
        "Is Source",
        "The objects in this collection are what a nodes preview shows",
        default=False,
    )
    camera: camera_pointer("Flexible Camera", "The flexible camera whose picture this collection shows")
    scene: pointer("Scene", "The scene that the preview was switched on in", bpy.types.Scene)
    view_layer: text("View Layer", "Name of the view layer that the preview shows")
    parts: CollectionProperty(
        name="Parts",
        description="The pictures that make up the preview, each with what it shows",
        type=SCFPF_PreviewPart,
    )
    view_camera: camera_pointer("View Camera", "The orthographic camera that frames the picture")
    table: pointer("Table", "The object with the table of projectors that the modifier reads")
    shelf: pointer("Shelf", "The collection in the scene that holds the pictures", bpy.types.Collection)
    source: pointer(
        "Source",
        "Of a shelf: the collection, linked to no scene, with the objects that the pictures show",
        bpy.types.Collection,
    )
    problem: text("Problem", "Why the preview does not follow the camera at present; empty when it does")


CLASSES = (SCFPF_PreviewPart, SCFPF_Preview)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Collection.scfpf_preview = PointerProperty(name="Nodes Preview", type=SCFPF_Preview)


def unregister():
    del bpy.types.Collection.scfpf_preview
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
