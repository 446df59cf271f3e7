# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shaders of a surface do with light: shine, scatter, mirror, refract, let through.

A surface is the sum of its closures. Each is taken apart into lobes: a *body*, the constants that
lamps and the world light (``Materials``), and shares that are sent on along straight lines.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from ..nodes.context import ShadingContext, dot
from ..nodes.graph import MaterialGraph, registers
from ..nodes.inputs import fresnel_dielectric
from ..nodes.operations import OPERATIONS
from ..scene.shading_scene import Materials
from .microfacet import SCHLICK_MEAN, mean_reflectance, sent_again

# Roughness up to which a reflection is followed in full, and from which it is left to lamps' highlights and
# to the world's even light: of metals, which show nothing else, and of what lies on something diffuse.
METAL_ROUGHNESS = 0.7, 0.9
COAT_ROUGHNESS = 0.3, 0.5

SentKind = Literal["THROUGH", "MIRROR", "REFRACTED"]


@dataclass(frozen=True)
class Body:
    """What is lit at n hits. weight: (1, n). materials: a row a hit. normal: (3, n)."""

    weight: Array
    materials: Materials
    normal: Array


class Gloss(NamedTuple):
    """How a rough surface reflects. roughness: (1, n). front, edge: (3, n) reflectance, head-on and grazing.
    again: (3, n) share of what facets send to each other that leaves the surface in the end. ior: (1, n) of
    a dielectric, whose share is Fresnel's; 0 for Schlick's from front to edge.
    """

    roughness: Array
    front: Array
    edge: Array
    again: Array
    ior: Array

    def reflectance(self, cosine: Array) -> Array:
        """(3, n), by the cosine to the facet (n,)."""
        schlick = self.front + (self.edge - self.front) * (1.0 - cosine) ** 5
        if not self.ior.any():
            return schlick
        return np.where(self.ior > 0.0, fresnel_dielectric(cosine[None], np.maximum(self.ior, 1.0)), schlick)


@dataclass(frozen=True)
class Sent:
    """What goes on. tint: (3, n) share of light. normal: (3, n). ior: (1, n), far over near side.
    gloss: of a MIRROR that is not sharp.
    """

    kind: SentKind
    tint: Array
    normal: Array
    ior: Array
    gloss: Gloss | None = None

    def take(self, index: IndexArray) -> Sent:
        """Of the hits at ``index``."""
        return Sent(
            self.kind,
            self.tint[:, index],
            self.normal[:, index],
            self.ior[:, index],
            self.gloss and Gloss(*(each[:, index] for each in self.gloss)),
        )


def lobes(graph: MaterialGraph, place: ShadingContext) -> Iterator[Body | Sent]:
    """The lobes of a material at its hits."""
    results = registers(graph, place, OPERATIONS)
    for closure in graph.closures:
        values = {name: results[ref.operation][ref.output] for name, ref in closure.inputs.items()}
        values = {name: clean(value) for name, value in values.items()}
        weight = np.maximum(clean(results[closure.weight.operation][closure.weight.output]), 0.0)
        if weight.any():
            yield from READERS[closure.kind](_Reader(values, weight, place))


