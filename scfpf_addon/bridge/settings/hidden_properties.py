# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of what Look Behind has found, the list ``Object.scfpf.hidden_things``."""

from __future__ import annotations

import bpy

from .property_options import STATIC, number, text, vector


class SCFPF_HiddenThing(bpy.types.PropertyGroup):
    """A thing that the image hides. Names stand for objects, which may have gone since."""

    name: text("Name", "Full name of the hidden object, or of the one that instances it", **STATIC)
    hider: text("Hidden By", "Full name of the object that hides most of it", **STATIC)
    share: number("Share", "Share of the picture that it would cover alone", 0.0, 0.0, 1.0, **STATIC)
    hidden: number("Hidden", "Part of it that other things hide", 0.0, 0.0, 1.0, **STATIC)
    past: vector(
        "Past",
        "Way in the picture to where it is not hidden, as shares of its width and height; 0 for none",
        (0.0, 0.0),
        -1.0,
        1.0,
        **STATIC,
    )
    message: text("Message", "What hides it, and where the picture nearly sees past that", **STATIC)


CLASSES = (SCFPF_HiddenThing,)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
