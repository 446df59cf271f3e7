# SPDX-License-Identifier: GPL-3.0-or-later
"""Blends of two and more cameras in a town: a square behind a palace, and a tour of places."""

from __future__ import annotations

import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from ..evening import evening
from ..mesh import MeshBuilder, material, place
from ..render_demo import build_street
from . import town
from .parts import add_camera, blended, new_scene, pinned, sized

HIDDEN_SIZE, TOUR_SIZE = (1120, 500), (1120, 600)
# The monument in the square, which the palace hides.
MONUMENT = (0.0, 31.0, 3.4)
# Who is in the square and before the palace: x, y, turn in degrees.
PEOPLE = (
    (-3.4, 25.2, 160.0),
    (-2.6, 25.6, 200.0),
    (4.0, 24.4, 20.0),
    (5.6, 33.0, 110.0),
    (-6.5, 34.5, -70.0),
    (8.2, 27.0, -140.0),
    (-9.0, 28.2, 60.0),
    (1.4, 38.2, 180.0),
    (-14.0, -10.0, 30.0),
    (-13.2, -10.4, -30.0),
    (15.8, -12.5, 150.0),
    (12.0, -6.5, 80.0),
    (-9.5, -5.2, 200.0),
)


def behind():
    """A monument behind a palace, shown where it would be seen without the palace.

    Wu and Popescu, Multiperspective Focus+Context Visualization (TVCG 2016).
    """
    scene = new_scene(*HIDDEN_SIZE)
    _square(scene)
    first = add_camera(scene, "Eye Level", (0.0, -31.0, 1.9), (0.0, 10.0, 5.0), 26.0)
    seen = seen_at(scene, first, MONUMENT)
    second = pinned(scene, "Over the Roof", (0.0, -10.0, 30.0), MONUMENT, seen, 26.0)
    second.data.lens *= (Vector(MONUMENT) - second.location).length / (
        Vector(MONUMENT) - first.location
    ).length
    second = _again(scene, second, seen)
    scene.camera = blended(
        first,
        second,
        "RADIAL",
        "Behind the Palace",
        center=(seen[0], seen[1] + 0.03),
        size=(0.44, 0.5),
        border=0.2,
    )
    return scene


def _again(scene, camera, at):
    """A camera pinned anew after its lens has changed."""
    import bpy

    name, place_, lens = camera.name, camera.location.copy(), camera.data.lens
    bpy.data.objects.remove(camera)
    return pinned(scene, name, place_, MONUMENT, at, lens)


def seen_at(scene, camera, point) -> tuple[float, float]:
    """The place of a point in a camera's image, as shares of its width and height."""
    import bpy

    bpy.context.view_layer.update()
    found = world_to_camera_view(scene, camera, Vector(point))
    return found.x, found.y


def _square(scene) -> None:
    plots = [((-13.0, 0.0), (13.0, 11.0), "SENW", 2)]
    for side in (-1, 1):
        for low in (-14.0, -3.0, 8.0, 19.0, 30.0, 41.0):
            xs = sorted((side * 24.0, side * 36.0))
            plots.append(((xs[0], low), (xs[1], low + 11.0), "EW"[side > 0] + "S", 3 + int(low) % 2))
    for low in (-36.0, -24.0, -12.0, 0.0, 12.0, 24.0):
        plots.append(((low, 54.0), (low + 12.0, 66.0), "S", 4 - int(low / 12) % 2))
    town.houses(scene, plots)
    town.ground(
        scene,
        140.0,
        [
            (-15.0, -2.0, 15.0, 13.0),
            (-38.0, -16.0, -21.5, 70.0),
            (21.5, -16.0, 38.0, 70.0),
            (-13.0, 18.0, 13.0, 44.0),
        ],
    )
    builder = MeshBuilder()
    steps = [
        (4.2, 0.0),
        (4.2, 0.35),
        (3.5, 0.35),
        (3.5, 0.7),
        (2.8, 0.7),
        (2.8, 1.05),
        (1.1, 1.1),
        (0.9, 1.5),
    ]
    builder.lathe(
        [*steps, (0.75, 4.6), (1.15, 4.9), (1.15, 5.2), (0, 5.2)], 40, "Z", (0, MONUMENT[1], 0.15), "Stone"
    )
    builder.ball((0, MONUMENT[1], 6.5), (1.3, 1.3, 1.3), "Gold", segments=48)
    palette = {
        "Stone": material("Pale marble", (0.66, 0.63, 0.58), 0.6),
        "Gold": material("Gold", (0.80, 0.42, 0.05), 0.35, 0.6),
    }
    place("Monument", builder.mesh("Monument", palette, outward=True), town.group(scene, "Monument"))
    ring = [(10.5 * np.cos(a), MONUMENT[1] + 10.5 * np.sin(a)) for a in np.radians(np.arange(0, 360, 45))]
    rows = [(side * 19.0, y) for side in (-1, 1) for y in np.arange(-20.0, 46.0, 11.0)]
    town.furnish(scene, [*ring[::2], *rows], [*ring[1::2], *((x, y + 5.0) for x, y in rows)])
    red, cream = (0.38, 0.012, 0.010), (0.60, 0.48, 0.28)
    town.cars(
        scene,
        (
            ("Car", red, -5.5, 20.5, 2.0),
            ("Red car", red, 6.0, 22.0, -1.2),
            ("Cream car", cream, 17.0, -7.0, 0.0),
            ("White car", (0.6, 0.6, 0.6), -17.6, -12.0, np.pi),
        ),
    )
    town.walkers(scene, PEOPLE)
    town.dusk(scene, (66.0, 0.0, -28.0), dusk=True, exposure=0.85)


# Places that were visited: name, what is looked at, from where, the lens, and the diameter of the circle.
VISITS = (
    ("Car", (0.0, 0.0, 0.8), (-4.0, -20.0, 6.5), 36.0, 0.34),
    ("Tower", (0.0, 60.0, 12.0), (-5.0, -6.0, 17.0), 34.0, 0.28),
    ("Corner", (13.0, 10.0, 4.0), (1.0, -24.0, 9.0), 36.0, 0.26),
)


def _seeing_far(camera):
    """The camera, with an end behind the hills."""
    camera.data.clip_end = 320.0
    return camera


def tour():
    """A town from above, in which places look as they did when they were visited.

    Singh and Balakrishnan, Visualizing 3D Scenes Using Non-Linear Projections and Data Mining of Previous
    Camera Movements (AFRIGRAPH 2004).
    """
    scene = sized(build_street(), *TOUR_SIZE)
    town.hills(scene, 112.0, 24.0, (0.0, 20.0))
    overview = made = _seeing_far(
        add_camera(scene, "Overview", (-13.0, -76.0, 39.0), (1.0, 16.0, 11.0), 36.0)
    )
    for name, thing, eye, lens, wide in VISITS:
        at = seen_at(scene, overview, thing)
        visit = _seeing_far(pinned(scene, f"{name} Visit", eye, thing, at, lens))
        made = blended(
            made, visit, "RADIAL", f"Overview and {name}", center=at, size=(wide, 0.5), border=0.7 * wide
        )
    scene.camera = made
    evening(scene, (69.0, 0.0, -26.0), exposure=0.65)
    return scene
