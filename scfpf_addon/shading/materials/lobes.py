# SPDX-License-Identifier: GPL-3.0-or-later
"""The lobes of closures: bodies, whose constants lamps and the world light, and what is scattered on.

A surface is the sum of its closures. Mirrors, glass and transparency send on light that straight rays or
projectors look for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...projection.typing import Array, BoolArray
from ..nodes.inputs import fresnel_dielectric
from .constants import Materials
from .microfacet import SCHLICK_MEAN, f0_of, ior_of, mean_albedo, multiscatter_share
from .parameters import ClosureRows

# Roughness up to which rays follow a whole reflection, and from which they follow none of it: of metals and
# of dielectrics over a diffuse surface. Highlights and the environment on the surface stand for the rest.
METAL_ROUGHNESS = 0.7, 0.9
DIELECTRIC_ROUGHNESS = 0.3, 0.5


def followed(roughness: Array, limits: tuple[float, float]) -> Array:
    """The share of a reflection that rays follow, from 1 to 0 between two limits."""
    full, none = limits
    share = np.clip((none - roughness) / (none - full), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def split(closures: ClosureRows) -> ClosureRows:
    """Work out the lobes of closures, in place: metal, a dielectric layer over diffuse, glass.

    body, metal, dielectric, glass: (1, n) shares of the surface that lamps light, and whose reflections or
    refractions rays follow; alpha cuts them all. transparent: (3, n) tint of light that passes straight. f0:
    (1, n), of the layer.
    """
    weight, alpha, metallic = closures["weight"], closures["alpha"], closures["metallic"]
    roughness, transmission = closures["roughness"], closures["transmission"]
    f0 = np.clip(f0_of(closures["ior"]) * 2.0 * closures["specular_level"], 0.0, 1.0)
    dielectric = weight * alpha * (1.0 - metallic)
    closures["f0"][:] = f0
    closures["transparent"][:] = weight * (1.0 - alpha) * closures["clear"]
    closures["body"][:] = weight * alpha * closures["lit"]
    closures["metal"][:] = weight * alpha * metallic * followed(roughness, METAL_ROUGHNESS)
    closures["glass"][:] = dielectric * transmission
    dielectric *= (1.0 - transmission) * followed(roughness, DIELECTRIC_ROUGHNESS)
    closures["dielectric"][:] = dielectric * (f0 > 0.0)
    return closures


def scatters(closures: ClosureRows) -> BoolArray:
    """Return whether closures send light on, (n,)."""
    sent = closures["metal"] + closures["dielectric"] + closures["glass"]
    found: BoolArray = closures["transparent"].any(axis=0) | (sent > 0.0)[0]
    return found


def bodies(closures: ClosureRows) -> Materials:
    """The bodies of closures as constants that lamps light.

    The highlights of lamps are whole; the environment lights only what rays do not follow.
    """
    metallic, roughness, opaque = closures["metallic"], closures["roughness"], 1.0 - closures["transmission"]
    rows = {
        "metallic": metallic,
        "roughness": roughness,
        "specular_f0": closures["f0"],
        "ambient": 1.0 - metallic * followed(roughness, METAL_ROUGHNESS),
        "specular_ambient": opaque * (1.0 - followed(roughness, DIELECTRIC_ROUGHNESS)),
        "specular_coverage": opaque,
        "grazing": closures["grazing"],
        "multiscatter": closures["multiscatter"],
    }
    base = closures["base_color"] * (1.0 - (1.0 - metallic) * closures["transmission"])
    colors = {"base_color": base.T, "emission": closures["emission"].T}
    return Materials.of_rows({**{name: values[0] for name, values in rows.items()}, **colors})


@dataclass(frozen=True)
class RoughReflectance:
    """The reflectance of rough surfaces at n hits, of which the first m are on metals, the others on layers.

    roughness: (n,). f0, f90: (3, m), which Schlick blends. ior: (n - m,) of the layers, which reflect by
    Fresnel. again: (3, m) and (1, n - m) shares of multiple scattering that leave metals and layers.
    """

    roughness: Array
    f0: Array
    f90: Array
    ior: Array
    again: tuple[Array, Array]

    @classmethod
    def of(cls, closures: ClosureRows, metals: int) -> RoughReflectance:
        """The reflectance of closures (n,): of the metals of the first ``metals``, of the others' layers."""
        roughness, layer_f0 = closures["roughness"][0], closures["f0"][:, metals:]
        f0, grazing = closures["base_color"][:, :metals], closures["grazing"][:, :metals]
        f90 = f0 + (1.0 - f0) * grazing
        white, multiscatter = mean_albedo(roughness)[0], closures["multiscatter"]
        means = f0 + (f90 - f0) * SCHLICK_MEAN, layer_f0 + (1.0 - layer_f0) * SCHLICK_MEAN
        metal = multiscatter_share(means[0], white[:metals]) * multiscatter[:, :metals]
        layer = multiscatter_share(means[1], white[metals:]) * multiscatter[:, metals:]
        return cls(roughness, f0, f90, ior_of(layer_f0[0]), (metal, layer))

    def at(self, cosine: Array, once: Array) -> Array:
        """The reflectance (3, n), by the cosine to the facet (n,).

        once: (n,) share of light that leaves a white surface after one facet. Light that facets send to each
        other leaves in the same direction.
        """
        metals, more = self.f0.shape[1], (1.0 - once) / once
        away = 1.0 - cosine[:metals]
        schlick = self.f0 + (self.f90 - self.f0) * (away * away * away * away * away)
        result = np.empty((3, len(cosine)))
        result[:, :metals] = schlick * (1.0 + self.again[0] * more[:metals])
        fresnel = fresnel_dielectric(cosine[metals:], self.ior)
        result[:, metals:] = fresnel * (1.0 + self.again[1][0] * more[metals:])
        return result
