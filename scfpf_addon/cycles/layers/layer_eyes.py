# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras that see the layers in a temporary scene, and the sheet that covers needless pixels.

A camera is a rig, or a copy of a camera that needs none. All of them make the whole image, in which the
picture of a layer has its place and size: their pixels are those of the image. The sheet ends the camera rays
of covered pixels. Those of other pixels pass beside it: they see what they saw without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import bpy
import numpy as np

from ...bridge.blender.all_or_nothing import all_or_nothing
from ...bridge.blender.scene_objects import delete_with_data, object_by_uid
from ...bridge.render.image_size import image_aspect, image_size
from ...projection.surfaces.surface import Plane
from ...projection.typing import Array, BoolArray
from ...projection.user_error import UserError
from ...projection.volume.reparameterisation import Framed
from ...scanline.generated_collection import follow_image_size
from ...scanline.table.table_object import grid_cells
from .. import hidden_surfaces
from ..cautions import cautions
from ..chords.chord_plan import ChordPlan, plan_chords
from ..rig_data import MODIFIER, check, check_surfaces, make_rig, remove_rig, rigs
from ..skipping.refresh import write_skipping
from .layer_views import LayerView
from .temporary_scene import TemporaryScene

GONE = "A camera or the scene was deleted meanwhile: render again"
# The sheet is this share farther away than where the camera's rays begin, or as far as float32 tells its
# places apart by this share of a pixel. What is before it is rendered as ever.
BEHIND, PRECISE = 2.0**-8, 1.0 / 8.0
# Pixels that a ray of a needed one may pass besides the filter's, for the places of rays are rounded.
MARGIN = 1
# Fewer pixels are not worth a sheet.
FEWEST = 64
SHEET = "SCFPF Covered"


@contextmanager
def seen_through(passing: TemporaryScene, view: LayerView) -> Iterator[list[str]]:
    """Let the passing scene be rendered through a view's camera; yields cautions. Raises UserError."""
    camera = object_by_uid(view.camera)
    if camera is None or passing.scene is None:
        raise UserError(GONE)
    kind = _rigged if view.place is None else _copied
    with kind(passing, camera, view) as found:
        yield found


@contextmanager
def _rigged(passing: TemporaryScene, camera, view: LayerView) -> Iterator[list[str]]:
    made = None
    try:
        with passing.shaped(view.frame.size[0] / view.frame.size[1]):
            chords = _plan(passing.scene, camera, view)
            passes = passing.passes.need_chords
            with all_or_nothing() as kept:
                kept.keep_keys(camera)
                rig = make_rig(passing.scene, camera, chords, passing=True, passes=passes)
                hidden_surfaces.forget()
                hidden_surfaces.hide_surfaces(True)
                write_skipping(rig, chords)
            made = rig.session_uid
        _place(rig, view.frame)
        yield cautions(passing.scene, passing.scene.view_layers[0], rig)
    finally:
        # Undo may have removed it.
        for rig in [each for each in rigs() if each.session_uid == made]:
            remove_rig(rig)
        hidden_surfaces.forget()
        hidden_surfaces.hide_surfaces(bool(rigs()))


def _plan(scene, camera, view: LayerView) -> ChordPlan:
    check(scene, camera)
    check_surfaces(camera)
    size = tuple(
        max(1, round(n * share)) for n, share in zip(image_size(scene), view.frame.size, strict=True)
    )
    lines = grid_cells([slot.object for slot in camera.scfpf.surfaces])
    plan = plan_chords([view.own], (size[0], size[1]), camera.scfpf.pixel_error, lines)
    return replace(plan, is_own_view=view.is_own)


def _place(rig, frame: Framed) -> None:
    """Put a rig's screen where the frame is in what the rig's camera sees."""
    settings, (across, up) = rig.scfpf_rig, frame.size
    modifier, lens = settings.portals.modifiers[MODIFIER], settings.view_camera.data
    if across != up:
        follow_image_size(modifier, ("Aspect",), settings.scene, across / up)
    # The screen stays as it is, and its camera sees more.
    lens.ortho_scale, lens.sensor_width = lens.ortho_scale / across, lens.sensor_width / across
    aspect = image_aspect(settings.scene)
    lens.shift_x, lens.shift_y = 0.5 - frame.centre[0], (0.5 - frame.centre[1]) / aspect


@contextmanager
def _copied(passing: TemporaryScene, camera, view: LayerView) -> Iterator[list[str]]:
    eye, before = camera.copy(), passing.scene.camera
    # A flexible copy would get a volume of its own, and a warning that Cycles ignores it.
    eye.property_unset("scfpf")
    eye.data = lens = camera.data.copy()
    made, kept = eye.session_uid, None if before is None else before.session_uid
    try:
        lens.animation_data_clear()
        passing.scene.collection.objects.link(eye)
        if view.frame != Framed():
            _aim_lens(lens, view)
        passing.scene.camera = eye
        del eye, lens, before, camera
        yield []
    finally:
        if passing.scene is not None:
            passing.scene.camera = object_by_uid(kept or 0)
        if (copy := object_by_uid(made)) is not None:
            delete_with_data(copy)


