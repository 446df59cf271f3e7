# SPDX-License-Identifier: GPL-3.0-or-later
"""The plates of the gallery: the figures of the paper in order, then those of ``gallery_beyond``."""

from __future__ import annotations

import json

from .gallery_beyond import BEYOND
from .gallery_panels import FISHEYE, SPHERES, Panel, Plate, sizes
from .render_demo import ROOT, SHOTS, Shot

HALL_EYE = Shot((0.0, 0.0, 1.7), (0.0, 1.0, 1.7), size=(1280, 640))
HOUSE = Shot((0.0, -21.0, 10.0), (0.0, 0.0, 2.6), 1.3)
TWIST = Shot((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), size=(800, 800))
STREET_VIEW = Shot((0.0, 0.0, 1.7), (0.0, 1.0, 1.7), size=(1800, 200))
PASSAGE = Shot((0.0, -1.0, 2.6), (0.0, 10.0, 2.6), size=(1024, 768))


def _zooms(left: float, right: float) -> dict[int, dict[str, object]]:
    """Changes of the curved street's far surface: factors of its height at the left and right end."""
    data = json.loads((ROOT / "presets" / "street_panorama_curved.json").read_text(encoding="utf-8"))
    rows = data["surfaces"][2]["points"]

    def height(x: float) -> float:
        share = min(max((x + 10) / 20, 0.0), 1.0)
        return left + (right - left) * share * share * (3 - 2 * share)

    points = [[(x, 1.7 + (y - 1.7) * height(x), z) for x, y, z in row] for row in rows]
    return {2: {"points": points}}


