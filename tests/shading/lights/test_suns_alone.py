# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way to straight pictures under suns makes the same picture as the general one."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scfpf_addon.casting import tiles as tiling
from scfpf_addon.casting.cast import usable_projectors
from scfpf_addon.casting.common.ray_visibility import CATCHER, EVERYWHERE, HOLDOUT
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.straight import OFF_VERTICES
from scfpf_addon.casting.visible_triangles import FlatRays
from scfpf_addon.projection.surfaces.surface import BilinearPatch, Cylinder, Disc, Plane, Point
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.fast_paths.suns_alone import SunsAlone
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights.light_table import LightTable
from scfpf_addon.shading.lights.lighting import Lamp
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.passes.light_passes import LIGHT_PASSES
from scfpf_addon.shading.pipeline import Pipeline
from scfpf_addon.shading.sampling.pixel_filter import PixelFilter
from scfpf_addon.shading.scene.depth_of_field import Aperture, lens_of
from scfpf_addon.shading.scene.shading_scene import Light, Materials
from scfpf_addon.shading.scene.surface import SurfacePoints, SurfaceTable
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings
from scfpf_addon.shading.settings.stylised_settings import Stylised
from scfpf_addon.shading.tracing.hit_colors import Shading

# Colours differ by float32's rounding, most where a highlight is sharp: its power enlarges it.
SAME = 1e-4
# Pixels that may see another triangle: rays differ in the last bit, and edges are met by some of them.
AT_EDGES = 0.003


def volume(build, kind, generator):
    """A random straight volume that looks down on the scene."""
    if kind == "planes":
        near, far = (build.placed((*generator.uniform(-0.3, 0.3, 2), z)) for z in (1.6, -1.2))
        sizes = generator.uniform(0.3, 2.5, 4)
        surfaces = Plane(*sizes[:2], matrix=near), Plane(*sizes[2:], matrix=far)
    elif kind == "pinhole":
        surfaces = Point(matrix=build.placed((0.2, 0, 2))), Plane(3, 2, matrix=build.placed((0, 0.1, -1)))
    elif kind == "patches":
        corners = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
        surfaces = tuple(
            BilinearPatch(corners=corners + generator.normal(0, 0.2, (4, 3)), matrix=build.placed((0, 0, z)))
            for z in (1.7, -1.3)
        )
    elif kind == "round":
        surfaces = Cylinder(0.1, 1.5, 1.0), Cylinder(3.0, 1.5, 2.0)
    else:
        surfaces = tuple(Disc(r, matrix=build.placed((0, 0, z))) for r, z in ((0.4, 1.6), (1.4, -1)))
        return Projection(ViewingVolume(surfaces), Polar(), aspect=4 / 3)
    u = np.sort(generator.uniform(0, 1, 2)) if generator.integers(2) else (0.0, 1.0)
    return Projection(ViewingVolume(surfaces), u_range=tuple(u), aspect=4 / 3)


def scene_of(build, generator, smooth, suns):
    """Squares and a sphere of random materials under random suns."""
    ball = build.sphere(9, generator.uniform(-0.4, 0.4, 3), 0.6)
    parts = [
        build.square(1.6, -0.7),
        ball if smooth else (*ball[:2], None),
        build.square(0.5, 0.9, (0.6, 0.3)),
    ]
    if not smooth:
        # Poles of the sphere are no triangles.
        points, faces = np.asarray(ball[0]), np.asarray(ball[1])
        a, b, c = points[faces].transpose(1, 0, 2)
        parts[1] = points, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9], None
    several, linked = generator.integers(2, size=2).astype(bool)
    materials = Materials(
        generator.uniform(0, 1, (3, 3)),
        generator.uniform(0, 1, 3),
        generator.uniform(0.25, 1, 3),
        np.full(3, generator.choice([0.0, 0.04])),
        generator.choice([0.0, 0.5]) * generator.uniform(0, 1, (3, 3)),
    )
    lights = tuple(
        Light(
            "SUN",
            generator.uniform(0, 3, 3),
            build.placed(shines=generator.normal(size=3) - [0, 0, 1]),
            casts_shadow=False,
            angle=float(generator.choice([0.0, 0.3])),
            receivers=generator.uniform(size=3) < 0.7 if linked else None,
        )
        for _ in range(suns)
    )
    scene = replace(build.scene(parts, lights), materials=materials)
    if linked:
        geometry = replace(scene.geometry, linked=scene.geometry.object_index.copy())
        scene = replace(scene, geometry=geometry)
    if not several:
        geometry = replace(scene.geometry, material=np.zeros_like(scene.geometry.material))
        scene = replace(scene, geometry=geometry)
    return replace(scene, world_color=generator.choice([0.0, 0.2]) * np.array([1, 0.5, 0]))


