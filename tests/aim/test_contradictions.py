# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets that no volume meets are found before one is looked for, and those that one meets are let be."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.aim.cases import NET, WIDTH, room, setting, view_setting
from scfpf_addon.aim.contradictions import (
    MOSTLY,
    Contradiction,
    find_contradiction,
    shown_twice,
    surfaces_at,
)
from scfpf_addon.aim.solver.problem import AimPins
from scfpf_addon.aim.views import AimView, sample_view, seen_of
from scfpf_addon.projection.surfaces.surface import Cylinder
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

# Points of the room: on the back wall, on the picture before it, in the air before that, and on the floor.
WALL, FRAME, AIR, FLOOR = (-3.0, 5.0, 1.0), (0.0, 4.9, 1.75), (0.0, 2.0, 1.65), (1.0, 0.0, 0.0)
PIXEL = 1.0 / WIDTH


@pytest.fixture(scope="module")
def place():
    return room()


def pins(*given):
    """Pins by themselves: a point, a place and, or not, a direction each."""
    rows = [(*point, *place, *(direction or [(np.nan,) * 3])[0]) for point, place, *direction in given]
    points, positions, directions = np.split(np.array(rows, np.float64).T, (3, 5))
    return AimPins(points, positions, directions)


AHEAD, LEFT = (0.0, 1.0, 0.0), (0.1, 0.995, 0.0)


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        # The same point at two places, or almost the same one far apart.
        ([(WALL, (0.2, 0.5)), (WALL, (0.6, 0.5))], "POINT"),
        ([(WALL, (0.2, 0.5)), (WALL, (0.2, 0.5 + 8 * PIXEL))], "POINT"),
        ([(WALL, (0.2, 0.5)), ((-2.999, 5.0, 1.0), (0.6, 0.5))], "POINT"),
        ([(AIR, (0.2, 0.5)), (AIR, (0.6, 0.5))], "POINT"),
        ([(FLOOR, (0.1, 0.1)), (WALL, (0.2, 0.5)), (FLOOR, (0.6, 0.1))], "POINT"),
        # Twice the same wish, or one within a pixel or two.
        ([(WALL, (0.2, 0.5)), (WALL, (0.2, 0.5))], None),
        ([(WALL, (0.2, 0.5)), (WALL, (0.2 + 2 * PIXEL, 0.5))], None),
        ([(WALL, (0.2, 0.5)), ((-2.8, 5.0, 1.0), (0.3, 0.5))], None),
        # Two points at the same place: what lies on a surface hides the other.
        ([(WALL, (0.4, 0.5)), (FRAME, (0.4, 0.5))], "PLACE"),
        ([(FLOOR, (0.4, 0.4)), (FRAME, (0.4, 0.4))], "PLACE"),
        ([(AIR, (0.5, 0.5)), (FRAME, (0.5, 0.5))], None),
        ([(FLOOR, (0.4, 0.4)), (FRAME, (0.45, 0.4))], None),
        # One point from two directions.
        ([(WALL, (0.2, 0.5), AHEAD), (WALL, (0.2, 0.5), LEFT)], "DIRECTION"),
        ([(WALL, (0.2, 0.5), AHEAD), (WALL, (0.2, 0.5), AHEAD)], None),
        ([(WALL, (0.2, 0.5), AHEAD), (WALL, (0.2, 0.5))], None),
        ([(WALL, (0.2, 0.5), AHEAD), (FLOOR, (0.6, 0.2), LEFT)], None),
        ([(WALL, (0.2, 0.5))], None),
    ],
)
def test_pins_that_no_volume_meets_are_found(place, given, kind):
    found = find_contradiction(place.scene, place.base, pins(*given), {}, WIDTH)
    assert (found and found.kind) == kind
    if kind == "PLACE":
        # The nearer one hides the other, whichever comes first in the list.
        assert given[found.first][0][1] < given[found.second][0][1]
        swapped = find_contradiction(place.scene, place.base, pins(*given[::-1]), {}, WIDTH)
        assert swapped == Contradiction(kind, 1 - found.first, 1 - found.second)


