# SPDX-License-Identifier: GPL-3.0-or-later
"""Detours: where projectors may pass what hides their pins, found by casting bent projectors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.bezier import bernstein
from .aim_scene import AimScene
from .judge import Judgement
from .released import Released
from .solver.control_net import position_and_tangent
from .solver.problem import AimDetours, AimProblem, AimResult, AimStays
from .solver.start import projection_of
from .solver.vectors import across_of, cross, dot, unit

# Displacements that are tried at the obstacle: in so many directions, by these shares of the image's width.
RING, SIZES = 16, (0.02, 0.04, 0.06, 0.08, 0.12, 0.16, 0.24)
# An obstacle is bent round before this share of the pin's t: nearer to the pin no bend is smooth.
LAST_SHARE = 0.85
# Projectors are free if they reach so much of t before their pin.
NEARER = 0.01
_FIELDS = ("pins", "t", "points", "passes")
# What stays of an obstacle is released within so many displacements of where projectors meet it.
RELEASED = 4.0


def free_pins(
    scene: AimScene, problem: AimProblem, wanted: BoolArray, result: AimResult, judgement: Judgement
) -> tuple[AimProblem, Released] | None:
    """The problem whose detours free hidden pins of a result, and what it releases; None if nothing helps.

    wanted: (T,), the triangles of the things that pins show, which are not to be passed.
    """
    own = np.unique(scene.objects[wanted])
    hidden = (judgement.hidden_by >= 0) & ~np.isin(judgement.hidden_by, own)
    if problem.first_hits is None or not hidden.any():
        return None
    controls = projection_of(result.patches, problem.aspect).volume.controls(*problem.pins.positions)
    found, met = [], []
    groups = np.where(problem.pins.views >= 0, problem.pins.views, -1 - np.arange(problem.pins.count))
    for group in np.unique(groups[hidden]):
        pins = np.flatnonzero(groups == group)
        part = _detours(problem, result, controls.points[..., pins], pins, hidden[pins])
        if part is not None:
            found.append(part)
            met.append(part.points[:, hidden[pins]])
    if not found:
        return None
    joined = AimDetours(*(np.concatenate([getattr(d, n) for d in found], axis=-1) for n in _FIELDS))
    shift = joined.passes - joined.points
    reach = RELEASED * float(np.sqrt(dot(shift, shift).max()))
    released = Released(np.unique(judgement.hidden_by[hidden]), np.hstack(met), reach)
    stays = tuple(_without(scene, problem, stay, released) for stay in problem.stays)
    return replace(problem, stays=stays, detours=joined, solved=result), released


def _detours(
    problem: AimProblem, result: AimResult, controls: Array, pins: IndexArray, hidden: BoolArray
) -> AimDetours | None:
    """The least displacement of a view's projectors that frees most of its pins; None if it frees no more.

    controls: (surfaces, 3, P) of its pins. hidden: (P,). All pins of a view are displaced equally, so that
    neighbouring projectors do not pass an obstacle on different sides.
    """
    assert problem.first_hits is not None
    pin_t, hits = result.t[pins], problem.first_hits(controls)
    met = hidden & (hits.t < pin_t)
    if not met.any():
        return None
    t = np.minimum(np.where(met, hits.t, np.median(hits.t[met])), LAST_SHARE * pin_t)
    shifts = _shifts(problem, result, pins, t)
    bent = np.repeat(controls[..., None], shifts.shape[2], axis=3)
    bent[1:] += _bump(len(controls) - 1, t, pin_t)[:, None, :, None] * shifts
    seen = problem.first_hits(bent.reshape(*controls.shape[:2], -1))
    is_free = seen.wanted | (seen.t >= np.repeat(pin_t - NEARER, shifts.shape[2]))
    free = is_free.reshape(len(pins), -1).sum(axis=0)
    best = int(free.argmax())
    position, _ = position_and_tangent(controls, t)
    return AimDetours(pins, t, position, position + shifts[:, :, best]) if free[best] > free[0] else None


def _shifts(problem: AimProblem, result: AimResult, pins: IndexArray, t: Array) -> Array:
    """Displacements across the projectors of pins at t (P,), (3, P, K): none, then the least ones first."""
    volume = projection_of(result.patches, problem.aspect).volume
    u, v = problem.pins.positions[:, pins]
    sample = volume.evaluate(u, v, t)
    tangent = unit(sample.dt)
    right = unit(across_of(sample.du, tangent))
    up = cross(right, tangent)
    angles = np.tile(np.arange(RING) * (2.0 * np.pi / RING), len(SIZES))
    width = float(np.median(np.sqrt(dot(sample.du, sample.du))))
    sizes = width * np.repeat(SIZES, RING)
    ring: Array = sizes * (np.cos(angles) * right[:, :, None] + np.sin(angles) * up[:, :, None])
    return np.concatenate([np.zeros((3, len(pins), 1)), ring], axis=2)


def _bump(degree: int, t: Array, pin_t: Array) -> Array:
    """The least weights (degree, P) of the moving surfaces that displace Q(t) by 1 and keep Q(pin_t)."""
    there, kept = bernstein(degree, t)[1:], bernstein(degree, pin_t)[1:]
    a, b, c = ((x * y).sum(axis=0) for x, y in ((there, there), (there, kept), (kept, kept)))
    found: Array = (there * c - kept * b) / (a * c - b * b)
    return found


def _without(scene: AimScene, problem: AimProblem, stays: AimStays, released: Released) -> AimStays:
    """Stays without those on what is released."""
    x, y = np.repeat(stays.x, len(stays.y)), np.tile(stays.y, len(stays.x))
    hits = scene.hits(projection_of(problem.patches, problem.aspect), x, y, problem.width)
    objects = np.where(hits.triangle >= 0, scene.objects[hits.triangle], -1)
    covered = released.covers(stays.points.reshape(3, -1), objects).reshape(stays.weights.shape)
    return replace(stays, weights=np.where(covered, 0.0, stays.weights))
