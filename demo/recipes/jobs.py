# SPDX-License-Identifier: GPL-3.0-or-later
"""The recipes: jobs that people come for, each as steps that a page tells and a test performs."""

from __future__ import annotations

import math
from pathlib import Path

from ..toon import MANGA, draw_outlines, draw_tones
from . import scenes
from .steps import Recipe, Step, add, add_as_made, done, place, render, render_with_eevee, scale, select, size


def _add_layer() -> None:
    import bpy

    done(bpy.ops.scfpf.layer_add())


def _cursor_to_selected() -> None:
    import bpy

    bpy.context.scene.cursor.location = bpy.context.object.location


def _turn_about_cursor() -> None:
    import bpy
    from mathutils import Matrix

    eye, pivot = bpy.context.scene.camera.scfpf.layers[0].camera, bpy.context.scene.cursor.location
    turn = Matrix.Rotation(math.radians(TURN), 4, "Z")
    eye.matrix_world = Matrix.Translation(pivot) @ turn @ Matrix.Translation(-pivot) @ eye.matrix_world


def _look_behind() -> None:
    import bpy

    done(bpy.ops.scfpf.look_behind())
    settings = bpy.context.object.scfpf
    settings.active_hidden = settings.hidden_things.find("Head")


def _show_hidden() -> None:
    import bpy

    done(bpy.ops.scfpf.hidden_show(way="VIEW"))


def _solve() -> None:
    import bpy

    done(bpy.ops.scfpf.aim_solve())


def _from_screen() -> None:
    import bpy

    done(bpy.ops.scfpf.camera_from_screen())
    bpy.context.scene.camera = bpy.context.object


def _from_calibration() -> None:
    import bpy

    done(bpy.ops.scfpf.camera_from_calibration(filepath=str(CALIBRATION)))
    bpy.context.scene.camera = bpy.context.object


def _own_frustum() -> None:
    import bpy

    done(bpy.ops.scfpf.camera_from_camera())


def _blend() -> None:
    import bpy

    done(bpy.ops.scfpf.camera_blend())


def _gradient() -> None:
    import bpy

    done(bpy.ops.scfpf.blend_map(kind="LINEAR"))
    field = bpy.context.object.scfpf.blend_field
    field.angle, field.center, field.border = math.radians(90.0), (0.5, 0.55), 0.4


def _add_view() -> None:
    import bpy

    done(bpy.ops.scfpf.camera_add(preset="VIEW"))
    bpy.context.scene.camera = bpy.context.object


def _by_distance() -> None:
    import bpy

    done(bpy.ops.scfpf.by_distance())


def _view_at(distance: float, angle: float, is_new: bool = False):
    """Give the active distance, or a new one, a field of view in degrees."""

    def act() -> None:
        import bpy

        settings = bpy.context.object.scfpf
        if is_new:
            done(bpy.ops.scfpf.distance_add(distance=distance))
        own = settings.surfaces[settings.active_surface].object.scfpf_surface
        own.distance, own.angle = distance, math.radians(angle)

    return act


def _over_time() -> None:
    import bpy

    done(bpy.ops.scfpf.time_render(way="ROLLING", span=SHUTTER, steps=bpy.context.scene.render.resolution_y))


def _quilt() -> None:
    import bpy

    columns, rows = VIEWS
    done(bpy.ops.scfpf.quilt(columns=columns, rows=rows, cone=math.radians(CONE), focus=BODY[0]))


def _tiles() -> None:
    import bpy

    done(bpy.ops.scfpf.dimetric(tile=TILE))


# Views across and up a quilt, and the angle between its first and its last view, in degrees.
VIEWS, CONE = (8, 6), 35.0
# The width of a tile of one metre in pixels.
TILE = 24
# The thickness of lines in metres, by collection.
LINES = {"Town": 0.24, "Boxer": 0.026, "Fist": 0.009}
# How many frames the rolling shutter of the propeller takes.
SHUTTER = 9.0
# Distances and fields of view, in degrees, of the recipe of the fist.
FIST, BODY = (1.2, 43.0), (2.8, 76.0)
# A lens, as OpenCV's calibration writes it.
CALIBRATION = Path(__file__).with_name("action_camera.yml")
# The angle by which the recipe of the best side turns the layer's camera, in degrees.
TURN = 50.0
SCREEN = (
    select(
        "Model the screen where it stands, and unwrap it as its pixels lie. Put an empty at the viewer's "
        "eye. Select the eye, then the screen with Shift.",
        "Eye",
        "Screen",
    ),
    Step("Choose *Add › Camera › Flexible Camera from Screen*.", _from_screen),
)
SCREEN_MORE = (
    "The camera follows the eye and the screen when you move them. The picture shows the scene without the "
    "screen, as seen from the eye, pixel by pixel of its UV map. What stands before the screen pops out of "
    "it, as long as the screen is behind all of it. [The guide](../guide.md#ways-to-a-picture) says more."
)

