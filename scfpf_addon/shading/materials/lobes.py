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
    """The reflectance of rough surfaces at n hits.

    roughness: (n,). f0, f90: (3, n). multiscatter: (3, n) share of multiple scattering that leaves the
    surface. ior: (n,) of a dielectric, which reflects by Fresnel; 0 for Schlick's blend of F0 and F90.
    """

    roughness: Array
    f0: Array
    f90: Array
    multiscatter: Array
    ior: Array

    @classmethod
    def of(cls, closures: ClosureRows, metal: BoolArray) -> RoughReflectance:
        """The reflectance of the metals of closures where ``metal`` (n,), of their layers elsewhere."""
        roughness, base = closures["roughness"][0], closures["base_color"]
        f0 = np.where(metal, base, closures["f0"])
        f90 = np.where(metal, base + (1.0 - base) * closures["grazing"], 1.0)
        mean = f0 + (f90 - f0) * SCHLICK_MEAN
        multiscatter = multiscatter_share(mean, mean_albedo(roughness)[0]) * closures["multiscatter"]
        return cls(roughness, f0, f90, multiscatter, np.where(metal, 0.0, ior_of(closures["f0"][0])))

    def at(self, cosine: Array) -> Array:
        """The reflectance (3, n), by the cosine to the facet (n,)."""
        schlick = self.f0 + (self.f90 - self.f0) * (1.0 - cosine) ** 5
        return np.where(self.ior > 0.0, fresnel_dielectric(cosine, np.maximum(self.ior, 1.0)), schlick)
