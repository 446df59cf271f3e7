# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces are hidden from the rays of Cycles rigs as long as the file has a rig.

Drivers of the objects' own ray visibility hide them, with or without the add-on, while the rendered scene's
camera is a rig's. All other cameras see them as before. A ray visibility that the artist has switched off
gets no driver, so that removing the drivers restores what was there. Drivers refer to no datablock by
pointer, which makes them safe to add and remove between two steps of undo.
"""

from __future__ import annotations

import bpy

from ..bridge.blender.drivers import new_driver
from ..bridge.blender.rig_mark import (
    HIDDEN_RAYS,
    HIDING,
    OTHER_HIDING,
    add_mark,
    has_other_animation,
    is_hiding,
)
from ..bridge.blender.scene_objects import holds
from ..bridge.blender.slot_animation import curve_collections
from ..bridge.sync.camera_sync import camera_objects
from ..bridge.volume.camera_members import grids_of, surfaces_of
from ..bridge.volume.screens import screens_of

# Lattices are not rendered.
RENDERED = {"MESH", "SURFACE"}

# Found at the last look, numbers only: how many objects there are, and surfaces with their visibility.
_known: list[tuple] = []


def forget() -> None:
    """Look at all objects at the next call of ``hide_surfaces``."""
    _known.clear()


def hide_surfaces(is_wanted: bool) -> None:
    """Hide the control surfaces of all cameras from the rays of rigs, and show all other objects.

    is_wanted: whether the file has a rig. Quick if nothing has changed.
    """
    surfaces = _surfaces(camera_objects() if _known else bpy.data.objects) if is_wanted else {}
    now = len(bpy.data.objects), tuple((uid, surface.hide_render) for uid, surface in surfaces.items())
    if _known == [now]:
        return
    for obj in bpy.data.objects:
        if obj.animation_data is not None and obj.session_uid not in surfaces and obj.is_editable:
            _show(obj)
    for surface in surfaces.values():
        if surface.is_editable and _may_be_rendered(surface):
            _hide(surface)
    _known[:] = [now]


def seen_surfaces(scene) -> list[str]:
    """Names of a scene's surfaces that a rig's rays meet: linked ones, and those with other drivers."""
    return sorted(
        surface.name
        for surface in _surfaces(camera_objects()).values()
        if _may_be_rendered(surface)
        and any(not _is_hidden(surface, ray) for ray in HIDDEN_RAYS)
        and holds(scene.objects, surface)
    )


def has_rendered(scene) -> bool:
    """Return whether a scene has a control surface that cameras without a rig see when it is rendered."""
    surfaces = _surfaces(bpy.data.objects).values()
    return any(_may_be_rendered(surface) and holds(scene.objects, surface) for surface in surfaces)


def hidden_from_rigs() -> set:
    """The control surfaces that no ray of a rig meets."""
    return {
        surface
        for surface in _surfaces(camera_objects()).values()
        if all(_is_hidden(surface, ray) for ray in HIDDEN_RAYS)
    }


def _surfaces(candidates) -> dict[int, bpy.types.Object]:
    """Surfaces, mapping grids and screens of the cameras among ``candidates``, by session id.

    No render shows them.
    """
    found = {}
    for camera in candidates:
        if camera.type != "CAMERA":
            continue
        for member in surfaces_of(camera) + grids_of(camera) + screens_of(camera):
            if member.type in RENDERED:
                found[member.session_uid] = member
    return found


def _may_be_rendered(surface) -> bool:
    return not surface.hide_render or _curve(surface, "hide_render") is not None


def _curve(obj, path: str):
    """The driver of a property, or else an F-curve of it; None if it has neither."""
    curves = (curve for curves in curve_collections(obj) for curve in curves)
    return next((curve for curve in curves if curve.data_path == path), None)


def _is_hidden(surface, ray: str) -> bool:
    curve = _curve(surface, ray)
    return is_hiding(curve) if curve is not None else not getattr(surface, ray)


def _hide(surface) -> None:
    for ray in HIDDEN_RAYS:
        curve = _curve(surface, ray)
        driver = None if curve is None else curve.driver
        has_driver = driver is not None and driver.expression != OTHER_HIDING
        if has_driver or (curve is None and not getattr(surface, ray)):
            continue
        add_mark(new_driver(surface, ray, HIDING))


def _show(obj) -> None:
    """Remove the drivers from an object; the ray visibilities that have one were on."""
    hidden = [curve.data_path for curve in obj.animation_data.drivers if is_hiding(curve)]
    for ray in hidden:
        obj.driver_remove(ray)
        setattr(obj, ray, True)
    if hidden and not has_other_animation(obj):
        obj.animation_data_clear()
