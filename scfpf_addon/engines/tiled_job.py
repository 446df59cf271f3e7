# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of several eyes, tile beside tile, by any engine through anchors or by Cycles through its rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from ..bridge.camera.eye_camera import eye_camera
from ..bridge.camera.ordinary_camera import placement
from ..bridge.camera.stereo_views import Eye
from ..bridge.render.image_size import image_aspect, image_size, require_size
from ..bridge.render.quilt import tile_place
from ..bridge.render.render_inputs import read_view
from ..bridge.scene.render_depsgraph import with_render_depsgraph
from ..cycles.engine_choice import engine_name
from ..cycles.layers.layered_render import LayeredRender
from ..cycles.layers.layers_job import LayersJob
from ..cycles.layers.temporary_scene import TemporaryScene
from ..projection.user_error import Message, UserError
from ..scanline.generated_collection import remove_replaced_groups
from ..shading.typing import Single
from .anchor_scene import AnchorScene
from .anchored_render import AnchoredRender
from .anchors_job import AnchorsJob

LAYERS = "Tiles by the Cycles rig have no layers: choose another engine, or switch off the layers of '{0}'"


class _Tiles(LayersJob):
    """One picture with a tile for each of several eyes, from the lower left row by row upwards.

    Those have ``_eye_picture``.
    """

    def begin_tiles(self, context, eyes: Sequence[Eye], columns: int) -> None:
        """Take the eyes. columns: tiles side by side. Raises UserError."""
        width, height = image_size(context.scene)
        require_size(columns * width, -(-len(eyes) // columns) * height)
        self._eyes, self._columns = tuple(eyes), columns
        self._frames, self._count = [*range(len(eyes))], len(eyes)
        self._tiles: Single | None = None

    @property
    def _number(self) -> int:
        """The place of the present eye."""
        return self._count - len(self._frames) - 1

    @property
    def progress(self) -> Message:
        """The name of the present render or work, for the status bar."""
        place = self._number + 1, self._count
        if self.work is not None:
            return Message("view {0} of {1}, {2}", *place, self._text)
        total = self._render.total if self._render is not None else 0
        return Message("view {0} of {1}, {2} ({3} of {4})", *place, self._text, self._done, total)

    def picture(self, scene, view_layer):
        """The temporary scene of one tile, which has its name, and the tile's renders."""
        return self._eye_picture(scene, view_layer, self._eyes[self._number])

    def _eye_picture(self, scene, view_layer, eye: Eye):
        """The temporary scene of an eye, and its renders."""
        raise NotImplementedError

    def _deliver(self) -> None:
        """Put a finished tile in its place; after the last one keep the picture, and write its file."""
        pixels: Single = self._render.pixels
        height, width = pixels.shape[:2]
        if self._tiles is None:
            rows = -(-self._count // self._columns)
            self._tiles = np.zeros((rows * height, self._columns * width, 4), np.float32)
        self._tiles[tile_place(self._number, self._columns, (width, height))] = pixels
        if self._frames:
            self.warnings += [text for text in self._render.warnings if text not in self.warnings]
            self._end_picture()
            return
        self._render.pixels, self._render.passes = self._tiles, {}
        super()._deliver()

    def _file(self, _frame: int) -> str:
        return super()._file(self._frame_before[0])


class TiledJob(_Tiles, AnchorsJob):
    """Tiles by any engine that knows ordinary cameras."""

    def __init__(
        self, context, camera, eyes: Sequence[Eye], columns: int, path: str = "", renderer: str = ""
    ) -> None:
        """eyes, columns: see ``begin_tiles``. Raises USER_ERRORS."""
        AnchorsJob.__init__(self, context, camera, (), path, renderer)
        self.begin_tiles(context, eyes, columns)

    def _eye_picture(self, scene, view_layer, eye: Eye):
        passing = AnchorScene(scene, view_layer, self._renderer)
        self.engine = engine_name(passing.scene)
        return passing, AnchoredRender(passing, eye=eye)


class RiggedTilesJob(_Tiles):
    """Tiles by Cycles, whose rays follow the projectors of each eye."""

    def __init__(self, context, camera, eyes: Sequence[Eye], columns: int, path: str = "") -> None:
        """eyes, columns: see ``begin_tiles``. Raises USER_ERRORS."""
        super().__init__(context, camera, (), path)
        if any(layer.is_on for layer in camera.scfpf.layers):
            raise UserError(LAYERS, camera.name)
        self.begin_tiles(context, eyes, columns)
        self._groups = {group.session_uid for group in bpy.data.node_groups}

    def _eye_picture(self, scene, view_layer, eye: Eye):
        passing = TemporaryScene(scene, view_layer)
        return passing, _RiggedEye(passing, eye)

    def _end_picture(self) -> None:
        super()._end_picture()
        # Those of volumes cannot go while there is a second scene.
        made = [group for group in bpy.data.node_groups if group.session_uid not in self._groups]
        remove_replaced_groups(made)


class _RiggedEye(LayeredRender):
    """The picture of an eye through a rig of a camera of its own."""

    def __init__(self, passing: TemporaryScene, eye: Eye) -> None:
        super().__init__(passing)
        self._eye = eye

    def steps(self, camera) -> Iterator[str]:
        scene = self._passing.scene

        def read(depsgraph, camera=camera):
            seen = read_view(depsgraph, camera, image_aspect(scene), self._eye)
            return seen, placement(camera.evaluated_get(depsgraph))

        projection, place = with_render_depsgraph(scene, scene.view_layers[0], read)
        with eye_camera(scene, camera, place, projection) as own:
            del camera
            steps = super().steps(own)
            del own
            yield from steps
