# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that a render of layers needs to know of a scene, read at once, and the pixels of each layer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...bridge.camera.ordinary_camera import is_own_frustum, is_own_view, placement
from ...bridge.layers.read_image_layers import ReadLayers, read_image_layers
from ...bridge.render.image_size import shown_aspect
from ...bridge.render.render_inputs import read_view, ready_size
from ...bridge.scene.render_depsgraph import with_render_depsgraph
from ...casting.common.parallel import chunks, parallel_map
from ...casting.layers.layer_parts import Box, Hull
from ...projection.typing import Array, BoolArray
from ...projection.volume.reparameterisation import Framed
from ...projection.volume.viewing_volume import Projection
from ...shading.settings.frame_settings import Border
from ..hidden_surfaces import has_rendered
from ..rig_data import rigs
from .joined_layers import within
from .layer_eyes import LayerView
from .layer_things import FoundThings, find_things
from .opaque_things import is_all_opaque
from .temporary_scene import TemporaryScene

# Pixels around a layer's own that its things may colour besides the filter's.
MARGIN = 1


@dataclass(frozen=True)
class ReadViews:
    """An image with layers: numbers and arrays only.

    size: in pixels. views: of the image and of each layer, by number. layers: as read. things: of the layers.
    blurs: whether things may show beyond their places: by motion, or by a lens in any view. is_opaque: if no
    camera ray passes what it meets.
    """

    size: tuple[int, int]
    views: tuple[LayerView, ...]
    layers: ReadLayers
    things: FoundThings
    blurs: bool
    is_opaque: bool
    filter_width: float

    def bounds(self, number: int) -> tuple[Box, Hull] | None:
        """The bounds of a layer's things; None if renders show none of them."""
        things = self.things.by_layer.get(number)
        return None if things is None else things.bounds

    def box(self, number: int) -> Box:
        """The box around the things of a layer that has some."""
        found = self.bounds(number)
        assert found is not None
        return found[0]

    def window(self, number: int) -> Border | None:
        """The rectangle of pixels that may show a layer (from 1 on) or its halo; None if none may."""
        found = self.bounds(number)
        if found is None:
            return None
        layer, (box, hull) = self.layers.layers[number - 1], found
        if layer.halo > 0.0:
            hull = Hull.around(box.corners)
        is_open = self.blurs or self.things.by_layer[number].is_open
        width, height = self.size

        def seen(some: slice) -> BoolArray:
            which = np.arange(some.start, some.stop)
            x, y = (which % width + 0.5) / width, (which // width + 0.5) / height
            met = layer.shown_at(x, y)
            image = layer.projection.reparameterisation
            met &= image.points(x, y, layer.projection.aspect).mask
            if not is_open and met.any():
                met[met] = hull.may_be_met(layer.projection, x[met], y[met], layer.halo)
            return met

        met = np.concatenate(parallel_map(seen, chunks(width * height))).reshape(height, width)
        window = within(met, Border(0, 0, width, height))
        if window is None:
            return None
        more = MARGIN + int(np.ceil(self.filter_width / 2))
        return Border(
            max(window.left - more, 0),
            max(window.bottom - more, 0),
            min(window.right + more, width),
            min(window.top + more, height),
        )

    def beyond(self, number: int) -> frozenset[int]:
        """Session ids of the objects of layer 0 that are outside of a layer's halo."""
        found, halo = self.bounds(number), self.layers.layers[number - 1].halo
        if found is None:
            return frozenset()
        box = found[0]
        return frozenset(uid for uid, blocks in self.things.boxes.items() if _gap(box, blocks) > halo)


def _gap(box: Box, blocks: list[Array]) -> float:
    """The least distance between a box and the boxes around blocks of points (3, N)."""
    gaps = []
    for points in blocks:
        other = Box.around(points)
        apart = np.maximum(0.0, np.maximum(other.lower - box.upper, box.lower - other.upper))
        gaps.append(float(np.linalg.norm(apart)))
    return min(gaps)


def read_views(passing: TemporaryScene, camera) -> ReadViews:
    """Read an image of the passing scene through a camera with layers. Raises USER_ERRORS."""
    scene = passing.scene
    size = ready_size(scene, camera)
    return with_render_depsgraph(
        scene, scene.view_layers[0], lambda depsgraph: _read(depsgraph, camera, size)
    )


def _own_place(camera, depsgraph, seen: Projection) -> Array | None:
    """The place of a flexible camera whose picture F12 makes without a rig; None for others.

    seen: its projection. A rig of its own, the shutter, the lens, and control surfaces that other renders
    show keep it flexible.
    """
    scene, evaluated = depsgraph.scene_eval, camera.evaluated_get(depsgraph)
    is_plain = not (scene.render.use_motion_blur or camera.data.dof.use_dof)
    if not is_plain or has_rendered(depsgraph.scene) or any(rig.scfpf_rig.camera == camera for rig in rigs()):
        return None
    return placement(evaluated) if is_own_frustum(seen, evaluated, depsgraph) else None


def _read(depsgraph, camera, size: tuple[int, int]) -> ReadViews:
    scene = depsgraph.scene_eval
    aspect = shown_aspect(scene.render, *size)
    layers = read_image_layers(camera, depsgraph, aspect)
    lenses, seen = [camera.data.dof.use_dof], read_view(depsgraph, camera, aspect)
    is_own = is_own_view(seen, camera.evaluated_get(depsgraph), depsgraph)
    views = [LayerView(camera.session_uid, Framed(), seen, _own_place(camera, depsgraph, seen), is_own)]
    own = {each.camera.session_uid: each.camera for each in camera.scfpf.layers if each.camera is not None}
    own_views = (plane is not None for plane in layers.planes)
    read = zip(layers.layers, layers.cameras, layers.frames, own_views, strict=True)
    for layer, uid, frame, is_own in read:
        eye = own[uid].evaluated_get(depsgraph)
        place = None if eye.scfpf.enabled else placement(eye)
        views.append(LayerView(uid, frame, layer.projection, place, is_own))
        lenses.append(eye.data.dof.use_dof)
    halos = any(layer.halo > 0.0 for layer in layers.layers)
    return ReadViews(
        size=size,
        views=tuple(views),
        layers=layers,
        things=find_things(depsgraph, layers.members, halos),
        blurs=scene.render.use_motion_blur or any(lenses),
        is_opaque=is_all_opaque(depsgraph),
        filter_width=scene.cycles.filter_width,
    )
