# SPDX-License-Identifier: GPL-3.0-or-later
"""Portals that rays of the Cycles rig pass on the demo's street, by preset, without a clock.

    python3 dev.py bench --street [--cells 32 16 8]

A ray passes the screen, and a portal at the end of each chord without a hit. Chords in which a cell of the
image certainly has nothing are left out (``casting/cells``). Hits are the caster's, of every fourth pixel.
``counts.py`` stores the figures for cells of CELL pixels, and the vertices of a rig's sheets for the whole
image; the table here has those for other cells, and the processor time of the search.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import process_time
from typing import NamedTuple

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.counts import STREET, Counts
from demo.render_demo import ROOT, SHOTS, Shot, build_street, place_camera
from demo.render_thumbnails import OWN, USUAL
from scfpf_addon import bridge
from scfpf_addon.bridge.camera.flexible_camera import apply_preset
from scfpf_addon.bridge.render.type_registration import register_types
from scfpf_addon.bridge.scene.read_scene import read_scene
from scfpf_addon.casting.cells.occupied_chords import occupied_chords
from scfpf_addon.casting.frame import cast_frame, pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.cycles import rig, rig_properties
from scfpf_addon.cycles.chords.chord_plan import ChordPlan, plan_chords
from scfpf_addon.cycles.portals.paths import needed_faces, portals_passed
from scfpf_addon.projection.presets.preset import load_preset, read_preset
from scfpf_addon.projection.typing import Array, BoolArray, IndexArray
from scfpf_addon.projection.volume.viewing_volume import Projection

PRESETS = (
    "around_the_car",
    "nonlinear_twist",
    "deep_curvy_volume",
    "house_of_stairs",
    "curved_convergence",
    "occlusion_camera",
    "street_panorama_curved",
    "perspective",
    "cylindrical_panorama",
)
# The others whose sheets have the most vertices.
LARGE = ("equirectangular", "mirror_ball", "orthographic_to_perspective", "sample_rate_lens")
# In pixels: what chords may stray, and the side of a cell.
PIXEL_ERROR, CELL = 0.25, 16
# Every so many pixels across and up has a ray.
STEP = 2


class View(NamedTuple):
    """A preset on the street: its projection, its chords, and the chord in which each ray has its hit.

    rays: (R,) places x and y of those that exist. chord: (R,), the number of chords for a miss.
    """

    projection: Projection
    size: tuple[int, int]
    plan: ChordPlan
    x: Array
    y: Array
    chord: IndexArray


def register() -> None:
    """Register the extension's properties, as it does itself."""
    register_types((*bridge.TYPES, rig_properties))


def street() -> tuple[CastScene, Array]:
    """The demo's street for the caster, and its triangles (3, 3, T). It replaces the open file."""
    build_street()
    geometry = read_scene(bpy.context.evaluated_depsgraph_get()).geometry
    # In an order that does not depend on Blender's.
    corners = geometry.vertices[geometry.triangles]
    order = np.lexsort(np.round(corners.mean(axis=1), 6).T)
    scene = CastScene(geometry.vertices, geometry.triangles[order])
    return scene, np.ascontiguousarray(corners[order].transpose(1, 2, 0))


def shot_of(stem: str) -> Shot:
    """From where the demo or else its thumbnail shows a preset."""
    return SHOTS.get(stem) or OWN.get(stem, USUAL)


