# SPDX-License-Identifier: GPL-3.0-or-later
"""Preset files: what is refused and how it is said, fitting, and the way back to text."""

import copy
import json
import math
import os
import pathlib
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.presets.preset import (
    PresetError,
    load_preset,
    preset_to_json,
    read_preset,
)
from scfpf_addon.projection.surfaces.kinds import surface_from_parameters
from scfpf_addon.projection.surfaces.surface import Cylinder

FLAT = [[[-1, -1, 0], [1, -1, 0]], [[-1, 1, 0], [1, 1, 0]]]
SURFACES = {
    "POINT": {},
    "PLANE": {"width": 3, "height": 2},
    "PATCH": {"points": FLAT},
    "DISC": {"radius": 2, "arc_degrees": 180},
    "CYLINDER": {"radius": 2, "arc_degrees": 90, "height": 4},
    "CONE": {"radius_start": 0, "radius_end": 2, "arc_degrees": 120, "height": 4},
    "SPHERE": {"radius": 2, "arc_degrees": 90, "latitude_start_degrees": -30, "latitude_end_degrees": 45},
    "PARABOLOID": {"radius": 2, "arc_degrees": 180, "depth": 3},
    "GRID": {"points": [[[0, 0, 0], [1, 0, 0], [2, 0, 1]], [[0, 1, 0], [1, 1, 0], [2, 1, 1]]]},
    "NURBS": {
        "points": [[[x, y, x * y, 1 + y] for x in range(4)] for y in range(3)],
        "order_u": 4,
        "order_v": 3,
    },
    "UV_MESH": {
        "points": [[0, 0, 0], [2, 0, 1], [2, 1, 0], [0, 1, -1]],
        "uv": [[0, 0], [1, 0], [1, 1], [0, 1]],
        "triangles": [[0, 1, 2], [0, 2, 3]],
    },
}


def data(*surfaces, **changes):
    """A valid preset's data with the given surfaces, or two planes."""
    if not surfaces:
        surfaces = (
            {"name": "Near", "kind": "PLANE", "width": 1.0, "height": 0.5, "location": [0, 0, -1]},
            {"name": "Far", "kind": "PLANE", "width": 4.0, "height": 2.0, "location": [1, 2, -9]},
        )
    base = {
        "format": 1,
        "name": "Trial",
        "description": "",
        "source": "",
        "basis": "BEZIER",
        "reparameterisation": "RECTANGLE",
        "u_range": [0, 1],
        "v_range": [0, 1],
        "aspect": 2.0,
        "fit": "WIDTH",
        "surfaces": copy.deepcopy(list(surfaces)),
    }
    return base | changes


def load(values):
    return load_preset(json.dumps(values))


def with_surface(**changes):
    values = data()
    values["surfaces"][1] |= changes
    return values


def test_every_kind_of_surface_is_read_in_radians():
    kinds = [{"name": kind, "kind": kind} | numbers for kind, numbers in SURFACES.items()]
    preset = load(data(*kinds))
    for surface in preset.surfaces:
        numbers = SURFACES[surface.kind]
        for key, value in numbers.items():
            if key.endswith("_degrees"):
                assert surface.parameters[key.removesuffix("_degrees")] == math.radians(value)
            elif key == "points":
                assert np.array_equal(surface.points, np.array(value, float))
            elif key == "triangles":
                assert np.array_equal(surface.chart.vertices, value)
            elif key == "uv":
                assert np.array_equal(surface.chart.uv, np.array(value, float)[numbers["triangles"]])
            else:
                assert surface.parameters[key] == value
    assert preset.volume().spans.degree == len(kinds) - 1


def test_transform_is_scale_then_rotation_about_x_y_z_then_location():
    turned = {"name": "A", "kind": "POINT", "location": [5, 6, 7], "rotation_degrees": [90, 0, 90]}
    matrix = load(data(turned | {"scale": [2, 3, 4]}, turned)).surfaces[0].matrix
    # X goes to Z-rotated X = +Y; Y goes to +Z, which stays; Z goes to -Y, then to +X.
    expected = np.array([[0, 0, 4, 5], [2, 0, 0, 6], [0, 3, 0, 7], [0, 0, 0, 1]])
    assert np.allclose(matrix, expected, atol=1e-15)


