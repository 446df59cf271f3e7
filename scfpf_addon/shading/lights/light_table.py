# SPDX-License-Identifier: GPL-3.0-or-later
"""What materials make of light: their constants as the coefficients that radiance is summed with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ..materials.lobes import ior_of
from ..materials.microfacet import (
    FRESNEL_MEAN,
    SCHLICK_MEAN,
    VIEWS,
    dielectric_share,
    mean_reflectance,
    schlick,
    seen_rows,
    sent_again,
)
from ..scene.shading_scene import Materials
from ..typing import Single

if TYPE_CHECKING:
    from .sky_light import SkyLight

Numbers = TypeVar("Numbers", bound=NDArray[Any])

# Roughness below which a highlight no longer sharpens: a spot a degree across. What a float32's rounding
# makes of its middle is still below 1 %.
SMALLEST_ROUGHNESS = 0.08
# What facets send on to each other is left out below this share of what they send on at once.
FAINT = 2e-3
# Cosines that the reflection of a few materials is tabulated for, a thousandth apart where it is steepest.
SHINES, FEW = 4096, 64


class ViewTerms(NamedTuple):
    """What N points make of light as they are seen from where they are, (N,) each.

    under: share of the scattered light that the layer above it lets through; None for all. more: light that
    facets send to each other by what they send on at once; None for none. grazed: share of an even world's
    light that metals reflect as they do grazing light; None where they reflect none of it.
    """

    under: Single | None = None
    more: Single | None = None
    grazed: Single | None = None


@dataclass(frozen=True)
class LightTable:
    """M materials, turned into the coefficients of what lamps and the world make of them, float32.

    emitted: (3, M) radiance that needs no lamp, the world's light included but for what metals reflect of it;
    through: (3, M) what is added, times what the layer lets through; emission: (3, M) without the world.
    glow: (3, M) radiance of the world that a metal's facets reflect.
    diffuse: (3, M) albedo/π. over, f0, sent: (M,) of the layer above it: how much of that is covered, what it
    reflects head-on, share of what its facets send to each other that leaves the surface; coat, ior: (M,) by
    what its highlights are multiplied, index of refraction. front, edge, again: (3, M) of a metal's facets:
    what they reflect head-on, what comes to it where light grazes them, and as ``sent``.
    alpha: (M,) roughness of the facets, squared.
    row: (M,) where a roughness begins in ``missing``, ``grazed`` and ``layered``, (R · VIEWS,), see
    ``seen_rows``.
    few: whether what each material does under every cosine is worth a table of its own. sky: what lights as a
    world does whose light differs by direction. even: under a sky, what they make of an even world of one.
    """

    emitted: Single
    through: Single
    emission: Single
    diffuse: Single
    over: Single
    f0: Single
    sent: Single
    coat: Single
    ior: Single
    front: Single
    edge: Single
    again: Single
    glow: Single
    alpha: Single
    row: IndexArray
    missing: Single
    grazed: Single
    layered: Single
    few: bool
    sky: SkyLight | None = None
    even: LightTable | None = None

    @classmethod
    def of(
        cls, materials: Materials, world_color: Array, sky: SkyLight | None = None, per_hit: bool = False
    ) -> LightTable:
        """Coefficients under a uniform world of radiance ``world_color`` (3,), and what a sky adds to it.

        per_hit: each row is of one hit; what comes out for it must not depend on how many there are.

        Diffuse is Lambert's, scaled by 1 - metallic and by what the layer above it lets through. Highlights
        are those of GGX facets with α = roughness² (Walter et al. 2007), a dielectric's by Fresnel, a
        metal's by Schlick, brighter by what facets send on to each other (Kulla, Conty 2017). The world
        lights a surface with what it reflects, but for what mirrors show.
        """
        base = np.asarray(materials.base_color, np.float64).reshape(-1, 3).T
        metallic = np.asarray(materials.metallic, np.float64)
        rough = np.maximum(materials.roughness, SMALLEST_ROUGHNESS)
        f0 = np.asarray(materials.specular_f0, np.float64)
        ambient, over, shown = _or_all(materials.ambient), _or_all(materials.over), _or_all(materials.layer)
        grazed, multiple = _or_all(materials.edge), _or_all(materials.multiple)
        white, layered = mean_reflectance(rough)
        missing = 1.0 / white - 1.0
        reflects = f0 > 0.0
        sent = multiple * sent_again(f0 + (1.0 - f0) * FRESNEL_MEAN, white)
        coat = np.where(reflects, (1.0 - metallic) * (1.0 + sent * missing), 0.0)
        mean = np.where(reflects, _kept(f0, sent, missing, layered), 0.0)
        front, edge = base, (1.0 - base) * grazed
        again = multiple * sent_again(front + edge * SCHLICK_MEAN, white)
        below = base * (1.0 - metallic)
        emission = np.asarray(materials.emission, np.float64).reshape(-1, 3).T
        # What a layer keeps it sends on itself, as much as mirrors leave to it.
        covered = reflects & (np.asarray(over) > 0.0)
        sends = np.where(covered, shown * (1.0 - metallic) / np.where(covered, over, 1.0), 0.0)
        without = np.where(covered, sends, ambient * below + shown * mean * (1.0 - metallic))
        through = np.where(covered, ambient * below - sends, 0.0)
        world, glow = np.reshape(world_color, (3, 1)), ambient * np.ones_like(base)
        row, rows = seen_rows(rough)
        table = cls(
            emitted=_single(emission + without * world),
            through=_single(through * world),
            emission=_single(emission),
            diffuse=_single(below / np.pi),
            over=_single(np.where(reflects, over, 0.0)),
            f0=_single(f0),
            sent=_single(sent),
            coat=_single(coat),
            ior=_single(ior_of(f0)),
            front=_single(front * metallic),
            edge=_single(edge * metallic),
            again=_single(again),
            glow=_single(glow * world),
            alpha=_single(rough**4),
            row=row,
            missing=rows[0],
            grazed=rows[1],
            layered=rows[2],
            few=not per_hit and len(row) <= FEW,
            sky=sky,
        )
        if sky is None:
            return table
        even = replace(
            table,
            emitted=_single(without * np.ones((3, 1))),
            through=_single(through),
            emission=np.zeros_like(table.emission),
            glow=_single(glow),
            sky=None,
        )
        return replace(table, even=even)

    @cached_property
    def dielectric(self) -> bool:
        """Whether any material has the highlights of one."""
        return bool(self.coat.any())

    @cached_property
    def metal(self) -> bool:
        """Whether any material has the highlights of one."""
        return bool(self.front.any() or self.edge.any())

    @property
    def glossy(self) -> bool:
        """Whether any material has a highlight."""
        return self.dielectric or self.metal

    @cached_property
    def _covered(self) -> bool:
        # A black thing's layer, too, sends on what it keeps of the world's light.
        return self._passes or bool((self.over * self.diffuse).any())

    @cached_property
    def _passes(self) -> bool:
        return bool(self.through.any())

    @cached_property
    def _glows(self) -> bool:
        return bool((self.glow * (self.front + self.edge)).any())

    @cached_property
    def _sends_again(self) -> bool:
        return self.metal and (not self.few or float(self.again.max() * self.missing.max()) > FAINT)

    @cached_property
    def _under(self) -> Single:
        """What the layers of a few materials let through, (M · VIEWS,)."""
        curves = (table.reshape(-1, VIEWS)[self.row // VIEWS] for table in (self.missing, self.layered))
        kept = _kept(self.f0[:, None], self.sent[:, None], *curves)
        return (1 - self.over[:, None] * kept).reshape(-1)

    @cached_property
    def _gloss(self) -> Single:
        """What the layers of a few materials reflect, (M · SHINES,) by the cosine to its facets."""
        cosines = _single((np.arange(SHINES) + 0.5) / SHINES)
        return (dielectric_share(cosines, self.ior[:, None]) * self.coat[:, None]).reshape(-1)

    def seen(self, material: IndexArray, facing: Single) -> ViewTerms:
        """What points make of light under a cosine to the viewer, (N,); material: (N,), or (1,) for all."""
        under = more = grazed = None
        if not (self._covered or self._sends_again or self._glows):
            return ViewTerms()
        place = _column(facing, VIEWS)
        row = place + by_material(self.row, material)
        if self._covered and self.few:
            under = self._under.take(place + material * VIEWS if self.row.size > 1 else place)
        elif self._covered:
            kept = _kept(
                by_material(self.f0, material),
                by_material(self.sent, material),
                self.missing.take(row),
                self.layered.take(row),
            )
            under = 1 - by_material(self.over, material) * kept
        if self._sends_again or self._glows:
            more = self.missing.take(row)
        if self._glows:
            grazed = self.grazed.take(row)
        return ViewTerms(under, more, grazed)

    def unlit(self, material: IndexArray, seen: ViewTerms) -> Single:
        """Radiance that needs no lamp, (3, N) or (3, 1)."""
        light = by_material(self.emitted, material)
        if seen.under is not None and self._passes:
            light = light + by_material(self.through, material) * seen.under
        if seen.grazed is not None and seen.more is not None:
            mirrored = by_material(self.front, material) / (1 + seen.more)
            mirrored += by_material(self.edge, material) * seen.grazed
            mirrored *= 1 + by_material(self.again, material) * seen.more
            mirrored *= by_material(self.glow, material)
            light = light + mirrored
        return light

    def shine(self, material: IndexArray, cosine: Single, seen: ViewTerms) -> Single:
        """What facets reflect of light under a cosine to them, (N,) or, of metals, (3, N)."""
        if self.dielectric:
            if self.few:
                place = _column(cosine, SHINES)
                gloss = self._gloss.take(place + material * SHINES if self.row.size > 1 else place)
            else:
                gloss = dielectric_share(cosine, by_material(self.ior, material))
                gloss *= by_material(self.coat, material)
            if not self.metal:
                return gloss
        light: Single = by_material(self.edge, material) * schlick(cosine)
        light += by_material(self.front, material)
        if seen.more is not None:
            light *= 1 + by_material(self.again, material) * seen.more
        if self.dielectric:
            light += gloss
        return light


def by_material(table: Numbers, material: IndexArray) -> Numbers:
    """The entries (…, N) of a table (…, M) by material, or the one entry (…, 1) that there is."""
    if table.shape[-1] == 1:
        return table
    return cast(Numbers, table.take(material, axis=-1, mode="clip"))


def _kept(f0: Numbers, sent: Numbers, missing: Numbers, layered: Numbers) -> Numbers:
    """What a layer keeps from what lies under it: what its facets reflect at once and, of that, again.

    All (N,) or alike: reflectance head-on, and as in ``LightTable``. After Cycles' layers.
    """
    at_once = f0 / (1 + missing) + (1 - f0) * layered
    return cast(Numbers, at_once * (1 + sent * missing))


def _column(cosine: Single, columns: int) -> IndexArray:
    """In which of the columns from 0 to 1 cosines (N,) are."""
    place = (cosine * np.float32(columns)).astype(np.intp)
    np.maximum(place, 0, out=place)
    return np.minimum(place, columns - 1, out=place)


def _or_all(values: Array | None) -> Array | float:
    return 1.0 if values is None else values


def _single(values: Array) -> Single:
    return values.astype(np.float32)
