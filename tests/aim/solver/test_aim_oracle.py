# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of aiming beside that of SciPy's least_squares, a trust region on the same kind of residuals."""

from math import comb

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from scfpf_addon.aim.solver.control_net import ControlNet
from scfpf_addon.aim.solver.gauss_newton import Aim
from scfpf_addon.aim.solver.problem import AimPins, AimProblem, AimStays, AimWeights
from scfpf_addon.aim.solver.start import start_volume
from scfpf_addon.aim.solver.vectors import nearest_t
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, ASPECT, DEPTH = 400, 1.5, 8.0
WEIGHTS = AimWeights(smooth=0.02, home=0.01)


def plane(depth):
    """The plane of a perspective with half a width of 0.5 at distance 1."""
    corners = [[[0.5 * x * depth, 0.5 * y / ASPECT * depth, -depth] for x in (-1, 1)] for y in (-1, 1)]
    straight = NurbsAxis(order=2)
    return NurbsPatch(np.array(corners), straight, straight)


def at(x, y, depth):
    """World points (3, ...) at image positions of the start."""
    return np.stack([(x - 0.5) * depth, (y - 0.5) / ASPECT * depth, -depth + 0 * x])


def asked():
    """A pin that is shifted, and stays on a wall behind it: 6 × 5 control points, 60 moving ones."""
    projection = Projection(ViewingVolume((plane(0.5), plane(20.0))), aspect=ASPECT)
    start = start_volume(projection, WIDTH, (6, 5), 2, subject=0.4)
    grid = np.linspace(0.0, 1.0, 7)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    points, volume = at(x, y, 12.0), ViewingVolume(start.patches)
    t = nearest_t(volume.controls(x.ravel(), y.ravel()).points, points.reshape(3, -1))
    stays = AimStays(grid, grid, points, t.reshape(7, 7), np.ones((7, 7)))
    pins = AimPins(at(np.array([0.53]), np.array([0.47]), DEPTH), np.array([[0.5], [0.5]]))
    return AimProblem(start.patches, WIDTH, ASPECT, pins, (stays,), weights=WEIGHTS)


def differences(values, order, axis):
    return np.diff(values, order, axis=axis).ravel()


def basis(count, places, order=0):
    """Values or derivatives of the clamped cubic B-splines at places, (places, count), by SciPy."""
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, count - 2), np.ones(3)])
    return BSpline(knots, np.eye(count), 3)(places, nu=order)


def bezier(control, t):
    """Points (N, 3) of quadratic curves (N, 3, 3) at t (N,)."""
    return sum(comb(2, k) * ((1 - t) ** (2 - k) * t**k)[:, None] * control[:, k] for k in range(3))


def tangent_of(control, t):
    """Their derivatives."""
    return 2 * (
        (1 - t)[:, None] * (control[:, 1] - control[:, 0]) + t[:, None] * (control[:, 2] - control[:, 1])
    )


def residuals_of(problem, aim):
    """The residuals that ``AimWeights`` defines, as a function of a flat vector, without the product's code.

    Unknowns are the moving control points and t of the pin; t of the stays is where projectors are nearest.
    """
    net, start, w = aim.net, aim.start, problem.weights
    (stays,), fine = problem.stays, (net.columns / 8, net.rows / 6)
    points = stays.points.reshape(3, -1).T
    share = np.sqrt(512 / stays.weights.size)

    def surfaces(x, y, order=0):
        """From control points to those of projectors at all pairs of places, or their derivatives by u."""
        both = np.kron(basis(net.columns, x, order), basis(net.rows, y))
        return lambda control: np.tensordot(both, control, 1)

    at_pin = surfaces(*problem.pins.positions)
    at_stays, along_u = surfaces(stays.x, stays.y), surfaces(stays.x, stays.y, 1)

    def nearest(control):
        t = np.full(len(points), 0.6)
        for _ in range(4):
            dt = tangent_of(control, t)
            t = t + ((points - bezier(control, t)) * dt).sum(axis=1) / (dt**2).sum(axis=1)
        dt = tangent_of(control, t)
        return t, dt / np.linalg.norm(dt, axis=1, keepdims=True)

    straight = nearest(at_stays(start))[1]
    home = aim.t.copy()

    def residuals(unknowns):
        moved = start.copy()
        moved[:, 1:] += unknowns[:-1].reshape(net.points, 2, 3)
        pin = bezier(at_pin(moved), home + unknowns[-1]) - problem.pins.points.T
        control = at_stays(moved)
        t, ahead = nearest(control)
        du = bezier(along_u(moved), t)
        pixel = np.linalg.norm(du - (du * ahead).sum(axis=1, keepdims=True) * ahead, axis=1) / WIDTH
        off = np.linalg.norm(bezier(control, t) - points, axis=1) / pixel
        robust = 1.0 / np.sqrt(1.0 + (off / w.robust) ** 2)
        turn = straight - (straight * ahead).sum(axis=1, keepdims=True) * ahead
        steady = np.degrees(np.linalg.norm(turn, axis=1)) * robust**2
        d = (moved - start)[:, 1:].reshape(net.columns, net.rows, 2, 3) / aim.footprints[:, None]
        return np.concatenate(
            [
                (w.pin * pin / aim.pin_energy.footprint).ravel(),
                [w.depth * unknowns[-1]],
                share * w.stay * off * robust,
                share * w.stay * w.stay_direction * steady,
                w.smooth * fine[0] ** 1.5 * np.diff(d, 2, axis=0).ravel(),
                w.smooth * fine[1] ** 1.5 * np.diff(d, 2, axis=1).ravel(),
                1.4 * w.smooth * np.diff(np.diff(d, axis=0), axis=1).ravel(),
                0.3 * w.smooth * fine[0] ** 0.5 * np.diff(d, axis=0).ravel(),
                0.3 * w.smooth * fine[1] ** 0.5 * np.diff(d, axis=1).ravel(),
                0.3 * w.smooth * np.diff(d, axis=2).ravel(),
                w.home * d.ravel(),
            ]
        )

    return residuals


def test_scipy_finds_no_smaller_energy_from_there():
    problem = asked()
    aim = Aim(problem)
    assert aim.net == ControlNet(6, 5, 3)
    residuals = residuals_of(problem, aim)
    home, result = aim.t.copy(), aim.solve()
    moved = aim.net.gather(result.patches)
    own = np.append((moved - aim.start)[:, 1:].ravel(), result.t - home)
    found = (residuals(own) ** 2).sum()
    oracle = least_squares(residuals, own, x_scale="jac", max_nfev=4)
    assert found < 1e-4 * (residuals(np.zeros(181)) ** 2).sum()
    assert found < 1.03 * (oracle.fun**2).sum()
    # The pin is where SciPy has it, to a tenth of a pixel: its rows are the first three.
    apart = residuals(own)[:3] - oracle.fun[:3]
    assert np.linalg.norm(apart) < 0.1 * problem.weights.pin