def _aim_lens(lens, view: LayerView) -> None:
    """Let an ordinary camera see the whole image, of which its own picture is the frame."""
    near = view.own.volume.surfaces[0]
    assert isinstance(near, Plane) and view.place is not None
    there = np.linalg.inv(view.place) @ near.matrix
    depth = -there[2, 3] if lens.type == "PERSP" else 1.0
    width = near.width / depth / view.frame.size[0]
    height = near.height / depth / view.frame.size[1]
    middle = (there[:2, 3] / depth) + (0.5 - np.array(view.frame.centre)) * (width, height)
    lens.sensor_fit = "HORIZONTAL"
    if lens.type == "PERSP":
        lens.sensor_width = width * lens.lens
    else:
        lens.ortho_scale = width
    lens.shift_x, lens.shift_y = middle / width


def without_neighbours(is_needless: BoolArray, filter_width: float) -> BoolArray:
    """The mask (H, W) without pixels within the filter's radius of its border: the mask, eroded.

    Rays of pixels outside the mask do not come near the pixels that remain. filter_width: in pixels.
    """
    reach = MARGIN + int(np.ceil(filter_width / 2.0))
    kept = is_needless
    for axis in (0, 1):
        padded = np.pad(kept, [(reach, reach) if axis == each else (0, 0) for each in (0, 1)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis)
        kept = windows.all(axis=-1)
    return kept


def runs(is_covered: BoolArray) -> tuple[Array, Array, Array]:
    """The runs of covered pixels in the rows of an image (H, W): their rows, first columns and ends."""
    steps = np.diff(np.pad(is_covered, [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    return row, first, np.nonzero(steps == -1)[1]


@contextmanager
def covered(scene, place: Array, is_covered: BoolArray) -> Iterator[None]:
    """Cover pixels of the whole image (H, W), row 0 at the bottom, of a scene's camera without a rig.

    place: (4, 4) of the camera, without scale.
    """
    plane = _plane(scene, place, is_covered.shape)
    if plane is None or np.count_nonzero(is_covered) < FEWEST:
        yield
        return
    made = None
    try:
        made = _add_sheet(scene, place, is_covered, *plane)
        yield
    finally:
        # Undo may have removed it.
        if made is not None and (sheet := object_by_uid(made)) is not None:
            delete_with_data(sheet)


def _plane(scene, place: Array, shape: tuple[int, int]) -> tuple[Array, Array, Array] | None:
    """The lower left corner of the sheet's plane in the camera's space, and the sides of the image, (3,).

    None if float32 does not tell the pixels (H, W) of an image apart there.
    """
    lens, eps = scene.camera.data, float(np.finfo(np.float32).eps)
    frame = np.array([corner[:] for corner in lens.view_frame(scene=scene)])
    depth = (1.0 + BEHIND) * lens.clip_start
    if lens.type == "PERSP":
        frame /= -frame[0, 2]
    right, corner, left = frame[1:4]
    pixel = min(np.linalg.norm(right - corner) / shape[1], np.linalg.norm(left - corner) / shape[0])
    off = eps * (np.abs(place[:3, 3]).max() + np.abs(frame).max())
    if lens.type == "PERSP":
        depth = max(depth, off / (pixel * PRECISE))
        frame *= depth
    elif lens.type != "ORTHO" or off > pixel * PRECISE:
        return None
    frame[:, 2] = -depth
    right, corner, left = frame[1:4]
    return corner, right - corner, left - corner


def _add_sheet(scene, place: Array, is_covered: BoolArray, corner: Array, across: Array, up: Array) -> int:
    """Add a rectangle for each run of pixels in a ``_plane``; returns the object's session id."""
    (row, first, end), (height, width) = runs(is_covered), is_covered.shape
    x, y = np.stack([first, end, end, first]) / width, np.stack([row, row, row + 1, row + 1]) / height
    points = corner + x.T[..., None] * across + y.T[..., None] * up
    mesh = bpy.data.meshes.new(SHEET)
    faces = np.arange(4 * len(row)).reshape(-1, 4)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist())
    sheet = bpy.data.objects.new(SHEET, mesh)
    sheet.matrix_world = place.T.tolist()
    # A hole has no position and no light, whatever the view layer's material is.
    sheet.is_holdout = True
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(sheet, f"visible_{kind}", False)
    scene.collection.objects.link(sheet)
    return sheet.session_uid
