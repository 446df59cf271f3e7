# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules for every shipped preset: its texts, its group, its file, that it neither folds nor mirrors."""

import json
from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import PresetError, load_preset, preset_to_json, read_preset
from scfpf_addon.projection.volume.viewing_volume import determinant, image_derivatives

FOLDER = Path(__file__).resolve().parents[3] / "presets"
GROUPS = {
    "Cameras": (
        "anamorphic_billboard",
        "digital_cubism",
        "inverted_perspective",
        "irregular_perspective",
        "occlusion_camera",
        "off_centre",
        "perspective",
        "telephoto",
    ),
    "Drawings and Maps": (
        "cavalier",
        "dimetric",
        "military",
        "oblique",
        "orthographic",
        "panorama_map",
        "three_quarter",
    ),
    "Fisheyes and Lenses": (
        "angular_fisheye",
        "barrel_lens",
        "crystal_ball",
        "equisolid_fisheye",
        "fulldome_master",
        "magic_lens",
        "mirror_ball",
        "polynomial_fisheye",
        "sample_rate_lens",
        "stereographic",
    ),
    "General Linear Cameras": (
        "bilinear",
        "cross_slit",
        "epi",
        "multiperspective_tiles",
        "pencil",
        "pushbroom",
        "twisted_orthographic",
    ),
    "Panoramas": (
        "cylindrical_panorama",
        "equirectangular",
        "long_pan",
        "panini",
        "panini_compressed",
        "panini_vertical",
        "street_panorama",
        "street_panorama_curved",
        "strip_camera",
        "tiny_planet",
    ),
    "Twists and Curves": (
        "around_the_car",
        "curved_convergence",
        "curved_world",
        "deep_curvy_volume",
        "house_of_stairs",
        "inward_sphere",
        "linear_twist",
        "nonlinear_twist",
        "orthographic_to_perspective",
    ),
}
NAMES = sorted(name for names in GROUPS.values() for name in names)
# A plane for a volume: its determinant is 0 throughout.
FLAT = "epi"
# Their poles are at the image's centre.
POLAR = {
    "angular_fisheye",
    "crystal_ball",
    "equisolid_fisheye",
    "fulldome_master",
    "mirror_ball",
    "polynomial_fisheye",
}
# They look down: at the centre v runs ahead rather than up.
DOWN = {"tiny_planet", "panorama_map"}
# Text that fits into a tooltip.
LONGEST_DESCRIPTION = 320


def preset(name):
    return read_preset(FOLDER / f"{name}.json")


def test_the_folder_holds_these_presets_in_these_groups():
    files = [f"{name}.json" for name in NAMES]
    assert sorted(path.name for path in FOLDER.glob("*")) == sorted([*files, "thumbnails"])
    found = {name: preset(name).group for name in NAMES}
    assert found == {name: group for group, names in GROUPS.items() for name in names}


def test_every_preset_has_a_small_image_for_the_menus():
    images = sorted((FOLDER / "thumbnails").glob("*"))
    assert [path.name for path in images] == [f"{name}.png" for name in NAMES]
    for path in images:
        data = path.read_bytes()
        width, height = (int.from_bytes(data[start : start + 4], "big") for start in (16, 20))
        assert data[:8] == b"\x89PNG\r\n\x1a\n" and (width, height) == (192, 144)
        assert len(data) < 25_000


def test_names_differ_and_texts_say_what_and_whence():
    presets = [preset(name) for name in NAMES]
    assert len({shown.name for shown in presets}) == len(presets)
    for shown in presets:
        assert 40 < len(shown.description) <= LONGEST_DESCRIPTION and shown.description.endswith(".")
        assert shown.source
        names = [surface.name for surface in shown.surfaces]
        assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", NAMES)
def test_text_gives_the_preset_back(name):
    before = preset(name)
    after = load_preset(preset_to_json(before))
    assert after.group == before.group and after.subject == before.subject
    for old, new in zip(before.surfaces, after.surfaces, strict=True):
        assert np.allclose(new.matrix, old.matrix, rtol=1e-15, atol=1e-14)
        assert new.parameters == old.parameters
        assert new.points is None or np.array_equal(new.points, old.points)


