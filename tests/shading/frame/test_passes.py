# SPDX-License-Identifier: GPL-3.0-or-later
"""Data passes of a level square seen from above, where everything is known."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.passes.depths import perspective_depth, projector_length
from scfpf_addon.shading.settings.frame_settings import FrameSettings

NAMES = ("DEPTH", "POSITION", "NORMAL", "UV", "PARAMETERS", "PERSPECTIVE_DEPTH", "TANGENT")
INDICES = ("OBJECT_INDEX", "MATERIAL_INDEX", "CHORD_COUNT", "CHORD_ERROR")
SIDE = 12


def passes(build, heights, scene, names, **settings):
    """The passes of an image of 4 × 4 that looks down from the first height to the last, (SIDE, SIDE, …)."""
    made = FrameSettings(SIDE, SIDE, samples=1, passes=DataPasses(names), **settings)
    return render_frame(build.looking_down(*heights, size=4.0), scene, made).passes


@pytest.fixture
def scene(build):
    """A square of half-size 1 at z = 0 with texture coordinates from 0 to 1, the object 7 of material 3."""
    made = build.scene([build.square(1.0)])
    corners = made.geometry.vertices[made.geometry.triangles][:, :, :2]
    geometry = replace(made.geometry, uv=((corners + 1) / 2).astype(np.float32), object_names=("Square",))
    geometry = replace(geometry, material=np.zeros(2, np.int32), object_index=np.zeros(2, np.int32))
    return replace(made, geometry=geometry, object_index=(7,), material_index=(3,))


@pytest.mark.parametrize("heights", [(3.0, -1.0), (3.0, 1.0, -1.0)])
def test_what_an_orthographic_image_sees(build, scene, heights):
    found = passes(build, heights, scene, NAMES + INDICES, pixel_error=0.01)
    centre = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * 4
    x, y = np.meshgrid(centre, centre)
    hit = np.maximum(np.abs(x), np.abs(y)) < 1
    nought, one = np.zeros_like(x), np.ones_like(x)
    for name, values in {
        "DEPTH": [3 * one],
        "POSITION": [x, y, nought],
        "NORMAL": [nought, nought, one],
        "UV": [(x + 1) / 2, (y + 1) / 2, one],
        "PARAMETERS": [x / 4 + 0.5, y / 4 + 0.5, 0.75 * one],
        "PERSPECTIVE_DEPTH": [0.75 * one],
        "TANGENT": [nought, nought, -one],
        "OBJECT_INDEX": [7 * one],
        "MATERIAL_INDEX": [3 * one],
    }.items():
        expected = np.stack(values, axis=-1)
        np.testing.assert_allclose(found[name][hit], expected[hit], atol=1e-5, err_msg=name)
    assert (found["DEPTH"][~hit] > 1e9).all() and (found["PERSPECTIVE_DEPTH"][~hit] == 1.0).all()
    for name in ("POSITION", "UV", "OBJECT_INDEX"):
        assert not found[name][~hit].any()
    # Without a bend one chord is enough, and does not err.
    assert (found["CHORD_COUNT"][hit] >= 1).all() and found["CHORD_ERROR"].max() < 1e-6


def test_depth_can_be_that_of_a_plane(build, scene):
    """A distance from the plane z = 2, as of a camera that looks down from there."""
    settings = FrameSettings(
        SIDE, SIDE, samples=1, passes=DataPasses(("DEPTH",), depth_plane=np.array([0.0, 0.0, -1.0, 2.0]))
    )
    found = render_frame(build.looking_down(3.0, -1.0, size=1.0), scene, settings).passes["DEPTH"]
    np.testing.assert_allclose(found, 2.0, atol=1e-5)


def test_chords_of_a_polyline_are_counted_from_where_the_scene_begins(build):
    """Pieces end at z = 3, 1, -1, -3: a square at 0 is met in the second, a larger one at -2 in the third."""
    camera = build.looking_down(3.0, 1.0, -1.0, -3.0, size=4.0, basis="POLYLINE")
    settings = FrameSettings(SIDE, SIDE, samples=1, passes=DataPasses(("CHORD_COUNT", "PARAMETERS")))
    scene = build.scene([build.square(1.0), build.square(4.0, -2.0)])
    found = render_frame(camera, scene, settings).passes
    t, count = found["PARAMETERS"][..., 2], found["CHORD_COUNT"][..., 0]
    first = t < 0.6
    assert 0 < first.sum() < first.size
    np.testing.assert_allclose(t, np.where(first, 3 / 6, 5 / 6), atol=1e-6)
    # Rows that see the lower square alone begin at it.
    both = first.any(axis=1)
    np.testing.assert_array_equal(count[both], np.where(first, 1.0, 2.0)[both])
    np.testing.assert_array_equal(np.unique(count[~both] <= 2.0), True)


def test_what_was_not_read_is_asked_for_in_words(build, scene):
    bare = replace(scene, geometry=replace(scene.geometry, uv=None))
    with pytest.raises(ValueError, match="without texture coordinates"):
        passes(build, (3.0, -1.0), bare, ("UV",))
    with pytest.raises(ValueError, match="frames before and after"):
        passes(build, (3.0, -1.0), scene, ("VECTOR",))


@pytest.mark.parametrize(("near", "far"), [(1.0, 10.0), (2.0, 3.0), (0.1, 1000.0)])
def test_perspective_depth_of_a_frustum_is_the_papers(near, far):
    """f (1 - d/z) / (f - d) (paper §3.2) for z between the planes at d and f; t itself for parallel ones."""

    def plane(depth, width):
        matrix = np.eye(4)
        matrix[2, 3] = -depth
        return Plane(width, width, matrix=matrix)

    t = np.linspace(0.0, 1.0, 11)
    half = np.full(11, 0.3)
    frustum = ViewingVolume((plane(near, near), plane(far, far)))
    z = near + t * (far - near)
    expected = far * (1 - near / z) / (far - near)
    np.testing.assert_allclose(perspective_depth(frustum, half, half, t), expected, atol=1e-12)
    box = Projection(ViewingVolume((plane(near, 2.0), plane(far, 2.0)))).volume
    np.testing.assert_allclose(perspective_depth(box, half, half, t), t, atol=1e-12)


def test_depth_is_a_length_where_t_does_not_advance_evenly():
    spans, points = span_basis("NURBS", 2, (1.0, 3.0)), np.zeros((2, 3, 2))
    points[1, 2] = 5.0
    t = np.array([0.3, 0.8])
    expected = 5.0 * spans.weights(t)[0][1]
    np.testing.assert_allclose(projector_length(spans, points, t), expected, rtol=1e-9)
