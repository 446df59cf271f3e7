# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders end soon after they are cancelled, at whatever step they are."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.common import cancellation
from scfpf_addon.casting.common.ray_visibility import CAMERA, CATCHER, GLASS, MIRROR, SHADOW
from scfpf_addon.casting.scene import cast_scene
from scfpf_addon.casting.scene.prisms import PrismScene
from scfpf_addon.casting.scene.traced_mesh import TracedMesh
from scfpf_addon.casting.tiles import image_tiles
from scfpf_addon.shading import frame
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.scene.motion import Moment
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.scene.sky_map import COLUMNS, ROWS
from scfpf_addon.shading.scene.world import MOST_AT_ONCE, World
from scfpf_addon.shading.settings.frame_settings import FrameSettings

WIDTH, HEIGHT = 20, 3


def graph(kind, **inputs):
    """A material of one shader."""
    values = {"color": (0.9, 0.9, 0.9), **inputs}
    operations = [Operation("CONSTANT", (), {"value": np.array([1.0])}), Operation("NORMAL")]
    refs = {"normal": Ref(1)}
    for name, value in values.items():
        refs[name] = Ref(len(operations))
        operations.append(Operation("CONSTANT", (), {"value": np.atleast_1d(np.array(value, float))}))
    return MaterialGraph(tuple(operations), (Closure(kind, Ref(0), refs),), reflects=True)


def by_direction():
    """A world that differs by direction."""
    operations = (Operation("CONSTANT", (), {"value": np.array([1.0])}), Operation("POSITION"))
    return World(MaterialGraph(operations, (Closure("EMISSION", Ref(0), {"color": Ref(1)}),)))


@pytest.fixture
def heavy(build):
    """Shadow catchers under an area lamp, a sun and a sky; mirrors, glass; a bent volume, and motion."""
    parts = [build.square(3.0)]
    parts += [build.sphere(8, (x, y, 0.6), 0.4) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    lights = [
        Light("AREA", np.array([30, 20, 10.0]), build.placed((1, 1, 3)), size=(1, 0.5)),
        Light("SUN", np.full(3, 2.0), build.placed(shines=(0.3, 0.2, -1))),
    ]
    scene = build.scene(parts, lights)
    mirror = graph("GLOSSY", roughness=[0.2], multiscatter=[1.0])
    glass = graph("GLASS", roughness=[0.0], ior=[1.5])
    materials = replace(scene.materials, graphs={1: mirror, 2: glass})
    geometry = scene.geometry
    kinds = np.full(len(geometry.triangles), CAMERA | SHADOW | MIRROR | GLASS, np.uint8)
    kinds[geometry.material == 0] |= CATCHER
    geometry = replace(geometry, visibility=kinds)
    scene = replace(scene, materials=materials, geometry=geometry, world=by_direction())
    projection = build.looking_down(2, 1, -1, shifts=[0, 0.8, 0])
    moved = replace(geometry, vertices=geometry.vertices + np.array([0.0, 0.01, 0.0]))
    moments = tuple(Moment(projection, replace(scene, geometry=g), None) for g in (geometry, moved))
    return projection, scene, moments


class Asked:
    """A signal that is set at the n-th question, and counts the rays cast between two questions."""

    def __init__(self, monkeypatch, at=None):
        self.looks = self.since = self.most = self.after = 0
        self.at = at
        for cls in (TracedMesh, PrismScene):
            monkeypatch.setattr(cls, "_embree", property(self._counting, self._keep), raising=False)

    def _keep(self, scene, embree):
        scene.__dict__["_embree"] = embree

    def _counting(self, scene):
        embree, asked = scene.__dict__["_embree"], self

        class Counting:
            def run(self, origins, *rest, **options):
                asked.since += len(origins)
                asked.most = max(asked.most, asked.since)
                asked.after += len(origins) * asked.stops
                return embree.run(origins, *rest, **options)

        return Counting()

    @property
    def stops(self):
        return self.at is not None and self.looks >= self.at

    def is_set(self):
        self.looks, self.since = self.looks + 1, 0
        return self.stops


@pytest.mark.parametrize("error", [0.1, 0.0])
def test_tiles_look_before_all_rays(heavy, monkeypatch, error):
    """At most one batch of rays is cast between two questions, and none after the last."""
    projection, scene, moments = heavy
    asked = Asked(monkeypatch)
    cancelled_by = cancellation.cancelled_by
    monkeypatch.setattr("scfpf_addon.casting.tiles.cancelled_by", lambda _event: cancelled_by(asked))
    settings = FrameSettings(WIDTH, HEIGHT, samples=2, pixel_error=error, threads=1)
    whole = render_frame(projection, scene, settings, moments=moments)
    rows = max(rows.stop - rows.start for rows in image_tiles(WIDTH, HEIGHT))
    looks = asked.looks
    assert 16 * len(image_tiles(WIDTH, HEIGHT)) < looks and whole.pixels.any()
    # Of a tile's pixels, each with rays of a mirror and of a glass; of exact casting's few rays all chords.
    assert asked.most <= {0.1: 4 * rows * WIDTH, 0.0: 1 << 15}[error]
    for share in (0.3, 0.8):
        asked.looks, asked.at = 0, 1 + int(share * looks)
        with pytest.raises(cancellation.Cancelled):
            render_frame(projection, scene, settings, moments=moments)
        # The thread takes the next tile, which ends at its first look.
        assert asked.after == 0


def test_what_is_made_before_the_first_tile_may_end_too(heavy, monkeypatch):
    """The map of the sky, each shutter time: an image that is cancelled there begins no tile."""
    projection, scene, moments = heavy
    settings = FrameSettings(WIDTH, HEIGHT, samples=2, threads=1)
    asked, begun = [0], []

    def begin(_job, *_rest):
        begun.append(asked[0])
        raise cancellation.Cancelled

    monkeypatch.setattr(frame, "render_tile", begin)

    def cancelled(at):
        def look():
            asked[0] += 1
            return asked[0] == at

        asked[0] = 0
        return look

    with pytest.raises(cancellation.Cancelled):
        render_frame(projection, scene, settings, cancelled=cancelled(None), moments=moments)
    count, begun[:] = begun[0], []
    # Blocks of the sky's map, and each thing that Embree builds.
    assert count > COLUMNS * ROWS // MOST_AT_ONCE
    for at in range(1, count, 5):
        fresh = replace(scene, world=by_direction())
        again = tuple(moment._replace(scene=fresh) for moment in moments[:1]) + moments[1:]
        assert render_frame(projection, fresh, settings, cancelled=cancelled(at), moments=again) is None
    assert not begun


def test_what_cannot_be_stopped_says_so(heavy, monkeypatch):
    """With motion blur prisms are built by the threads, one for each shutter time that is needed."""
    projection, scene, moments = heavy
    built = []
    made = cast_scene.PrismScene

    def making(*given):
        built.append(cancellation.is_uncancellable())
        return made(*given)

    monkeypatch.setattr(cast_scene, "PrismScene", making)
    settings = FrameSettings(WIDTH, HEIGHT, samples=4, pixel_error=0.0, threads=2)
    render_frame(projection, scene, settings, moments=moments)
    assert built == [True, True] and not cancellation.is_uncancellable()
