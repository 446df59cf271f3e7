# SPDX-License-Identifier: GPL-3.0-or-later
"""Perspective by Distance: planes that are as wide as fields of view say, at distances from the camera.

Each plane has its distance, field of view and shift as properties, and drivers make its size and place from
them. So keyframes of the properties act in every viewport and every render.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...projection.user_error import UserError
from ...projection.volume.basis import LARGEST_WEIGHT, SMALLEST_WEIGHT
from ..blender.all_or_nothing import way_back
from ..blender.drivers import add_property, add_scene_property, new_driver
from ..blender.slot_animation import SURFACES, move_slot
from ..surfaces.surface_object import parameter_properties
from ..volume.camera_members import cameras_with, surfaces_of
from ..volume.volume_object import sync_volume_object
from .flexible_camera import NewSurface, add_surface, make_flexible, replace_surfaces
from .ordinary_camera import frustum
from .read_projection import read_own_projection

# The properties of ``Object.scfpf_surface`` that the drivers ask, by the drivers' names for them.
ASKED = {"d": "distance", "a": "angle", "x": "shift[0]", "y": "shift[1]"}
# Properties of the rendered scene: the pixels across and up, and their aspect.
PICTURE = {
    "w": "render.resolution_x",
    "h": "render.resolution_y",
    "p": "render.pixel_aspect_x",
    "q": "render.pixel_aspect_y",
}
WIDTH, HEIGHT = "2*d*tan(a/2)", "2*d*tan(a/2)*h*q/(w*p)"
SIZES = {"Width": WIDTH, "Height": HEIGHT}
PLACES = (f"x*{WIDTH}", f"y*{WIDTH}", "-d")
# A name after a distance, perhaps with Blender's number of a name that is taken.
NAME = re.compile(r"At [\d.e+-]+")
# Positions along a projector at which a volume is measured for a new distance.
MEASURES = 513


class View(NamedTuple):
    """The view of a camera at a distance. angle: the horizontal field of view, radians.

    shift: of the middle of the picture, right and up, in widths of the picture.
    """

    distance: float
    angle: float
    shift: tuple[float, float] = (0.0, 0.0)


def is_by_distance(camera) -> bool:
    """Return whether all control surfaces of a camera are planes that drivers place by distance."""
    surfaces = surfaces_of(camera)
    return len(surfaces) > 1 and all(surface.scfpf_surface.is_by_distance for surface in surfaces)


def view_of_lens(camera, scene) -> View:
    """The view of a perspective lens, the same at all distances; its distance is 1. Raises UserError."""
    near, _ = frustum(camera, scene)
    if camera.data.type != "PERSP":
        raise UserError(
            "'{0}' has an orthographic lens, which has no field of view: choose a perspective one",
            camera.name,
        )
    distance = -near.matrix[2, 3]
    shift = near.matrix[:2, 3] / near.width
    return View(1.0, 2.0 * math.atan(near.width / (2.0 * distance)), (float(shift[0]), float(shift[1])))


def make(camera, views: Sequence[View]) -> None:
    """Replace a camera's volume by one that passes through views, nearest first. Raises UserError."""
    views = sorted(views)
    replace_surfaces(camera, [NewSurface(_name(view), "PLANE", np.eye(4)) for view in views])
    settings = camera.scfpf
    settings.basis, settings.reparameterisation, settings.fit = "SMOOTH", "RECTANGLE", "NONE"
    settings.u_range = settings.v_range = (0.0, 1.0)
    for slot, view in zip(settings.surfaces, views, strict=True):
        _follow(slot.object, view)
    _write_places(camera)
    make_flexible(camera)


def insert(camera, depsgraph, aspect: float, distance: float) -> None:
    """Add a plane at a distance. At it, the camera shows what it showed before. Raises UserError.

    distance: above 0, in camera space.
    """
    volume = read_own_projection(camera, depsgraph, aspect).volume
    views = [view_of(surface) for surface in surfaces_of(camera)]
    if not views[0].distance < distance < views[-1].distance:
        end = views[0] if distance <= views[0].distance else views[-1]
        _add(camera, end._replace(distance=distance))
        return
    t = np.linspace(0.0, 1.0, MEASURES)
    left, right = (
        volume.evaluate(np.full(MEASURES, u), np.full(MEASURES, 0.5), t).position for u in (0.0, 1.0)
    )
    middle, width = 0.5 * (left + right), right[0] - left[0]
    order = np.argsort(-middle[2], kind="stable")

    def at_distance(values) -> float:
        return float(np.interp(distance, -middle[2][order], values[order]))

    wide = max(at_distance(width), np.finfo(np.float32).tiny)
    shift = at_distance(middle[0]) / wide, at_distance(middle[1]) / wide
    _add(camera, View(distance, 2.0 * math.atan(wide / (2.0 * distance)), shift))


