# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes that look beyond one frame or one projector: motion vectors, chords, cryptomattes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.chord_map import chord_map
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.volume.inverse import follow
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.passes.cryptomatte import CryptoFilm, float_bits, identifiers, manifest, name_hash
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.passes.motion_vectors import Neighbour
from scfpf_addon.shading.sampling.adaptive import Adaptive
from scfpf_addon.shading.sampling.pixel_filter import PixelFilter
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings

# Motion vectors


def bent(build, middle=0.8):
    return build.looking_down(2, 1, -1, shifts=[0, middle, 0])


def test_vectors_lead_to_where_the_neighbours_show_the_same(build):
    """In the other frame's volume the place that the vector leads to holds the moved point."""
    scene = build.scene([build.square(0.8), build.square(0.3, 0.7, (0.2, 0.1))])
    view, before, after = bent(build), bent(build, 0.7), bent(build, 0.95)
    moves = np.array([[0.05, -0.02, 0.01], [-0.04, 0.03, 0.0]])
    vertices = scene.geometry.vertices
    # The upper square moves, the lower one stands still.
    shifted = [np.where(np.arange(len(vertices))[:, None] >= 4, vertices + move, vertices) for move in moves]
    neighbours = tuple(map(Neighbour, (before, after), shifted))
    names = ("VECTOR", "POSITION", "PARAMETERS", "OBJECT_INDEX")
    settings = FrameSettings(
        40, 30, samples=1, pixel_error=0.01, passes=DataPasses(names, neighbours=neighbours)
    )
    made = render_frame(view, replace(scene, object_index=(1, 2)), settings).passes
    hit = made["OBJECT_INDEX"][..., 0] > 0
    upper = made["OBJECT_INDEX"][hit][:, 0] == 2
    assert 30 < upper.sum() < hit.sum()
    rows, columns = np.nonzero(hit)
    x, y = (columns + 0.5) / 40, (rows + 0.5) / 30
    vector = made["VECTOR"][hit].astype(float)
    position = made["POSITION"][hit].astype(float)
    t = made["PARAMETERS"][hit][:, 2]
    for volume, sign, shares, move in (
        (before, 1, vector[:, :2], moves[0]),
        (after, -1, vector[:, 2:], moves[1]),
    ):
        u, v = x + sign * shares[:, 0] / 40, y + sign * shares[:, 1] / 30
        there = position + np.where(upper[:, None], move, 0.0)
        found = follow(volume.volume, there.T, np.stack([u, v, t]))
        assert found.found.all()
        assert np.abs(found.u - u).max() < 1e-5 and np.abs(found.v - v).max() < 1e-5
        assert np.abs(shares).max() > 1
    assert not made["VECTOR"][~hit].any()


def test_without_the_same_triangles_the_volume_alone_moves(build):
    scene = build.scene([build.square(0.8)])
    view = build.looking_down(1, -1)
    shifted = build.looking_down(1, -1, shifts=[0.1, 0.1])
    neighbours = (Neighbour(shifted, None), Neighbour(view, None))
    settings = FrameSettings(20, 20, samples=1, passes=DataPasses(("VECTOR",), neighbours=neighbours))
    vector = render_frame(view, scene, settings).passes["VECTOR"]
    # The image is 2 wide: what stands still moved by a twentieth of 20 pixels to the left.
    assert np.allclose(vector[10, 10], [-1, 0, 0, 0], atol=1e-6)


def test_points_are_followed_beyond_the_image(build):
    volume = build.looking_down(1, -1).volume
    point = np.array([[1.3, 1.8], [0.0, 0.0], [0.0, 0.0]])
    found = follow(volume, point, np.full((3, 2), 0.5))
    assert found.found.tolist() == [True, False]
    assert np.allclose([found.u[0], found.v[0], found.t[0]], [1.15, 0.5, 0.5])


# Chords


def test_chords_of_a_pixel_are_near_its_curve(build):
    scene = build.scene([build.square(0.9), build.sphere(8, (0.2, 0.1, 0.5), 0.4)])
    cast_scene = CastScene(scene.geometry.vertices, scene.geometry.triangles)
    view = bent(build).transformed(cast_scene.matrix)
    x, y = (a.ravel() for a in np.meshgrid((np.arange(32) + 0.5) / 32, (np.arange(24) + 0.5) / 24))
    t = np.where(np.arange(len(x)) % 5, 0.6, np.inf)
    counts = {}
    for error in (1.0, 0.1, 0.01):
        made = chord_map(cast_scene, view, x, y, t, (1 / 32, 1 / 24), error, 32)
        assert 0 < made.error.max() <= 1.05 * error
        assert not made.error[np.isinf(t)].any()
        assert (made.count[np.isinf(t)] >= made.count[np.isfinite(t)].max()).all()
        counts[error] = made.count.max()
    assert counts[1.0] < counts[0.1] < counts[0.01]


