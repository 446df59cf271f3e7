# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of accuracy: pixels that differ from the exact image, and how far, against time.

    python3 dev.py bench --trade [--quick] [--json FILE] [--png FILE] [--markdown docs/accuracy.md]

--markdown replaces the table in a document, and what peers take with it. Each pixel error, and
pixel error 0, casts the same tiles in one thread; times are CPU seconds, the least of several runs
that take turns, divided by what raw Embree takes for the same scene's straight image. A pixel
*differs* when its t is not the exact one; it is *beyond a pixel* when its t is also outside what the
exact image shows in the eight pixels around it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files, replace_section
from benchmarks.raw import raw_embree
from benchmarks.run import Image, raw_rays
from benchmarks.scenes import SCENES, Mesh, bent_projection
from scfpf_addon.casting.cast import CastCounts
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.typing import Array
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

ERRORS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.0)
BENDS = {"straight": (1, 0), "degree 2, 10°": (2, 10), "degree 2, 60°": (2, 60), "degree 3, 180°": (3, 180)}
BENDS |= {"degree 4, 300°": (4, 300), "degree 5, 180°": (5, 180)}
BASES = {"polyline": "POLYLINE", "B-spline": "B_SPLINE"}
PRESETS = ("nonlinear_twist", "around_the_car", "curved_convergence", "deep_curvy_volume", "house_of_stairs")

# Where the plot has no pixel that differs, and exact casting.
NONE, EXACT = 2e-6, 5e-7

# Hits are the same when their t differ by less.
SAME = 1e-9


def volumes() -> dict[str, Projection]:
    """Everything to cast through, by name."""
    result = {name: bent_projection(degree, math.radians(angle)) for name, (degree, angle) in BENDS.items()}
    bent = bent_projection(5, math.radians(120)).volume.surfaces
    result |= {name: Projection(ViewingVolume(bent, basis), aspect=16 / 9) for name, basis in BASES.items()}
    folder = Path(__file__).resolve().parents[1] / "presets"
    for name in PRESETS:
        preset = read_preset(folder / f"{name}.json")
        result[preset.name] = preset.projection(16 / 9)
    return result


def put_into(mesh: Mesh, projection: Projection) -> Mesh:
    """A scene moved and stretched into a preset's volume: most of the box that the far half fills."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)))
    points = np.concatenate([projection.volume.evaluate(u, v, t).position for t in (0.4, 0.7, 1.0)], axis=1)
    low, high = np.percentile(points, 10, axis=1), np.percentile(points, 90, axis=1)
    vertices, triangles = mesh
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return low + (vertices - lower) * ((high - low) / (upper - lower)), triangles


def cast_all(
    scene: CastScene, inside: Projection, image: Image, error: float
) -> tuple[Array, CastCounts, float]:
    """t of every pixel, inf as 2, the counts and the CPU seconds."""
    start, parts, counts = process_time(), [], CastCounts()
    for rows in image.tiles:
        hits, own = image.cast_tile(scene, inside, rows, error)
        parts.append(np.where(np.isfinite(hits.t), hits.t, 2.0))
        counts.add(own)
    return np.concatenate(parts), counts, process_time() - start


def around(t: Array, width: int) -> tuple[Array, Array]:
    """The least and the largest t of each pixel and its neighbours."""
    rows = np.pad(t.reshape(-1, width), 1, mode="edge")
    height = len(rows) - 2
    blocks = np.stack([rows[j : j + height, i : i + width] for j in range(3) for i in range(3)])
    return blocks.min(axis=0).ravel(), blocks.max(axis=0).ravel()


def trade(mesh: Mesh, projection: Projection, image: Image, runs: int) -> list[dict[str, Any]]:
    """One row for each pixel error."""
    scene = CastScene(*mesh)
    straight = raw_rays(scene, bent_projection(1, 0.0).transformed(scene.matrix), image)
    cast_raw, inside = raw_embree(scene), projection.transformed(scene.matrix)
    seconds = dict.fromkeys(ERRORS, math.inf)
    raw, images, counted = math.inf, {}, {}
    for error in (1.0, 0.0):  # builds what only these need
        cast_all(scene, inside, image, error)
    for _ in range(runs):
        start = process_time()
        for rays in straight:
            cast_raw(*rays)
        raw = min(raw, process_time() - start)
        for error in ERRORS:
            images[error], counted[error], spent = cast_all(scene, inside, image, error)
            seconds[error] = min(seconds[error], spent)
    low, high = around(images[0.0], image.width)
    pixels = image.width * image.height
    return [
        {
            "pixel error": error,
            "differ": float((np.abs(images[error] - images[0.0]) > SAME).mean()),
            "beyond a pixel": float(((images[error] < low - SAME) | (images[error] > high + SAME)).mean()),
            "nanoseconds a pixel": seconds[error] / pixels * 1e9,
            "times raw": seconds[error] / raw,
            "chords": counted[error].chords / pixels,
            "error bound": counted[error].error_bound,
        }
        for error in ERRORS
    ]


def table(results: dict[str, list[dict[str, Any]]]) -> list[str]:
    """The trade in Markdown, a row for each scene and volume."""
    names = [f"{error:g} px" if error else "exact" for error in ERRORS]
    lines = ["| scene and volume | " + " | ".join(names) + " | beyond a pixel |"]
    lines.append("|---" * (len(ERRORS) + 2) + "|")
    for title, rows in results.items():
        cells = [
            f"{row['times raw']:.1f}×" + (f", {row['differ']:.0e}" if row["pixel error"] else "")
            for row in rows
        ]
        lines.append(f"| {title} | " + " | ".join(cells) + f" | {rows[0]['beyond a pixel']:.0e} |")
    return lines


def frontier(rows: list[dict[str, Any]]) -> list[bool]:
    """The rows that no other beats in both time and accuracy."""
    return [
        not any(other["times raw"] < row["times raw"] and other["differ"] <= row["differ"] for other in rows)
        for row in rows
    ]


def draw_volume(panel: Any, rows: list[dict[str, Any]], style: str, volume: str) -> None:
    """One volume's line in a panel; hollow is what another pixel error beats in both."""
    height = [EXACT if row["pixel error"] == 0.0 else max(row["differ"], NONE) for row in rows]
    time = [row["times raw"] for row in rows]
    line = panel.plot(time[:-1], height[:-1], style, linewidth=1.2, label=volume)[0]
    for x, y, best, row in zip(time, height, frontier(rows), rows, strict=True):
        color = line.get_color()
        exact = row["pixel error"] == 0.0
        marker, size = ("*", 70) if exact else ("o", 16)
        face = color if best or exact else "white"
        panel.scatter(x, y, size, marker=marker, facecolors=[face], edgecolors=[color], zorder=3)
    for row, x, y in zip(rows, time, height, strict=True):
        if row["pixel error"] in (1.0, 0.1, 0.01) and volume == "degree 3, 180°":
            text = f"{row['pixel error']:g} px"
            panel.annotate(text, (x, y), (5, 3), textcoords="offset points", fontsize=7)


