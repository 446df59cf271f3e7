# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as a projection sees it at one moment: projectors are cast at it, and their hits are coloured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...casting.cast import cast, cast_at_nothing
from ...casting.common.hits import CastCounts, Hits
from ...casting.continuation import Continuation, ContinuedTile, TileProjectors
from ...casting.frame import pixel_centres
from ...casting.layers.layer_parts import LayerParts
from ...casting.layers.layered_cast import LayeredCast, LayeredHits, LayeredProjectors
from ...casting.scene.cast_scene import CastScene
from ...projection.arrays import put_columns
from ...projection.typing import Array, IndexArray
from ...projection.volume.viewing_volume import Projection
from ..passes.light_passes import ENVIRONMENT, LightParts
from ..scene.depth_of_field import DepthOfField, through
from ..scene.shading_scene import Scene
from ..scene.world import World
from ..settings.frame_settings import FrameSettings
from ..typing import Single
from .hit_colors import Shading

# Backs that a projector passes, at most: what lies behind more is seen as the last of them.
MOST_PASSED = 64


@dataclass(frozen=True, kw_only=True)
class SceneView:
    """A scene and the projection that sees it.

    projection, depth_of_field: in cast space. cast_scene, shading: of the triangles that projectors can hit,
    None for none. world: shown where nothing is hit; None for a uniform background. parts: of the scene, in
    the projection's layers; None if the projection itself shows all.
    """

    projection: Projection
    scene: Scene
    settings: FrameSettings
    cast_scene: CastScene | None
    shading: Shading | None
    world: World | None
    depth_of_field: DepthOfField | None
    parts: LayerParts | None = None

    @property
    def pixel_size(self) -> tuple[float, float]:
        """Width and height of a pixel as shares of the image's."""
        return 1 / self.settings.width, 1 / self.settings.height

    def seen_by(self, projection: Projection, lens: DepthOfField | None) -> SceneView:
        """The same scene seen by another projection through another lens, both in world space."""
        if self.cast_scene is None:
            return replace(self, projection=projection, depth_of_field=lens)
        matrix = self.cast_scene.matrix
        inside = projection.transformed(matrix)
        parts = self.parts and self.parts.seen_by(inside.layers)
        return replace(self, projection=inside, depth_of_field=lens and lens.transformed(matrix), parts=parts)

    def through_lens(self, share: Array | None) -> SceneView:
        """The view whose n projectors pass the lens at shares (2, n) of it; itself for None."""
        lens = self.depth_of_field
        if lens is None or share is None:
            return self
        return replace(self, projection=through(self.projection, lens, share))

    def pixel_centres(self, rows: slice) -> tuple[Array, Array]:
        """Image positions (x, y) of the centre of each pixel of the rows, each (n,)."""
        return pixel_centres(self.settings.width, self.settings.height, (rows.start, rows.stop))

    def cast(
        self, x: Array, y: Array, counts: CastCounts, weighted: bool = False, in_rows: bool = True
    ) -> Hits:
        """The hits of the projectors at image positions (n,); all miss where there are no triangles.

        weighted: barycentric weights are needed even if all triangles are flat. in_rows: the positions are
        whole rows of pixels.
        """
        if self.parts:
            return self.cast_layers(x, y, counts, weighted, in_rows).hits
        if self.cast_scene is None:
            return cast_at_nothing(self.projection, x, y)
        hits = cast(
            self.cast_scene,
            self.projection,
            x,
            y,
            self.pixel_size,
            self.settings.pixel_error,
            counts,
            self.settings.width if in_rows else None,
            self._weighted(weighted),
        )
        self._pass_backs(x, y, hits)
        return hits

    def cast_layers(
        self, x: Array, y: Array, counts: CastCounts, weighted: bool = False, in_rows: bool = True
    ) -> LayeredHits:
        """The hits as ``cast`` has them, each with its layer."""
        if self.parts is None:
            return LayeredHits(self.cast(x, y, counts, weighted, in_rows), np.zeros(len(x), np.uint8))
        columns = self.settings.width if in_rows else None
        found = self._layered(self.parts, weighted).first_hits(x, y, counts, columns)
        changed = self._pass_backs(x, y, found.hits)
        found.layer[changed] = self.parts.numbers.take(found.hits.triangle[changed])
        return found

    def _pass_backs(self, x: Array, y: Array, hits: Hits) -> IndexArray:
        """Follow the projectors of hits (N,), in place, past the backs of faces that are seen from the front.

        Returns the numbers (n,) of those that passed any.
        """
        one_sided, scene = self.scene.geometry.one_sided, self.cast_scene
        if one_sided is None or scene is None:
            return np.zeros(0, np.intp)
        tile, which = self._tile(scene, x, y, hits), np.arange(len(x))
        passed = np.zeros(len(x), bool)
        for _ in range(MOST_PASSED):
            triangle = hits.triangle[which]
            which = which[(triangle >= 0) & one_sided[triangle]]
            normal = scene.normals(hits.triangle[which].astype(np.int64))
            which = which[np.einsum("cn,cn->n", normal, hits.tangent.take(which, 1)) > 0.0]
            if not len(which):
                break
            passed[which] = True
            hits.put(which, tile.next_hits(which, hits.t[which], hits.triangle[which]))
        return np.flatnonzero(passed)

    def _layered(self, parts: LayerParts, weighted: bool) -> LayeredCast:
        return LayeredCast(
            parts=parts,
            projection=self.projection,
            pixel_size=self.pixel_size,
            pixel_error=self.settings.pixel_error,
            weighted=self._weighted(weighted),
        )

    def _weighted(self, weighted: bool) -> bool:
        """Return whether barycentric weights are needed, if only because triangles are not flat."""
        return weighted or self.shading is None or self.shading.surface.weighted

    def cast_with_continuation(
        self, x: Array, y: Array, counts: CastCounts, in_rows: bool
    ) -> tuple[Hits, Continuation | None]:
        """The hits as ``cast`` has them, and the continuation of their projectors, None without triangles."""
        hits = self.cast(x, y, counts, in_rows=in_rows)
        return hits, self._continuation(x, y, hits)

    def cast_samples(
        self, samples: Sequence[tuple[SceneView, Array, Array]], counts: CastCounts
    ) -> list[tuple[Hits, Continuation | None]]:
        """The hits and continuations of several samples of the pixels of whole rows.

        samples: of each, this view through its lens, and its image positions (n,).
        """
        if self.parts is None:
            return [view.cast_with_continuation(x, y, counts, True) for view, x, y in samples]
        columns = self.settings.width
        rests = [view._layered(self.parts, False).rest_hits(x, y, counts, columns) for view, x, y in samples]
        x, y = (np.concatenate([sample[axis] for sample in samples]) for axis in (1, 2))
        found = self._layered(self.parts, False).in_front(x, y, rests, counts)
        for (view, own_x, own_y), (hits, _) in zip(samples, found, strict=True):
            view._pass_backs(own_x, own_y, hits)
        return [
            (hits, view._continuation(x, y, hits))
            for (view, x, y), (hits, _) in zip(samples, found, strict=True)
        ]

    def _continuation(self, x: Array, y: Array, hits: Hits) -> Continuation | None:
        """The continuation of the projectors of hits at image positions (n,), None without triangles."""
        if self.cast_scene is None:
            return None
        return Continuation.of_tile(self._tile(self.cast_scene, x, y, hits), len(x))

    def _tile(self, scene: CastScene, x: Array, y: Array, hits: Hits) -> ContinuedTile:
        """The projectors of hits at image positions (n,). scene: ``cast_scene``."""
        if self.parts:
            return LayeredProjectors(self._layered(self.parts, False), x, y, hits.mask)
        return TileProjectors(
            scene,
            self.projection,
            x=x,
            y=y,
            mask=hits.mask,
            pixel_size=self.pixel_size,
            pixel_error=self.settings.pixel_error,
        )

    def with_world(
        self, hits: Hits, where: IndexArray, color: Single, parts: LightParts | None
    ) -> tuple[IndexArray, Single, LightParts | None]:
        """Add projectors that see the world to the hits at ``where`` (n,), their colours and parts.

        They miss, and see it in the direction in which they leave the volume.
        """
        clear = self.settings.transparent
        if self.world is None or (clear and parts is None):
            return where, color, parts
        missed = np.flatnonzero(hits.mask & (hits.triangle < 0))
        if not len(missed):
            return where, color, parts
        shown = np.flatnonzero(hits.mask)
        light = self.world.radiance(hits.tangent.take(missed, axis=1))
        whole = np.ones((4, len(hits.mask)), np.float32)
        put_columns(whole[: len(color)], where, color)
        whole[:3, missed], whole[3, missed] = (0.0, 0.0) if clear else (light, 1.0)
        if parts:
            rows = np.zeros((len(parts.rows), len(hits.mask)), np.float32)
            rows[:, where], rows[ENVIRONMENT, missed] = parts.rows, light
            parts = LightParts(len(shown))
            parts.rows[:] = rows[:, shown]
        return shown, whole.take(shown, axis=1), parts