def test_straight_projectors_are_one_chord_and_exact_ones_none(build):
    scene = build.scene([build.square(0.9), build.square(0.3, 1.2)])
    names = ("CHORD_COUNT", "CHORD_ERROR")
    settings = FrameSettings(8, 6, samples=1, passes=DataPasses(names))
    made = render_frame(build.looking_down(1, -1), scene, settings).passes
    assert (made["CHORD_COUNT"] == 1).all() and not made["CHORD_ERROR"].any()
    made = render_frame(bent(build), scene, replace(settings, pixel_error=0.0)).passes
    assert not made["CHORD_COUNT"].any() and not made["CHORD_ERROR"].any()
    made = render_frame(bent(build), scene, replace(settings, pixel_error=1e-3)).passes
    assert made["CHORD_COUNT"].max() > 1


# Cryptomatte


@pytest.mark.parametrize(
    ("text", "value"),
    [("", 0), ("a", 0x3C2569B2), ("hello", 0x248BFA47), ("hello, world", 0x149BBB7F)],
)
def test_hashes_are_murmurs(text, value):
    """MurmurHash3 x86 32 of seed 0: the widely published values."""
    assert name_hash(text) == value
    bits = float_bits(name_hash(text))
    number = np.array([bits], np.uint32).view(np.float32)[0]
    assert np.isfinite(number) and abs(number) >= np.finfo(np.float32).tiny


def test_manifest_names_what_is_in_the_image():
    names = ["Würfel", "Cube.001"]
    read = json.loads(manifest(names))
    bits = identifiers(names).view(np.uint32)
    assert read == {name: f"{value:08x}" for name, value in zip(names, bits.tolist(), strict=True)}


def test_shares_are_counted_and_ranked():
    film = CryptoFilm(2, 1)
    both = np.arange(2)
    for numbers in ([3, 0], [1, 0], [1, 2], [5, 2], [1, 2]):
        film.add(both, np.array(numbers))
    film.add(np.array([1]), np.array([2]))
    identifier = np.arange(10, 16, dtype=np.float32)
    made = film.develop(both, np.array([10.0, 6.0], np.float32), identifier)
    assert np.allclose(made, [[11, 0.3, 13, 0.1], [12, 4 / 6, 10, 2 / 6]])


def test_cryptomattes_are_shares_of_the_image(build):
    """They sum up to alpha, by the filter and adaptive sampling that the image has, border or not."""
    scene = build.scene([build.square(0.8), build.square(0.3, 0.7, (0.2, 0.1))], emission=(1, 1, 1))
    names = ("CRYPTO_OBJECT_00", "CRYPTO_MATERIAL_00")
    marks = np.array([7.0, 9.0], np.float32)
    settings = FrameSettings(
        32,
        24,
        samples=16,
        transparent=True,
        pixel_filter=PixelFilter("GAUSSIAN", 2.0),
        passes=DataPasses(names, identifiers={"OBJECT": marks, "MATERIAL": marks}),
    )
    straight = build.looking_down(1, -1)
    for projection, adaptive in ((bent(build), None), (bent(build), Adaptive(0.02, 4)), (straight, None)):
        frame = render_frame(projection, scene, replace(settings, adaptive=adaptive))
        layer = frame.passes["CRYPTO_OBJECT_00"]
        assert np.allclose(layer[..., 1] + layer[..., 3], frame.pixels[..., 3], atol=1e-6)
        assert (layer[..., 1] >= layer[..., 3]).all() and set(np.unique(layer[..., ::2])) == {0, 7, 9}
        assert np.array_equal(layer, frame.passes["CRYPTO_MATERIAL_00"])
        part = render_frame(
            projection, scene, replace(settings, adaptive=adaptive, border=Border(11, 9, 30, 20))
        )
        assert np.array_equal(part.passes["CRYPTO_OBJECT_00"], layer[9:20, 11:30])