def test_patch_rows_run_along_v():
    corners = [[[0, 0, 0], [1, 0, 0]], [[0, 2, 0], [1, 2, 3]]]
    patch = load(data(*[{"name": "P", "kind": "PATCH", "points": corners}] * 2)).surfaces[0].surface()
    for u, v in ((0, 0), (1, 0), (0, 1), (1, 1)):
        assert patch.evaluate(u, v).position[:, 0].tolist() == corners[v][u]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (with_surface(height=0), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height=-2.5), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height="2"), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height=True), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height=None), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height=[1]), "surface 2 'Far': height must be a number above 0"),
        (with_surface(height=float("nan")), "surface 2 'Far': height must be a number between"),
        (with_surface(height=float("inf")), "height must be a number between 1e-09 and 1e+09"),
        (with_surface(height=10**400), "height must be a number between 1e-09 and 1e+09"),
        (with_surface(height=1e-300), "height must be a number between 1e-09 and 1e+09"),
        (with_surface(colour="red"), "surface 2 'Far' has an unknown key 'colour'"),
        (with_surface(radius=1), "surface 2 'Far' has an unknown key 'radius'"),
        (with_surface(kind="TORUS"), "surface 2 'Far': kind must be one of POINT, PLANE"),
        (with_surface(name=""), "surface 2: name must be a text in one line"),
        (with_surface(name="a\nb"), "surface 2: name must be a text in one line"),
        (with_surface(name="\ud800"), "surface 2: name must be a text in one line"),
        (with_surface(name="n" * 64), "surface 2: name must not be longer than 63 bytes"),
        (with_surface(location=[0, 0]), "surface 2 'Far': location must be three numbers"),
        (with_surface(location=[0, 0, 2e9]), "location must be a number between -1e+09 and 1e+09"),
        (with_surface(rotation_degrees=[0, 0, "90"]), "surface 2 'Far': rotation_degrees must be a number"),
        (with_surface(scale=[1, 0, 1]), "surface 2 'Far': scale must not be 0 along any axis"),
        (data(format=2), "format must be 1"),
        (data(format=True), "format must be 1"),
        (data(name=7), "name must be a text in one line"),
        (data(description=["x"]), "description must be a text"),
        (data(source="x" * 10_001), "source must not be longer than 10000 characters"),
        (data(basis="SPLINE"), "basis must be one of BEZIER, POLYLINE, B_SPLINE, NURBS"),
        (with_surface(weight=0), "surface 2 'Far': weight must be a number above 0"),
        (with_surface(weight="1"), "surface 2 'Far': weight must be a number above 0"),
        (with_surface(weight=1e-4), "weight must be a number between 0.001 and 1000"),
        (with_surface(weight=1001), "weight must be a number between 0.001 and 1000"),
        (data(basis=[]), "basis must be one of BEZIER, POLYLINE"),
        (data(reparameterisation="LENS"), "reparameterisation must be one of RECTANGLE, POLAR"),
        (data(fit="BOTH"), "fit must be one of WIDTH, HEIGHT, CROP, NONE"),
        (data(aspect=0), "aspect must be a number above 0"),
        (data(aspect=1e9), "aspect must be a number between 0.001 and 1000"),
        (data(u_range=[0.5, 0.5]), "u_range must rise from its start to its end"),
        (data(v_range=[-0.5, 1]), "v_range must be a number between 0 and 1"),
        (data(v_range=[0, 1, 1]), "v_range must be two numbers [start, end]"),
        (data(surfaces=[]), "surfaces must be a list of 2 to 64 surfaces"),
        (data(surfaces="Near"), "surfaces must be a list of 2 to 64 surfaces"),
        (data(surfaces=data()["surfaces"][:1]), "surfaces must be a list of 2 to 64 surfaces"),
        (data(surfaces=data()["surfaces"] * 33), "surfaces must be a list of 2 to 64 surfaces"),
        (data(surfaces=[1, 2]), "surface 1 must be an object"),
        (data(surfaces=[{"kind": "POINT"}] * 2), "surface 1 needs name"),
        (data(surfaces=[{"name": "A"}] * 2), "surface 1 needs kind"),
        (data(surfaces=[{"name": "A", "kind": "PLANE", "width": 1}] * 2), "surface 1 'A' needs height"),
        (data(licence="free"), "the preset has an unknown key 'licence'"),
        ({k: v for k, v in data().items() if k != "basis"}, "the preset needs basis"),
        ([1, 2], "the preset must be an object"),
        (data(subject={"centre": [0, 0, 0]}), "subject needs size"),
        (data(subject={"centre": [0, 0, 0], "size": [1, 0, 1]}), "subject: size must be a number above 0"),
        (data(subject=None), "subject must be an object"),
    ],
)
def test_bad_values_are_named(values, message):
    with pytest.raises(PresetError) as caught:
        load(values)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("DISC", {"arc_degrees": 361}, "arc_degrees must be a number between 1e-06 and 360"),
        ("DISC", {"arc_degrees": -10}, "arc_degrees must be a number above 0"),
        ("CYLINDER", {"radius": 0}, "radius must be a number above 0"),
        ("CONE", {"radius_start": -1}, "radius_start must be a number between 0 and 1e+09"),
        ("CONE", {"radius_end": 0}, "radius_start or radius_end must be above 0"),
        ("SPHERE", {"latitude_end_degrees": 91}, "latitude_end_degrees must be a number between -90 and 90"),
        ("SPHERE", {"latitude_end_degrees": -30}, "latitude_end_degrees must differ"),
        ("GRID", {"points": []}, "points must be at least 2 × 2 points [x, y, z], in rows of one length"),
        ("GRID", {"points": [[], []]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": FLAT[:1]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": [FLAT[0], FLAT[1] * 2]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": [FLAT[0], [[0, 1], [0, 1]]]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": [FLAT[0], 5]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": [FLAT[0], [5, 6]]}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": {"x": 1}}, "points must be at least 2 × 2 points"),
        ("GRID", {"points": [FLAT[0], [[0, 1, True], [0, 1, 2]]]}, "points must be numbers between"),
        ("GRID", {"points": [FLAT[0], [[0, 1, "2"], [0, 1, 2]]]}, "points must be numbers between"),
        ("GRID", {"points": [FLAT[0], [[0, 1, [2]], [0, 1, 2]]]}, "points must be numbers between"),
        ("GRID", {"points": [FLAT[0], [[0, 1, 10**400], [0, 1, 2]]]}, "points must be numbers between"),
        ("GRID", {"points": [FLAT[0], [[0, 1, math.nan], [0, 1, 2]]]}, "points must be numbers between"),
        ("GRID", {"points": [FLAT[0], [[0, 1, -math.inf], [0, 1, 2]]]}, "points must be numbers between"),
        ("PATCH", {"points": SURFACES["GRID"]["points"]}, "points must be 2 × 2 points"),
    ],
)
def test_bad_numbers_of_a_kind_are_named(kind, changes, message):
    surface = {"name": "S", "kind": kind} | SURFACES[kind] | changes
    with pytest.raises(PresetError) as caught:
        load(data({"name": "O", "kind": "POINT"}, surface))
    assert str(caught.value).startswith("surface 2 'S'")
    assert message in str(caught.value)


