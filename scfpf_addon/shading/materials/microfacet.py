# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection off rough surfaces: GGX facets with Smith's masking and shadowing.

Walter et al. 2007, Heitz 2014. Their reflectance by Fresnel or Schlick, and tables of their albedo.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from ..nodes.inputs import fresnel_dielectric
from ..typing import Single
from ..vectors import dot_row
from .ggx_sampling import R2_STEP, masking_shadowing, visible_normals

# The mean of Schlick's (1 - cos)⁵ over the hemisphere, by the cosine.
SCHLICK_MEAN = 1.0 / 21.0
# The mean over the hemisphere of (F - F0) / (1 - F0) of a dielectric whose index of refraction is 1.5.
FRESNEL_MEAN = 0.0540
# Steps of tables of albedo: of roughness, each hundredth that people choose, and of the cosine to the viewer.
ROUGH_STEPS, VIEWS = 101, 1024
# Cosines that a row of these is computed at, denser towards grazing angles, and facets for each.
COSINES, FACETS = 24, 256
# The layer's albedo is tabulated for this index of refraction; for others it differs by at most 0.02.
USUAL_IOR = 1.5
# The least cosine to the viewer.
EDGE_ON = np.float32(1e-4)
TINY = np.float32(1e-30)


def ggx_reflection(lit: Single, facing: Single, between: Single, alpha: Single) -> tuple[Single, Single]:
    """Radiance of white facets by irradiance, (N,), and the cosine of light and viewer to the facets, (N,).

    lit, facing, between: (N,) cosines from the normal to the lamp, at least 0, from the normal to the viewer,
    and from the lamp to the viewer. alpha: (N,) or (1,), GGX's α squared. Where lit is 0 the radiance is any
    number.
    """
    facing = np.maximum(facing, EDGE_ON)
    # Half the squared length of the half vector, the only property of it that is needed.
    half = 1 + between
    np.maximum(half, TINY, out=half)
    spread = lit + facing
    spread *= spread
    spread /= half
    np.minimum(spread, 2, out=spread)
    spread *= np.float32(0.5) * (alpha - 1)
    spread += 1
    spread *= spread
    rest = 1 - alpha
    # At least EDGE_ON · α, so that nothing is divided by 0.
    masked = _masking(lit, alpha, rest)
    masked *= facing
    other = _masking(facing, alpha, rest)
    other *= lit
    masked += other
    spread *= masked
    density = np.divide(alpha * np.float32(0.5 / np.pi), spread, out=spread)
    half *= np.float32(0.5)
    return density, np.sqrt(half, out=half)


def schlick(cosine: Single) -> Single:
    """Schlick's weight of F90, (1 - cos)⁵, (N,)."""
    away = 1 - cosine
    fourth = away * away
    fourth *= fourth
    away *= fourth
    return away


def dielectric_reflectance(cosine: Single, ior: Single) -> Single:
    """``fresnel_dielectric`` from the thinner side, in float32. cosine: (N,), ior: (N,) or (1,)."""
    square = cosine * cosine
    root = square + (ior * ior - 1)
    np.sqrt(root, out=root)
    less, more = root - cosine, root + cosine
    across = np.divide(less, more, out=root)
    across *= across
    more *= cosine
    more -= 1
    less *= cosine
    less += 1
    more /= less
    more *= more
    more += 1
    more *= np.float32(0.5)
    more *= across
    return more


def _masking(cosine: Single, alpha: Single, rest: Single) -> Single:
    """The square root in Smith's masking for a cosine, (N,)."""
    root = cosine * cosine
    root *= rest
    root += alpha
    return np.sqrt(root, out=root)


def ior_of(f0: Array) -> Array:
    """The index of refraction of a dielectric that reflects ``f0`` head-on."""
    root = np.sqrt(np.minimum(f0, 0.999))
    result: Array = (1.0 + root) / (1.0 - root)
    return result


def f0_of(ior: Array) -> Array:
    """The reflectance head-on of a dielectric: the inverse of ``ior_of``."""
    result: Array = ((ior - 1.0) / (ior + 1.0)) ** 2
    return result


def multiscatter_share(reflectance: Array, white: Array) -> Array:
    """Share of multiply scattered light that leaves the surface in the end.

    reflectance: mean of a facet's. white: see ``mean_albedo``. As in Cycles (Kulla, Conty 2017).
    """
    share: Array = reflectance * white / (1.0 - reflectance * (1.0 - white))
    return share