def in_general(projection, scene, wanted):
    """The frame as the general way makes it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pipeline, "suns_alone", None)
        return render_frame(projection, scene, wanted)


@settings(max_examples=30, deadline=None)
@example("planes", True, 1, 1, False, "BOX", False, False, 0)
@example("round", True, 2, 3, True, "GAUSSIAN", False, True, 1)
@example("polar", False, 1, 2, True, "BOX", True, False, 2)
@given(
    st.sampled_from(["planes", "pinhole", "patches", "round", "polar"]),
    st.booleans(),
    st.integers(0, 2),
    st.integers(1, 3),
    st.booleans(),
    st.sampled_from(["BOX", "GAUSSIAN"]),
    st.booleans(),
    st.booleans(),
    st.integers(0, 2**32),
)
def test_both_ways_make_the_same_picture(
    build, kind, smooth, suns, samples, transparent, pixel_filter, scrambled, bordered, seed
):
    generator = np.random.default_rng(seed)
    projection, scene = volume(build, kind, generator), scene_of(build, generator, smooth, suns)
    if scrambled:
        scene = replace(scene, lights=tuple(replace(light, angle=0.0) for light in scene.lights))
    wanted = FrameSettings(
        40,
        30,
        samples,
        transparent=transparent,
        border=Border(7, 4, 31, 29) if bordered else None,
        pixel_filter=PixelFilter(pixel_filter, 1.5),
        scrambled=scrambled,
    )
    short, general = render_frame(projection, scene, wanted), in_general(projection, scene, wanted)
    if general.report.built:
        assert Pipeline.of(projection, scene, wanted, None).suns_alone is not None
    assert np.isfinite(short.pixels).all()
    off = np.abs(short.pixels - general.pixels).max(axis=2)
    allowed = SAME * (1 + np.abs(general.pixels).max(axis=2))
    assert (off > allowed).mean() <= AT_EDGES * samples
    mine, its = short.report, general.report
    assert mine.projectors == its.projectors
    assert mine.rays == mine.chords <= its.rays
    assert mine.hit_fraction == pytest.approx(its.hit_fraction, abs=AT_EDGES)


def sun(build, **changed):
    plain = Light("SUN", np.ones(3), build.placed(shines=(0.2, 0, -1)), casts_shadow=False)
    return replace(plain, **changed)


@pytest.mark.parametrize(
    ("light", "curved", "wanted", "alone"),
    [
        ({}, False, {}, True),
        ({"angle": 0.2}, False, {}, True),
        ({}, False, {"scrambled": True}, True),
        ({"angle": 0.2}, False, {"scrambled": True}, False),
        ({"casts_shadow": True}, False, {}, True),
        ({"kind": "POINT"}, False, {}, False),
        ({"kind": "AREA"}, False, {}, False),
        ({}, True, {}, False),
        ({}, False, {"pixel_error": 0.0}, False),
        ({}, False, {"stylised": Stylised()}, False),
    ],
)
def test_only_simple_pictures_take_the_short_way(build, light, curved, wanted, alone):
    scene = build.scene([build.square()], [sun(build, **light)])
    projection = build.looking_down(1, 0, -1, shifts=[0, 0.2, 0]) if curved else build.looking_down(1, -1)
    pipeline = Pipeline.of(projection, scene, FrameSettings(8, 6, **wanted), None)
    assert (pipeline.suns_alone is not None) == alone


def test_holdouts_and_passes_of_light_take_the_general_way(build, monkeypatch):
    scene = build.scene([build.square(), build.square(0.4, 0.3)], [sun(build)])
    projection, wanted = build.looking_down(1, -1), FrameSettings(8, 6)
    for bit in (HOLDOUT, CATCHER):
        held = replace(
            scene.geometry, visibility=np.array([EVERYWHERE] * 2 + [EVERYWHERE | bit] * 2, np.uint8)
        )
        assert Pipeline.of(projection, replace(scene, geometry=held), wanted, None).suns_alone is None
    monkeypatch.setattr(SunsAlone, "sample", lambda *_: pytest.fail("the short way was taken"))
    name = next(iter(LIGHT_PASSES))
    render_frame(projection, scene, replace(wanted, passes=DataPasses((name,))))


def test_a_lens_takes_the_general_way(build):
    surfaces = Point(matrix=build.placed((0, 0, 2))), Plane(3, 3, matrix=build.placed((0, 0, -1)))
    projection = Projection(ViewingVolume(surfaces))
    lens = lens_of(projection, Aperture(0.1, 2.0), np.diag([1.0, 1, -1]))
    scene = build.scene([build.square()], [sun(build)])
    wanted = FrameSettings(8, 6)
    assert Pipeline.of(projection, scene, wanted, None).suns_alone is not None
    assert lens is not None
    assert Pipeline.of(projection, scene, replace(wanted, depth_of_field=lens), None).suns_alone is None


# All that the short way's condition has been thought through for.
KNOWN = {
    Pipeline: "projection settings background places cast_scene shading passes depth_of_field geometry world "
    "moments drawing",
    Shading: "surface coefficients lamps tracer held_out catchers",
    LightTable: "emitted through emission diffuse over f0 sent coat ior front edge again glow alpha "
    "row missing grazed layered few sky even",
    SurfaceTable: "cast_scene flat smooth bulge shadows material linked",
    SurfacePoints: "position normal view material shadow linked",
    Lamp: "light color places axis local softness beam occluders",
    Light: "kind color matrix casts_shadow radius angle size ellipse spread sphere spot_angle spot_blend "
    "receivers blockers scattered mirrored",
    FrameSettings: "width height samples pixel_error transparent threads border passes pixel_filter "
    "exposure scrambled adaptive depth_of_field stylised",
}


@pytest.mark.parametrize("kind", KNOWN)
def test_what_makes_a_picture_is_known_to_the_short_way(kind):
    """Whoever adds a field says in ``short_way`` whether such pictures may go the short way, then here."""
    names = kind._fields if hasattr(kind, "_fields") else [field.name for field in fields(kind)]
    assert list(names) == KNOWN[kind].split()


def test_neither_tiles_nor_threads_change_a_bit(build, monkeypatch):
    generator = np.random.default_rng(5)
    scene, projection = scene_of(build, generator, True, 2), volume(build, "planes", generator)
    wanted = FrameSettings(61, 47, samples=2, threads=1)
    plain = render_frame(projection, scene, wanted).pixels
    monkeypatch.setattr(tiling, "FEWEST_TILES", 1)
    for pixels, threads in ((1 << 20, 1), (61, 2), (61 * 5, 3)):
        monkeypatch.setattr(tiling, "TILE_PIXELS", pixels)
        again = render_frame(projection, scene, replace(wanted, threads=threads)).pixels
        assert again.tobytes() == plain.tobytes()


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(["planes", "pinhole"]), st.integers(0, 2**32))
def test_rays_of_flat_surfaces_are_those_of_the_projection(build, kind, seed):
    generator = np.random.default_rng(seed)
    scene = CastScene(*build.square()[:2])
    inside = volume(build, kind, generator).transformed(scene.matrix)
    rays = FlatRays.of(inside, scene)
    x, y = generator.uniform(0, 1, 30), generator.uniform(0, 1, 20)
    origins, directions = rays.made(x, y)
    (start, end), _, farthest = usable_projectors(inside, np.tile(x, 20), np.repeat(y, 30))
    # Each is rounded three times.
    error = 3 * 2.0**-24 * 2 * farthest
    assert np.abs(origins - (start + OFF_VERTICES)).max() <= error
    assert np.abs(directions - (end - start)).max() <= error


@pytest.mark.parametrize("near", [Point(), Plane(0.02, 0.02), Plane(1, 2)])
@pytest.mark.parametrize("far", [30.0, 3e3])
def test_of_a_long_volume_what_lies_about_the_scene_is_cast(build, near, far):
    """As a camera with a distant far clip has it."""
    near = replace(near, matrix=build.placed((0.1, 0, 3.0)))
    projection = Projection(
        ViewingVolume((near, Plane(1.6 * far, 1.2 * far, matrix=build.placed((0, 0, 3.0 - far)))))
    )
    ball = build.sphere(9, (0.1, 0, 0), 0.6)
    scene, wanted = build.scene([build.square(0.9, -0.7), ball], [sun(build)], f0=0.04), FrameSettings(60, 40)
    short = Pipeline.of(projection, scene, wanted, None).suns_alone
    assert short.window.left > 0.05 and short.window.top < 0.95
    assert max(np.abs(part).max() for part in (short.rays.middle, short.rays.across, short.rays.up)) < 16
    mine, its = render_frame(projection, scene, wanted), in_general(projection, scene, wanted)
    off = np.abs(mine.pixels - its.pixels).max(axis=2)
    assert (off > SAME).mean() <= AT_EDGES and 0.02 < its.report.hit_fraction < 0.9


def test_rays_of_other_volumes_are_not_sums(build):
    generator = np.random.default_rng(1)
    others = [volume(build, kind, generator) for kind in ("patches", "round", "polar")]
    far = build.looking_down(1, -1, size=100.0)
    scene = CastScene(*build.square()[:2])
    assert [FlatRays.of(projection, scene) for projection in (*others, far)] == [None] * 4
    flat = BilinearPatch(matrix=build.placed((0, 0, 1)))
    assert FlatRays.of(Projection(ViewingVolume((flat, Plane(matrix=build.placed())))), scene) is not None