LIMITS = "scfpf_addon.projection.file_limits"


def test_numbers_are_bounded_in_each_surface_and_together(monkeypatch):
    grid = {"name": "G", "kind": "GRID", "points": SURFACES["GRID"]["points"]}
    for most in (35, 17):
        monkeypatch.setattr(f"{LIMITS}.MAXIMUM_NUMBERS", most)
        with pytest.raises(PresetError, match=f"the preset has too many numbers, at most {most} are allowed"):
            load(data(grid, grid))
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_NUMBERS", 36)
    load(data(grid, grid))


def test_nurbs_points_are_bounded_together(monkeypatch):
    patch = {"name": "N", "kind": "NURBS"} | SURFACES["NURBS"]
    count = np.array(patch["points"])[..., 0].size
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_NURBS_POINTS", 2 * count - 1)
    with pytest.raises(PresetError, match=f"too many NURBS points, at most {2 * count - 1}"):
        load(data(patch, patch))


def test_time_and_memory_are_bounded(monkeypatch):
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_SECONDS", -1.0)
    with pytest.raises(PresetError, match="longer than -1 s"):
        load(data())
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_MEMORY", 1_000)
    with pytest.raises(PresetError, match="more than 0 MB of memory"):
        load(data())


# The dearest texts for their length: empty lists and objects, lists of lists, small objects, numbers.
DEAREST = ("[],", "{},", "[0],", '{"":0},', '{"":{}},', "0,", "0.5,", '"ab",', '{"a":[]},', "[[],0],")