def view_of(scene: CastScene, stem: str) -> View:
    """A preset on the street."""
    shot = shot_of(stem)
    camera = bpy.data.objects.new(stem, None)
    place_camera(camera, shot)
    matrix = np.array(camera.matrix_basis) @ np.diag([shot.scale] * 3 + [1.0])
    bpy.data.objects.remove(camera)
    preset = read_preset(ROOT / "presets" / f"{stem}.json")
    projection = preset.projection(shot.size[0] / shot.size[1]).transformed(matrix)
    plan = plan_chords([projection], shot.size, PIXEL_ERROR)
    width, height = (count // STEP for count in shot.size)
    hits = cast_frame(scene, projection, width, height, PIXEL_ERROR)
    assert hits is not None
    x, y = pixel_centres(width, height, (0, height))
    chord = np.searchsorted(plan.breaks, np.where(np.isfinite(hits.t), hits.t, 1.0), side="right") - 1
    chord = np.where(np.isfinite(hits.t), np.minimum(chord, plan.count - 1), plan.count)
    return View(projection, shot.size, plan, x[hits.mask], y[hits.mask], chord[hits.mask])


def chord_points(view: View, cells: tuple[int, int]) -> Array:
    """The ends of the chords of the cells' corners, (n + 1, 3, rows + 1, columns + 1)."""
    x, y = np.meshgrid(*(np.arange(count + 1) / count for count in cells))
    points = view.projection.projectors(x.ravel(), y.ravel()).points
    spans, plan = view.projection.volume.spans, view.plan
    ends = np.empty((len(plan.breaks), 3, *x.shape))
    for end, t, shift in zip(ends, plan.breaks, plan.shifts, strict=True):
        (span,), (start,), (length,) = spans.locate(np.array([t]))
        values, _, bends = spans.within(int(span), np.array([(t - start) / length]))
        end[:] = np.einsum("k,kcs->cs", (values - shift * bends)[0], points).reshape(end.shape)
    return ends


def occupied_of(view: View, triangles: Array, cell: int) -> tuple[BoolArray, float]:
    """The occupied chords of cells of so many pixels, and the seconds of the processor for the search."""
    ends = chord_points(view, (-(-view.size[0] // cell), -(-view.size[1] // cell)))
    before = process_time()
    return occupied_chords(ends, [triangles]), process_time() - before


def passed(view: View, occupied: BoolArray) -> IndexArray:
    """The portals that the view's rays pass, (R,)."""
    rows, columns = occupied.shape[1:]
    row, column = (
        np.minimum((place * count).astype(np.intp), count - 1)
        for place, count in ((view.y, rows), (view.x, columns))
    )
    return portals_passed(occupied, row, column, view.chord)


def sheet_vertices(stem: str) -> int:
    """The vertices of the sheets that the rig makes for a preset's whole image on the street."""
    scene, shot = bpy.context.scene, shot_of(stem)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *shot.size, 100
    camera = bpy.data.objects.new(stem, bpy.data.cameras.new(stem))
    place_camera(camera, shot)
    scene.collection.objects.link(camera)
    preset = load_preset((ROOT / "presets" / f"{stem}.json").read_text(encoding="utf-8"))
    apply_preset(camera, preset, shot.size[0] / shot.size[1], shot.scale)
    bpy.context.view_layer.update()
    made = rig.switch_on(bpy.context, camera)
    # As ``price_of_rig``, also if handlers of an add-on that did not make the rig stop its skipping.
    count = len(made.scfpf_rig.portals.data.vertices) - made.scfpf_rig.sheet_vertices
    for group in bpy.data.node_groups:
        group.use_fake_user = True  # the next preset's would be built anew, which takes seconds
    rig.switch_off(made)
    bpy.data.objects.remove(camera)
    return count


def counted(sheets: tuple[str, ...] = (*PRESETS, *LARGE)) -> Counts:
    """The counts of each preset; portals by 1,000 rays for all chords and for occupied ones.

    sheets: the presets whose sheets are made.
    """
    scene, triangles = street()
    found: Counts = {}
    for stem in PRESETS:
        view = view_of(scene, stem)
        occupied, _ = occupied_of(view, triangles, CELL)
        each = {"all": 1 + view.chord, "occupied": passed(view, occupied)}
        found[f"{stem}{STREET}"] = {
            "chords": view.plan.count,
            **{key: round(1000 * float(count.mean())) for key, count in each.items()},
            "occupied_95": int(np.percentile(each["occupied"], 95)),
            "faces": int(needed_faces(occupied).sum()),
            "occupied_chords": int(occupied.sum()),
        }
    found[f"vertices of sheets{STREET}"] = {stem: sheet_vertices(stem) for stem in sheets}
    return found


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[32, 16, 8], help="sides of cells in pixels")
    options = parser.parse_args()
    register()
    scene, triangles = street()
    print("| preset | chords | portals of all | cell | occupied, mean (95 %) | faces | processor |")
    print("|---|---|---|---|---|---|---|")
    for stem in PRESETS:
        view = view_of(scene, stem)
        for cell in options.cells:
            occupied, seconds = occupied_of(view, triangles, cell)
            count = passed(view, occupied)
            row = (
                stem,
                view.plan.count,
                f"{(1 + view.chord).mean():.1f}",
                f"{cell} px",
                f"{count.mean():.2f} ({np.percentile(count, 95):.0f})",
                needed_faces(occupied).sum(),
                f"{seconds:.2f} s",
            )
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


if __name__ == "__main__":
    main()
