# SPDX-License-Identifier: GPL-3.0-or-later
"""The plates of the gallery beyond the figures of the paper."""

from __future__ import annotations

from .gallery_panels import FISHEYE, SPHERES, Panel, Plate, sizes
from .render_demo import SHOTS, Shot

LEVEL = Shot((0.0, -4.0, 0.8), (0.0, 12.0, 0.8))

BEYOND = (
    Plate(
        "equirectangular",
        "Equirectangular panorama",
        "A sphere inside a larger one shows everything around the camera, above and below it.",
        (
            Panel(
                "equirectangular",
                "street",
                Shot((-2.4, -4.2, 1.6), (0.0, 0.0, 1.6), size=(1280, 640)),
                projectors=(17, 7),
                direction=(35.0, 30.0),
                drawn={0: {"radius": 1.2}, 1: {"radius": 6}},
                hidden=("Houses",),
            ),
        ),
        paper=False,
    ),
    Plate(
        "stereographic",
        "Stereographic wide view",
        "The picture shows more than half of the surroundings, and every small thing in its true shape.",
        (
            Panel(
                "stereographic",
                "street",
                Shot((-2.4, -4.2, 1.6), (0.2, 1.0, 1.6)),
                projectors=(9, 6),
                direction=(140.0, 30.0),
                reach=14.0,
                hidden=("Houses",),
            ),
        ),
        paper=False,
    ),
    Plate(
        "oblique",
        "Oblique: a cabinet drawing",
        "Parallel projectors meet the rectangles at a slant. The front keeps its true shape, and depth rises "
        "to the right.",
        (Panel("oblique", "house", Shot((0.0, -22.0, 3.6), (0.0, 0.0, 3.6), 1.25), hidden=("Trees",)),),
        paper=False,
    ),
    Plate(
        "off-centre",
        "Off centre: an architect's shift lens",
        "The far rectangle is higher than the near one. The view goes up, and verticals stay upright.",
        (
            Panel(
                "off_centre",
                "street",
                Shot((-1.0, -9.0, 1.9), (-1.0, 1.0, 1.9)),
                drawn={
                    0: {"width": 2.88, "height": 1.62, "location": [0, 0.6, -2]},
                    1: {"width": 28.8, "height": 16.2, "location": [0, 6.0, -20]},
                },
                hidden=("Houses", "Street furniture"),
            ),
        ),
        paper=False,
    ),
    Plate(
        "telephoto",
        "Telephoto",
        "From fifty metres away, near and far things look almost equally large.",
        (
            Panel(
                "telephoto",
                "street",
                Shot((0.6, -54.0, 3.0), (0.6, 2.0, 1.1)),
                drawn=sizes((0.6, 0.3375, 5), (7.2, 4.05, 60)),
                hidden=("Houses", "Street furniture"),
            ),
        ),
        paper=False,
    ),
    Plate(
        "digital-cubism",
        "Digital cubism",
        "After Glassner: the upper, middle and lower parts of the picture show the car from different sides.",
        (
            Panel(
                "digital_cubism",
                "street",
                Shot((0.35, -7.4, 2.3), (0.35, 0.0, 0.75), 0.74, (800, 800)),
                projectors=(5, 9),
                direction=(30.0, 40.0),
                hidden=("Houses", "Street furniture"),
            ),
        ),
        paper=False,
    ),
    Plate(
        "strip-camera",
        "A slit camera on a circle",
        "After Rademacher and Bishop: the centre of projection moves round the car and peels it.",
        (
            Panel(
                "strip_camera",
                "street",
                Shot((0.0, -12.0, 1.0), (0.0, 0.0, 1.0), 1.2, (1500, 500)),
                projectors=(25, 3),
                direction=(30.0, 45.0),
                hidden=("Houses", "Street furniture"),
            ),
        ),
        paper=False,
    ),
    Plate(
        "magic-lens",
        "A magic lens in space",
        "The middle of a plan is magnified: its projectors converge on the far surface.",
        (
            Panel(
                "magic_lens",
                "square",
                Shot((0.0, 12.0, 40.0), (0.0, 12.001, 0.0), 2.6),
                projectors=(13, 9),
                direction=(20.0, 20.0),
            ),
        ),
        paper=False,
    ),
    Plate(
        "barrel-lens",
        "A bulging front lens",
        "Projectors start on a bulging glass and spread faster towards the borders.",
        (
            Panel(
                "barrel_lens",
                "colonnade",
                Shot((0.0, -1.5, 2.6), (0.0, 10.0, 2.6)),
                projectors=(9, 6),
                reach=9.0,
                direction=(70.0, 20.0),
            ),
        ),
        paper=False,
    ),
    Plate(
        "image-mappings",
        "Mappings of the picture",
        "The angular fisheye through a lens' polynomial is the paper's figure 8, lower right. Radial curves "
        "make it equisolid, or show all directions like a mirror ball. The last picture is a perspective "
        "with more samples in its middle.",
        (
            *(
                Panel(stem, "street", FISHEYE, title, (9, 9), direction=(115.0, 25.0), drawn=SPHERES)
                for stem, title in (
                    ("polynomial_fisheye", "Lens-like"),
                    ("equisolid_fisheye", "Equisolid"),
                    ("mirror_ball", "Mirror ball"),
                )
            ),
            Panel("sample_rate_lens", "street", SHOTS["perspective"], "Sample-rate lens", (9, 7), reach=9.0),
        ),
        paper=False,
    ),
    Plate(
        "linear-cameras",
        "General linear cameras",
        "After Yu and McMillan: three projectors determine all others. A pushbroom is a slit that flies by, "
        "a pencil goes through one line, and no two projectors of a bilinear camera meet. The epipolar plane "
        "image shows one level slice from all places along a line.",
        tuple(
            Panel(
                stem,
                "square",
                Shot((0.0, -9.0, 6.0), (0.0, 12.0, 1.0)) if stem != "epi" else LEVEL,
                title,
                (7, 5),
            )
            for stem, title in (
                ("pushbroom", "Pushbroom"),
                ("cross_slit", "Crossed slits"),
                ("pencil", "Pencil"),
                ("bilinear", "Bilinear"),
                ("twisted_orthographic", "Twisted orthographic"),
                ("epi", "Epipolar plane image"),
            )
        ),
        paper=False,
    ),
    Plate(
        "tiles",
        "Multiperspective tiles",
        "After Yu and McMillan: sixteen triangles are linear cameras, each defined by the projectors of its "
        "corners. Front, both sides and the roof are in one picture. Straight lines kink where tiles meet, "
        "but do not break.",
        (
            Panel(
                "multiperspective_tiles",
                "house",
                Shot((0.0, -21.0, 4.5), (0.0, 0.0, 4.5)),
                projectors=(9, 5),
                hidden=("Trees",),
            ),
        ),
        paper=False,
    ),
    Plate(
        "drawn",
        "Drawn",
        "*Drawn Style* draws lines where surfaces end, bend or change, and flat shades on white. Other "
        "styles have cross-hatching, or lines of equal t, which are cuts through the volume.",
        (
            Panel("nonlinear_twist", "street", SHOTS["nonlinear_twist"], "Paper Look", style="PAPER"),
            Panel(
                "house_of_stairs",
                "shaft",
                Shot((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), size=(600, 900)),
                "Pen and Ink",
                projectors=(3, 13),
                direction=(75.0, 10.0),
                hidden=("Side walls",),
                style="INK",
            ),
            Panel("nonlinear_twist", "street", SHOTS["nonlinear_twist"], "Lines of Equal t", style="DEPTH"),
        ),
        paper=False,
    ),
)
