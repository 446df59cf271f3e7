# SPDX-License-Identifier: GPL-3.0-or-later
"""The preset of triangular tiles: each a general linear camera of its three rays, together continuous.

Yu and McMillan, A Framework for Multiperspective Rendering (EGSR 2004): the image is cut into triangles;
in each of them rays are the affine combinations of those of its corners, on two parallel planes.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.casting.frame import cast_frame
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.presets.preset import PresetError, load_preset, preset_to_json, read_preset
from scfpf_addon.projection.surfaces.uv_chart import UVChart

FILE = Path(__file__).resolve().parents[3] / "presets" / "multiperspective_tiles.json"
# A few roundings of float64, lengths being some tens.
EXACT = 1e-12
# Weights of three places well inside of a triangle, and what leads from these to its corners.
INSIDE = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
OUTWARDS = np.linalg.inv(INSIDE)


@pytest.fixture(scope="module")
def shown():
    return read_preset(FILE)


def tiles(shown):
    """The UVs of the triangles' corners, (T, 3, 2), and the vertices' numbers, (T, 3)."""
    chart = shown.surfaces[0].chart
    return np.asarray(chart.uv), np.asarray(chart.vertices)


def rays(volume, uv):
    """(4, N): where projectors meet the plane through the camera, and their slopes against depth."""
    uv = uv.reshape(-1, 2)
    near, far = (volume.evaluate(*uv.T, np.full(len(uv), t)).position for t in (0.25, 0.75))
    slope = (far[:2] - near[:2]) / (near[2] - far[2])
    return np.concatenate([near[:2] + slope * near[2], slope])


def corner_rays(shown, aspect):
    """(4, T, 3): each triangle's affine map, told from its inside, at its corners."""
    uv, _ = tiles(shown)
    inner = np.einsum("kc,tcx->tkx", INSIDE, uv)
    found = rays(shown.projection(aspect).volume, inner).reshape(4, len(uv), 3)
    return found @ OUTWARDS.T


@pytest.mark.parametrize("aspect", [16 / 9, 0.8])
def test_each_tile_is_the_linear_camera_of_its_corners(shown, aspect):
    uv, _ = tiles(shown)
    share = np.random.default_rng(1).dirichlet(np.ones(3), size=(len(uv), 40))
    there = np.einsum("tnc,tcx->tnx", share, uv)
    found = rays(shown.projection(aspect).volume, there).reshape(4, len(uv), -1)
    combined = np.einsum("tnc,ktc->ktn", share, corner_rays(shown, aspect))
    assert np.abs(found - combined).max() < EXACT * np.abs(found).max()


def test_tiles_that_meet_agree_along_their_edge_and_differ_beyond_it(shown):
    """From both sides, each triangle continued: one ray a vertex, and so one ray a place of an edge."""
    found = corner_rays(shown, shown.aspect)
    _, vertices = tiles(shown)
    for vertex in range(vertices.max() + 1):
        one = found[:, vertices == vertex]
        assert np.ptp(one, axis=1).max() < EXACT * np.abs(found).max()
    edges = {}
    for number, corners in enumerate(vertices):
        for k in range(3):
            edges.setdefault(frozenset(corners[[k, k - 1]]), []).append(number)
    pairs = [both for both in edges.values() if len(both) == 2]
    assert len(vertices) == 16 and len(pairs) == 18 and max(map(len, edges.values())) == 2
    volume, (uv, _) = shown.volume(), tiles(shown)
    kinked = 0
    for first, second in pairs:
        common = np.isin(vertices[first], vertices[second])
        ends, beyond = uv[first][common], uv[first][~common][0]
        place = ends.mean(axis=0)
        # The same step to either side of the edge changes the ray differently: another camera begins there.
        step = 0.01 * (beyond - place)
        here, there = (
            rays(volume, place + sign * step)[:, 0] - rays(volume, place)[:, 0] for sign in (1, -1)
        )
        kinked += np.abs(here + there).max() > 1e-3
    assert kinked >= 16


