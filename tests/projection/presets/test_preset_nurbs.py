# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets with NURBS surfaces and B-spline projectors: what they mean and what is refused."""

import json

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import (
    PresetError,
    load_preset,
    preset_to_json,
)
from scfpf_addon.projection.surfaces.kinds import surface_from_parameters
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch

NET = [[[x, y, x * y, 1 + y] for x in range(4)] for y in range(3)]


def load(projectors="B_SPLINE", **changes):
    near = {"name": "Near", "kind": "PLANE", "width": 1, "height": 1}
    far = {"name": "Far", "kind": "NURBS", "points": NET, "order_u": 4, "order_v": 3} | changes
    base = {
        "format": 1,
        "name": "Trial",
        "description": "",
        "source": "",
        "basis": projectors,
        "reparameterisation": "RECTANGLE",
        "u_range": [0, 1],
        "v_range": [0, 1],
        "aspect": 2.0,
        "fit": "WIDTH",
        "surfaces": [near, near, near, near, far],
    }
    return load_preset(json.dumps(base))


def test_a_nurbs_surface_is_read_fitted_and_written():
    preset = load(location=[0, 0, -5])
    surface = preset.surfaces[-1].surface()
    assert (surface.along_u, surface.along_v) == (NurbsAxis(4), NurbsAxis(3))
    assert np.array_equal(surface.points, np.array(NET, float))
    assert preset.volume().basis == "B_SPLINE" and len(preset.volume().spans.matrices) == 2
    wide = preset.fitted(4.0).surfaces[-1].points
    assert np.array_equal(wide, np.array(NET) * [2, 1, 1, 1])
    again = load_preset(preset_to_json(preset))
    assert again.basis == preset.basis and again.surfaces[-1].parameters == preset.surfaces[-1].parameters
    assert np.array_equal(again.surfaces[-1].points, surface.points)


def test_weights_may_be_left_out():
    net = np.array(NET, float)[..., :3]
    surface = load(points=net.tolist()).surfaces[-1].surface()
    assert np.array_equal(surface.points, net)
    u, v = np.random.default_rng(1).uniform(size=(2, 9))
    expected = NurbsPatch(net, NurbsAxis(4), NurbsAxis(3)).evaluate(u, v).position
    assert np.array_equal(surface.evaluate(u, v).position, expected)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"order_u": 5}, "surface 5 'Far': order_u: order 5 needs at least 5 control points, not 4"),
        ({"order_v": 2.5}, "order_v must be a whole number"),
        ({"order_v": 1}, "order_v must be a number between 2 and 6"),
        ({"points": NET[:2]}, "at least 3 × 3"),
        ({"points": [row[:2] for row in NET]}, "at least 3 × 3"),
        ({"points": [[[0, 0, 0, 0]] * 4] * 3}, "every weight must be a number above 0"),
        ({"points": [[[0, 0, 0, -1]] * 4] * 3}, "every weight must be a number above 0"),
        ({"points": [[[0, 0, 0, 1, 2]] * 4] * 3}, "[x, y, z, weight]"),
        ({"points": [*NET[:2], [[0, 0, 0]] * 4]}, "[x, y, z, weight]"),
        ({"cyclic_u": True}, "unknown key 'cyclic_u'"),
    ],
)
def test_what_is_no_nurbs_surface_is_refused(changes, message):
    with pytest.raises(PresetError) as caught:
        load(**changes)
    assert message in str(caught.value)


def test_an_unknown_basis_is_refused():
    with pytest.raises(PresetError, match="basis must be one of BEZIER, POLYLINE, B_SPLINE"):
        load("CATMULL")


@pytest.mark.parametrize("parameters", [{}, {"order_u": 3.0}, {"order_u": 3.0, "order_v": 2.5}])
def test_orders_are_needed(parameters):
    with pytest.raises(ValueError, match=r"needs order_[uv], a whole number"):
        surface_from_parameters("NURBS", parameters, np.zeros((3, 3, 3)), np.eye(4))
