# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of Blender's Solid shading: up to four lamps that stand around the viewer, with soft borders.

The formulas are Workbench's (Blender's source, ``workbench_world_light.bsl.hh`` and ``workbench_common``):
wrapped diffuse light, Blinn's highlights, an approximate Fresnel term, and reciprocals that are fast and not
exact. The stored precision of roughness and metallic is Workbench's as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...projection.typing import Float32Array
from ..typing import Single

# Reflectance of a dielectric at normal incidence.
DIELECTRIC = np.float32(0.05)
# Exponent of the Fresnel term: 2 ** (FRESNEL · cosine).
FRESNEL = np.float32(-8.35)
# Steps of the values that Workbench packs into one byte: 5 bits of roughness, 3 bits of metallic.
ROUGHNESS_STEPS, METALLIC_STEPS = 31, 7
# Bits from which a float's own are subtracted for its reciprocal (Drobot 2014, "Low Level Optimizations").
RECIPROCAL_BITS = np.int32(0x7EEF370B)


@dataclass(frozen=True)
class StudioLight:
    """K lamps at infinity and ambient light, linear colours.

    direction: (3, K) towards the lamps; right, up and towards the viewer, or world space if ``in_world``.
    diffuse, specular: (3, K). wrap: (K,) in [0, 1], the softness. ambient: (3,).
    """

    direction: Single
    diffuse: Single
    specular: Single
    wrap: Single
    ambient: Single
    in_world: bool = False


class LitPixels(NamedTuple):
    """The geometry of n pixels, in the space of the light.

    normal: (3, n) unit vectors. incident: (3, n) or (3, 1), unit vectors towards the viewer.
    """

    normal: Single
    incident: Single


class Gloss(NamedTuple):
    """The coefficients of highlights for K lamps and m roughnesses, (K, m) each but ``smooth``, (m,).

    shininess: Blinn's exponent. strength: its normalisation. wrap, scale: of the reflected environment.
    smooth: 1 - roughness.
    """

    shininess: Single
    strength: Single
    wrap: Single
    scale: Single
    smooth: Single

    def take(self, which: np.ndarray) -> Gloss:
        """The coefficients of pixels by their number of roughness; a single roughness serves all."""
        if len(self.smooth) == 1:
            return self
        return Gloss(*(values.take(which, axis=-1) for values in self))


def fast_reciprocal(values: Single) -> Single:
    """The approximate reciprocals that Workbench uses, up to 12 % from the exact ones."""
    bits: Single = (RECIPROCAL_BITS - np.ascontiguousarray(values, np.float32).view(np.int32)).view(
        np.float32
    )
    return bits


def packed_roughness(roughness: Float32Array) -> Single:
    """Blender's roughness as Workbench stores it: the square root, in 32 steps, rounded down."""
    stored = np.floor(np.sqrt(np.clip(roughness, 0.0, 1.0)) * 255.0 + 0.5) / 255.0
    return (np.floor(stored * ROUGHNESS_STEPS) / ROUGHNESS_STEPS).astype(np.float32)


def packed_metallic(metallic: Float32Array) -> Single:
    """Metallic as Workbench stores it: in 8 steps, rounded down."""
    stored = np.floor(np.clip(metallic, 0.0, 1.0) * 255.0 + 0.5) / 255.0
    return (np.floor(stored * METALLIC_STEPS) / METALLIC_STEPS).astype(np.float32)


def gloss_of(light: StudioLight, roughness: Single) -> Gloss:
    """The coefficients of highlights. roughness: (m,), as ``packed_roughness`` gives it."""
    smooth = np.float32(1.0) - roughness
    wrap = light.wrap[:, None]
    shininess = np.exp2(np.float32(10.0) * smooth * (1 - wrap) + 1)
    wider = wrap + (1 - wrap) * roughness
    return Gloss(
        shininess, shininess * np.float32(0.125) + 1, wider, fast_reciprocal((wider + 1) ** 2), smooth
    )


def studio_color(
    light: StudioLight, seen: LitPixels, base: Single, metallic: Single | None, gloss: Gloss | None
) -> Single:
    """The linear colour (3, n) of surfaces in the light of a studio.

    base: (3, n). metallic: (n,), None where nothing is. gloss: of n pixels or of one; None for no highlights.
    """
    toward = light.direction.T @ seen.normal
    diffuse = _wrapped(toward, light.wrap[:, None], fast_reciprocal((light.wrap + 1) ** 2)[:, None])
    color: Single = light.diffuse @ diffuse
    color += light.ambient[:, None]
    if gloss is None:
        color *= base
        return color
    facing = np.einsum("cn,cn->n", seen.normal, np.broadcast_to(seen.incident, seen.normal.shape))
    shine: Single = light.specular @ _highlights(light, seen, toward, facing, gloss)
    shine += light.ambient[:, None]
    np.maximum(facing, 0, out=facing)
    reflected, diffused = _shares(base, metallic, facing, gloss.smooth)
    # Colored reflections darken the diffuse light by their mean only.
    color *= diffused
    color *= 1 - reflected.sum(axis=0) * np.float32(0.33333 * (3 / len(reflected)))
    shine *= reflected
    color += shine
    return color


def _wrapped(cosine: Single, wrap: Single, scale: Single) -> Single:
    """Diffuse light that reaches around a surface."""
    light = cosine + wrap
    light *= scale
    return np.clip(light, 0, 1, out=light)


def _shares(base: Single, metallic: Single | None, facing: Single, smooth: Single) -> tuple[Single, Single]:
    """The share that is reflected, (3, n), or (1, n) if it has no colour; and the diffuse colour (3, n)."""
    fresnel = np.exp2(FRESNEL * facing)
    fresnel *= smooth
    if metallic is None:
        return (DIELECTRIC + (1 - DIELECTRIC) * fresnel)[None], base
    specular = DIELECTRIC + (base - DIELECTRIC) * metallic
    return specular + (1 - specular) * fresnel, base * (1 - metallic)


def _highlights(light: StudioLight, seen: LitPixels, toward: Single, facing: Single, gloss: Gloss) -> Single:
    """The reflected light of each lamp, (K, n): a highlight, or a soft environment where the lamp is soft.

    toward: (K, n) cosines of normal and lamp. facing: (n,) cosines of normal and viewer.
    """
    beside = light.direction.T @ seen.incident
    # The half vector is (lamp + viewer) / length; the mirrored one is 2 · facing · normal - viewer.
    half = toward + facing
    half /= np.sqrt(np.maximum(2 + 2 * beside, np.float32(1e-12)))
    np.clip(half, np.float32(1e-9), 1, out=half)
    sharp = np.log(half, out=half)
    sharp *= gloss.shininess
    np.exp(sharp, out=sharp)
    sharp *= np.maximum(toward, 0)
    sharp *= gloss.strength
    mirrored = toward * (2 * facing)
    mirrored -= beside
    soft = _wrapped(mirrored, gloss.wrap, gloss.scale)
    blend = (light.wrap * light.wrap)[:, None]
    soft -= sharp
    soft *= blend
    sharp += soft
    return sharp
