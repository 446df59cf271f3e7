# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of a live image as in Blender's Solid shading, lit along the projectors."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from ...projection.arrays import put_columns
from ...projection.colors import linear_from_srgb, srgb_from_linear
from ...projection.typing import Array, BoolArray, IndexArray
from ..settings.stylised_settings import Lines
from ..typing import Single
from .background import Background
from .cavity import Cavity, cavity_factor
from .live_hits import LiveHits
from .live_lines import draw_lines
from .live_overlays import Overlays, draw_overlays
from .live_textures import LiveTextures, footprints
from .matcap import Matcap, matcap_color
from .studio_light import Gloss, StudioLight, gloss_of, packed_metallic, packed_roughness, studio_color
from .view_space import camera_share, columns, seen_by_lights

# Pixels that are shaded at once: their arrays stay in the processor's cache.
CHUNK = 8192
# Steps of the table of display values. They are even in the square root, which follows the eye.
DISPLAY_STEPS = 4096
# Alpha of an image below which Blender does not show the surface (``workbench_image.bsl.hh``).
CUT_OUT = np.float32(0.1)


@dataclass(frozen=True)
class SurfaceLooks:
    """The surfaces of a scene by their row of the table of looks, L rows; linear colours.

    color: (3, L). metallic, roughness, alpha: (L,), as Blender's materials have them. image: (L,) row of the
    images, -1 for none. uses_attribute: (L,) whether the mesh's colour attribute replaces the colour.
    """

    color: Single
    metallic: Single
    roughness: Single
    alpha: Single
    image: IndexArray
    uses_attribute: BoolArray

    @cached_property
    def metal(self) -> Single | None:
        """Metallic (L,) as Workbench stores it, None if nothing is."""
        metal = packed_metallic(self.metallic)
        return metal if metal.any() else None

    @cached_property
    def is_opaque(self) -> bool:
        """Return whether no surface lets the background through; images aside."""
        return bool((self.alpha >= 1).all())

    @cached_property
    def roughnesses(self) -> tuple[Single, IndexArray]:
        """The different values of roughness as Workbench stores them, and the number of each row's."""
        return np.unique(packed_roughness(self.roughness), return_inverse=True)


@dataclass(frozen=True)
class SolidLook:
    """The settings that decide the colours of a live image.

    light: None for flat colours. highlights: whether lights are reflected. lines: those of Drawn Style, their
    widths in pixels of the screen. camera_axes: (3, 3), the camera's
    right, up and backward in world space as columns; None lights each pixel from its own axes.
    """

    light: StudioLight | Matcap | None
    highlights: bool
    surfaces: SurfaceLooks
    background: Background
    textures: LiveTextures | None = None
    cavity: Cavity | None = None
    overlays: Overlays = field(default_factory=Overlays)
    lines: Lines | None = None
    camera_axes: Array | None = None

    @property
    def wants_uv(self) -> bool:
        """Return whether ``paint`` uses texture coordinates."""
        return self.textures is not None and bool((self.surfaces.image >= 0).any())

    @property
    def wants_color(self) -> bool:
        """Return whether ``paint`` uses the colour attributes of meshes."""
        return bool(self.surfaces.uses_attribute.any())

    @cached_property
    def key(self) -> bytes:
        """Bytes that differ whenever images may differ."""
        digest = hashlib.blake2b(digest_size=16)
        light = self.light
        # The images of a matcap are large, and kept as long as there are looks of them.
        lit = (id(light.diffuse), light.is_flipped) if isinstance(light, Matcap) else light
        parts: list[object] = [lit, self.highlights, self.surfaces, self.background, self.cavity]
        parts += [self.overlays, self.lines, self.camera_axes, self.textures and self.textures.serial]
        for part in parts:
            values = (getattr(part, one.name) for one in fields(part)) if is_dataclass(part) else (part,)
            for value in values:
                digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
        return digest.digest()


class _Frame(NamedTuple):
    """Values that all chunks of an image share.

    share: of the camera's axes, see ``camera_share``. gloss: by number of roughness. cavity, footprint:
    (n,), None where they are not used.
    """

    hits: LiveHits
    look: SolidLook
    share: float
    gloss: Gloss | None
    cavity: Single | None
    footprint: Single | None