@pytest.mark.parametrize("piece", DEAREST)
def test_no_text_takes_more_memory_than_is_counted(piece, monkeypatch):
    """Python's own count of what it takes is below the bound that a text is refused by."""
    count = 20_000
    text = "[" + piece * count + "0]"
    tracemalloc.start()
    try:
        with pytest.raises(PresetError, match="must be an object"):
            load_preset(text)
        _, taken = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # Beyond the text itself, which is there before.
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_MEMORY", taken)
    with pytest.raises(PresetError, match="MB of memory"):
        load_preset(text)


def test_keys_are_bounded_and_cut_in_messages():
    with pytest.raises(PresetError, match="an object has 30000 keys, at most 4096 are allowed"):
        load_preset("{" + ",".join(f'"{number}": 0' for number in range(30_000)) + "}")
    twice = "{" + ",".join(f'"{number}": 0' for number in (*range(4_000), 3_999)) + "}"
    with pytest.raises(PresetError, match="the key '3999' stands twice"):
        load_preset(twice)
    for text in ('{"KEY": 1, "KEY": 2}', '{"KEY": 1}'):
        with pytest.raises(PresetError, match="kkk…'") as caught:
            load_preset(text.replace("KEY", "k" * 100_000))
        assert len(str(caught.value)) < 200


def test_what_is_no_file_is_not_waited_for(tmp_path):
    with pytest.raises(PresetError, match="cannot read"):
        read_preset(tmp_path)
    if os.name == "posix":
        os.mkfifo(tmp_path / "pipe.json")
        for path in (tmp_path / "pipe.json", pathlib.Path("/dev/zero")):
            with pytest.raises(PresetError, match="not a regular file"):
                read_preset(path)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_mutated_presets_are_read_or_refused(draw):
    """A changed file is a preset or is refused in one line, and never raises another error."""
    text = json.dumps(data(*({"name": kind, "kind": kind} | numbers for kind, numbers in SURFACES.items())))
    for _ in range(draw.draw(st.integers(1, 4))):
        start = draw.draw(st.integers(0, len(text)))
        end = min(len(text), start + draw.draw(st.integers(0, 12)))
        put = draw.draw(
            st.sampled_from(["", "[", "]", "{", "}", ",", '"', "0", "-", "1e999", "NaN", "null", text[:40]])
        )
        text = text[:start] + put + text[end:]
    try:
        load_preset(text)
    except PresetError as error:
        assert str(error) and len(str(error)) < 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not valid JSON"),
        ("{", "not valid JSON"),
        ("[" * 200_000, "nested too deeply|not valid JSON"),
        ("9" * 5000, "not valid JSON"),
        ('{"format": 1, "format": 1}', "the key 'format' stands twice"),
        ("null", "the preset must be an object"),
    ],
)
def test_text_that_is_no_preset(text, message):
    with pytest.raises(PresetError, match=message):
        load_preset(text)