FIGURES = (
    Plate(
        "figure-1",
        "Figure 1: almost all round a car",
        "Projectors start on a wide rectangle, bend round the car and end inside it. Its front is in the "
        "middle of the picture, both sides beside it, and the back at the borders. One camera makes the "
        "picture, without a seam.",
        (
            Panel(
                "around_the_car",
                "street",
                SHOTS["around_the_car"],
                projectors=(15, 3),
                direction=(35.0, 35.0),
                hidden=("Houses", "Street furniture"),
            ),
        ),
    ),
    Plate(
        "figure-2",
        "Figure 2: where it starts, an orthographic volume",
        "Two equal rectangles have parallel projectors. All other volumes are this box, deformed.",
        (Panel("orthographic", "house", HOUSE, drawn=sizes((16, 9, 1), (16, 9, 32)), hidden=("Trees",)),),
    ),
    Plate(
        "figure-3",
        "Figure 3: a volume of curved surfaces and curved projectors",
        "Three bicubic patches: the near one bulges, the middle one stands aside, the far one is a saddle.",
        (
            Panel(
                "deep_curvy_volume",
                "square",
                Shot((-5.0, -7.0, 7.5), (-3.0, 12.0, 0.5), 1.8, (1024, 768)),
                projectors=(6, 5),
            ),
        ),
    ),
    Plate(
        "figure-4",
        "Figure 4: perspective, orthographic, inverted perspective",
        "The far rectangle is larger than the near one, equal, or smaller. Distant things shrink, keep their "
        "size, or grow. The last picture shows both sides of the house at once.",
        (
            Panel(
                "perspective",
                "house",
                Shot((0.0, -33.0, 15.0), (0.0, 0.0, 2.6)),
                "Perspective",
                drawn=sizes((3.6, 2.025, 5), (33.12, 18.63, 46)),
                hidden=("Trees",),
            ),
            Panel(
                "orthographic",
                "house",
                HOUSE,
                "Orthographic",
                drawn=sizes((16, 9, 1), (16, 9, 32)),
                hidden=("Trees",),
            ),
            Panel(
                "inverted_perspective",
                "house",
                Shot((0.0, -21.0, 10.0), (0.0, 0.0, 2.6), 1.45),
                "Inverted perspective",
                hidden=("Trees",),
            ),
        ),
    ),
    Plate(
        "figure-5",
        "Figure 5: a hall without wide-angle distortion",
        "In the wide perspective on the left, columns get fatter towards the borders. On the right the near "
        "rectangle is much wider. Its projectors do not meet in a point, and columns keep their width.",
        (
            Panel(
                "perspective",
                "hall",
                HALL_EYE,
                "Perspective, 127° wide",
                changed=sizes((4, 2, 1), (80, 40, 20)),
                direction=(60.0, 30.0),
            ),
            Panel("irregular_perspective", "hall", HALL_EYE, "Irregular perspective", direction=(60.0, 30.0)),
        ),
    ),
    Plate(
        "figure-6",
        "Figure 6: a cylindrical panorama",
        "A cylinder inside a larger one makes a picture 360° wide.",
        (
            Panel(
                "cylindrical_panorama",
                "street",
                SHOTS["cylindrical_panorama"],
                projectors=(25, 4),
                direction=(35.0, 40.0),
                drawn={0: {"radius": 1.5, "height": 5.3}, 1: {"radius": 7, "height": 24.7}},
            ),
        ),
    ),
    Plate(
        "figure-7",
        "Figure 7: a twist that stays, a twist that passes",
        "Left: the far square is turned by 90°. More distant frames are turned more, and the arrow on the "
        "far wall points aside. Right: only the middle one of three squares is turned. Projectors are "
        "curved, and the arrow points upwards again.",
        (
            Panel("linear_twist", "frames", TWIST, "Linear twist", direction=(62.0, 22.0)),
            Panel("nonlinear_twist", "frames", TWIST, "Nonlinear twist", direction=(62.0, 22.0)),
        ),
    ),
    Plate(
        "figure-8",
        "Figure 8: an angular fisheye",
        "A small hemisphere inside a large one, unrolled in polar coordinates. The distance from the "
        "picture's middle is the angle to the axis.",
        (
            Panel(
                "angular_fisheye",
                "street",
                FISHEYE,
                projectors=(9, 9),
                direction=(115.0, 25.0),
                drawn=SPHERES,
            ),
        ),
    ),
    Plate(
        "figure-9",
        "Figure 9: parallels that converge along curves",
        "Three rectangles have different shapes. Rails, beams and blue lines run straight away from the "
        "viewer, and bend in the picture.",
        (Panel("curved_convergence", "colonnade", PASSAGE, projectors=(6, 5), direction=(65.0, 20.0)),),
    ),
    Plate(
        "figure-10",
        "Figure 10: the occlusion camera",
        "The volume is a perspective up to the car. Behind its front, projectors bend towards the picture's "
        "middle and show its sides, which a perspective (left) hides.",
        (
            Panel(
                "perspective",
                "street",
                Shot((0.0, -10.0, 0.9), (0.0, 0.0, 0.9), size=(1024, 768)),
                "Perspective",
                changed=sizes((0.12, 0.09, 0.1), (120, 90, 100)),
                drawn=sizes((1.2, 0.9, 1), (19.2, 14.4, 16)),
                hidden=("Houses",),
            ),
            Panel(
                "occlusion_camera",
                "street",
                Shot((0.0, -10.0, 0.9), (0.0, 0.0, 0.9), size=(1024, 768)),
                "Occlusion camera",
                projectors=(9, 5),
                reach=19.0,
                hidden=("Houses",),
            ),
        ),
    ),
    Plate(
        "figure-11",
        "Figure 11: a long street, straight and with views into A and B",
        "Straight projectors show only the ends of the side streets. Curved ones bend apart in the two "
        "regions A and B. Each side street has a perspective of its own, and the fronts stay as they are.",
        (
            Panel(
                "street_panorama",
                "long street",
                STREET_VIEW,
                "Straight projectors",
                projectors=(25, 2),
                direction=(20.0, 40.0),
            ),
            Panel(
                "street_panorama_curved",
                "long street",
                STREET_VIEW,
                "Curved projectors",
                projectors=(25, 2),
                direction=(20.0, 40.0),
            ),
            Panel(
                "street_panorama_curved",
                "long street",
                STREET_VIEW,
                "The far surface's height varied: areas of differing zoom",
                projectors=(25, 2),
                direction=(20.0, 40.0),
                changed=_zooms(1.7, 0.5),
            ),
        ),
    ),
    Plate(
        "figure-12",
        "Figure 12: orthographic near by, perspective far away",
        "Near things are drawn to scale, as in a plan. Behind them the view opens into a perspective.",
        (
            Panel(
                "orthographic_to_perspective",
                "square",
                Shot((0.0, -4.0, 8.6), (0.0, 30.0, -1.4), 2.2, (1024, 768)),
                projectors=(6, 5),
            ),
        ),
    ),
    Plate(
        "figure-13",
        "Figure 13: the House of Stairs",
        "After M. C. Escher's study of 1951. Left: a perspective of the shaft. Right: all of it from zenith "
        "to nadir, with verticals that bend towards both.",
        (
            Panel(
                "perspective",
                "shaft",
                Shot((0.0, -5.5, 0.0), (0.0, 1.0, 0.0), size=(600, 900)),
                "Perspective",
                changed=sizes((0.12, 0.18, 0.1), (60, 90, 50)),
                drawn=sizes((1.2, 1.8, 1), (12, 18, 10)),
                direction=(75.0, 10.0),
                hidden=("Side walls",),
            ),
            Panel(
                "house_of_stairs",
                "shaft",
                Shot((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), size=(600, 900)),
                "House of Stairs",
                projectors=(3, 13),
                direction=(75.0, 10.0),
                hidden=("Side walls",),
            ),
        ),
    ),
)

PLATES = (*FIGURES, *BEYOND)
