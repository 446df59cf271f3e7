# SPDX-License-Identifier: GPL-3.0-or-later
"""The layers of a flexible camera's image: which things they show, and through which volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.mappings.stack import seen_through
from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from ...projection.volume.reparameterisation import Framed
from ...projection.volume.viewing_volume import ImageLayer, Projection, ViewingVolume
from ..blender.image_masks import mask_pixels
from ..blender.scene_objects import absent_text
from ..camera.ordinary_camera import frustum_projection
from ..camera.read_projection import read_projection
from ..camera.stereo_views import Eye, eye_place, own_depth_plane, seen_by
from ..scene.read_materials import listing

# Layers of one image at most: their numbers are bytes.
MOST_LAYERS = 64
NOT_HERE = Message("The nodes preview does not show layers: {0}")
NOT_BY_F12 = Message("F12 by Cycles does not show layers: press Render Layers with Cycles")
SHARP = Message("Depth of field is left out in layers: only the rest of the picture is blurred")
TWICE = Message("In the layers '{0}' and '{1}', of which the first alone shows them: {2}")
EMPTY = Message("Layers that show nothing, as renders show none of their objects: ")


@dataclass(frozen=True)
class ReadLayers:
    """The layers of an image, as evaluated.

    layers, names, cameras, frames, planes: by number, from 1 on; session ids of the cameras, the frames of
    their pictures in the image, and their planes of depth, see ``own_depth_plane``. members: the number of
    the layer by the session id of each object that a layer shows. taken: the numbers of layers whose things
    are all in earlier ones. warnings: about layers that are left out or show less than asked.
    """

    layers: tuple[ImageLayer, ...] = ()
    names: tuple[str, ...] = ()
    cameras: tuple[int, ...] = ()
    frames: tuple[Framed, ...] = ()
    planes: tuple[Array | None, ...] = ()
    members: Mapping[int, int] = field(default_factory=dict)
    taken: frozenset[int] = frozenset()
    warnings: tuple[str, ...] = ()

    def warnings_of(self, geometry: Geometry, is_blurred: bool) -> tuple[str, ...]:
        """The warnings, with those about the scene that was read. is_blurred: by depth of field."""
        if not self.layers:
            return self.warnings
        numbers = geometry.image_layer
        shown = set() if numbers is None else set(np.unique(numbers).tolist())
        shown |= self.taken  # of which other warnings tell
        empty = [name for number, name in enumerate(self.names, 1) if number not in shown]
        more = [Message("{0}{1}", EMPTY, listing(empty))] if empty else []
        return (*self.warnings, *more, *([SHARP] if is_blurred else []))


def read_image_layers(camera, depsgraph, aspect: float, eye: Eye = "") -> ReadLayers:
    """Read the layers of a camera that are switched on and complete.

    aspect: of the image. eye: of a stereoscopic scene; each layer's camera has its own two. Raises
    UserError, with the layer's name.
    """
    evaluated = camera.evaluated_get(depsgraph)
    place = np.array(eye_place(evaluated, eye)[:3, 3], np.float64) if evaluated.scfpf.layers else None
    layers, names, shown, planes, collections, warnings = [], [], [], [], [], []
    for own, state in zip(camera.original.scfpf.layers, evaluated.scfpf.layers, strict=True):
        if not state.is_on or not camera.original.scfpf.enabled:
            continue
        lack = lacking(own)
        if lack or len(layers) == MOST_LAYERS:
            reason = lack or Message("an image has at most {0} layers", MOST_LAYERS)
            warnings.append(Message("Layer '{0}' is left out: {1}", own.name, reason))
            continue
        frame = Framed(*map(tuple, (state.position, state.size)))
        try:
            projection, plane = _view(own.camera, frame, depsgraph, aspect, eye)
        except UserError as error:
            raise UserError("Layer '{0}': {1}", own.name, error) from error
        mask = None if own.mask is None else mask_pixels(own.mask)
        if mask is None and own.mask is not None:
            warnings.append(
                Message(
                    "The mask of layer '{0}' has no pixels, so it hides nothing: paint or load it", own.name
                )
            )
        layers.append(ImageLayer(projection, state.front, place, mask, state.halo, state.feather))
        names.append(own.name)
        shown.append((own.camera.session_uid, frame))
        planes.append(plane)
        collections.append(own.collection)
    members, twice = _members(names, collections)
    cameras, frames = tuple(zip(*shown, strict=True)) if shown else ((), ())
    things = {number for number, each in enumerate(collections, 1) if len(each.all_objects)}
    return ReadLayers(
        layers=tuple(layers),
        names=tuple(names),
        cameras=cameras,
        frames=frames,
        planes=tuple(planes),
        members=members,
        taken=frozenset(things - set(members.values())),
        warnings=(*warnings, *twice),
    )


def lacking(layer) -> str:
    """The message of what a layer lacks to be shown, and what to do; empty if it is complete."""
    if layer.collection is None:
        return Message("it has no collection: choose one")
    if layer.camera is None:
        return Message("it has no camera: choose one under Seen By")
    return ""


def _view(camera, frame: Framed, depsgraph, aspect: float, eye: Eye) -> tuple[Projection, Array | None]:
    """The projection of a layer's camera in a frame of the image, and its plane of depth.

    Raises UserError.
    """
    if lost := absent_text(camera, depsgraph.scene, Message("choose another camera under Seen By")):
        raise UserError(lost)
    evaluated = camera.evaluated_get(depsgraph)
    own_aspect = aspect * frame.size[0] / frame.size[1]
    if camera.scfpf.enabled:
        projection = read_projection(camera, depsgraph, own_aspect)
    else:
        projection = frustum_projection(evaluated, depsgraph, own_aspect)
    plane = own_depth_plane(projection, evaluated, depsgraph, eye)
    if not camera.scfpf.enabled:
        # A frame of another shape shows more or less height, undistorted.
        ends = (replace(end, height=end.height * aspect / own_aspect) for end in projection.volume.surfaces)
        projection = replace(projection, volume=ViewingVolume(tuple(ends)))
    if frame != Framed():
        seen = seen_through((frame,), projection.reparameterisation)
        projection = replace(projection, reparameterisation=seen)
    return projection.transformed(seen_by(evaluated, eye)) if eye else projection, plane


def _members(names, collections) -> tuple[dict[int, int], list[str]]:
    """The layer of each object, and a warning for each two layers that share some: the first shows them."""
    members: dict[int, int] = {}
    shared: dict[tuple[int, int], list[str]] = {}
    for number, collection in enumerate(collections, 1):
        for obj in collection.all_objects:
            first = members.setdefault(obj.session_uid, number)
            if first != number:
                shared.setdefault((first, number), []).append(obj.name)
    return members, [
        Message(TWICE, names[first - 1], names[second - 1], listing(objects))
        for (first, second), objects in shared.items()
    ]


def shown_layers(camera) -> list[str]:
    """The names of the layers that a camera's renders show."""
    if not camera.scfpf.enabled:
        return []
    return [layer.name for layer in camera.scfpf.layers if layer.is_on and not lacking(layer)]


def not_here(camera) -> str:
    """The sentence for the nodes preview, which does not show layers; empty if the camera has none."""
    names = shown_layers(camera)
    return Message(NOT_HERE, listing(names)) if names else ""
