# SPDX-License-Identifier: GPL-3.0-or-later
"""Cautions: warnings in the panel about a Cycles rig that cannot give the right image."""

from __future__ import annotations

from ..bridge.blender.slot_animation import curve_collections
from ..bridge.blends.camera_blend import has_cuts
from ..bridge.layers.read_image_layers import NOT_BY_F12, shown_layers
from ..projection.user_error import Message
from . import aov_passes, hidden_surfaces
from .chords.chord_plan import SMALLEST_ERROR
from .engine_choice import ALIKE
from .rig_data import CYCLES, LAYOUT, NO_CYCLES, has_cycles

# Start of the data paths of image mappings.
MAPPINGS_PATH = "scfpf.mappings["
NO_AREA = Message("Projectors meet in a line, and what is behind it shows too: widen that control surface")
FREESTYLE = Message(
    "Freestyle's lines are left out, as it only draws what an ordinary camera sees: render with Flexible "
    "Projection and use Drawn Style"
)
OWN_DEPTH = Message(
    "Cycles' own passes Depth and Mist measure to the rig's camera: press t, Depth, (u, v, t) Passes and use "
    "those of the node SCFPF Passes"
)
PASSES_CHANGED = Message(
    "The node SCFPF Passes has the mist of another world, or is of another version: press Update Chords"
)
STEPS = Message(
    "Sharp seams of maps have steps of 1/256 of the picture: for finer ones render with Flexible Projection"
)
# Pixels whose sizes in space differ by a larger factor from those that Cycles takes them for differ visibly.
# Textures of a fisheye of 120° have 1.44 and are off by 0.026 beside Cycles' own one; of 90° 1.23 and 0.006.
MOST_SPREAD = 1.3
FLAT = Message("Bump comes out flat, since another version of the add-on made the rig: press Update Chords")


def cautions(scene, view_layer, rig) -> list[str]:
    """The cautions about a scene's rig, most of them in two parts: the problem, and what to do."""
    if not has_cycles(scene):
        return [NO_CYCLES]
    return _about_scene(scene, view_layer, rig.scfpf_rig) + _about_volume(scene, rig.scfpf_rig)


def _about_scene(scene, view_layer, settings) -> list[str]:
    cycles, found = scene.cycles, []
    if settings.problem:
        found.append(settings.problem)
    if scene.render.engine != CYCLES:
        found.append(Message("The rig works only in Cycles: choose it as the Render Engine"))
    if scene.camera != settings.view_camera:
        found.append(Message("The scene has another camera: make the rig's the scene camera again"))
    if scene.render.use_multiview:
        found.append(ALIKE)
    if view_layer.material_override is not None:
        found.append(Message("The material override stops the rays: clear it in View Layer Properties"))
    if cycles.transparent_max_bounces < settings.chords + 2:
        found.append(
            Message(
                "Too few transparent bounces: raise Light Paths > Transparent to {0}", settings.chords + 2
            )
        )
    if settings.strokes:
        found.append(
            Message("Not shown, as Blender draws it for ordinary cameras only: '{0}'", settings.strokes)
        )
    if not settings.passing and (view_layer.use_pass_z or view_layer.use_pass_mist):
        found.append(OWN_DEPTH)
    if settings.passes and not settings.passing and not aov_passes.is_in_step(scene):
        found.append(PASSES_CHANGED)
    if scene.render.use_freestyle and view_layer.use_freestyle:
        found.append(FREESTYLE)
    if scene.render.use_simplify and (cycles.use_camera_cull or cycles.use_distance_cull):
        found.append(Message("Culling would leave all objects out: switch it off in Simplify > Culling"))
    return found


def _about_volume(scene, settings) -> list[str]:
    found = [NOT_BY_F12] if shown_layers(settings.camera) and not settings.passing else []
    if settings.camera.data.dof.use_dof and settings.chords > 1:
        found.append(
            Message("No depth of field, as the projectors are bent: switch it off, or make them straight")
        )
    if settings.smoke:
        found.append(
            Message(
                "The near surface is in the smoke of '{0}', which Cycles misses: move it out", settings.smoke
            )
        )
    if settings.smoke_later not in ("", settings.smoke):
        found.append(
            Message(
                "At frame {1} the near surface is in the smoke of '{0}', which Cycles misses: move it out "
                "and press Update Chords",
                settings.smoke_later,
                settings.smoke_frame,
            )
        )
    if settings.smoke_unknown:
        found.append(
            Message(
                "The smoke of '{0}' changes with the frame: press Update Chords, which looks whether the "
                "near surface gets into it",
                settings.smoke_unknown,
            )
        )
    if settings.raycast:
        found.append(
            Message(
                "The Raycast node of '{0}' meets the rig's sheets: switch on Only Local", settings.raycast
            )
        )
    if settings.asks_camera:
        found.append(
            Message(
                "The nodes of '{0}' use the camera or the ray, and get the rig's: replace those nodes",
                settings.asks_camera,
            )
        )
    found += pixel_cautions(settings)
    if settings.flat:
        found.append(NO_AREA)
    if has_cuts(settings.camera):
        found.append(STEPS)
    elif settings.error > max(settings.camera.scfpf.pixel_error, SMALLEST_ERROR):
        found.append(
            Message("Off by up to {0:.2g} px, the best possible: bend the volume less", settings.error)
        )
    if settings.missing > 0.0:
        found.append(
            Message(
                "Empty parts of the image are filled in: render with Flexible Projection to keep them empty"
            )
        )
    found += [
        Message(
            "Cycles shows the control surface '{0}': make it local, or remove its Ray Visibility drivers",
            name,
        )
        for name in hidden_surfaces.seen_surfaces(scene)
    ]
    if _mappings_move(settings.camera):
        found.append(
            Message(
                "Image mappings stand still in an animation by Cycles: render it with Flexible Projection"
            )
        )
    return found


def pixel_cautions(settings) -> list[str]:
    """The cautions about what Cycles measures in pixels: bump, levels of textures, wires."""
    # Rays of a rig that another version has made have footprints that are far too wide.
    if settings.layout != LAYOUT:
        return [FLAT]
    if settings.spread <= MOST_SPREAD:
        return []
    found = []
    if settings.wires:
        found.append(
            Message(
                "The wires of '{0}' have wrong widths, as pixels differ much in size: switch off Pixel Size",
                settings.wires,
            )
        )
    # Blender has it from 5.2 on.
    if settings.levels and getattr(settings.scene.render, "use_texture_cache", False):
        found.append(
            Message(
                "Images as of '{0}' are too soft or too sharp, as pixels differ much in size: switch off "
                "Texture Cache in Performance",
                settings.levels,
            )
        )
    return found


def _mappings_move(camera) -> bool:
    """Return whether an image mapping is animated: the mapped positions are computed in advance."""
    if not any(mapping.enabled for mapping in camera.scfpf.mappings):
        return False
    return any(curve.data_path.startswith(MAPPINGS_PATH) for c in curve_collections(camera) for curve in c)
