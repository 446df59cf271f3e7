# SPDX-License-Identifier: GPL-3.0-or-later
"""The lobes of a material that is a node graph: closures, split by how their light is computed.

A surface is the sum of its closures. Each is split into bodies, whose constants lamps and the world light,
and scattered lobes, whose light straight rays or projectors look for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from ..nodes.context import ShadingContext
from ..nodes.graph import MaterialGraph, finite, registers
from ..nodes.inputs import fresnel_dielectric
from ..nodes.operations import OPERATIONS
from ..vectors import dot_row
from .constants import Materials
from .microfacet import SCHLICK_MEAN, f0_of, ior_of, mean_albedo, multiscatter_share

# Roughness up to which rays follow a whole reflection, and from which they follow none of it: of metals and
# of dielectrics over a diffuse surface. Highlights and the environment on the surface stand for the rest.
METAL_ROUGHNESS = 0.7, 0.9
DIELECTRIC_ROUGHNESS = 0.3, 0.5

# The least index of refraction.
LEAST_IOR = 1e-5

LobeKind = Literal["TRANSPARENT", "GLOSSY", "TRANSMISSION"]


@dataclass(frozen=True)
class Body:
    """Constants that lamps light at n hits. weight: (1, n). materials: a row a hit. normal: (3, n)."""

    weight: Array
    materials: Materials
    normal: Array


class RoughReflectance(NamedTuple):
    """The reflectance of a rough surface at n hits.

    roughness: (1, n). f0, f90: (3, n). multiscatter: (3, n) share of multiple scattering that leaves the
    surface. ior: (1, n) of a dielectric, which reflects by Fresnel; 0 for Schlick's blend of F0 and F90.
    """

    roughness: Array
    f0: Array
    f90: Array
    multiscatter: Array
    ior: Array

    def reflectance(self, cosine: Array) -> Array:
        """(3, n), by the cosine to the facet (n,)."""
        schlick = self.f0 + (self.f90 - self.f0) * (1.0 - cosine) ** 5
        if not self.ior.any():
            return schlick
        return np.where(self.ior > 0.0, fresnel_dielectric(cosine[None], np.maximum(self.ior, 1.0)), schlick)


@dataclass(frozen=True)
class ScatteredLobe:
    """Light that n hits pass on. tint: (3, n) share of light. normal: (3, n).

    ior: (1, n), of the far side over the near side. rough: of a glossy lobe that is not a mirror.
    """

    kind: LobeKind
    tint: Array
    normal: Array
    ior: Array
    rough: RoughReflectance | None = None

    def take(self, index: IndexArray) -> ScatteredLobe:
        """The lobe of the hits at ``index``."""
        return ScatteredLobe(
            self.kind,
            self.tint[:, index],
            self.normal[:, index],
            self.ior[:, index],
            self.rough and RoughReflectance(*(each[:, index] for each in self.rough)),
        )


Lobes = Iterator[Body | ScatteredLobe]


def lobes(graph: MaterialGraph, context: ShadingContext) -> Lobes:
    """The lobes of a material at its hits."""
    results = registers(graph, context, OPERATIONS)
    for closure in graph.closures:
        values = {name: finite(results[ref.operation][ref.output]) for name, ref in closure.inputs.items()}
        weight = np.maximum(finite(results[closure.weight.operation][closure.weight.output]), 0.0)
        if weight.any():
            yield from CLOSURES[closure.kind](_ClosureInputs(values, weight, context))


class _ClosureInputs:
    """The inputs of a closure at n hits, and the lobes made of them."""

    def __init__(self, values: Mapping[str, Array], weight: Array, context: ShadingContext) -> None:
        self._values, self._context = values, context
        self.count = context.count
        self.weight = self._spread(weight)
        self.normal = np.broadcast_to(values["normal"], (3, context.count))

    def _spread(self, values: Array) -> Array:
        """Values of all hits, (channels, n)."""
        return np.broadcast_to(values, (len(values), self.count))

    def share(self, name: str) -> Array:
        """An input in [0, 1], (1, n)."""
        return self._spread(np.clip(self._values[name], 0.0, 1.0))

    def color(self, name: str) -> Array:
        """A colour without negative channels, (3, n)."""
        return self._spread(np.maximum(self._values[name], 0.0))

    def value(self, name: str) -> Array:
        """A number, (1, n), or light of any sign, (3, n)."""
        return self._spread(self._values[name])

    @property
    def facing(self) -> Array:
        """Cosine between normal and view, (1, n)."""
        return np.clip(dot_row(self.normal, self._context.view), 0.0, 1.0)

    @property
    def ior(self) -> Array:
        """Index of refraction, (1, n)."""
        return np.maximum(self.value("ior"), LEAST_IOR)

    @property
    def relative_ior(self) -> Array:
        """Index of refraction of the far side over the near side, (1, n)."""
        ior = self.ior
        return np.where(self._context.back > 0.0, 1.0 / ior, ior)

    def body(
        self, color: Array, weight: Array | None = None, emission: Array | float = 0.0, **given: Array | float
    ) -> Body:
        """A body with a row of constants a hit. given: constants of ``Materials`` other than the usual."""
        rows = {name: np.broadcast_to(each, (1, self.count))[0] for name, each in (USUAL | given).items()}
        light = np.broadcast_to(emission, (3, self.count)).T
        materials = Materials.of_rows({"base_color": color.T, "emission": light, **rows})
        return Body(self.weight if weight is None else weight, materials, self.normal)

    def sharp(self, kind: LobeKind, tint: Array, ior: Array | None = None) -> ScatteredLobe:
        """A sharp lobe."""
        return ScatteredLobe(kind, tint, self.normal, np.ones((1, self.count)) if ior is None else ior)

    def glossy(self, weight: Array, f0: Array, f90: Array, ior: Array | None = None) -> ScatteredLobe:
        """A glossy lobe of a share ``weight`` (1, n) of the light. f0, f90, ior: see ``RoughReflectance``."""
        roughness = self.share("roughness")
        white = mean_albedo(roughness)[0]
        mean = f0 + (f90 - f0) * SCHLICK_MEAN
        multiscatter = multiscatter_share(mean, white) * self.share("multiscatter")
        ones = np.ones((1, self.count))
        rough = RoughReflectance(roughness, f0, f90, multiscatter, 0.0 * ones if ior is None else ior)
        return ScatteredLobe("GLOSSY", np.repeat(weight, 3, axis=0), self.normal, ones, rough)

    def boundary(self, weight: Array, reflection: Array | float, color: Array) -> Lobes:
        """The lobes of glass: Fresnel's share is reflected, times ``reflection``, and the rest refracted."""
        ior = self.relative_ior
        fresnel = fresnel_dielectric(self.facing, ior)
        yield self.sharp("GLOSSY", np.broadcast_to(weight * fresnel * reflection, (3, self.count)))
        yield self.sharp("TRANSMISSION", weight * (1.0 - fresnel) * color, ior)


