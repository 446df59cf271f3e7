# SPDX-License-Identifier: GPL-3.0-or-later
"""An image with layers through Cycles: renders of each view, in steps that Blender takes, and their join.

Of a view there is a render of its colours and, where its distances decide what is in front, one of positions
at several places of each pixel.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np

from ...casting.layers.join_images import cover, halo_share
from ...casting.layers.layer_keys import layer_keys
from ...projection.typing import Array
from ...shading.settings.frame_settings import Border
from ...shading.typing import Single
from .exr_passes import read_passes
from .layer_eyes import seen_through
from .layer_views import ReadViews, read_views
from .passing_scene import KEY_SIDE, PassingScene
from .shown_pixels import ShownPixels, around, join_into

PASSES = ("Combined", "Position")


class LayeredRender:
    """One image with layers: ``pixels`` after the last of its ``steps``, (H, W, 4), row 0 at the bottom.

    warnings: what the image does not show as asked. total: the number of its renders, once that is known.
    """

    def __init__(self, passing: PassingScene) -> None:
        self._passing = passing
        self.warnings: list[str] = []
        self.pixels: Single | None = None
        self.total = 0

    def steps(self, camera) -> Iterator[str]:
        """Yield the name of what is to be rendered: the caller has Blender render the passing scene.

        Close the iterator to end early. Raises RigError, PassesError and RENDER_ERRORS.
        """
        read = read_views(self._passing, camera)
        del camera
        self.warnings += read.layers.warnings
        self._passing.add_groups(read.layers.members, len(read.views))
        found = {number: read.window(number) for number in range(1, len(read.views))}
        windows = {number: window for number, window in found.items() if window is not None}
        compared = [w for number, w in windows.items() if read.layers.layers[number - 1].front != "ORDER"]
        renders = [(1 + (layer.front == "DEPTH")) * (1 + (layer.halo > 0.0)) for layer in read.layers.layers]
        self.total = 1 + bool(compared) + sum(renders[number - 1] for number in windows)
        self._passing.show((0,))
        with seen_through(self._passing, read.views[0]) as cautions:
            self._caution(cautions)
            rest = yield from self._rest(read, around(compared) if compared else None)
        shown = []
        for number, window in windows.items():
            # Rays skip chords in which nothing is that any of the layer's renders shows.
            has_halo = read.layers.layers[number - 1].halo > 0.0
            self._passing.show(*(((0, number), read.beyond(number)) if has_halo else ((number,),)))
            with seen_through(self._passing, read.views[number]) as cautions:
                self._caution(cautions)
                shown.append((yield from self._layer(read, number, window)))
        if shown:
            join_into(rest, shown)
        self.pixels = rest.color

    def _caution(self, texts: list[str]) -> None:
        self.warnings += [text for text in texts if text not in self.warnings]

    def _rest(self, read: ReadViews, compared: Border | None) -> Generator[str, None, ShownPixels]:
        """Render what is in no layer. compared: the pixels in which its keys matter, None without any."""
        whole = Border(0, 0, *read.size)
        color, _ = yield from self._colors("the picture", whole, read, is_layer=False)
        keys = np.full((1, 1, 1), np.inf)
        if compared is not None:
            keys = yield from self._keys("the picture", compared, read, 0)
        return ShownPixels(whole, color, compared or Border(0, 0, 1, 1), keys)

    def _layer(self, read: ReadViews, number: int, window: Border) -> Generator[str, None, ShownPixels]:
        """Render a layer. window: the pixels in which it may be seen."""
        layer, name = read.layers.layers[number - 1], f"'{read.layers.names[number - 1]}'"
        (box, _), layers = read.bounds(number), read.layers.layers
        self._passing.show((number,))
        color, _ = yield from self._colors(name, window, read, is_layer=True)
        if layer.front == "DEPTH":
            keys = yield from self._keys(name, window, read, number)
        if layer.halo > 0.0:
            self._passing.show((0, number), read.beyond(number))
            near, there = yield from self._colors(f"{name}, its halo", window, read, is_layer=True)
            share = halo_share(box, there, layer.halo, color[..., 3])
            color = color + (near - color) * share[..., None]
            if layer.front == "DEPTH":
                ground = yield from self._keys(f"{name}, its halo", window, read, number)
                keys = np.where(share > 0.0, ground, keys)
        is_shown = (color[..., 3] > 0.0).ravel()
        nearest = layer_keys(layers, number, box.middle[:, None], is_shown, box.middle)
        nearest = nearest.reshape(1, *color.shape[:2])
        if layer.front == "DEPTH":
            # Where no place meets anything opaque the middle of the things has to do.
            keys = np.where(np.isfinite(keys).any(axis=0), keys, nearest)
        else:
            keys = nearest
        return ShownPixels(window, color * cover(layer, read.size, window)[..., None], window, keys)

    def _colors(
        self, name: str, window: Border, read: ReadViews, is_layer: bool
    ) -> Generator[str, None, tuple[Single, Single]]:
        """Render colours (H, W, 4) and positions (H, W, 3) of what is met last in each pixel."""
        with self._passing.colored(window, read.size, is_layer):
            yield name
            found = read_passes(self._passing.path, PASSES)
        return found["Combined"], found["Position"]

    def _keys(self, name: str, window: Border, read: ReadViews, number: int) -> Generator[str, None, Array]:
        """Render positions, and return their keys (S, H, W)."""
        with self._passing.located(window, read.size):
            yield f"{name}, distances"
            place = read_passes(self._passing.path, PASSES[1:])["Position"].astype(np.float64)
        height, width = window.top - window.bottom, window.right - window.left
        place = place.reshape(height, KEY_SIDE, width, KEY_SIDE, 3).transpose(4, 1, 3, 0, 2).reshape(3, -1)
        bounds = read.bounds(number) if number else None
        middle = bounds[0].middle if bounds else None
        keys = layer_keys(read.layers.layers, number, place, place.any(axis=0), middle)
        return keys.reshape(-1, height, width)