def clean(values: Array) -> Array:
    """Values without what is no number."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, posinf=0.0, neginf=0.0)


class _Reader:
    """The inputs of a closure at n hits."""

    def __init__(self, values: Mapping[str, Array], weight: Array, place: ShadingContext) -> None:
        self._values, self._place = values, place
        self.count = place.count
        self.weight = self.spread(weight)
        self.normal = np.broadcast_to(values["normal"], (3, place.count))

    def spread(self, values: Array) -> Array:
        """Values of all hits, (channels, n)."""
        return np.broadcast_to(values, (len(values), self.count))

    def share(self, name: str) -> Array:
        """An input in [0, 1], (1, n)."""
        return self.spread(np.clip(self._values[name], 0.0, 1.0))

    def color(self, name: str) -> Array:
        """A colour without negative channels, (3, n)."""
        return self.spread(np.maximum(self._values[name], 0.0))

    def value(self, name: str) -> Array:
        """A number, (1, n), or light of any sign, (3, n)."""
        return self.spread(self._values[name])

    @property
    def facing(self) -> Array:
        """Cosine between normal and view, (1, n)."""
        return np.clip(dot(self.normal, self._place.view), 0.0, 1.0)

    def relative_ior(self) -> Array:
        """Index of refraction of the far side over the near side, (1, n)."""
        ior = np.maximum(self.value("ior"), 1e-5)
        return np.where(self._place.back > 0.0, 1.0 / ior, ior)

    def body(
        self,
        weight: Array,
        color: Array,
        metallic: Array | float = 0.0,
        roughness: Array | float = 1.0,
        f0: Array | float = 0.0,
        emission: Array | float = 0.0,
        ambient: Array | float = 1.0,
        layer: Array | float = 1.0,
        over: Array | float = 1.0,
        edge: float = 1.0,
        multiple: Array | float = 1.0,
    ) -> Body:
        """A body with one row of constants a hit."""
        count = self.count
        given = metallic, roughness, f0, ambient, layer, over, edge, multiple
        rows = [np.broadcast_to(each, (1, count))[0] for each in given]
        light = np.broadcast_to(emission, (3, count)).T
        materials = Materials(
            color.T,
            metallic=rows[0],
            roughness=rows[1],
            specular_f0=rows[2],
            emission=light,
            ambient=rows[3],
            layer=rows[4],
            over=rows[5],
            edge=rows[6],
            multiple=rows[7],
        )
        return Body(weight, materials, self.normal)

    def sent(self, kind: SentKind, tint: Array, ior: Array | None = None) -> Sent:
        """A share that goes on."""
        return Sent(kind, tint, self.normal, np.ones((1, self.count)) if ior is None else ior)

    def glossy(
        self, weight: Array, roughness: Array, front: Array, edge: Array, ior: Array | None = None
    ) -> Sent:
        """A share (1, n) that is reflected, sharp or not. The others as in ``Gloss``."""
        white = mean_reflectance(roughness)[0]
        again = sent_again(front + (edge - front) * SCHLICK_MEAN, white) * self.share("multiple")
        nothing = np.ones((1, self.count))
        return Sent(
            "MIRROR",
            np.repeat(weight, 3, axis=0),
            self.normal,
            nothing,
            Gloss(roughness, front, edge, again, 0.0 * nothing if ior is None else ior),
        )


def followed(roughness: Array, limits: tuple[float, float]) -> Array:
    """How much of a reflection is followed by rays, 1 to 0 between two limits."""
    full, none = limits
    share = np.clip((none - roughness) / (none - full), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def _principled(reader: _Reader) -> Iterator[Body | Sent]:
    """Metal, a dielectric under Fresnel's reflection, glass by its transmission; alpha outside of all."""
    alpha = reader.share("alpha")
    through = reader.weight * (1.0 - alpha)
    if through.any():
        yield reader.sent("THROUGH", np.repeat(through, 3, axis=0))
    weight = reader.weight * alpha
    base, metallic, roughness = (
        reader.color("base_color"),
        reader.share("metallic"),
        reader.share("roughness"),
    )
    emission, level = reader.value("emission"), np.maximum(reader.value("specular_level"), 0.0)
    ior = np.maximum(reader.value("ior"), 1e-5)
    f0 = np.clip(((ior - 1.0) / (ior + 1.0)) ** 2 * 2.0 * level, 0.0, 1.0)
    clear = reader.share("transmission")
    polished = metallic * followed(roughness, METAL_ROUGHNESS)
    coated = (1.0 - metallic) * (1.0 - clear) * followed(roughness, COAT_ROUGHNESS) * (f0 > 0.0)
    coat_ior = ior_of(f0)
    glass = (1.0 - metallic) * clear
    if polished.any():
        yield reader.glossy(weight * polished, roughness, base, np.ones_like(base))
    if coated.any():
        front = np.repeat(f0, 3, axis=0)
        yield reader.glossy(weight * coated, roughness, front, np.ones_like(front), coat_ior)
    if glass.any():
        # What goes in and out again is coloured twice.
        yield from _boundary(reader, weight * glass, 1.0, np.sqrt(base))
    # Highlights of lamps stay whole; what the world lights is what no mirror shows.
    lit = base * (1.0 - glass)
    layer = (1.0 - clear) * (1.0 - followed(roughness, COAT_ROUGHNESS))
    rest, over, multiple = 1.0 - polished, 1.0 - clear, reader.share("multiple")
    yield reader.body(weight, lit, metallic, roughness, f0, emission, rest, layer, over, multiple=multiple)


def ior_of(f0: Array) -> Array:
    """The index of refraction of what reflects ``f0`` head-on."""
    root = np.sqrt(np.minimum(f0, 0.999))
    result: Array = (1.0 + root) / (1.0 - root)
    return result


def _diffuse(reader: _Reader) -> Iterator[Body | Sent]:
    yield reader.body(reader.weight, reader.color("color"))


def _glossy(reader: _Reader) -> Iterator[Body | Sent]:
    color, roughness = reader.color("color"), reader.share("roughness")
    traced = followed(roughness, METAL_ROUGHNESS)
    if traced.any():
        yield reader.glossy(reader.weight * traced, roughness, color, color)
    more = reader.share("multiple")
    yield reader.body(reader.weight, color, 1.0, roughness, ambient=1.0 - traced, edge=0.0, multiple=more)


def _emission(reader: _Reader) -> Iterator[Body | Sent]:
    yield reader.body(reader.weight, np.zeros((3, reader.count)), emission=reader.value("color"))


def _transparent(reader: _Reader) -> Iterator[Body | Sent]:
    yield reader.sent("THROUGH", reader.weight * reader.color("color"))


def _boundary(reader: _Reader, weight: Array, mirror: Array | float, color: Array) -> Iterator[Body | Sent]:
    """What glass does: mirrors Fresnel's share, refracts the rest."""
    ior = reader.relative_ior()
    mirrored = fresnel_dielectric(reader.facing, ior)
    yield reader.sent("MIRROR", np.broadcast_to(weight * mirrored * mirror, (3, reader.count)))
    yield reader.sent("REFRACTED", weight * (1.0 - mirrored) * color, ior)


def _glass(reader: _Reader) -> Iterator[Body | Sent]:
    color = reader.color("color")
    yield from _boundary(reader, reader.weight, color, color)
    # Highlights of lamps, which no straight ray meets.
    ior = np.maximum(reader.value("ior"), 1e-5)
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    yield reader.body(
        reader.weight, np.zeros((3, reader.count)), 0.0, reader.share("roughness"), f0, layer=0.0
    )


def _refraction(reader: _Reader) -> Iterator[Body | Sent]:
    ior = reader.relative_ior()
    # Nothing where all would be reflected.
    let_in = fresnel_dielectric(reader.facing, ior) < 1.0
    yield reader.sent("REFRACTED", reader.weight * let_in * reader.color("color"), ior)


READERS = {
    "DIFFUSE": _diffuse,
    "EMISSION": _emission,
    "GLASS": _glass,
    "GLOSSY": _glossy,
    "PRINCIPLED": _principled,
    "REFRACTION": _refraction,
    "TRANSPARENT": _transparent,
}
