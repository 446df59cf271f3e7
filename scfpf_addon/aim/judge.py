# SPDX-License-Identifier: GPL-3.0-or-later
"""The judge of a solution: what the caster sees in it, independent of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..casting.common.hits import Hits
from ..casting.frame import pixel_centres
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.inverse import INSIDE_MARGIN, Inverse, find_in_image, follow
from ..projection.volume.viewing_volume import Projection, VolumeSample, determinant
from .aim_scene import AimScene
from .released import Released
from .solver.problem import AimPins
from .solver.vectors import nearest_t
from .stays import halo_weights

# Columns of the image that is judged.
COLUMNS = 192
# In a judgement, of so many of its pixels one is looked at for the background.
EACH = 4
# Shares of the way to the first hit at which folds are looked for; the last is the hit.
SHARES = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97, 1.0)
# A hit is before a point if it is nearer by more pixels than this; a nearer one is the point's own surface.
HIDING_PIXELS = 8.0
# Of a better image at most these shares of the pixels may be mirrored or folded more than before.
MORE_MIRRORED, MORE_FOLDED = 0.005, 0.02
# A pin is solved within so many pixels; residuals beyond the largest do not count more.
SOLVED, LARGEST = 1.5, 200.0
# The background of a better image moves by a median of at most so many pixels.
MOST_MOVED = 25.0
# The bars of a good image: pixels of nearly all pins and of all, and of half and of nearly all background.
PIN_BARS, BACKGROUND_BARS, NEARLY_ALL = (0.5, SOLVED), (2.0, 25.0), 95.0
# A share of mirrored or folded pixels, or of hidden pins, counts as much as doubling a distance.
DOUBLING = 0.002, 0.002, 0.5


@dataclass(frozen=True)
class Judgement:
    """Measurements of an image by ray casting.

    pixels: (P,), distances of the pins' points from their positions, inf where the volume misses a point.
    angles: (P,), degrees between wanted and found directions, NaN where free. seen: (P,), whether nothing
    hides the point. hidden_by: (P,), the number of the object that does, -1 without one. mirrored, folded:
    shares of the pixels that are mirrored, and with a fold before their hit. moved: (N,), pixels by which
    the visible background outside the halos moved, inf for points that were lost. What stands where the image
    then shows a wanted thing, or a halo where its view has it, does not count: it is hidden. released: what
    may leave its place.
    """

    pixels: Array
    angles: Array
    seen: BoolArray
    hidden_by: IndexArray
    mirrored: float
    folded: float
    moved: Array
    released: Released | None = None

    @property
    def background_median(self) -> float:
        """The median of ``moved``, 0 without a background."""
        return percentile(self.moved, 50.0)

    @property
    def background_most(self) -> float:
        """The 95th percentile of ``moved``, 0 without a background."""
        return percentile(self.moved, NEARLY_ALL)

    @property
    def hidden(self) -> float:
        """The share of pins that something hides."""
        return float((self.hidden_by >= 0).mean()) if len(self.seen) else 0.0

    @property
    def meets_bars(self) -> bool:
        """Return whether the pins and the background are where they shall be, and nothing folds."""
        return not self.misses_pins and not self.misses_background and self.is_clean

    @property
    def unclean(self) -> float:
        """The share of the pixels that is mirrored or has a fold before its hit, whichever is larger."""
        return max(self.mirrored, self.folded)

    @property
    def is_clean(self) -> bool:
        """Return whether nothing that is seen is mirrored or behind a fold."""
        return self.unclean == 0.0

    @property
    def misses_pins(self) -> bool:
        """Return whether pins are farther from their places than the bars allow."""
        nearly_all, most = PIN_BARS
        return percentile(self.pixels, NEARLY_ALL) > nearly_all or float(self.pixels.max(initial=0.0)) > most

    @property
    def misses_background(self) -> bool:
        """Return whether the background has moved farther than the bars allow."""
        median, nearly_all = BACKGROUND_BARS
        return self.background_median > median or self.background_most > nearly_all

    @property
    def _distances(self) -> float:
        """The amount by which the bars of distances are missed, in doublings."""
        pins = percentile(self.pixels, NEARLY_ALL), float(self.pixels.max(initial=0.0))
        found = (*pins, self.background_median, self.background_most)
        bars = (*PIN_BARS, *BACKGROUND_BARS)
        return float(sum(np.log2(max(min(a, LARGEST) / b, 1.0)) for a, b in zip(found, bars, strict=True)))

    @property
    def shortfall(self) -> float:
        """The amount by which the image misses the bars and hides its pins, in doublings of distances."""
        shares = zip((self.mirrored, self.folded, self.hidden), DOUBLING, strict=True)
        return self._distances + float(sum(share / unit for share, unit in shares))

    def worse_than(self, old: Judgement) -> str:
        """The way the image is worse than ``old``: PINS, MIRRORED, FOLDED or BACKGROUND; else empty."""
        if np.minimum(self.pixels, LARGEST).sum() > np.minimum(old.pixels, LARGEST).sum() + SOLVED:
            return "PINS"
        if self.mirrored > old.mirrored + MORE_MIRRORED:
            return "MIRRORED"
        if self.folded > old.folded + MORE_FOLDED:
            return "FOLDED"
        if self.background_median > max(MOST_MOVED, old.background_median):
            return "BACKGROUND"
        return ""


def percentile(values: Array, share: float) -> float:
    """The least value that at least a share in percent of the values does not exceed, 0 without any."""
    return float(np.percentile(values, share, method="inverted_cdf")) if len(values) else 0.0


class BackgroundPoints(NamedTuple):
    """Points outside the halos that the image shows before the volume is aimed.

    points: (3, N), in world space. pixels: (N,), the numbers of the judged pixels that show them. objects:
    (N,), the numbers of their objects.
    """

    points: Array
    pixels: IndexArray
    objects: IndexArray


@dataclass(frozen=True)
class Judge:
    """A judge of images by casting them.

    before: in world space; its parameters are those of the image. pins, halos, wanted: as for ``find_stays``.
    width: of the image in pixels. columns: of the image that is cast for a judgement.
    """

    scene: AimScene
    before: Projection
    pins: AimPins
    halos: Array
    wanted: BoolArray
    width: int
    columns: int = COLUMNS

    def judgement_of(self, after: Projection, released: Released | None = None) -> Judgement:
        """The judgement of a projection in world space. released: what may leave its place."""
        pins, scene = self.pins, self.scene
        place = places_of(after, pins.points, pins.positions)
        pixels = self.distances(place, pins.positions)
        seen, hidden_by = visibility(scene, after, place, self.width)
        sample = after.volume.evaluate(*(np.nan_to_num(a) for a in place[:3]))
        cosine = np.einsum("cn,cn->n", sample.dt, pins.directions) / np.linalg.norm(sample.dt, axis=0)
        angles = np.where(place.found, np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), np.nan)
        x, y = self.centres
        hits = scene.hits(after, x, y, self.columns)
        mirrored, folded = self._folds(after, hits)
        moved = self._moved(after, hits, released)
        return Judgement(pixels, angles, seen, hidden_by, mirrored, folded, moved, released)

    @cached_property
    def centres(self) -> tuple[Array, Array]:
        """The image positions of the pixels that are judged."""
        rows = max(1, round(self.columns / self.before.aspect))
        return pixel_centres(self.columns, rows, (0, rows))

    @cached_property
    def _background(self) -> BackgroundPoints:
        return self.background(EACH)

    def background(self, each: int) -> BackgroundPoints:
        """The background in one of ``each`` pixels of the image before the volume is aimed."""
        x, y = (part[::each] for part in self.centres)
        hits = self.scene.hits(self.before, x, y, self.width)
        kept = np.flatnonzero((hits.triangle >= 0) & ~self.wanted[hits.triangle])
        points = self.scene.world(hits.position[:, kept])
        outside = halo_weights(points, self.pins, self.halos) >= 1.0
        kept = kept[outside]
        return BackgroundPoints(points[:, outside], each * kept, self.scene.objects[hits.triangle[kept]])

    @cached_property
    def _orientation(self) -> float:
        """The sign of the determinant where nothing is mirrored."""
        x, y = self.centres
        return float(np.sign(determinant(self.before.volume.evaluate(x, y, np.full(len(x), 0.5))).sum()))

    def distances(self, place: Inverse, positions: Array) -> Array:
        """The distances (N,) in pixels of a found place from image positions (2, N), inf where not found."""
        across, up = place.u - positions[0], (place.v - positions[1]) / self.before.aspect
        return np.where(place.found, np.hypot(across, up) * self.width, np.inf)

    def _folds(self, after: Projection, hits: Hits) -> tuple[float, float]:
        """The shares of pixels that are mirrored, and with a fold before their hit."""
        hit = hits.triangle >= 0
        end = np.minimum(hits.t, 1.0)
        controls = after.volume.controls(*self.centres)
        samples = (after.volume.evaluate_controls(controls, end * share) for share in SHARES)
        against = np.stack([determinant(sample) * self._orientation < 0 for sample in samples])
        mirrored = float(against[-1][hit].mean()) if hit.any() else 0.0
        return mirrored, float((against.any(axis=0) & hit).mean())

    def _moved(self, after: Projection, hits: Hits, released: Released | None) -> Array:
        """The pixels by which the background moved, see ``Judgement``. hits: of the image after."""
        points, pixels, objects = self._background
        now, positions = hits.triangle[pixels], np.stack(self.centres)[:, pixels]
        # What a wanted thing hides is meant to be hidden, and so is what its halo hides.
        counts = (now < 0) | ~self.wanted[now]
        counts[counts] = ~self._shows_halo(positions[:, counts], hits.position[:, pixels[counts]])
        if released is not None:
            counts &= ~released.covers(points, objects)
        positions = positions[:, counts]
        return self.distances(near_places(after, points[:, counts], positions), positions)

    def _shows_halo(self, positions: Array, hits: Array) -> BoolArray:
        """Return whether image positions (2, N) show a halo where its view has it. hits: (3, N)."""
        pins = self.pins
        with np.errstate(divide="ignore"):
            reach = self.halos / np.linalg.norm(pins.across, axis=0)
        right, up = positions[:, :, None] - pins.positions[:, None]
        # Pins without a frame have no reach, NaN.
        is_near: BoolArray = (np.hypot(right, up / self.before.aspect) < reach).any(axis=1)
        is_near[is_near] = halo_weights(self.scene.world(hits[:, is_near]), pins, self.halos) < 1.0
        return is_near


def places_of(projection: Projection, points: Array, positions: Array) -> Inverse:
    """The parameters at which a volume shows points (3, N), those nearest to image positions (2, N)."""
    near = near_places(projection, points, positions)
    lost = np.flatnonzero(~near.found)
    if len(lost):
        other = find_in_image(projection, points[:, lost])
        for mine, found in zip(near, other, strict=True):
            mine[lost] = found
    return near


def near_places(projection: Projection, points: Array, positions: Array) -> Inverse:
    """The parameters at which a volume shows points (3, N) near image positions (2, N), by Newton's method.

    Points before the near surface and behind the far one are lost, as projectors do not reach them.
    """
    controls = projection.volume.controls(*positions)
    t = nearest_t(controls.points, points)
    found = follow(projection.volume, points, np.stack([*positions, t]))
    # NaN is out of reach, too.
    reached = (found.t >= -INSIDE_MARGIN) & (found.t <= 1.0 + INSIDE_MARGIN)
    return found._replace(found=found.found & reached)


def visibility(
    scene: AimScene, projection: Projection, place: Inverse, width: int
) -> tuple[BoolArray, IndexArray]:
    """Return whether points at parameters are seen, (P,), and the numbers of the objects that hide them."""
    u, v, t = (np.nan_to_num(a) for a in place[:3])
    inside = place.found & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    hits = scene.hits(projection, np.clip(u, 0, 1), np.clip(v, 0, 1), width)
    sample = projection.volume.evaluate(u, v, t)
    ahead = (t - hits.t) * np.linalg.norm(sample.dt, axis=0)
    hidden = inside & (hits.triangle >= 0) & (ahead > HIDING_PIXELS * footprint_of(sample, width))
    return inside & ~hidden, np.where(hidden, scene.objects[hits.triangle], -1)


def footprint_of(sample: VolumeSample, width: int) -> Array:
    """World units across a pixel, (N,)."""
    tangent = sample.dt / np.maximum(np.linalg.norm(sample.dt, axis=0), 1e-300)
    across = sample.du - np.einsum("cn,cn->n", sample.du, tangent) * tangent
    footprint: Array = np.linalg.norm(across, axis=0) / width
    return footprint