def test_the_tiles_fill_the_image_and_are_cameras_of_several_types(shown):
    """Twice the area of the rays' triangle at depth λ is Aλ² + Bλ + C: its roots are slits, if there are."""
    uv, _ = tiles(shown)
    side, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = (side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]) / 2
    assert (area > 0).all() and area.sum() == pytest.approx(1, abs=1e-12)
    s, t, across, up = corner_rays(shown, shown.aspect)

    def doubled(a, b):
        return (a[:, 1] - a[:, 0]) * (b[:, 2] - b[:, 0]) - (a[:, 2] - a[:, 0]) * (b[:, 1] - b[:, 0])

    a, b, c = doubled(across, up), doubled(s, up) + doubled(across, t), doubled(s, t)
    slits = b**2 - 4 * a * c
    assert (slits > 1e-6).any(), "no crossed slits"
    depth = np.linspace(0, 32, 65)
    assert ((a * depth[:, None] + b) * depth[:, None] + c > 0).all(), (
        "no tile turns inside out within the volume"
    )


def test_the_caster_shows_each_tile_s_own_image_of_a_wall(shown):
    """A wall square to the view at depth 20, in patches: first hits are where the tiles' rays meet it."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-20, 20, 21), np.linspace(-20, 20, 21)))
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    quads = np.stack([corner, corner + 1, corner + 22, corner + 21], 1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    scene = CastScene(np.stack([x, y, np.full_like(x, -20.0)], 1), triangles)
    width, height = 96, 54
    projection = shown.projection(width / height)
    for pixel_error in (0.1, 0.0):
        hits = cast_frame(scene, projection, width, height, pixel_error, threads=1)
        assert (hits.triangle >= 0).all()
        vertices = np.stack([x, y, np.full_like(x, -20.0)], 1)
        corners = vertices[triangles[hits.triangle]]
        second, third = hits.barycentric
        met = np.einsum("kn,nkc->cn", np.stack([1 - second - third, second, third]), corners)
        px, py = (
            a.ravel()
            for a in np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        )
        uv, _ = tiles(shown)
        edges = uv[:, 1:] - uv[:, :1]
        weights = np.einsum(
            "tij,tnj->tni", np.linalg.inv(edges.transpose(0, 2, 1)), np.stack([px, py], 1) - uv[:, :1]
        )
        weights = np.concatenate([1 - weights.sum(axis=2, keepdims=True), weights], axis=2)
        tile = weights.min(axis=2).argmax(axis=0)
        s, t, across, up = np.einsum(
            "nc,knc->kn", weights[tile, np.arange(len(px))], corner_rays(shown, width / height)[:, tile]
        )
        assert np.allclose(met[0], s + 20 * across, rtol=0, atol=1e-9)
        assert np.allclose(met[1], t + 20 * up, rtol=0, atol=1e-9)


def changed(**values):
    data = json.loads(FILE.read_text(encoding="utf-8"))
    data["surfaces"][0].update(values)
    return json.dumps(data)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"triangles": [[0, 1, 15]]}, "between 0 and 14"),
        ({"triangles": [[0, 1, 2.5]]}, "whole numbers from 0 to 14"),
        ({"triangles": [[0, 1]]}, "rows of 3 numbers"),
        ({"triangles": []}, "rows of 3 numbers"),
        ({"triangles": [[0, 1, True]]}, "numbers between"),
        ({"triangles": [[0, 1, 2]]}, "no triangle has an area"),
        ({"uv": [[0, 0]]}, "as many as the points, 15, not 1"),
        ({"uv": [["0", 0]] * 15}, "numbers between"),
        ({"uv": [[1e300, 0]] * 15}, "between -1000 and 1000"),
        ({"points": [[0, 0, 10**400]] * 15}, "numbers between"),
        ({"points": [[0, 0, float("nan")]] * 15}, "numbers between"),
        ({"points": 7}, "rows of 3 numbers"),
        ({"order_u": 4}, "unknown key"),
    ],
)
def test_bad_meshes_say_what_is_wrong(values, message):
    with pytest.raises(PresetError, match=message) as raised:
        load_preset(changed(**values))
    assert str(raised.value).startswith("surface 1 'Near'")


def test_meshes_are_bounded(monkeypatch):
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_NUMBERS", 47)
    with pytest.raises(PresetError, match="too many numbers, at most 47"):
        load_preset(changed())


LIMITS = "scfpf_addon.projection.file_limits"


def heap(count, size=1.0, corner=0.0):
    """Triangles in the UV square that lie on one another, or cross as thin ones do, as values of a mesh."""
    turn = np.linspace(0, 0.5 * np.pi, count)
    tips = corner + size * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    uv = np.concatenate([np.full((1, 2), corner), tips, tips + np.array([0.0, 1e-4])]).clip(0, 1)
    number = np.arange(1, count + 1)
    triangles = np.stack([np.zeros(count, int), number, number + count], axis=1)
    points = np.concatenate([uv, np.full((len(uv), 1), -1.0)], axis=1)
    return {"points": points.tolist(), "uv": uv.tolist(), "triangles": triangles.tolist()}


def test_heaps_of_triangles_are_refused_before_anything_is_looked_up():
    """The same triangle 3,000 times; thin ones that cross; small ones in a corner."""
    once = {"points": [[-1, -1, -1], [1, -1, -1], [-1, 1, -1]], "uv": [[0, 0], [1, 0], [0, 1]]}
    heaps = [once | {"triangles": [[0, 1, 2]] * 3000}, heap(6000), heap(6000, 1e-3, 0.25)]
    for values in heaps:
        with pytest.raises(PresetError, match="too many triangles overlap in the UV square, at most 2048"):
            load_preset(changed(**values))
    load_preset(changed(**once | {"triangles": [[0, 1, 2]] * 2000}))
    away = once | {"uv": [[0, 0], [1, 0], [0, 1]] + [[5, 5]] * 3, "points": once["points"] * 2}
    away["triangles"] = [[0, 1, 2]] + [[3, 4, 5]] * 10_001
    with pytest.raises(PresetError, match="10001 triangles meet at one point, at most 10000"):
        load_preset(changed(**away))


def test_no_look_up_tests_more_triangles_than_is_said():
    """Random triangles: the most of a place, counted one by one in float64, are in the bins' longest list."""
    generator = np.random.default_rng(4)
    for count, size in ((40, 1.0), (300, 0.2), (2000, 0.05)):
        uv = generator.random((count, 1, 2)) + size * generator.normal(size=(count, 3, 2))
        chart = UVChart(uv, np.arange(3 * count).reshape(-1, 3))
        place = generator.random((200, 2))
        sides = np.roll(uv, -1, axis=1) - uv
        away = place[:, None, None] - uv
        turn = sides[..., 0] * away[..., 1] - sides[..., 1] * away[..., 0]
        inside = (turn >= 0).all(axis=2) | (turn <= 0).all(axis=2)
        most = inside.sum(axis=1).max()
        assert most <= chart.most_overlaps
        assert chart.mean_overlaps <= chart.most_overlaps


def test_a_point_with_two_places_in_the_map_stands_twice_in_a_file(shown):
    """A seam: file and preset have the same triangles all the same."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.array([[[0, 0], [0.5, 0], [0.5, 1]], [[0.5, 0], [1, 1], [0.5, 1]]])
    seamed = replace(shown.surfaces[0], points=points, chart=UVChart(uv, corners))
    again = load_preset(preset_to_json(replace(shown, surfaces=(seamed, *shown.surfaces[1:])))).surfaces[0]
    assert len(again.points) == 6
    assert np.array_equal(again.points[again.chart.vertices], points[corners])
    assert np.array_equal(again.chart.uv, uv)