def test_files(tmp_path, monkeypatch):
    good = tmp_path / "good.json"
    good.write_text(json.dumps(data()), encoding="utf-8-sig")
    assert read_preset(good).name == "Trial"
    with pytest.raises(PresetError, match=r"cannot read missing\.json: No such file"):
        read_preset(tmp_path / "missing.json")
    with pytest.raises(PresetError, match="cannot read"):
        read_preset(tmp_path)
    wrong = tmp_path / "wrong.json"
    wrong.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PresetError, match=r"wrong\.json: not a text file in UTF-8"):
        read_preset(wrong)
    wrong.write_text(json.dumps(data(aspect=-1)))
    with pytest.raises(PresetError, match=r"wrong\.json: aspect must be a number above 0"):
        read_preset(wrong)
    monkeypatch.setattr(f"{LIMITS}.MAXIMUM_BYTES", 100)
    with pytest.raises(PresetError, match=r"good\.json: the preset is larger than"):
        read_preset(good)


def all_kinds(fit):
    place = {"location": [3, 5, 7]}
    kinds = [{"name": kind, "kind": kind} | numbers | place for kind, numbers in SURFACES.items()]
    return load(data(*kinds, fit=fit))


@pytest.mark.parametrize(("fit", "axis", "factor"), [("WIDTH", 0, 1.5), ("HEIGHT", 1, 2 / 3)])
def test_fitting_changes_extents_along_one_axis(fit, axis, factor):
    before, after = all_kinds(fit), all_kinds(fit).fitted(3.0)
    assert after.aspect == 3.0
    extent = ("width", "height")[axis]
    for old, new in zip(before.surfaces, after.surfaces, strict=True):
        moved = old.matrix.copy()
        moved[axis, 3] *= factor
        assert np.array_equal(new.matrix, moved)
        wanted = {k: v * factor if k == extent else v for k, v in old.parameters.items()}
        assert new.parameters == wanted
        if old.points is not None:
            stretch = np.ones(old.points.shape[-1])
            stretch[axis] = factor
            assert np.array_equal(new.points, old.points * stretch)
    assert np.array_equal(before.surfaces[1].matrix, all_kinds(fit).surfaces[1].matrix)


def test_fitting_by_crop_shows_the_largest_part_of_the_surfaces():
    before = load(data(fit="CROP"))
    assert before.aspect == 2.0
    wide, tall = before.fitted(4.0), before.fitted(0.5)
    assert wide.surfaces == before.surfaces
    assert (wide.u_range, wide.v_range) == ((0.0, 1.0), (0.25, 0.75))
    assert (tall.u_range, tall.v_range) == ((0.375, 0.625), (0.0, 1.0))
    assert tall.fitted(2.0) == before


def test_fitting_with_none_changes_only_the_aspect():
    before = all_kinds("NONE")
    assert before.fitted(3.0).surfaces == before.surfaces
    assert before.fitted(3.0).aspect == 3.0


@pytest.mark.parametrize("aspect", [0.0, -1.0, math.nan, math.inf])
def test_an_image_without_size_is_refused(aspect):
    with pytest.raises(PresetError, match="an image needs a width and a height"):
        load(data()).projection(aspect)


def test_projection_carries_ranges_and_aspect():
    projection = load(data(u_range=[0.25, 0.5], v_range=[0.5, 1], reparameterisation="POLAR")).projection(1.5)
    assert (projection.u_range, projection.v_range, projection.aspect) == ((0.25, 0.5), (0.5, 1.0), 1.5)
    assert not projection.parameters(0.0, 0.0).mask[0]


def test_surface_from_parameters_says_what_is_missing():
    identity = np.eye(4)
    with pytest.raises(ValueError, match="a surface of kind CONE needs radius_end, height"):
        surface_from_parameters("CONE", {"radius_start": 1, "arc": 1}, None, identity)
    with pytest.raises(ValueError, match="kind GRID needs points"):
        surface_from_parameters("GRID", {}, None, identity)
    with pytest.raises(ValueError, match="a patch needs 2 × 2 points"):
        surface_from_parameters("PATCH", {}, np.zeros((3, 2, 3)), identity)
    with pytest.raises(ValueError, match="unknown surface kind 'NONE'"):
        surface_from_parameters("NONE", {}, None, identity)
    numbers = {"radius": 2, "arc": 1, "height": 3, "x": 9}
    surface = surface_from_parameters("CYLINDER", numbers, None, identity)
    assert (type(surface), surface.radius, surface.arc, surface.height) == (Cylinder, 2.0, 1.0, 3.0)