def test_a_panorama_of_more_than_a_turn_shows_points_twice(place):
    """Positions 0.1 and 0.9 of one and a quarter turns show the same direction."""
    turns = 1.25 * 2 * np.pi
    surfaces = tuple(Cylinder(radius=size, height=size, arc=turns) for size in (0.1, 20.0))
    before = Projection(ViewingVolume(surfaces), aspect=2.0)
    sample = before.volume.evaluate(np.array([0.1, 0.9]), np.full(2, 0.5), np.full(2, 0.2))
    np.testing.assert_allclose(sample.position[:, 0], sample.position[:, 1], atol=1e-9)
    twice = AimPins(sample.position, np.array([[0.1, 0.9], [0.5, 0.5]]))
    assert find_contradiction(place.scene, before, twice, {}, WIDTH) is None
    moved = replace(twice, positions=np.array([[0.1, 0.5], [0.5, 0.5]]))
    assert find_contradiction(place.scene, before, moved, {}, WIDTH).kind == "POINT"


def view_of(place, shift=0.0, left=0.0):
    """A view of the chair, and its place in the image moved to the right."""
    shown = place.view(left, 0.0)
    shown = replace(shown, position=(shown.position[0] + shift, shown.position[1]))
    return AimView(shown, place.wanted, seen_of(place.scene, place.wanted, shown))


@pytest.mark.parametrize(("off", "is_told"), [(0.0, False), (0.03, False), (0.2, True)])
def test_a_pin_on_what_a_view_shows_elsewhere_is_found(place, off, is_told):
    view = view_of(place)
    of_view = sample_view(place.scene, place.wanted, view.map, 4)
    point = of_view.points[:, :1]
    single = AimPins(point, view.map.positions(point) + np.array([[off], [0.0]]))
    both = AimPins.joined([single, of_view])
    found = find_contradiction(place.scene, place.base, both, {4: view}, WIDTH)
    assert found == (Contradiction("VIEW", 0, 1) if is_told else None)
    # A pin on something else, and one on what the view's eye does not see, do not matter.
    for other in (np.array([WALL]).T, np.array([[0.0], [1.25], [0.8]])):
        single = AimPins(other, np.array([[0.05], [0.9]]))
        both = AimPins.joined([single, of_view])
        assert find_contradiction(place.scene, place.base, both, {4: view}, WIDTH) is None


@pytest.mark.parametrize(("shift", "share"), [(0.0, 0.0), (0.03, 0.0), (0.2, 1.0)])
def test_views_that_show_the_same_twice_are_found(place, shift, share):
    views = {0: view_of(place), 3: view_of(place, shift)}
    both = AimPins.joined(
        [sample_view(place.scene, place.wanted, view.map, number) for number, view in views.items()]
    )
    for least in (0.25, MOSTLY):
        found = shown_twice(place.scene, both, views, least)
        assert found == (Contradiction("VIEWS", 0, int((both.views == 0).sum())) if share else None)
    assert (find_contradiction(place.scene, place.base, both, views, WIDTH) is None) == (share == 0.0)


def test_a_surface_is_found_at_points_on_it_only(place):
    points = np.array([WALL, FRAME, FLOOR, AIR, (0.0, 4.8, 1.75)]).T
    pixel = np.full(5, 0.002)
    np.testing.assert_array_equal(surfaces_at(place.scene, points, pixel) >= 0, [1, 1, 1, 0, 0])


def test_benchmarks_do_not_contradict_themselves(place):
    case = view_setting(place, 45.0, 10.0)
    assert find_contradiction(place.scene, case.before, case.problem.pins, {0: view_of(place)}, WIDTH) is None
    far = setting(place, pins((WALL, (0.2, 0.5)), (FRAME, (0.5, 0.5)), (FLOOR, (0.6, 0.2))), 1.0, net=NET)
    assert find_contradiction(place.scene, far.before, far.problem.pins, {}, WIDTH) is None
