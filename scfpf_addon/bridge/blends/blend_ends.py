# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras that a blend is made of, and the map that each but the first one has.

The ends have numbers: 1 is the first camera, 2 the second one or a preset, further cameras follow.
"""

from __future__ import annotations

from typing import NamedTuple

from ...projection.editing.blend_map import BlendMap
from ...projection.editing.blending import SHARP_FACES, SMOOTH_FACES
from ..blender.image_masks import mask_pixels
from ..blender.slot_animation import curve_collections

# Paths of what Bake Map bakes, and of what a map around views follows on another camera.
MAP_PATHS = ("scfpf.blend_field.", "scfpf.blend_more[")
VIEW_PATH = "scfpf.aim_targets["
# The most cameras of a blend: each keeps a shape of each surface.
MOST_ENDS = 16


class BlendEnd(NamedTuple):
    """An end of a blend other than the first one: its number, its camera or None, and its map's settings."""

    number: int
    camera: object
    settings: object


def ends_of(camera) -> list[BlendEnd]:
    """The ends of a blend camera other than the first one, in order."""
    settings = camera.scfpf
    further = [BlendEnd(number, end.camera, end.field) for number, end in enumerate(settings.blend_more, 3)]
    return [BlendEnd(2, settings.blend_ends.second, settings.blend_field), *further]


def knows_its_ends(camera) -> bool:
    """Return whether the first two ends of a camera's blend are known."""
    ends = camera.scfpf.blend_ends
    return ends.first is not None and (ends.second is not None or bool(ends.preset))


def read_map(end: BlendEnd, with_pixels: bool = True) -> BlendMap | None:
    """The map of an end; None without a map, for an image without pixels and a camera without views.

    with_pixels: whether to read those of an image, which takes long in drawing.
    """
    settings = end.settings
    if settings.kind == "NONE":
        return None
    pixels, circles = None, ()
    if settings.kind == "IMAGE":
        pixels = None if settings.image is None else mask_pixels(settings.image, with_pixels)
    if settings.kind == "VIEWS":
        circles = view_circles(end.camera)
    if (settings.kind == "IMAGE" and pixels is None) or (settings.kind == "VIEWS" and not circles):
        return None
    return BlendMap(
        kind=settings.kind,
        centre=tuple(settings.center),
        size=tuple(settings.size),
        angle=settings.angle,
        border=settings.border,
        pixels=pixels,
        is_sharp=settings.is_sharp,
        is_inverted=settings.is_inverted,
        circles=circles,
    )


def view_circles(camera) -> tuple[tuple[float, float, float], ...]:
    """The place and width in the image of each view of Aim that a camera has and that is switched on."""
    targets = () if camera is None else camera.scfpf.aim_targets
    return tuple(
        (view.position[0], view.position[1], view.width)
        for view in targets
        if view.kind == "VIEW" and view.is_on
    )


def is_map_animated(camera) -> bool:
    """Return whether keyframes or drivers move a blend camera's maps, which then have no sharp seams."""
    if _has_curves(camera, MAP_PATHS):
        return True
    return any(
        end.settings.kind == "VIEWS" and end.camera is not None and _has_curves(end.camera, VIEW_PATH)
        for end in ends_of(camera)
    )


def _has_curves(camera, paths: str | tuple[str, ...]) -> bool:
    return any(curve.data_path.startswith(paths) for curves in curve_collections(camera) for curve in curves)


def own_seams(camera, with_pixels: bool = True) -> list[tuple[BlendEnd, BlendMap]]:
    """The ends of a blend camera whose maps have no border, with these maps, as ``read_map`` does."""
    if is_map_animated(camera):
        return []
    maps = [(end, read_map(end, with_pixels)) for end in ends_of(camera)]
    return [(end, blend_map) for end, blend_map in maps if blend_map is not None and blend_map.has_seam]


def seams_of(camera) -> list[BlendMap]:
    """The maps without a border of a blend camera and of the blends at its ends, the camera's own first."""
    found, seen, left = [], [], [camera]
    while left:
        own = left.pop(0)
        if own is None or own in seen:
            continue
        seen.append(own)
        found += [blend_map for _end, blend_map in own_seams(own)]
        left += [own.scfpf.blend_ends.first, *(end.camera for end in ends_of(own))]
    return found


def least_faces(camera) -> int:
    """The least number of faces along each axis of a blend camera's grids, for its maps."""
    is_animated = is_map_animated(camera)
    return max(_faces(end.settings, is_animated) for end in ends_of(camera))


def _faces(settings, is_animated: bool) -> int:
    if settings.kind == "NONE":
        return 1
    if settings.border <= 0.0 and settings.kind != "IMAGE" and not is_animated:
        # Straight seams need none, a circle is a polygon.
        return SMOOTH_FACES if settings.kind in ("RADIAL", "VIEWS") else 1
    is_smooth = settings.kind != "IMAGE" and settings.border >= 2.0 / SMOOTH_FACES
    return SMOOTH_FACES if is_smooth else SHARP_FACES