def paint(hits: LiveHits, look: SolidLook, pixel_size: float = 1.0) -> Single:
    """The image (H, W, 4) of what projectors hit, float32, row 0 at the bottom.

    Colours are display values (sRGB), as Blender's Solid view shows them, and opaque everywhere. pixel_size:
    pixels of the screen across a pixel of the image, for lines and stripes of the right width.
    """
    image = np.ones((hits.height * hits.width, 4), np.float32)
    image[:, :3] = look.background.rows(hits.height, hits.width)
    if not hits.mask.all():
        image[~hits.mask, :3] *= look.background.outside
    frame = _frame(hits, look)
    for start in range(0, len(image), CHUNK):
        rows = hits.look[start : start + CHUNK]
        seen = rows >= 0
        count = np.count_nonzero(seen)
        if count:
            stop = start + len(rows)
            some = slice(start, stop) if count == len(rows) else np.flatnonzero(seen) + start
            color, cover = _shaded(frame, some)
            if cover is not None:
                behind = _linear_table().take((image[some, :3].T * (DISPLAY_STEPS - 1)).astype(np.intp))
                color = behind + (color - behind) * cover
            image[some, :3] = displayed(color).T
    result = image.reshape(hits.height, hits.width, 4)
    if look.lines is not None:
        draw_lines(result, hits, look.lines, pixel_size)
    draw_overlays(result, hits, look.overlays, pixel_size)
    return result


def _frame(hits: LiveHits, look: SolidLook) -> _Frame:
    """Prepare what chunks share."""
    light, gloss, share = look.light, None, 0.0
    in_world = isinstance(light, StudioLight) and light.in_world
    if (light is not None and not in_world) or look.cavity is not None:
        share = camera_share(hits, look.camera_axes)
    if isinstance(light, StudioLight) and look.highlights:
        gloss = gloss_of(light, look.surfaces.roughnesses[0])
    cavity = footprint = None
    if look.cavity is not None:
        normal = seen_by_lights(hits, slice(None), look.camera_axes, share, False).normal
        cavity = cavity_factor(look.cavity, normal, hits)
    if look.wants_uv and hits.uv is not None:
        footprint = footprints(hits.uv, hits.look, hits.width)
    return _Frame(hits, look, share, gloss, cavity, footprint)


def _shaded(frame: _Frame, some: slice | IndexArray) -> tuple[Single, Single | None]:
    """The linear colour (3, n) of some pixels that are hit, and their alpha (n,), None if all is opaque."""
    hits, look = frame.hits, frame.look
    rows = hits.look[some]
    base, cover = _base(frame, some, rows)
    light = look.light
    if light is None:
        color = base
    else:
        in_world = isinstance(light, StudioLight) and light.in_world
        seen = seen_by_lights(hits, some, look.camera_axes, frame.share, in_world)
        if isinstance(light, Matcap):
            color = matcap_color(light, seen, base, look.highlights)
        else:
            surfaces, gloss = look.surfaces, frame.gloss
            metallic = None
            if gloss is not None:
                gloss = gloss.take(surfaces.roughnesses[1].take(rows))
                metallic = None if surfaces.metal is None else surfaces.metal.take(rows)
            color = studio_color(light, seen, base, metallic, gloss)
    if frame.cavity is not None:
        color *= frame.cavity[some]
    return color, cover


def _base(frame: _Frame, some: slice | IndexArray, rows: IndexArray) -> tuple[Single, Single | None]:
    """The surface colour (3, n) of some pixels, and their alpha (n,), None if all is opaque."""
    hits, surfaces = frame.hits, frame.look.surfaces
    base = surfaces.color.take(rows, axis=1)
    cover = None if surfaces.is_opaque else surfaces.alpha.take(rows)
    if hits.color is not None and frame.look.wants_color:
        where = np.flatnonzero(surfaces.uses_attribute.take(rows))
        put_columns(base, where, columns(hits.color, some).take(where, 1))
    if frame.footprint is not None and hits.uv is not None and frame.look.textures is not None:
        image = surfaces.image.take(rows)
        where = np.flatnonzero(image >= 0)
        if len(where):
            uv, footprint = columns(hits.uv, some).take(where, 1), frame.footprint[some][where]
            values = frame.look.textures.sample(image[where], uv, footprint)
            put_columns(base, where, values[:3])
            if (values[3] < CUT_OUT).any():
                cover = np.ones(len(rows), np.float32) if cover is None else cover
                cover[where] *= values[3] >= CUT_OUT
    return base, cover


def displayed(color: Single) -> Single:
    """The display values (sRGB) of linear colours of any shape, which are overwritten; from a table."""
    np.clip(color, 0, 1, out=color)
    np.sqrt(color, out=color)
    color *= DISPLAY_STEPS - 1
    color += np.float32(0.5)
    return _display_table().take(color.astype(np.int32))


@lru_cache(maxsize=1)
def _display_table() -> Single:
    steps = np.linspace(0.0, 1.0, DISPLAY_STEPS)
    return srgb_from_linear((steps * steps).astype(np.float32)).astype(np.float32)


@lru_cache(maxsize=1)
def _linear_table() -> Single:
    return linear_from_srgb(np.linspace(0.0, 1.0, DISPLAY_STEPS)).astype(np.float32)
