# SPDX-License-Identifier: GPL-3.0-or-later
"""An image with layers through Cycles: renders of each view, in steps that Blender takes, and their join.

Of a view there is a render of its colours and, where its distances decide what is in front, one of positions
at several places of each pixel.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...bridge.render.image_size import render_region
from ...casting.layers.join_images import cover, halo_share
from ...casting.layers.layer_keys import layer_keys
from ...projection.typing import Array, BoolArray
from ...projection.user_error import Message, UserError
from ...projection.volume.viewing_volume import ImageLayer
from ...shading.settings.frame_settings import Border
from ...shading.typing import Single
from .joined_layers import ShownPixels, around, hidden_behind, join_into, padded, slices, widened, within
from .layer_eyes import covered, seen_through, without_neighbours
from .layer_passes import COMBINED, OF_ONE_SAMPLE, POSITION, Mist, delivered, summed
from .layer_views import ReadViews, read_views
from .pass_files import Pass, read_passes
from .temporary_scene import KEY_SIDE, TemporaryScene

# The share from which a part of a pixel stands for its one sample.
HALF = 0.5


class LayeredRender:
    """One image with layers: ``pixels`` after the last of its ``steps``, (H, W, 4), row 0 at the bottom.

    passes: of the image, that the view layer has switched on. warnings: what it does not show as asked.
    total: the number of its renders, once that is known.
    """

    def __init__(self, passing: TemporaryScene) -> None:
        self._passing = passing
        self.warnings: list[str] = []
        self.pixels: Single | None = None
        self.passes: dict[str, Pass] = {}
        self.total = 0

    def steps(self, camera) -> Iterator[str]:
        """Yield the name of what is to be rendered: the caller has Blender render the passing scene.

        Close the iterator to end early. Raises USER_ERRORS.
        """
        read = read_views(self._passing, camera)
        del camera
        self.warnings += [*read.layers.warnings, *self._passing.passes.warnings]
        self._passing.add_groups(read.layers.members, len(read.views))
        render = self._passing.scene.render
        region, is_cropped = _region(render, read.size), render.use_crop_to_border
        del render
        found = {number: read.window(number, region) for number in range(1, len(read.views))}
        windows = {number: window for number, window in found.items() if window is not None}
        fronts = {number: read.layers.layers[number - 1].front for number in windows}
        counts = [3 if layer.halo > 0.0 else 1 + (layer.front == "DEPTH") for layer in read.layers.layers]
        is_compared = any(front != "ORDER" for front in fronts.values())
        self.total = 1 + is_compared + sum(counts[number - 1] for number in windows)
        shown: dict[int, ShownPixels] = {}
        for number, window in windows.items():
            # Rays skip chords in which nothing is that any of the layer's renders shows.
            has_halo = read.layers.layers[number - 1].halo > 0.0
            self._passing.show(*(((0, number), read.beyond(number)) if has_halo else ((number,),)))
            with seen_through(self._passing, read.views[number]) as cautions:
                self._caution(cautions)
                pixels = yield from ViewRenders(self._passing, read, number).layer(window)
            if pixels is not None:
                shown[number] = pixels
        # Last, as its distances matter only where layers are seen.
        compared = [pixels.window for number, pixels in shown.items() if fronts[number] != "ORDER"]
        self._passing.show((0,))
        with seen_through(self._passing, read.views[0]) as cautions:
            self._caution(cautions)
            renders = ViewRenders(self._passing, read, 0)
            shown_around = around(compared) if compared else None
            rest = yield from renders.rest(region, shown_around, [*shown.values()])
        if shown:
            join_into(rest, [*shown.values()])
        if not is_cropped:
            rest = rest.in_image(read.size)
        self.pixels, self.passes = rest.color, delivered(rest.passes, self._passing.passes)

    def _caution(self, texts: list[str]) -> None:
        self.warnings += [text for text in texts if text not in self.warnings]


class ViewRenders:
    """The renders of one view of an image with layers, while the temporary scene is seen through it.

    number: of the view: of a layer from 1 on, 0 for what is in no layer.
    """

    def __init__(self, passing: TemporaryScene, read: ReadViews, number: int) -> None:
        self._passing, self._read, self._number = passing, read, number
        self._name: str = f"'{read.layers.names[number - 1]}'" if number else Message("the picture")

    @property
    def _layer(self) -> ImageLayer:
        return self._read.layers.layers[self._number - 1]

    def rest(
        self, region: Border, compared: Border | None, layers: Sequence[ShownPixels]
    ) -> Generator[str, None, ShownPixels]:
        """Render what is in no layer.

        region: the pixels to render. compared: those in which its keys matter, None without any.
        """
        whole, keys = Border(0, 0, *self._read.size), np.full((1, 1, 1), np.inf)
        if compared is not None:
            keys = self._keys(*(yield from self._places(self._name, compared)))
        else:
            compared = Border(0, 0, 1, 1)
        needless = hidden_behind(layers, keys, compared, whole)
        shot = yield from self._colors(self._name, region, needless)
        first = self._first_keys(shot, shot.is_hit)
        return ShownPixels(region, shot.color, compared, keys, shot.passes, first)

    def layer(self, window: Border) -> Generator[str, None, ShownPixels | None]:
        """Render a layer; None if nothing of it is seen. window: the pixels in which it may be seen."""
        layer, box, keys = self._layer, self._read.box(self._number), None
        self._passing.show((self._number,))
        shot = yield from self._colors(self._name, window)
        own = within(shot.color[..., 3] > 0.0, window)
        if layer.front == "DEPTH" and own is not None:
            keys = self._keys(*(yield from self._places(self._name, own)))
            keys = padded(keys, own, window, len(keys))
        if layer.halo > 0.0:
            place, is_near = yield from self._halo(window, shot)
            if layer.front == "DEPTH":
                near = self._keys(place, is_near)
                keys = near if keys is None else np.where(is_near, near, keys)
        if (seen := within(shot.color[..., 3] > 0.0, window)) is None:
            return None
        shot = shot.part(slices(seen, window))
        keys = np.full((1, 1, 1), np.inf) if keys is None else keys[(slice(None), *slices(seen, window))]
        # Where no place meets anything opaque the middle of the things has to do.
        middle = np.broadcast_to(box.middle[:, None, None, None], (3, *shot.is_hit.shape))
        nearest = self._keys(middle, shot.color[None, ..., 3] > 0.0)
        keys = np.where(np.isfinite(keys).any(axis=0), keys, nearest)
        covered = cover(layer, self._read.size, seen)
        first = self._first_keys(shot, shot.is_hit & (covered >= HALF))
        passes = {
            name: each if name in OF_ONE_SAMPLE else each._replace(values=each.values * covered[..., None])
            for name, each in shot.passes.items()
        }
        return ShownPixels(seen, shot.color * covered[..., None], seen, keys, passes, first)

    def _halo(self, window: Border, shot: LayerRender) -> Generator[str, None, tuple[Array, BoolArray]]:
        """Render the halo of a layer into its shot.

        Returns positions (3, S, H, W) at S places of each pixel, and whether the halo shows what is there.
        """
        layer, number, name = self._layer, self._number, f"{self._name}, its halo"
        box, beyond = self._read.box(number), self._read.beyond(number)
        self._passing.show((0, number), beyond, held_out=number)
        place, is_seen = yield from self._places(name, window)
        distance = box.distance(place.reshape(3, -1)).reshape(is_seen.shape)
        nearness = is_seen * layer.halo_share(distance)
        share, is_near = halo_share(is_seen, nearness), nearness > 0.0
        if (part := within(share > 0.0, window)) is not None:
            self._passing.show((0, number), beyond)
            needless = widened(share <= 0.0, window, Border(0, 0, *self._read.size), True)
            near = yield from self._colors(name, part, needless)
            own, (height, width) = slices(part, window), near.color.shape[:2]
            distance = box.distance(near.position.reshape(3, -1)).reshape(height, width)
            shows = near.is_hit[0] & (layer.halo_share(distance) >= HALF) & (share[own] > 0.0)
            _lay_in(shot.part(own), near, share[own], shows)
        return place, is_near

    def _colors(
        self, name: str, window: Border, needless: BoolArray | None = None
    ) -> Generator[str, None, LayerRender]:
        """Render colours and passes of a window.

        needless: the pixels of the whole image (H, W) whose values make no difference.
        """
        read, wanted = self._read, self._passing.passes
        place = read.views[self._number].place
        is_rigged, scene = place is None, self._passing.scene
        with self._passing.colored(window, read.size, self._number > 0, is_rigged), ExitStack() as stack:
            # Blur and denoising take the values of a pixel from others, too.
            if needless is not None and place is not None and not (read.blurs or scene.cycles.use_denoising):
                stack.enter_context(covered(scene, place, without_neighbours(needless, read.filter_width)))
            del scene
            yield name
            found = read_passes(self._passing.path, (COMBINED, POSITION))
            mist = Mist.of(self._passing.scene.world) if is_rigged else None
        place = found[POSITION].values.transpose(2, 0, 1)[:, None]
        return LayerRender(found[COMBINED].values, summed(found, wanted, mist), place, place.any(axis=0))

    def _places(self, name: str, window: Border) -> Generator[str, None, tuple[Array, BoolArray]]:
        """Render positions (3, S, H, W) at S places of each pixel, and whether anything is there."""
        # Rigs are made of materials.
        read = self._read
        is_plain = read.is_opaque and read.views[self._number].place is not None
        with self._passing.located(window, read.size, is_plain):
            yield Message("{0}, distances", name)
            found = read_passes(self._passing.path, (COMBINED, POSITION))
            place, alpha = found[POSITION].values.astype(np.float64), found[COMBINED].values[..., 3:]
        height, width = window.top - window.bottom, window.right - window.left
        both = np.concatenate([place, alpha], axis=2).reshape(height, KEY_SIDE, width, KEY_SIDE, 4)
        both = both.transpose(4, 1, 3, 0, 2).reshape(4, -1, height, width)
        return both[:3], (both[3] > 0.0) & both[:3].any(axis=0)

    def _first_keys(self, shot: LayerRender, is_hit: BoolArray) -> Array:
        """The keys (H, W) of the sample of each pixel that passes are of; (0, 0) without passes or layers.

        is_hit: (1, H, W), whether it shows the layer.
        """
        if not shot.passes or not self._read.layers.layers:
            return np.zeros((0, 0))
        position: Array = shot.position.astype(np.float64)
        first: Array = self._keys(position, is_hit)[0]
        return first

    def _keys(self, place: Array, is_hit: BoolArray) -> Array:
        """The keys (S, H, W) of positions (3, S, H, W). is_hit: (S, H, W)."""
        read, number = self._read, self._number
        middle = read.box(number).middle if number else None
        keys = layer_keys(read.layers.layers, number, place.reshape(3, -1), is_hit.ravel(), middle)
        return keys.reshape(is_hit.shape)


class LayerRender(NamedTuple):
    """The pixels of a window in one render through a view's camera: colours, passes and positions.

    color: (H, W, 4), premultiplied. passes: see ``summed``. position: (3, 1, H, W) float32, of one
    sample of each pixel, and is_hit: (1, H, W), whether it meets anything.
    """

    color: Single
    passes: dict[str, Pass]
    position: NDArray[np.float32]
    is_hit: BoolArray

    def part(self, own: tuple[slice, slice]) -> LayerRender:
        """The part of the render in some rows and columns."""
        passes = {name: Pass(letters, values[own]) for name, (letters, values) in self.passes.items()}
        every = (slice(None), slice(None), *own)
        return LayerRender(self.color[own], passes, self.position[every], self.is_hit[every[1:]])


def _region(render, size: tuple[int, int]) -> Border:
    """The pixels of an image of a size that a scene's render region leaves. Raises UserError without any."""
    region = render_region(render, *size) or Border(0, 0, *size)
    if region.left >= region.right or region.bottom >= region.top:
        raise UserError("The render region has no pixels: enlarge it, or press Ctrl-Alt-B to clear it")
    return region


def _lay_in(shot: LayerRender, near: LayerRender, share: Array, shows: BoolArray) -> None:
    """Lay a halo of a shot's size into it.

    share: (H, W), of each pixel that the halo shows. shows: (H, W), whether it shows the pixel's one sample.
    """
    shot.color[:] += (near.color - shot.color) * share[..., None]
    for name, (_letters, values) in shot.passes.items():
        other = near.passes[name].values
        if name in OF_ONE_SAMPLE:
            values[shows] = other[shows]
        else:
            values += (other - values) * share[..., None]
    shot.position[:, 0, shows] = near.position[:, 0, shows]
    shot.is_hit[0, shows] = True
