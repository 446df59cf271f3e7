# SPDX-License-Identifier: GPL-3.0-or-later
"""Highlights of rough surfaces: facets by GGX, shadowed by Smith (Walter et al. 2007, Heitz 2014)."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...projection.typing import Array, IndexArray
from ..nodes.context import dot
from ..nodes.inputs import fresnel_dielectric
from ..typing import Single
from .reflection import EVEN, passed_on, visible_facets

# The mean of Schlick's (1 - cos)⁵ over the hemisphere.
SCHLICK_MEAN = 1.0 / 21.0
# The mean over the hemisphere of how much of the way from head-on to all a dielectric's reflection is, at an
# index of refraction of 1.5.
FRESNEL_MEAN = 0.0540
# Steps of roughness, the numbers that people choose, and of the cosine to the viewer in tables of what
# surfaces reflect.
ROUGH_STEPS, VIEWS = 101, 1024
# Cosines that a row of these is made from, more of them where it is seen edge-on, and draws for each.
COSINES, DRAWS = 24, 256
# A layer's share of grazing light is tabulated for this index of refraction; others differ by 0.02 at most.
USUAL_IOR = 1.5
# Cosine to the viewer below which a surface counts as seen edge-on.
EDGE_ON = np.float32(1e-4)
TINY = np.float32(1e-30)


def facets(lit: Single, facing: Single, between: Single, alpha: Single) -> tuple[Single, Single]:
    """Radiance of a white surface by irradiance, (N,), and the cosine of light and viewer to facets, (N,).

    lit, facing, between: (N,) of the angles from normal to lamp, not below 0, from normal to viewer, and from
    lamp to viewer. alpha: (N,) or (1,), the square of GGX's α. Of what is turned away from the lamp any
    number comes out.
    """
    facing = np.maximum(facing, EDGE_ON)
    # Half the square of the half vector's length, which is all that counts of it.
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
    # Never below EDGE_ON · α, so that nothing is divided by 0.
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
    """Schlick's share of grazing light, (1 - cos)⁵, (N,)."""
    away = 1 - cosine
    fourth = away * away
    fourth *= fourth
    away *= fourth
    return away


def dielectric_share(cosine: Single, ior: Single) -> Single:
    """As ``fresnel_dielectric`` from the thinner side, in float32. cosine: (N,), ior: (N,) or (1,)."""
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
    """The root that Smith's masking has for a cosine, (N,)."""
    root = cosine * cosine
    root *= rest
    root += alpha
    return np.sqrt(root, out=root)


def sent_again(reflected: Array, white: Array) -> Array:
    """Share of the light that facets send to each other which leaves the surface in the end.

    reflected: mean reflectance of a facet. white: see ``mean_reflectance``. As in Cycles (Kulla, Conty 2017).
    """
    share: Array = reflected * white / (1.0 - reflected * (1.0 - white))
    return share


def mean_reflectance(roughness: Array) -> tuple[Array, Array]:
    """What facets (n,) reflect in even light, as a mean over where they are seen from, (n,) each.

    At once of white ones, and of those that do by how much of the way from head-on to all Fresnel's
    reflection is.
    """
    # Not by clip, which leaves NaN as it is.
    place = np.fmin(np.fmax(roughness, 0.0), 1.0) * (ROUGH_STEPS - 1)
    below = np.minimum(place.astype(np.intp), ROUGH_STEPS - 2)
    # Only steps that some material lies between: a scene has few, and each takes as long as 10,000 hits.
    wanted = np.zeros(ROUGH_STEPS, bool)
    wanted[below], wanted[below + 1] = True, True
    table = np.zeros((2, ROUGH_STEPS))
    for step in np.flatnonzero(wanted):
        table[:, step] = _curves(int(step))[[0, 2]] @ _MEAN
    share = place - below
    white, layered = table[:, below] * (1.0 - share) + table[:, below + 1] * share
    return white, layered


def seen_rows(roughness: Array) -> tuple[IndexArray, Single]:
    """Where rows of roughness (n,) begin, (n,), in tables by where they are seen from, (3, R · VIEWS).

    Of VIEWS cosines each: the light that facets send to each other by what they send on at once, a metal's
    share of grazing light and a layer's.
    """
    step = np.rint(np.fmin(np.fmax(roughness, 0.0), 1.0) * (ROUGH_STEPS - 1)).astype(np.intp)
    wanted = np.zeros(ROUGH_STEPS, bool)
    wanted[step] = True
    steps = np.flatnonzero(wanted)
    curves = np.stack([_curves(int(each)) for each in steps], axis=1)
    rows = np.stack([1.0 / curves[0] - 1.0, curves[1], curves[2]]).astype(np.float32)
    return (np.cumsum(wanted) - 1)[step] * VIEWS, rows.reshape(3, -1)


# The middles of the columns, and what each counts in the mean of a curve over the hemisphere.
_VIEW = (np.arange(VIEWS) + 0.5) / VIEWS
_MEAN = 2.0 * _VIEW / VIEWS


@cache
def _curves(step: int) -> Array:
    """What facets reflect in even light by where they are seen from, (3, VIEWS), at the roughness of a step.

    At once of white ones, of those that reflect by Schlick's (1 - cos)⁵, and as ``mean_reflectance`` has it.
    """
    at = np.maximum(np.linspace(0.0, 1.0, COSINES) ** 2, 1e-4)
    view_cosine = at.repeat(DRAWS)
    view = np.stack([np.sqrt(1.0 - view_cosine**2), 0.0 * view_cosine, view_cosine])
    share = np.tile((np.arange(DRAWS)[:, None] * EVEN % 1.0).T, COSINES)
    alpha = np.full_like(view_cosine, (step / (ROUGH_STEPS - 1)) ** 2)
    facet = visible_facets(view, alpha, share)
    cosine = dot(facet, view)
    passed = passed_on(view, 2.0 * cosine * facet - view, alpha)
    f0 = ((USUAL_IOR - 1.0) / (USUAL_IOR + 1.0)) ** 2
    layered = (fresnel_dielectric(cosine, np.array(USUAL_IOR))[0] - f0) / (1.0 - f0)
    each = [passed, passed * (1.0 - cosine[0]) ** 5, passed * layered]
    white, grazing, layered = (values.reshape(COSINES, DRAWS).mean(axis=1) for values in each)
    return np.stack([np.interp(_VIEW, at, values) for values in (white, grazing, layered)])
