# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras that see the layers in a passing scene: a rig, or a copy of a camera that needs none.

All of them make the whole image, in which the picture of a layer has its place and size: their pixels are
those of the image.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...bridge.blender.all_or_nothing import all_or_nothing
from ...bridge.blender.scene_objects import delete_with_data, object_by_uid
from ...bridge.render.image_size import image_aspect, image_size
from ...projection.mappings.stack import Stack
from ...projection.surfaces.surface import Plane
from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.reparameterisation import Framed
from ...projection.volume.viewing_volume import Projection
from ...scanline.generated_collection import follow_image_size
from ...scanline.table.table_object import grid_cells
from .. import hidden_surfaces
from ..cautions import cautions
from ..chords.chord_plan import ChordPlan, plan_chords
from ..rig_data import MODIFIER, check, check_surfaces, make_rig, remove_rig, rigs
from ..skipping.refresh import write_skipping
from .temporary_scene import TemporaryScene

GONE = "A camera or the scene was deleted meanwhile: render again"


class LayerView(NamedTuple):
    """A view of an image with layers: that of the image itself, or of a layer.

    camera: its session id. frame: the place of its picture in the image. projection: what the image shows
    through it, world space. place: (4, 4), without scale, of a camera that Cycles renders without a rig: an
    ordinary one, or a flexible one whose volume is its own frustum. None for others. is_own: whether the
    projection is the view of the camera's own lens.
    """

    camera: int
    frame: Framed
    projection: Projection
    place: Array | None
    is_own: bool

    @property
    def own(self) -> Projection:
        """The projection of its own picture."""
        image = self.projection.reparameterisation
        if self.frame == Framed() or not isinstance(image, Stack):
            return self.projection
        return replace(self.projection, reparameterisation=image.base)


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