def draw(results: dict[str, list[dict[str, Any]]], path: str) -> None:
    """The trade as an image: one panel a scene, one line a volume."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, panels = pyplot.subplots(1, len(SCENES), figsize=(17, 7), sharey=True, sharex=True)
    for panel, scene in zip(panels, SCENES, strict=True):
        panel.set_prop_cycle(color=pyplot.get_cmap("tab20").colors[::2] + pyplot.get_cmap("Dark2").colors)
        for title, rows in results.items():
            where, volume = title.split(": ")
            if where == scene:
                draw_volume(panel, rows, "-" if volume in BENDS or volume in BASES else "--", volume)
        panel.set(xscale="log", yscale="log", ylim=(EXACT / 2, 1e-1), title=scene)
        panel.set_xlabel("time, multiples of raw Embree's for the straight image")
        panel.axhspan(EXACT / 2, NONE * 2, color="0.95", zorder=0)
        panel.xaxis.set_minor_locator(ticker.NullLocator())
        panel.set_xticks([1, 2, 5, 10, 20, 50, 100], labels=["1", "2", "5", "10", "20", "50", "100"])
        panel.set_yticks(
            [EXACT, NONE, 1e-5, 1e-4, 1e-3, 1e-2],
            labels=["exact", "none", "1 in 100,000", "1 in 10,000", "1 in 1,000", "1 in 100"],
        )
        panel.yaxis.set_minor_locator(ticker.NullLocator())
        panel.grid(True, alpha=0.3)
    panels[0].set_ylabel("pixels that differ from the exact image")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.tight_layout(rect=(0, 0.1, 1, 0.96))
    figure.suptitle("Each line: pixel errors from 1 (top) to 0.01; hollow: slower and no better; star: exact")
    figure.legend(handles, labels, loc="lower center", ncols=5, fontsize=9, frameon=False)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--png", metavar="FILE", help="draw error against time into FILE (matplotlib)")
    parser.add_argument("--markdown", metavar="FILE", help="replace the table in FILE")
    parser.add_argument("--quick", action="store_true", help="a small image, one run")
    options = parser.parse_args(arguments)
    check_files(parser, written=options.json, document=options.markdown, sections=["trade"])
    check_files(parser, written=options.png)
    image, runs = (Image(96, 54), 1) if options.quick else (Image(480, 270), 2)
    size = 2_000 if options.quick else 100_000
    results: dict[str, list[dict[str, Any]]] = {}
    for name, make in SCENES.items():
        for title, projection in volumes().items():
            mesh = make(size)
            mesh = mesh if title in BENDS or title in BASES else put_into(mesh, projection)
            results[f"{name}: {title}"] = trade(mesh, projection, image, runs)
            # What has been measured so far is seen at once; the heading comes with the first row.
            lines = table(results)
            print("\n".join(lines if len(results) == 1 else lines[-1:]), flush=True)
    if options.markdown:
        replace_section(options.markdown, "trade", table(results))
    if options.json:
        Path(options.json).write_text(json.dumps(results, indent=1) + "\n")
    if options.png:
        draw(results, options.png)


if __name__ == "__main__":
    main()