def _add(camera, view: View) -> None:
    index = sum(surface.scfpf_surface.distance < view.distance for surface in surfaces_of(camera))
    _follow(add_surface(camera, "PLANE", _name(view), index=index), view)
    _write_places(camera)
    sync_volume_object(camera)


def view_of(surface) -> View:
    """The view that a plane follows."""
    own = surface.scfpf_surface
    return View(own.distance, own.angle, tuple(own.shift))


def half_width(surface) -> float:
    """Half the width of what the picture shows at a plane's distance."""
    own = surface.scfpf_surface
    return own.distance * math.tan(own.angle / 2.0)


def set_half_width(surface, value: float) -> None:
    """Give a plane the field of view whose half width is a value above 0."""
    own = surface.scfpf_surface
    own.angle = 2.0 * math.atan2(value, own.distance)


def release(camera) -> None:
    """Leave a camera's planes as they are now, to be edited by hand. Raises UserError."""
    surfaces = [surface for surface in surfaces_of(camera) if surface.scfpf_surface.is_by_distance]
    sizes = [
        [(owner, name) for label, owner, name in parameter_properties(surface) if label in SIZES]
        for surface in surfaces
    ]
    for surface, inputs in zip(surfaces, sizes, strict=True):
        way_back(_follow, surface, view_of(surface))
        for owner, name in inputs:
            owner.driver_remove(name)
        surface.driver_remove("location")
        _lock(surface, False)
        surface.scfpf_surface.is_by_distance = False


def distance_edited(surface) -> None:
    """Keep the planes of the cameras of a surface in the order of distance, after an edit of one.

    A plane that is named after its distance gets another name.
    """
    if surface.scfpf_surface.is_by_distance and NAME.fullmatch(surface.name):
        surface.name = _name(view_of(surface))
    for camera in cameras_with(surface):
        if not is_by_distance(camera) or not camera.is_editable:
            continue
        settings = camera.scfpf
        distances = [slot.object.scfpf_surface.distance for slot in settings.surfaces]
        active = settings.surfaces[min(settings.active_surface, len(distances) - 1)].object
        for place in range(len(distances)):
            first = min(range(place, len(distances)), key=distances.__getitem__)
            if first != place:
                move_slot(settings, first, place, SURFACES)
                distances.insert(place, distances.pop(first))
        settings.active_surface = surfaces_of(camera).index(active)
        _write_places(camera)
        sync_volume_object(camera)


def _name(view: View) -> str:
    """The name of a plane, which ``NAME`` knows."""
    return f"At {view.distance:.4g}"


def _follow(surface, view: View) -> None:
    """Let a plane have the size and the place of a view, by drivers."""
    own = surface.scfpf_surface
    own.is_by_distance = True
    own.distance, own.angle, own.shift = view
    for label, owner, name in parameter_properties(surface):
        if label in SIZES:
            _drive(surface, owner, name, SIZES[label])
    for axis, expression in enumerate(PLACES):
        _drive(surface, surface, "location", expression, axis)
    _lock(surface, True)


def _lock(surface, on: bool) -> None:
    """Let a plane be moved by its properties alone, or by hand."""
    surface.lock_location = surface.lock_rotation = surface.lock_scale = (on,) * 3


def _drive(surface, owner, name: str, expression: str, axis: int = -1) -> None:
    driver = new_driver(owner, name, expression, axis)
    for variable, path in ASKED.items():
        target = add_property(driver, surface, f"scfpf_surface.{path}", variable)
        target.use_fallback_value, target.fallback_value = True, surface.path_resolve(f"scfpf_surface.{path}")
    for variable, path in PICTURE.items():
        add_scene_property(driver, path, variable)


def _write_places(camera) -> None:
    """Tell smooth projectors the distances of the surfaces that they run through."""
    distances = np.array([surface.scfpf_surface.distance for surface in surfaces_of(camera)])
    places = np.clip(distances / distances.max() * LARGEST_WEIGHT, SMALLEST_WEIGHT, LARGEST_WEIGHT)
    for slot, place in zip(camera.scfpf.surfaces, places, strict=True):
        slot.weight = place
