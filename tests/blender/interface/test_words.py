# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface texts of the extension's classes are spelled like Blender's."""

import bpy

from tests.british import british


def classes():
    """Every registered class of the extension."""
    found = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("SCFPF")]
    found += [kind for kind in bpy.types.PropertyGroup.__subclasses__() if kind.__name__.startswith("SCFPF")]
    found += [getattr(bpy.ops.scfpf, name).get_rna_type() for name in dir(bpy.ops.scfpf)]
    return [getattr(kind, "bl_rna", kind) for kind in found if getattr(kind, "is_registered", True)]


def texts():
    """The name, tooltip and choices of each class, with their places."""
    owners = [bpy.types.Object, bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Collection]
    ours = [(rna, rna.properties) for rna in classes()]
    ours += [
        (kind.bl_rna, [p for p in kind.bl_rna.properties if p.identifier.startswith("scfpf")])
        for kind in owners
    ]
    for rna, properties in ours:
        place = rna.identifier
        if place.startswith("SCFPF"):
            yield place, rna.name.replace(place, "")
            yield place, rna.description
        for shown in (one for one in properties if not one.identifier.startswith("bl_")):
            items = [
                text for item in getattr(shown, "enum_items", ()) for text in (item.name, item.description)
            ]
            for text in (shown.name, shown.description, *items):
                yield f"{place}.{shown.identifier}", text


def labels():
    """Titles and tabs of panels and menus."""
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        if name.startswith("SCFPF"):
            for attribute in ("bl_label", "bl_description", "bl_category"):
                yield name, getattr(kind, attribute, None) or ""


def test_names_and_tooltips_are_in_american_english():
    shown = [*texts(), *labels()]
    assert len(shown) > 500
    assert not {place: words for place, text in shown if (words := british(text))}
