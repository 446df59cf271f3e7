# SPDX-License-Identifier: GPL-3.0-or-later
"""The marks on a drawn volume: far rim, arrows, iso-surfaces, the picked projector, and colours that show."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.diagrams.diagram import DiagramOptions, diagram, even_iso, volume_signature
from scfpf_addon.projection.diagrams.line_colors import BRIGHT, DARK, line_colors, luminance
from scfpf_addon.projection.diagrams.marks import (
    DASH_SHARE,
    direction_arrows,
    far_rim,
    image_frame,
    safe_area,
)
from scfpf_addon.projection.diagrams.projector_lines import picked_line, projector_point
from scfpf_addon.projection.diagrams.surface_lines import iso_lines
from scfpf_addon.projection.surfaces.surface import Cylinder, Disc, Plane, Point
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

# Of Blender's own themes "Blender Dark" and "Blender Light": View3D, gradients, high_gradient.
DARK_THEME, LIGHT_THEME = (0x3D / 255,) * 3, (0x64 / 255,) * 3
WHITE, PALE_GREY = (1.0, 1.0, 1.0), (0.7, 0.7, 0.7)


def placed(z):
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def quadratic():
    """Half-sizes 1, 3, 1 at z = -1, -2, -5."""
    sizes = ((2, -1), (6, -2), (2, -5))
    return Projection(ViewingVolume(tuple(Plane(s, s, matrix=placed(z)) for s, z in sizes)))


def lengths(lines):
    return np.linalg.norm(np.diff(lines.astype(float), axis=1)[:, 0], axis=1)


@pytest.mark.parametrize("t", [0.0, 0.25, 0.5, 1.0])
def test_an_iso_surface_is_the_volume_at_its_t(t):
    lines = iso_lines(quadratic(), t)
    half = (1 - t) ** 2 + 6 * t * (1 - t) + t**2
    assert np.allclose(lines[..., 2], -((1 - t) ** 2) - 4 * t * (1 - t) - 5 * t**2, atol=1e-6)
    assert np.abs(lines[..., :2]).max() == pytest.approx(half, rel=1e-6)
    assert lengths(lines).sum() == pytest.approx(2 * 9 * 2 * half, rel=1e-5)


def test_iso_surfaces_of_a_polyline_lie_on_its_pieces():
    volume = replace(quadratic().volume, basis="POLYLINE")
    lines = iso_lines(Projection(volume), 0.25)
    assert np.allclose(lines[..., 2], -1.5) and np.abs(lines[..., 0]).max() == pytest.approx(2.0)


def test_even_iso_leaves_out_the_ends():
    assert even_iso(0) == () and even_iso(1) == (0.5,) and even_iso(3) == (0.25, 0.5, 0.75)


def test_the_far_rim_is_dashed_and_the_frame_is_whole():
    rim, frame = far_rim(quadratic()), image_frame(quadratic())
    assert (rim[..., 2] == -5).all() and (frame[..., 2] == -1).all()
    assert lengths(rim).sum() == pytest.approx(8 * DASH_SHARE, rel=1e-5)
    assert lengths(frame).sum() == pytest.approx(8, rel=1e-5)
    assert (np.abs(rim[..., :2]).max(axis=2) == 1).all()


def test_dashes_of_both_sides_of_a_seam_are_the_same():
    whole = Projection(ViewingVolume((Point(), Cylinder(1.0))))
    rim = far_rim(whole)
    seam = rim[np.abs(rim[..., 2] - 1).max(axis=1) < 1e-6]
    up = seam[:, 1, 1] > seam[:, 0, 1]
    assert np.allclose(np.sort(seam[up], axis=None), np.sort(seam[~up], axis=None), atol=1e-6)


def test_arrows_run_along_u_and_v_on_the_near_and_the_far_surface():
    along_u, along_v = direction_arrows(quadratic())
    for lines, axis in ((along_u, 0), (along_v, 1)):
        assert set(np.unique(lines[..., 2])) == {-1.0, -5.0}
        near = lines[lines[:, 0, 2] == -1]
        # The shaft begins in the corner where u and v are least; the two pieces of the head end at the tip.
        start, tip = near[0, 0], near[-1, 1]
        assert (start[:2] < -0.9).all() and tip[axis] - start[axis] > 0.25
        assert tip[1 - axis] == start[1 - axis]
        assert np.array_equal(near[-2, 1], tip) and (near[-2:, 0, axis] < tip[axis]).all()
        assert np.abs(near[..., :2]).max() <= 1


def test_arrows_of_a_turned_surface_follow_its_parameters():
    along_u, _ = direction_arrows(quadratic().transformed(np.diag([-1.0, 1, 1, 1])))
    assert along_u[0, 1, 0] < along_u[0, 0, 0]


def test_arrows_avoid_poles_and_points():
    discs = Projection(ViewingVolume((Point(), Disc(2.0, matrix=placed(-1)))), Polar())
    along_u, along_v = direction_arrows(discs)
    assert (along_u[..., 2] == -1).all() and (along_v[..., 2] == -1).all()
    radius = np.hypot(along_u[..., 0], along_u[..., 1])
    assert radius.min() > 1.7 and radius.max() <= 2.0 + 1e-6
    assert np.hypot(*along_v[0, 0, :2]) < np.hypot(*along_v[0, 1, :2])
    none = direction_arrows(Projection(ViewingVolume((Point(), Point()))))
    assert [len(lines) for lines in none] == [0, 0]


def test_the_picked_projector_goes_through_its_image_position():
    projection = replace(quadratic(), u_range=(0.5, 1.0))
    line = picked_line(projection, 0.5, 0.25)
    assert np.allclose(line[0, 0], (0.5, -0.5, -1)) and np.allclose(line[-1, 1], (0.5, -0.5, -5))
    half = 0.25 + 6 * 0.25 + 0.25
    assert np.allclose(projector_point(projection, 0.5, 0.25, 0.5), [(0.5 * half, -0.5 * half, -2.5)])


def test_no_projector_is_drawn_where_the_image_shows_nothing():
    discs = Projection(ViewingVolume((Disc(0.1), Disc(2.0, matrix=placed(-1)))), Polar())
    assert len(picked_line(discs, 0.5, 0.5)) == 1 and len(projector_point(discs, 0.5, 0.5, 0.3)) == 1
    assert len(picked_line(discs, 0.01, 0.01)) == 0 and len(projector_point(discs, 0.01, 0.01, 0.3)) == 0


def test_a_safe_area_keeps_its_margin_of_half_the_image():
    lines = safe_area(replace(quadratic(), u_range=(0.5, 1.0)), 0.2, 0.1)
    assert (lines[..., 2] == -1).all()
    # u runs over the right half of the near surface, x from 0 to 1.
    assert (lines[..., 0].min(), lines[..., 0].max()) == pytest.approx((0.1, 0.9))
    assert (lines[..., 1].min(), lines[..., 1].max()) == pytest.approx((-0.9, 0.9))
    assert lengths(lines).sum() == pytest.approx(2 * (0.8 + 1.8), rel=1e-5)


def test_a_safe_area_of_a_polar_image_goes_through_the_mapping_and_stops_at_its_rim():
    discs = Projection(ViewingVolume((Disc(1.0), Disc(2.0, matrix=placed(-1)))), Polar())
    inner = safe_area(discs, 0.5, 0.5)
    assert np.abs(inner[..., :2]).max() == pytest.approx(0.5, abs=1e-6)
    assert lengths(inner).sum() == pytest.approx(4, rel=0.01)
    outer = safe_area(discs, 0.1, 0.1)
    assert np.hypot(outer[..., 0], outer[..., 1]).max() <= 1 + 1e-6
    assert lengths(outer).sum() == pytest.approx(8 * np.sqrt(1 - 0.9**2), abs=8 * 2 * 1.8 / 48)


def test_options_leave_out_what_is_not_asked_for():
    lines = diagram(quadratic(), DiagramOptions(3, 3, folds=False))
    assert [role for role, segments in lines.items() if not len(segments)] == [
        "ISO",
        "FOLDED",
        "FOLD",
        "SAFE",
        "PICK",
    ]


def test_lines_of_surfaces_are_left_out_at_will():
    lines = diagram(quadratic(), DiagramOptions(3, 3, without=(0, 2)))["SURFACE"]
    assert (lines[..., 2] == -2).all() and len(lines)


def test_every_option_counts_in_the_signature():
    base = DiagramOptions(3, 3)
    others = [
        DiagramOptions(4, 3),
        DiagramOptions(3, 4),
        DiagramOptions(3, 3, iso=(0.5,)),
        DiagramOptions(3, 3, folds=False),
        DiagramOptions(3, 3, pick=(0.5, 0.5)),
        DiagramOptions(3, 3, safe_areas=((0.1, 0.05),)),
        DiagramOptions(3, 3, without=(1,)),
    ]
    signatures = {volume_signature(quadratic(), options) for options in (base, *others)}
    assert len(signatures) == len(others) + 1
    assert volume_signature(quadratic(), DiagramOptions(3, 3)) == volume_signature(quadratic(), base)


def contrast(first, second):
    """Contrast ratio of two display colours, 1 to 21 (WCAG 2.1, "contrast ratio")."""
    darker, lighter = sorted((luminance(first), luminance(second)))
    return (lighter + 0.05) / (darker + 0.05)


def test_contrast_is_that_of_the_web_guidelines():
    assert contrast((0, 0, 0), (1, 1, 1)) == pytest.approx(21)
    assert contrast((1, 1, 1), (0.2, 0.2, 0.2)) == contrast((0.2, 0.2, 0.2), (1, 1, 1))
    # #777777 on white, the guidelines' well-known near miss of 4.5.
    assert contrast((0x77 / 255,) * 3, WHITE) == pytest.approx(4.48, abs=0.005)
    assert luminance((1, 0, 0)) == pytest.approx(0.2126)


@pytest.mark.parametrize(
    "background, ratio",
    [(DARK_THEME, 3.0), (LIGHT_THEME, 2.0), (PALE_GREY, 3.0), (WHITE, 4.5)],
    ids=["dark theme", "light theme", "pale grey", "white"],
)
def test_every_line_shows_on_every_background(background, ratio):
    for role, color in line_colors(background).items():
        assert contrast(color, background) >= ratio, role


def test_both_sets_of_colours_have_every_role_in_the_same_order_and_hues_that_mean_the_same():
    assert list(BRIGHT) == list(DARK) == list(diagram(quadratic(), DiagramOptions(2, 2)))
    for colors in (BRIGHT, DARK):
        for role in ("ISO", "SURFACE", "FAR", "FRAME"):
            assert np.argmax(colors[role][:3]) == 1
        assert np.argmax(colors["PROJECTOR"][:3]) == 2 and np.argmax(colors["FOLD"][:3]) == 0
        assert colors["FOLD"][0] > 2 * max(colors["FOLD"][1:3])
        assert len(set(colors.values())) == len(colors)