# The constants of a body that a closure does not give.
USUAL: dict[str, Array | float] = {
    "metallic": 0.0,
    "roughness": 1.0,
    "specular_f0": 0.0,
    "ambient": 1.0,
    "specular_ambient": 1.0,
    "specular_coverage": 1.0,
    "grazing": 1.0,
    "multiscatter": 1.0,
}


def followed(roughness: Array, limits: tuple[float, float]) -> Array:
    """The share of a reflection that rays follow, from 1 to 0 between two limits."""
    full, none = limits
    share = np.clip((none - roughness) / (none - full), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def _principled(inputs: _ClosureInputs) -> Lobes:
    """Metal, a dielectric layer over diffuse, glass by the transmission; alpha applies to all."""
    alpha = inputs.share("alpha")
    transparent = inputs.weight * (1.0 - alpha)
    if transparent.any():
        yield inputs.sharp("TRANSPARENT", np.repeat(transparent, 3, axis=0))
    weight = inputs.weight * alpha
    base, metallic, roughness = (
        inputs.color("base_color"),
        inputs.share("metallic"),
        inputs.share("roughness"),
    )
    level = np.maximum(inputs.value("specular_level"), 0.0)
    f0 = np.clip(f0_of(inputs.ior) * 2.0 * level, 0.0, 1.0)
    opaque = 1.0 - inputs.share("transmission")
    dielectric_followed = followed(roughness, DIELECTRIC_ROUGHNESS)
    metal = metallic * followed(roughness, METAL_ROUGHNESS)
    dielectric = (1.0 - metallic) * opaque * dielectric_followed * (f0 > 0.0)
    glass = (1.0 - metallic) * inputs.share("transmission")
    if metal.any():
        yield inputs.glossy(weight * metal, base, np.ones_like(base))
    if dielectric.any():
        colorless = np.repeat(f0, 3, axis=0)
        yield inputs.glossy(weight * dielectric, colorless, np.ones_like(colorless), ior_of(f0))
    if glass.any():
        # Light that enters and leaves is tinted twice.
        yield from inputs.boundary(weight * glass, 1.0, np.sqrt(base))
    # The highlights of lamps are whole; the environment lights only what rays do not follow.
    yield inputs.body(
        base * (1.0 - glass),
        weight,
        inputs.value("emission"),
        metallic=metallic,
        roughness=roughness,
        specular_f0=f0,
        ambient=1.0 - metal,
        specular_ambient=opaque * (1.0 - dielectric_followed),
        specular_coverage=opaque,
        multiscatter=inputs.share("multiscatter"),
    )


def _diffuse(inputs: _ClosureInputs) -> Lobes:
    yield inputs.body(inputs.color("color"))


def _glossy(inputs: _ClosureInputs) -> Lobes:
    color, roughness = inputs.color("color"), inputs.share("roughness")
    traced = followed(roughness, METAL_ROUGHNESS)
    if traced.any():
        yield inputs.glossy(inputs.weight * traced, color, color)
    yield inputs.body(
        color,
        metallic=1.0,
        roughness=roughness,
        ambient=1.0 - traced,
        grazing=0.0,
        multiscatter=inputs.share("multiscatter"),
    )


def _emission(inputs: _ClosureInputs) -> Lobes:
    yield inputs.body(np.zeros((3, inputs.count)), emission=inputs.value("color"))


def _transparent(inputs: _ClosureInputs) -> Lobes:
    yield inputs.sharp("TRANSPARENT", inputs.weight * inputs.color("color"))


def _glass(inputs: _ClosureInputs) -> Lobes:
    color = inputs.color("color")
    yield from inputs.boundary(inputs.weight, color, color)
    # The highlights of lamps, which no straight ray meets.
    yield inputs.body(
        np.zeros((3, inputs.count)),
        roughness=inputs.share("roughness"),
        specular_f0=f0_of(inputs.ior),
        specular_ambient=0.0,
    )


def _refraction(inputs: _ClosureInputs) -> Lobes:
    ior = inputs.relative_ior
    # No light on total internal reflection.
    enters = fresnel_dielectric(inputs.facing, ior) < 1.0
    yield inputs.sharp("TRANSMISSION", inputs.weight * enters * inputs.color("color"), ior)


CLOSURES = {
    "DIFFUSE": _diffuse,
    "EMISSION": _emission,
    "GLASS": _glass,
    "GLOSSY": _glossy,
    "PRINCIPLED": _principled,
    "REFRACTION": _refraction,
    "TRANSPARENT": _transparent,
}