def mean_albedo(roughness: Array) -> tuple[Array, Array]:
    """Mean albedo of facets (n,) over the hemisphere: of white ones, and of a dielectric layer, (n,) each.

    Single scattering alone. The layer's is that of (F - F0) / (1 - F0) at USUAL_IOR.
    """
    # Unlike clip, these replace NaN.
    place = np.fmin(np.fmax(roughness, 0.0), 1.0) * (ROUGH_STEPS - 1)
    below = np.minimum(place.astype(np.intp), ROUGH_STEPS - 2)
    # Only steps next to some roughness: each takes as long as 10,000 hits.
    _tabulate(np.concatenate([below, below + 1]))
    table = _MEANS
    share = place - below
    white, layered = table[:, below] * (1.0 - share) + table[:, below + 1] * share
    return white, layered


class AlbedoCurves(NamedTuple):
    """Albedo of the facets of M materials by the cosine to the viewer, in VIEWS columns.

    row: (M,) the entry where a material's curve begins in the tables (ROUGH_STEPS · VIEWS,). compensation:
    multiple over single scattering of white facets. schlick: albedo of facets that reflect (1 - cos)⁵.
    layer: as in ``mean_albedo``.
    """

    row: IndexArray
    compensation: Single
    schlick: Single
    layer: Single

    @classmethod
    def of(cls, roughness: Array) -> AlbedoCurves:
        """The curves at roughnesses (M,), rounded to the steps."""
        step = np.rint(np.fmin(np.fmax(roughness, 0.0), 1.0) * (ROUGH_STEPS - 1)).astype(np.intp)
        _tabulate(step)
        return cls(step * VIEWS, *_CURVES)


# The middles of the columns, and their weights in the mean of a curve over the hemisphere.
_VIEW = (np.arange(VIEWS) + 0.5) / VIEWS
_MEAN = 2.0 * _VIEW / VIEWS
# Curves by step of roughness, and their means, both of ``mean_albedo``; and which of them are filled in.
_CURVES: Single = np.zeros((3, ROUGH_STEPS * VIEWS), np.float32)
_MEANS = np.zeros((2, ROUGH_STEPS))
_KNOWN = np.zeros(ROUGH_STEPS, bool)


def _tabulate(steps: IndexArray) -> None:
    """Fill the tables in at steps of roughness (n,). Threads that do so at once write the same."""
    wanted = np.zeros(ROUGH_STEPS, bool)
    wanted[steps] = True
    for step in np.flatnonzero(wanted & ~_KNOWN):
        curves = _curves(int(step))
        _MEANS[:, step] = curves[[0, 2]] @ _MEAN
        _CURVES[:, step * VIEWS : (step + 1) * VIEWS] = 1.0 / curves[0] - 1.0, curves[1], curves[2]
        _KNOWN[step] = True


@cache
def _curves(step: int) -> Array:
    """Albedo of facets by the cosine to the viewer, (3, VIEWS), at a step of roughness.

    Single scattering of white facets, of those that reflect by Schlick's (1 - cos)⁵, and of the layer as in
    ``mean_albedo``.
    """
    at = np.maximum(np.linspace(0.0, 1.0, COSINES) ** 2, 1e-4)
    view_cosine = at.repeat(FACETS)
    view = np.stack([np.sqrt(1.0 - view_cosine**2), 0.0 * view_cosine, view_cosine])
    share = np.tile((np.arange(FACETS)[:, None] * R2_STEP % 1.0).T, COSINES)
    alpha = np.full_like(view_cosine, (step / (ROUGH_STEPS - 1)) ** 2)
    facet = visible_normals(view, alpha, share)
    cosine = dot_row(facet, view)
    passed = masking_shadowing(view, 2.0 * cosine * facet - view, alpha)
    f0 = f0_of(np.array(USUAL_IOR))
    layered = (fresnel_dielectric(cosine, np.array(USUAL_IOR))[0] - f0) / (1.0 - f0)
    each = [passed, passed * (1.0 - cosine[0]) ** 5, passed * layered]
    white, grazing, layered = (values.reshape(COSINES, FACETS).mean(axis=1) for values in each)
    return np.stack([np.interp(_VIEW, at, values) for values in (white, grazing, layered)])