# Steps to a volume between two cameras.
RISING = (
    select("Place two ordinary cameras, one at the height of eyes. Select it.", "Level"),
    Step("Choose *This Camera's Own Frustum* in the menu *Projection Preset*.", _own_frustum),
    select("Select the other, which is above the roofs and looks down.", "From Above"),
    Step("Do the same with it: both show what they did before.", _own_frustum),
    select("Select the lower camera, then the upper one with Shift.", "Level", "From Above"),
    Step("Press *Blend Cameras* in the panel *Blend*.", _blend),
    Step(
        "Choose *Gradient* under *Map*. Set *Angle* to 90°, *Center* to 0.5 and 0.55, *Border* to 0.4.",
        _gradient,
    ),
)


def _outlines(more: str = "", thicknesses: dict[str, float] | None = None) -> Step:
    """Draw outlines. more: a sentence. thicknesses: see ``draw_outlines``."""
    text = (
        "Give the objects a black *Emission* material as their last one, with *Backface Culling* for "
        "*Camera* and *Shadow*. Add a *Solidify* modifier with *Offset* 1, *Flip Normals* on, *Fill Rim* "
        "off, and *Material Offset* so large that it reaches the black one."
    )
    return Step(text + more, lambda: draw_outlines(thicknesses))


# Steps to a cartoon, and to a picture in black, grey and white.
TONED = (
    "Give the materials *Diffuse*, *Shader to RGB* and a *Color Ramp* with *Constant* steps{0}, and "
    "multiply their color by it."
)
CARTOON = (Step(TONED.format(""), draw_tones), _outlines())
INKED = (
    Step(TONED.format(" of black, grey and white"), lambda: draw_tones(MANGA)),
    _outlines(
        f" *Thickness* is {LINES['Fist']:g} m at the fist, {LINES['Boxer']:g} m at the figure, and "
        f"{LINES['Town']:g} m in the town, which is farther away.",
        LINES,
    ),
)

