# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of Drawn Style in live images of planes, whose edges are known."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.shading.live.live_hits import LiveHits
from scfpf_addon.shading.live.live_lines import draw_lines
from scfpf_addon.shading.settings.stylised_settings import CREASE, MATERIAL, OBJECT, SILHOUETTE, Lines

HEIGHT, WIDTH = 40, 60
BLACK = Lines(SILHOUETTE | OBJECT | CREASE | MATERIAL, 2.0, 2.0)


def seen(depth, normal=(0.0, 0.0, 1.0), number=0, look=None):
    """Hits in parallel projection along -z, a unit across a pixel, of a surface of given depths (H, W)."""
    column, row = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    depth = np.broadcast_to(depth, (HEIGHT, WIDTH)).astype(float)
    count = HEIGHT * WIDTH
    number = np.broadcast_to(number, (HEIGHT, WIDTH)).ravel().astype(np.int32)
    zero, one = np.zeros(count, np.float32), np.ones(count, np.float32)
    normal = np.broadcast_to(np.array(normal, float).reshape(3, -1), (3, count))
    return LiveHits(
        width=WIDTH,
        height=HEIGHT,
        mask=np.ones(count, bool),
        look=number if look is None else look.ravel().astype(np.int32),
        object=number,
        t=one,
        position=np.stack([column, row, -depth]).reshape(3, -1).astype(np.float32),
        forward=np.stack([zero, zero, -one]),
        right=np.stack([one, zero, zero]),
        up=np.stack([zero, one, zero]),
        is_mirrored=np.zeros(count, bool),
        normal=(normal / np.linalg.norm(normal, axis=0)).astype(np.float32),
    )


def ink(hits, lines=BLACK, pixel_size=1.0):
    """The pixels (H, W) with ink on white, as shares."""
    image = np.ones((HEIGHT, WIDTH, 4), np.float32)
    draw_lines(image, hits, lines, pixel_size)
    return 1 - image[..., 0]


def ring(inside):
    """The pixels on both sides of a border between two sets, by a loop."""
    found = np.zeros_like(inside)
    for row in range(HEIGHT):
        for column in range(WIDTH):
            for r, c in ((row + 1, column), (row, column + 1)):
                if r < HEIGHT and c < WIDTH and inside[r, c] != inside[row, column]:
                    found[r, c] = found[row, column] = True
    return found


def square():
    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[10:25, 20:45] = True
    return inside


def test_a_step_in_depth_is_a_line_on_both_sides():
    assert (ink(seen(np.where(square(), 5.0, 9.0))) == ring(square())).all()


def test_a_steep_surface_has_no_line():
    """A floor that falls by 40 pixels a pixel: neighbours are far apart, and on one plane."""
    row = np.arange(HEIGHT)[:, None]
    assert (ink(seen(40.0 * row, (0.0, 40.0, 1.0))) == 0).all()


def test_the_rim_before_nothing_is_a_line():
    look = np.where(square(), 0, -1)
    assert (ink(seen(5.0, number=look)) == ring(square())).all()


@pytest.mark.parametrize("kind", [OBJECT, MATERIAL])
def test_borders_of_objects_and_materials_are_lines_if_asked_for(kind):
    objects = np.where(square(), 1, 0)
    hits = seen(5.0, number=objects) if kind == OBJECT else seen(5.0, look=objects)
    assert (ink(hits, replace(BLACK, kinds=kind)) == ring(square())).all()
    assert (ink(hits, replace(BLACK, kinds=CREASE)) == 0).all()


def test_a_crease_is_a_line_from_its_angle_on():
    """A roof whose sides meet at 90°, and at 20°."""
    column = np.arange(WIDTH)
    right = np.broadcast_to(column >= 30, (HEIGHT, WIDTH))
    for slope, is_line in ((1.0, True), (np.tan(np.radians(10)), False)):
        side = np.where(right, slope, -slope)
        normal = np.stack([side, 0 * side, np.ones_like(side)]).reshape(3, -1)
        expected = ring(right) if is_line else np.zeros_like(right)
        assert (ink(seen(slope * np.abs(column - 29.5) + 5, normal)) == expected).all()


def test_lines_are_as_wide_on_the_screen_as_they_are_set():
    hits = seen(np.where(square(), 5.0, 9.0))
    widths = {}
    for width, pixel_size in ((0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (6.0, 1.0), (2.0, 4.0)):
        # Along a row through the square's left border.
        line = ink(hits, replace(BLACK, width=width), pixel_size)[17, :32]
        widths[width, pixel_size] = float(line.sum()) * pixel_size
    assert widths == pytest.approx(
        {(0.5, 1.0): 0.5, (1.0, 1.0): 1, (2.0, 1.0): 2, (6.0, 1.0): 6, (2.0, 4.0): 2}
    )


def test_lines_have_their_colour():
    image = np.ones((HEIGHT, WIDTH, 4), np.float32)
    color = np.array([1.0, 0.0, 0.214041])
    draw_lines(image, seen(np.where(square(), 5.0, 9.0)), replace(BLACK, color=color), 1.0)
    assert np.allclose(image[ring(square())], (1, 0, 0.5, 1), atol=1e-3)