@pytest.mark.parametrize("name", sorted(set(NAMES) - {FLAT}))
def test_no_preset_folds_or_mirrors(name):
    """det[Qx Qy Qt] < 0 before the far surface, over the image: a polar map turns the sense of (u, v)."""
    shown = preset(name)
    grid = (np.arange(40) + 0.5) / 40
    x, y, t = (
        values.ravel() for values in np.meshgrid(grid, grid, np.linspace(0, 1, 40, endpoint=False)[1:])
    )
    for aspect in (shown.aspect, 0.7, 2.5):
        projection = shown.projection(aspect)
        image = projection.parameters(x, y)
        sample = projection.volume.evaluate(image.u, image.v, t)
        qx, qy = image_derivatives(sample.du, sample.dv, image.jacobian)
        assert (determinant(sample._replace(du=qx, dv=qy))[image.mask] < 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_neighbouring_projectors(name):
    """Qx, Qy and Qt of a projection against differences of its own positions, on one smooth piece each."""
    shown = preset(name)
    x, y, t = np.random.default_rng(6).uniform(0.05, 0.95, (3, 60))
    step = 1e-6

    def at(x, y, t):
        projection = shown.projection(shown.aspect)
        image = projection.parameters(x, y)
        controls = projection.volume.controls(image.u, image.v)
        sample = projection.volume.evaluate_controls(controls, t)
        return sample, image_derivatives(sample.du, sample.dv, image.jacobian), controls, image.mask

    here, (qx, qy), controls, mask = at(x, y, t)
    for derivative, move in ((qx, (step, 0, 0)), (qy, (0, step, 0)), (here.dt, (0, 0, step))):
        (less, _, one, before), (more, _, other, after) = (
            at(x + sign * move[0], y + sign * move[1], t + sign * move[2]) for sign in (-1, 1)
        )
        alike = mask & before & after & (one.tile == controls.tile) & (other.tile == controls.tile)
        assert alike.mean() > 0.5
        found = (more.position - less.position) / (2 * step)
        size = np.abs(here.position).max() + np.abs(derivative[:, alike]).max()
        # A kink may lie between two places: lines of a grid, the rim of a lens, the break of a polyline.
        wrong = np.abs(found - derivative).max(axis=0)[alike] > 1e-6 * size
        assert wrong.sum() <= 1, name


@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
def test_perspective_looks_ahead_in_the_middle_and_as_wide_as_its_planes_at_the_borders(aspect):
    """All projectors run from one centre; to a border's middle half the angle of the planes."""
    projection = preset("perspective").projection(aspect)
    points, valid = projection.projectors(np.array([0.5, 0.0, 1.0, 0.5]), np.array([0.5, 0.5, 0.5, 1.0]))
    near, far = projection.volume.surfaces
    way = points[1] - points[0]
    slopes = way[:2] / -way[2]
    depth = near.matrix[2, 3] - far.matrix[2, 3]
    half = np.array([far.width - near.width, far.height - near.height]) / 2 / depth
    assert valid.all()
    np.testing.assert_allclose(slopes, [[0, -half[0], half[0], 0], [0, 0, 0, half[1]]], atol=1e-12)
    assert half[0] / half[1] == pytest.approx(aspect)


@pytest.mark.parametrize("name", sorted(set(NAMES) - POLAR - DOWN))
def test_right_is_right_and_up_is_up_at_the_image_s_centre(name):
    volume = preset(name).volume()
    sample = volume.evaluate(np.array([0.5]), np.array([0.5]), np.array([0.45]))
    assert sample.du[0, 0] > 0 and sample.dt[2, 0] < 0
    assert sample.dv[1, 0] > 0 or name == FLAT


def test_a_group_is_one_line_and_may_be_left_out():
    data = json.loads((FOLDER / "perspective.json").read_text(encoding="utf-8"))
    assert load_preset(json.dumps(data)).group == "Cameras"
    for wrong in ("", "two\nlines", 3, "x" * 64):
        with pytest.raises(PresetError, match="group must"):
            load_preset(json.dumps(data | {"group": wrong}))
    del data["group"]
    plain = load_preset(json.dumps(data))
    assert plain.group == "" and '"group"' not in preset_to_json(plain)