RECIPES = (
    Recipe(
        "best-side",
        "A character from its best side, the rest as shot",
        "Turn one thing in the picture, and keep the background and the framing.",
        scenes.head,
        (
            size(960, 540),
            select("Select the character. The scene has an ordinary camera.", "Head"),
            Step("Press *Add Layer* in the panel *Layers* (press N, tab *Flexible Projection*).", _add_layer),
            Step(
                "Put the 3D cursor on the character: *Shift-S*, *Cursor to Selected*. Choose *3D Cursor* as "
                "*Pivot Point* in the viewport's header.",
                _cursor_to_selected,
            ),
            Step(
                "Select the layer's camera, *Head Layer*, and turn it about the cursor: *R Z 50 Enter*.",
                _turn_about_cursor,
            ),
            render(),
        ),
        "Only the character turns: every other pixel stays. *Live View* shows it while you turn, and *Size* "
        "in the panel makes it larger. Light and shadow are those of the scene. [Compose](../compose.md) has "
        "more; [Aim](../aim.md) turns things by one bent volume, without borders.",
    ),
    Recipe(
        "behind-a-wall",
        "A head that looks round a wall",
        "Find what the shot hides, and show it beside what hides it, in one picture without a cut.",
        scenes.behind_a_wall,
        (
            size(960, 540),
            select("Select the ordinary camera.", "Camera"),
            Step("Choose *This Camera's Own Frustum* in the menu *Projection Preset*.", _own_frustum),
            Step(
                "Open the panel *Look Behind* and press *Look Behind*. The list names what the picture "
                "hides, the largest first: choose *Head*.",
                _look_behind,
            ),
            Step("Press *Add View* below the list.", _show_hidden),
            Step("Press *Solve* in the panel *Aim*.", _solve),
            render(),
        ),
        "The view stands where the picture first sees past the wall, and its camera where nothing hides the "
        "head: projectors come round the edge. What is around the head follows it, within the *Halo* of the "
        "view; the rest stays. *Add Layer* instead shows the head where it is, in front of the wall. What is "
        "selected is named first, however small it is.",
    ),
    Recipe(
        "big-fist",
        "A big fist before a small figure",
        "Perspective by distance: a field of view for the hand, one for the body, one for the town.",
        scenes.boxer,
        (
            size(960, 540),
            select("Select the ordinary camera.", "Camera"),
            Step("Choose *Perspective by Distance* in the menu *Projection Preset*.", _by_distance),
            Step(
                f"In *Control Surfaces* give the distance in the middle *Distance* {FIST[0]:g} m and "
                f"*Field of View* {FIST[1]:g}°: the fist gets larger.",
                _view_at(*FIST),
            ),
            Step(
                f"Press + and give the new one *Distance* {BODY[0]:g} m and *Field of View* {BODY[1]:g}°: "
                "the body gets smaller.",
                _view_at(*BODY, is_new=True),
            ),
            render(),
        ),
        "Things at each distance have just the size that its field of view says. In between projectors run "
        "smoothly; *Polyline* makes them straight. The arrows in the viewport drag distances and widths. "
        "Keyframes act on *Distance*, *Field of View* and *Shift*. A narrow field of view at a face and a "
        "wide one behind it make a portrait as through a long lens, before a wide street.",
    ),
    Recipe(
        "light-field",
        "A quilt for a light-field display",
        "Looking Glass, lenticular prints: a picture that has depth without glasses.",
        scenes.boxer,
        (
            size(75, 100),
            select("Select the ordinary camera.", "Camera"),
            Step("Choose *This Camera's Own Frustum* in the menu *Projection Preset*.", _own_frustum),
            Step(
                f"Press *Quilt* in the panel. Enter *Columns* {VIEWS[0]}, *Rows* {VIEWS[1]}, *View Cone* "
                f"{CONE:g}° and *Focus* {BODY[0]:g} m, the distance of the body.",
                _quilt,
            ),
        ),
        "The resolution is that of one view: a display wants more of it. Players of quilts read the numbers "
        "from the end of the file's name, which the status bar tells. What is at *Focus* lies in the "
        "display, the fist before it and the town behind. Any volume serves. *Engine* lets EEVEE or "
        "Cycles render the views.",
    ),
    Recipe(
        "rolling-shutter",
        "A propeller by a rolling shutter",
        "A picture in which each row has a time of its own; columns make a slit scan.",
        scenes.propeller,
        (
            size(960, 540),
            select("Select the camera of an animated scene.", "Camera"),
            Step("Choose *This Camera's Own Frustum* in the menu *Projection Preset*.", _own_frustum),
            Step(
                f"Press *Over Time* in the panel. Enter *Frames* {SHUTTER:g} and *Steps* 540, one a row.",
                _over_time,
            ),
        ),
        "The propeller turns once in eight frames. Any volume serves, and moves with its keyframes "
        "meanwhile. *Image* takes the times from a painted image. *Assemble from Frames* makes the same "
        "from the frames that EEVEE or Cycles have rendered.",
    ),
    Recipe(
        "curved-world",
        "A small round world",
        "The ground falls away over a near horizon, as in games whose world rolls towards you.",
        scenes.street,
        (size(960, 540), *add_as_made("curved_world"), place((0.0, -27.0, 8.0), down=20.0), render()),
        "What comes nearer rises over the horizon. Move the surfaces in between and at the end up or down to "
        "make the world rounder or flatter.",
    ),
    Recipe(
        "unwrapped-car",
        "A thing from all round, unwrapped",
        "Front, sides, back, top and bottom in one picture, as a map shows a globe.",
        scenes.lone_car,
        (
            size(1000, 500),
            select("Select the thing: the car.", collection="Car"),
            add("inward_sphere"),
            render(),
        ),
        "The sphere of *Inward Sphere* lies around what was selected, and each of its points looks to the "
        "middle. With EEVEE or Cycles the picture is a texture for the thing, seen from without.",
    ),
    Recipe(
        "long-pan",
        "A bent background for a long pan",
        "One wide background over which a camera move slides, as in hand-drawn films.",
        scenes.street,
        (size(1520, 380), *add_as_made("long_pan"), place((0.0, -10.0, 2.0)), render()),
        "Move a 16:9 frame over the picture from left to right: the scene seems to turn by 100°. Pull the "
        "points of the two surfaces (*Edit Volume*, then Tab) to slide or turn elsewhere.",
    ),
    Recipe(
        "rising-street",
        "A street that rises before you",
        "A bent background: level in front, and farther away seen from ever higher.",
        scenes.two_cameras,
        (size(1120, 560), *RISING, render()),
        "The picture is that of one volume: nothing dissolves. Move the *Center* or make the *Border* "
        "wider in *Live View*. After a change of either camera press *Update Blend*. [Compose]"
        "(../compose.md) has more.",
    ),
    Recipe(
        "toon-rising-street",
        "A cartoon background that rises",
        "A bent background in flat tones, by EEVEE.",
        scenes.two_cameras,
        (
            size(800, 400),
            *CARTOON,
            *RISING,
            render_with_eevee(),
        ),
        "The hulls are bent with the things, so lines are as wide as the volume makes them: nearer is "
        "thicker. Lines that shall be seen from above the roofs need a *Thickness* of 0.1 m and more. *Plan "
        "Renders* tells before how many renders the picture takes.",
    ),
    Recipe(
        "panorama-map",
        "A panorama map",
        "A landscape like Heinrich Berann's: from above near by, from the front far away.",
        scenes.land,
        (size(1280, 720), *add_as_made("panorama_map"), place((0.0, -10.0, 12.0)), render()),
        "Heights count twice, for a camera 12 above the land. Scale the camera along its own Y (*S Y Y 2*) "
        "and raise it to 24: they count once. For larger land scale it along all axes, and raise it too.",
    ),
    Recipe(
        "led-wall",
        "The picture for a curved LED wall",
        "One render for a bent screen of several panels, without baking.",
        scenes.led_wall,
        (size(1280, 400), *SCREEN, render()),
        SCREEN_MORE,
    ),
    Recipe(
        "dome",
        "The picture for a dome and a viewer in it",
        "A dome master for an eye that is anywhere in the dome.",
        scenes.dome,
        (size(800, 800), *SCREEN, render()),
        SCREEN_MORE + " For an eye in the dome's centre take the [fulldome master](fulldome-master.md).",
    ),
    Recipe(
        "anamorphic-billboard",
        "An anamorphic billboard at a corner",
        "Two walls whose picture becomes a room when it is seen from the right place, and a ball pops out.",
        scenes.billboard,
        (size(1200, 460), *SCREEN, render()),
        SCREEN_MORE + " For one flat wall there is the preset *Anamorphic Billboard* as well.",
    ),
    Recipe(
        "calibrated-lens",
        "Things in the shot of a real lens",
        "Match a calibrated camera: OpenCV, a fisheye, OCamCalib or COLMAP.",
        scenes.street,
        (
            Step(
                "Choose *Add › Camera › Flexible Camera from Calibration File* and the file of your lens. "
                "Here it is `demo/recipes/action_camera.yml`, a wide action camera. The scene gets its "
                "resolution.",
                _from_calibration,
            ),
            place((-1.9, -4.6, 1.5), -24.0),
            render(),
        ),
        "Each pixel sees what the lens's own pixel sees. The image *action_camera Undistort* is the ST map "
        "that leads from the photograph to the picture behind the mapping. "
        "[The guide](../guide.md#a-measured-lens) has the files and models.",
    ),
    Recipe(
        "panini",
        "Wide angle without stretched edges",
        "150 degrees across, and people at the borders keep their width.",
        scenes.street,
        (size(1040, 585), add("panini"), place((-2.4, -4.4, 1.4), -30.0), render()),
        "*Panini, Half Compressed* bows level lines less. *Panini, Vertical* is for naves and towers.",
    ),
    Recipe(
        "game-tiles",
        "A town for an isometric game",
        "Tiles of the ground with an exact size in pixels, twice as wide as high.",
        scenes.street,
        (
            size(960, 540),
            Step("Choose *Add › Camera › Flexible Camera*.", _add_view),
            Step(
                "Choose *Dimetric for Tiles* in the menu *Projection Preset*. At the bottom left open "
                f"*Adjust Last Operation* and enter *Tile Width* {TILE}.",
                _tiles,
            ),
            render(),
        ),
        "The view is the preset *Dimetric 2:1*. A tile is one unit of the scene or *Tile Side*. Sprites that "
        "are rendered alone, with *Film › Transparent*, fit each other anywhere.",
    ),
    Recipe(
        "oblique",
        "Oblique and three-quarter views",
        "Drawings to measure in, and top-down views for games.",
        scenes.street,
        (
            size(1040, 585),
            *add_as_made("military"),
            scale(2.5),
            place((0.0, -37.5, 3.0)),
            render(),
        ),
        "*Oblique*, *Cavalier* and *Three-Quarter Top-Down* are applied in the same way. What is 15 ahead of "
        "the camera, times its scale, is in the middle.",
    ),
    Recipe(
        "tiny-planet",
        "A tiny planet",
        "The ground as a little planet with the town standing all round it.",
        scenes.street,
        (size(900, 900), add("tiny_planet"), place((0.0, -0.6, 5.0)), render()),
        "Lower the camera to make near things larger; raise it above the roofs to see the town from above. "
        "What is ahead of the camera points upwards.",
    ),
    Recipe(
        "toon-panorama",
        "A toon panorama",
        "150 degrees of a street as a cartoon, by EEVEE.",
        scenes.street,
        (
            size(800, 450),
            *CARTOON,
            add("panini"),
            place((-2.4, -4.4, 1.4), -30.0),
            render_with_eevee(),
        ),
        "Most of a panorama or a fisheye comes from six renders at most. More *Samples* smooth edges.",
    ),
    Recipe(
        "manga-perspective",
        "Manga perspective with outlines",
        "Five-point perspective in black and white, with ink lines, flat tones and dots, by EEVEE.",
        scenes.manga,
        (
            size(640, 800),
            *INKED,
            add("stereographic"),
            place((0.57, -1.95, 0.98), down=-17.0),
            render_with_eevee(),
        ),
        "Lines are as wide as the volume makes them: choose a *Thickness* that is two pixels and more where "
        "things are. What hangs on a wall gets a line all round if it stands a little before the wall. The "
        "dots of the sky are in its world, by direction, so that renders agree on them. The sun casts no "
        "shadows: the tones are those of the sides of things. *Plan Renders* tells before how many "
        "renders the picture takes.",
    ),
    Recipe(
        "fulldome-master",
        "A fulldome master",
        "The whole dome above the camera as a disk, for planetariums.",
        scenes.street,
        (size(900, 900), add("fulldome_master"), place((-1.7, -3.9, 1.2)), render()),
        "Planetariums ask for 4096 × 4096. For a tilted dome select both surfaces and turn them about the "
        "camera's X.",
    ),
    Recipe(
        "fulldome-eevee",
        "A fulldome master from EEVEE",
        "The whole dome by EEVEE, with the materials and lights that you have set up for it.",
        scenes.street,
        (size(600, 600), add("fulldome_master"), place((-1.7, -3.9, 1.2)), render_with_eevee()),
        "Most of it comes from six renders at most, at one place: nothing jumps at their borders. "
        "For a film use the command line: `blender -c scfpf render FILE.blend --engine eevee --frames FIRST "
        "LAST`.",
    ),
    Recipe(
        "all-sides",
        "A car from all sides at once",
        "Front, both sides and back of one thing in one picture, without a seam.",
        scenes.street,
        (
            size(1500, 500),
            select("Select the car, all of its parts.", collection="Car"),
            add("around_the_car"),
            render(),
        ),
        "The volume is placed around the selection. Its far surface is inside the car: drag it in *Live "
        "View*.",
    ),
    Recipe(
        "street-unrolled",
        "A street unrolled",
        "All fronts of a street side by side, each seen square-on.",
        scenes.street,
        (size(1800, 200), *add_as_made("street_panorama"), place((-4.0, 0.0, 2.05), -90.0), render()),
        "*Street Panorama, Curved* also looks into side streets. Scale the camera along its X for a longer "
        "street.",
    ),
    Recipe(
        "any-preset",
        "Any projection of the gallery in your scene",
        "Two clicks to each projection of the paper, and what to do then.",
        scenes.street,
        (
            size(800, 800),
            add("mirror_ball"),
            place((-1.7, -3.9, 1.2), -20.0),
            render(),
        ),
        "Every [preset](../presets.md) is applied like this, for example *Crystal Ball*. Then bend it: "
        "*Edit Volume* lets you click the surfaces, and *Live View* shows the picture while you drag.",
    ),
)
