# SPDX-License-Identifier: GPL-3.0-or-later
"""``Scene.scfpf_drawn``: the settings of Drawn Style, as properties and as a frame takes them."""

from __future__ import annotations

import math

import bpy
import numpy as np
from bpy.props import PointerProperty

from ...shading.settings.stylised_settings import (
    CONTOUR,
    CREASE,
    MATERIAL,
    OBJECT,
    SILHOUETTE,
    Hatching,
    Lines,
    Stylised,
)
from .property_options import choice, color, integer, number, switch

# Pixels. Wider lines take long to draw.
WIDEST = 64.0
# The kind of lines that each property switches on.
LINE_KINDS = {
    "use_silhouette": SILHOUETTE,
    "use_object": OBJECT,
    "use_contour": CONTOUR,
    "use_material": MATERIAL,
    "use_crease": CREASE,
}
PIXELS = "in pixels at 100 % resolution: other percentages scale it"


class SCFPF_Drawn(bpy.types.PropertyGroup):
    """Settings of Drawn Style in the engine and the Render button; only Combined follows them."""

    use_drawn: switch(
        "Drawn Style", "Draw the picture: lines, flat shades and paper; other passes stay as they are", False
    )
    use_lines: switch("Lines", "Draw lines where surfaces end, bend or change", True)
    use_silhouette: switch("Silhouettes", "Edges in front of other surfaces or of the background", True)
    use_object: switch("Objects", "Borders between objects, also where they touch", True)
    use_contour: switch(
        "Contours",
        "Lines along which projectors graze a smooth-shaded surface",
        True,
    )
    use_material: switch("Materials", "Borders between materials", False)
    use_crease: switch("Creases", "Edges sharper than Crease Angle", True)
    line_width: number(
        "Outline Width",
        f"Width of silhouettes and of objects' edges, {PIXELS}",
        2.0,
        0.1,
        WIDEST,
        soft_max=10.0,
        step=10,
    )
    inner_width: number(
        "Inner Width",
        f"Width of contours, material edges and creases, {PIXELS}",
        1.0,
        0.1,
        WIDEST,
        soft_max=10.0,
        step=10,
    )
    line_color: color("Line Color", "Color of the lines", (0.0, 0.0, 0.0))
    crease_angle: number(
        "Crease Angle",
        "The angle between two faces, whatever their shading, from which the edge between them is drawn",
        math.radians(30),
        math.radians(1),
        math.radians(179),
        subtype="ANGLE",
    )
    depth_jump: number(
        "Depth Jump",
        "Least distance between two surfaces for a silhouette, in widths of a pixel there: steep surfaces "
        "alone have none",
        2.0,
        0.0,
        1000.0,
        soft_min=0.5,
        soft_max=50.0,
    )
    fill: choice(
        "Fill",
        "Fill between the lines",
        items=(
            ("RENDERED", "Rendered", "The picture as rendered without Drawn Style"),
            (
                "TOON",
                "Steps of Light",
                "The materials' colors, darker in a few steps where less light arrives",
            ),
            ("FLAT", "Flat Colors", "The materials' colors, without light and shadow"),
            ("PAPER", "Paper", "Paper only"),
        ),
        default="TOON",
    )
    steps: integer("Steps", "Number of shades from the darkest one to full light", 3, 2, 64, soft_max=8)
    softness: number(
        "Softness",
        "Width of the transition between steps: 0 is a sharp edge, 1 leaves no even parts",
        0.0,
        0.0,
        1.0,
        subtype="FACTOR",
    )
    darkest: number(
        "Darkest",
        "Share of its color that a material keeps where no light falls",
        0.3,
        0.0,
        1.0,
        subtype="FACTOR",
    )
    exposure: number(
        "Exposure",
        "Brighten or darken the light for steps and strokes, in stops",
        0.0,
        -10.0,
        10.0,
        soft_min=-4.0,
        soft_max=4.0,
    )
    fade: number(
        "Fade to Paper", "How much of the paper shows through the fill", 0.0, 0.0, 1.0, subtype="FACTOR"
    )
    hatching: choice(
        "Hatching",
        "Strokes over the fill",
        items=(
            ("NONE", "None", "No strokes"),
            ("DEPTH", "Equal t", "Lines of equal t: cuts through the viewing volume"),
            ("TONE", "Tone", "Strokes where there is less light, in up to three layers"),
        ),
        default="NONE",
    )
    hatch_width: number(
        "Stroke Width", f"Width of strokes, {PIXELS}", 1.0, 0.1, WIDEST, soft_max=6.0, step=10
    )
    hatch_color: color("Stroke Color", "Color of the strokes", (0.0, 0.0, 0.0))
    hatch_count: integer(
        "Steps of t", "Number of parts into which lines of equal t cut the volume", 64, 2, 4096, soft_max=256
    )
    hatch_spacing: number(
        "Spacing", f"Between the middles of strokes, {PIXELS}", 6.0, 1.0, 1000.0, soft_max=40.0, step=10
    )
    hatch_angle: number(
        "Angle",
        "Angle of the strokes from the horizontal",
        math.radians(45),
        math.radians(-180),
        math.radians(180),
        subtype="ANGLE",
    )
    use_cross: switch(
        "Cross-Hatching", "Draw strokes for darker tones across the others instead of between them", True
    )
    use_paper: switch(
        "Paper",
        "Show paper where nothing is hit, also beyond the rim of round pictures, but not with a "
        "transparent film",
        True,
    )
    paper_color: color("Paper Color", "The color of the paper", (1.0, 1.0, 1.0))
    detail: integer(
        "Detail",
        "Places along each side of a pixel at which lines are searched: more find finer lines, and each "
        "takes about as long as a sample",
        2,
        1,
        4,
    )


def stylised_of(scene, width: int) -> Stylised | None:
    """Return the style of an evaluated scene for an image width in pixels, None if Drawn Style is off."""
    options = scene.scfpf_drawn
    if not options.use_drawn:
        return None
    lines = hatching = None
    if options.use_lines:
        lines = Lines(
            kinds=sum(bit for name, bit in LINE_KINDS.items() if getattr(options, name)),
            width=options.line_width,
            inner_width=options.inner_width,
            color=np.array(options.line_color, np.float64),
            crease_angle=options.crease_angle,
            jump=options.depth_jump,
        )
    if options.hatching != "NONE":
        hatching = Hatching(
            kind=options.hatching,
            width=options.hatch_width,
            color=np.array(options.hatch_color, np.float64),
            count=options.hatch_count,
            spacing=options.hatch_spacing,
            angle=options.hatch_angle,
            cross=options.use_cross,
        )
    style = Stylised(
        lines=lines,
        hatching=hatching,
        fill=options.fill,
        steps=options.steps,
        softness=options.softness,
        darkest=options.darkest,
        exposure=options.exposure,
        fade=options.fade,
        paper=np.array(options.paper_color, np.float64),
        on_paper=options.use_paper,
        detail=options.detail,
    )
    return style.scaled(width / scene.render.resolution_x)


def register():
    bpy.utils.register_class(SCFPF_Drawn)
    bpy.types.Scene.scfpf_drawn = PointerProperty(name="SCFPF Drawn Style", type=SCFPF_Drawn)


def unregister():
    del bpy.types.Scene.scfpf_drawn
    bpy.utils.unregister_class(SCFPF_Drawn)
