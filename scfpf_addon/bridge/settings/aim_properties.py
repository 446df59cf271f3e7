# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of Aim: the list ``Object.scfpf.aim_targets``, and ``Object.scfpf.aim`` for the rest.

Numbers of targets are keyframable. Results are properties too, so that scripts can read them.
"""

from __future__ import annotations

import math

import bpy

from .property_options import MARK, STATIC, choice, integer, number, pointer, switch, text, vector

VIEW, PIN, LINE, STAY = "VIEW", "PIN", "LINE", "STAY"
KINDS = (
    (VIEW, "View", "Show a collection or an object as a camera or an empty sees it"),
    (PIN, "Pin", "Show one point of the scene at one place in the picture"),
    (LINE, "Straight", "Keep the line between two pins straight in the picture"),
    (STAY, "Stay", "Hold a collection, an object or a painted region where the picture shows it"),
)
# Control points of the solved surfaces.
LEAST_COLUMNS, MOST_COLUMNS, LEAST_ROWS, MOST_ROWS = 6, 16, 6, 10
# Of positions in the image, as shares of its width and height.
LOWEST, HIGHEST = -2.0, 3.0
# A distance in pixels is this at most, that of a point which the picture has lost.
LARGEST = 1e9


def place(name: str, description: str):
    """A result that is a place in the picture, as shares of its width and height from the lower left."""
    return vector(name, description, (0.5, 0.5), 0.0, 1.0, **STATIC)


def _may_be_eye(target, candidate) -> bool:
    return candidate.type in {"CAMERA", "EMPTY"} and candidate != target.id_data


def _is_empty(_target, candidate) -> bool:
    return candidate.type == "EMPTY"


class SCFPF_AimTarget(bpy.types.PropertyGroup):
    """One thing that the image shall show. Only ``slot_animation`` may reorder and remove targets."""

    name: text("Name", "Name of the target in the list")
    kind: choice("Target", "What the target asks of the picture", items=KINDS, default=VIEW, options=set())
    is_on: switch("Use Target", "Let Solve follow this target", True)
    collection: pointer(
        "Collection", "The collection that the view shows or the region that stays", bpy.types.Collection
    )
    object: pointer(
        "Object", "The object that the view shows or that stays, if no collection is chosen", bpy.types.Object
    )
    eye: pointer(
        "Seen From",
        "The camera or empty from which the view shows its collection, an empty along its own -Z axis",
        bpy.types.Object,
        poll=_may_be_eye,
    )
    handle: pointer(
        "Handle",
        "The empty at the point that the pin holds, with its -Z axis in the direction in which the point "
        "is seen",
        bpy.types.Object,
        poll=_is_empty,
    )
    first: pointer(
        "First Pin", "The handle of the pin where the line begins", bpy.types.Object, poll=_is_empty
    )
    second: pointer(
        "Second Pin", "The handle of the pin where the line ends", bpy.types.Object, poll=_is_empty
    )
    mask: pointer(
        "Mask", "An image over the whole picture: what is white stays, what is black is free", bpy.types.Image
    )
    position: vector(
        "Position",
        "Place of the view's middle or of the pin, as shares of the picture from its lower left",
        (0.5, 0.5),
        LOWEST,
        HIGHEST,
        soft_min=0.0,
        soft_max=1.0,
        precision=4,
        step=1,
    )
    width: number(
        "Size",
        "Diameter of a sphere around the collection, as a share of the picture's width: the size stays while "
        "the view's camera turns",
        0.25,
        1e-3,
        10.0,
        soft_max=1.0,
        precision=3,
        step=1,
    )
    turn: number(
        "Roll",
        "Angle by which the view is rolled in the picture, counterclockwise",
        0.0,
        -4 * math.pi,
        4 * math.pi,
        subtype="ANGLE",
    )
    halo: number(
        "Halo",
        "Distance around the collection within which its surroundings follow it",
        2.0,
        0.0,
        1e6,
        soft_max=100.0,
        subtype="DISTANCE",
    )
    alone: switch("Alone", "Show only this view as asked: nothing else in the picture has to stay")
    use_direction: switch("Direction", "Show the point from the direction of the handle's arrow")
    weight: number(
        "Weight", "Strength of the target, compared with the others", 1.0, 0.0, 100.0, soft_max=10.0
    )
    residual_median: number(
        "Median Residual",
        "Half of the target's points are at most so many pixels from their places; -1 before Solve",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    residual_max: number(
        "Largest Residual",
        "The target's points are at most so many pixels from their places; -1 before Solve",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    whole_95: number(
        "Whole Thing",
        "95 % of what the view shows is at most so many pixels from its place; -1 before Solve",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    whole_max: number(
        "Worst Place",
        "All of what the view shows is at most so many pixels from its place; -1 before Solve",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    whole_worst: place(
        "Place of the Worst", "Where the picture shows the point of the view's thing that is farthest off"
    )
    hidden: number("Hidden", "Share of the target's points that other objects hide", 0.0, 0.0, 1.0, **STATIC)
    hidden_by: text("Hidden By", "Name of the object that hides most of the target", **STATIC)
    free_turn: vector(
        "Nearest Free Direction",
        "Angles by which the view's camera has to turn to the left and up until nothing hides the target",
        (0.0, 0.0),
        -math.pi,
        math.pi,
        subtype="EULER",
        **STATIC,
    )
    message: text("Message", "How well the target was met, and what to do", **STATIC)


class SCFPF_Aim(bpy.types.PropertyGroup):
    """``Object.scfpf.aim``: settings and results of Aim that concern the whole volume."""

    columns: integer(
        "Points Across",
        "Control points of each surface across the picture: more follow closer and are slower",
        12,
        LEAST_COLUMNS,
        MOST_COLUMNS,
        **STATIC,
    )
    rows: integer(
        "Points Up",
        "Control points of each surface up the picture: more follow closer and are slower",
        8,
        LEAST_ROWS,
        MOST_ROWS,
        **STATIC,
    )
    degree: integer("Bends", "Degree of the projectors: a higher one bends oftener", 3, 2, 4, **STATIC)
    live: switch(
        "Live Aim",
        "Let the volume follow while the camera or the empty of a target is moved",
        False,
        **STATIC,
    )
    is_solved: switch("Aimed", "The control surfaces were made by Aim and can be solved further", **MARK)
    mirrored: number(
        "Mirrored", "Share of the picture that the last Solve shows mirrored", 0.0, 0.0, 1.0, **STATIC
    )
    folds: number(
        "Folds",
        "Share of the visible part of the volume that the last Solve has folded",
        0.0,
        0.0,
        1.0,
        **STATIC,
    )
    background_median: number(
        "Background Moved",
        "Half of the background moved at most so many pixels in the last Solve; -1 before it and with Alone",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    background_95: number(
        "Background Moved at Most",
        "95 % of the background moved at most so many pixels in the last Solve; -1 before it and with Alone",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    background_max: number(
        "Background Moved Farthest",
        "All of the background moved at most so many pixels in the last Solve; -1 before it and with Alone",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    background_worst: place(
        "Place of the Farthest", "Where the picture shows the point of the background that moved farthest"
    )
    flaws: text("Flaws", "What is wrong in the last solution, and what to do; empty if nothing is", **STATIC)
    between: number(
        "Worst Between Keys",
        "Largest residual between two solved keyframes, in pixels; -1 without keyframes",
        -1.0,
        -1.0,
        LARGEST,
        **STATIC,
    )
    message: text("Aim Result", "What the last Solve has reached, or why it was not taken", **STATIC)


CLASSES = (SCFPF_AimTarget, SCFPF_Aim)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