coordinates = st.floats(-1e4, 1e4)
triples = st.lists(coordinates, min_size=3, max_size=3)
lengths = st.floats(1e-3, 1e4)
scales = st.lists(lengths.flatmap(lambda x: st.sampled_from([x, -x])), min_size=3, max_size=3)


@given(triples, st.lists(st.floats(-720, 720), min_size=3, max_size=3), scales, st.floats(0.01, 360))
def test_text_gives_the_preset_back(location, rotation, scale, arc):
    place = {"location": location, "rotation_degrees": rotation, "scale": scale}
    kinds = [{"name": kind, "kind": kind} | numbers | place for kind, numbers in SURFACES.items()]
    kinds[3]["arc_degrees"] = arc
    preset = load(data(*kinds, subject={"centre": location, "size": [1, 2, 3]}, source="a “b”\nc"))
    again = load_preset(preset_to_json(preset))
    for old, new in zip(preset.surfaces, again.surfaces, strict=True):
        error = np.abs(new.matrix - old.matrix) / np.maximum(1.0, np.abs(old.matrix).max(axis=0))
        # Near a right angle about Y the two other rotations are taken as one.
        assert error.max() < 3e-6
        assert new.parameters == pytest.approx(old.parameters, rel=1e-14)
        assert (new.points is None) == (old.points is None)
        assert new.points is None or np.array_equal(new.points, old.points)
    for key in ("name", "source", "basis", "u_range", "aspect", "fit", "subject"):
        assert getattr(again, key) == getattr(preset, key)
    # Written once more, nothing moves.
    assert load_preset(preset_to_json(again)).surfaces[1].matrix == pytest.approx(again.surfaces[1].matrix)


def test_weights_are_read_written_and_used_by_nurbs_projectors_only():
    values = with_surface(weight=2.5)
    plain = load(values)
    assert [s.weight for s in plain.surfaces] == [1.0, 2.5] and plain.volume().weights is None
    preset = load(values | {"basis": "NURBS"})
    assert preset.volume().weights == (1.0, 2.5)
    assert preset.projection(1.0).volume.weights == (1.0, 2.5)
    again = load_preset(preset_to_json(preset))
    assert [s.weight for s in again.surfaces] == [1.0, 2.5] and again.basis == "NURBS"
    assert '"weight"' not in preset_to_json(load(data()))
    # Two straight projectors, the second drawn to its far end.
    middle = preset.volume().evaluate(*np.full((3, 1), 0.5)).position[:, 0]
    np.testing.assert_allclose(middle, (np.array([0, 0, -1]) + 2.5 * np.array([1, 2, -9])) / 3.5)


def test_a_sheared_surface_is_not_written():
    preset = load(data())
    preset.surfaces[1].matrix[0, 1] = 0.5
    with pytest.raises(PresetError, match="surface 2 'Far' is sheared"):
        preset_to_json(preset)


junk = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.lists(st.one_of(st.floats(), st.none(), st.lists(st.floats(), max_size=3)), max_size=4),
    st.dictionaries(st.sampled_from(["name", "kind", "x"]), st.integers(), max_size=2),
)


def places(value, path=()):
    """The paths of all values inside JSON data."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


@settings(max_examples=300)
@given(st.data())
def test_junk_anywhere_is_a_preset_error_or_a_preset(source):
    kinds = [{"name": kind, "kind": kind} | numbers for kind, numbers in SURFACES.items()]
    values = data(*kinds, subject={"centre": [0, 0, 0], "size": [1, 1, 1]})
    path = source.draw(st.sampled_from([p for p in places(values) if p]))
    holder = values
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = source.draw(junk)
    try:
        preset = load(values)
    except PresetError as error:
        assert str(error) and "\n" not in str(error)
    else:
        sample = preset.projection(1.0).volume.evaluate(np.array([0.3]), np.array([0.7]), np.array([0.5]))
        assert np.isfinite(sample.position).all()
