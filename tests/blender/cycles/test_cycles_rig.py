# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles through the rig, compared with our exact caster pixel by pixel, and with Cycles' own cameras."""

import bpy
import numpy as np
import pytest
from mathutils import Euler
from rig_scenes import (
    VOLUMES,
    clear_scene,
    compose_passes,
    exact_passes,
    fill_volume,
    make_volume,
    reference,
    render_passes,
    show_whole_sheets,
    switch,
)

WIDTH, HEIGHT = 72, 48
# One or two of each kind of surface, basis and re-parameterisation; in all 31 presets no pixel was wrong.
PRESETS = (
    "angular_fisheye",
    "around_the_car",
    "curved_convergence",
    "cylindrical_panorama",
    "deep_curvy_volume",
    "equirectangular",
    "house_of_stairs",
    "occlusion_camera",
    "polynomial_fisheye",
    "sample_rate_lens",
    "stereographic",
    "street_panorama_curved",
)
FEW = ("around_the_car", "cylindrical_panorama", "bent cubic", "NURBS")
OTHERS = tuple(name for name in (*PRESETS, *VOLUMES) if name not in FEW)
WHOLE = ("angular_fisheye", "around_the_car", "loop")
# With image mappings: between the sheets' vertices u and v are as good as projectors are, here in pixels.
MAPPED = ("polynomial_fisheye", "sample_rate_lens")
MAPPED_ERROR = 0.1
# The pixel error of the rig, and so its number of chords. Edges are given 1.5 pixels.
PIXEL_ERROR = 0.3
# t along a chord is straight, on the curve it is not: this share of a chord, and as much where there is one.
T_SHARE = 0.15
T_STRAIGHT = 2e-3


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


@pytest.mark.parametrize("names", [FEW, OTHERS], ids=["few", "others"])
def test_cycles_sees_what_the_exact_caster_sees(addon, rig_of, tmp_path, monkeypatch, names):
    """Presets and some volumes more, with every kind of projector that there is; the passes too.

    Rays skip empty chords; of some volumes they also travel all.
    """
    far_off = {}
    for name in names:
        clear_scene()
        camera = reference.add_camera(WIDTH, HEIGHT)
        camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), Euler((1.4, 0.1, 0.5))
        make_volume(addon, camera, name)
        camera.scfpf.pixel_error = PIXEL_ERROR
        bpy.context.view_layer.update()
        fill_volume(addon, camera)
        ours = exact_passes(addon, camera)
        index = ours["OBJECT_INDEX"][..., 0].astype(int)
        assert switch(camera) == {"FINISHED"}
        assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
        compose_passes()
        for group in bpy.data.node_groups:
            # For the next volume: building them takes longer than all the rest.
            group.use_fake_user = True
        settings = rig_of().scfpf_rig
        assert addon("cycles.skipping.refresh").skips(rig_of()) or settings.chords == 1, settings.travels_all
        theirs = render_passes(tmp_path / "passes")
        assert settings.passed, settings.travels_all
        seen = theirs["Object Index"]
        wrong = index != seen
        edge = reference.near_edges(index) | reference.near_edges(seen)
        print(f"{name}: {settings.chords} chords, {settings.error:.2f} px, {wrong.mean():.2%} wrong")
        assert settings.error <= PIXEL_ERROR
        assert len(np.unique(index)) > 8 and (index > 0).mean() > 0.02
        far_off[name] = (wrong & ~edge).sum()
        check_passes(name, ours, theirs, edge, settings.chords)
        if name in WHOLE:
            with monkeypatch.context() as patch:
                patch.setattr(addon("cycles.rig"), "renew", lambda *_: None)
                show_whole_sheets(addon, rig_of())
                theirs = render_passes(tmp_path / "passes")
                assert not settings.passed
            check_passes(name, ours, theirs, edge, settings.chords)
        assert switch(camera) == {"FINISHED"} and rig_of() is None
    assert not any(far_off.values()), far_off


def check_passes(name, ours, theirs, edge, chords):
    """Position, (u, v, t) and depth, away from edges; nothing where nothing is seen."""
    index, position = ours["OBJECT_INDEX"][..., 0], ours["POSITION"].astype(np.float64)
    inside, empty = ~edge & (index > 0), ~edge & (index == 0)
    # Positions are points of the scene, not of the screen.
    off = np.linalg.norm(position - theirs["Position"], axis=2)[inside]
    step = reference.jitter_distance(position, index > 0)[inside] / reference.JITTER
    allowed = step * (PIXEL_ERROR + 0.05) + 1e-4 * np.abs(position).max()
    assert (off <= allowed).mean() > 0.99, name
    made = theirs["Composite"]
    u, v, t = np.abs(made[..., :3] - ours["PARAMETERS"])[inside].T
    # u of a turn may be just before its end or just behind its beginning.
    u = np.minimum(u, 1.0 - u)
    if name in MAPPED:
        around = 2.0 * np.pi * ours["PARAMETERS"][inside, 1] if "fisheye" in name else 2.0
        print(name, 0.5 * HEIGHT * np.hypot(u * around, v).max(), "px")
        assert 0.5 * HEIGHT * np.hypot(u * around, v).max() < MAPPED_ERROR, name
    else:
        assert u.max() < 1e-6 and v.max() < 1e-6, name
    assert (t <= (T_STRAIGHT if chords == 1 else T_SHARE / chords)).mean() > 0.95, (
        name,
        np.quantile(t, 0.95),
    )
    depth = ours["DEPTH"][..., 0]
    assert (np.abs(made[..., 3] - depth)[inside] <= 0.02 * depth[inside]).mean() > 0.95, name
    assert (made[empty, :3] == 0).all() and (made[empty, 3] > 9e9).all(), name
