# SPDX-License-Identifier: GPL-3.0-or-later
"""Very large scenes, images and files: time, and the most memory that a process of its own has held.

    python3 dev.py bench --scale [--json FILE] [--markdown FILE] [--quick] [--only PART ...] [--most GB]

Parts: `triangles`, 10 million of them, with chords and exact; `pictures` of up to 16384 × 16384 pixels,
without Blender and by its Render button; `cameras`, a hundred of them with up to a thousand control surfaces
in all. What would need more than --most is left out, and the table says so.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files, replace_section
from benchmarks.scenes import SCENES, bent_projection
from demo.render_demo import enable_add_on
from scfpf_addon.casting.common import memory
from scfpf_addon.casting.common.hits import CastError
from scfpf_addon.casting.common.memory import peak_memory
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.scene.shading_scene import Scene
from scfpf_addon.shading.settings.frame_settings import FrameSettings

TRIANGLES = 10_000_000
# So little memory, in bytes, that exact casting has to refuse.
LITTLE = 2e9
# The images of them.
SIZE = (1920, 1080)
THREADS = 2
PIXEL_ERROR = 0.1
BEND = 60.0
# Pixels along both sides, and what a pixel takes: four float32 numbers.
SIDES = (4096, 8192, 16384)
BYTES_PER_PIXEL = 16
# Of the scene of an image.
FEW_TRIANGLES = 20_000
# What a pixel of Blender's image may take, for --most: our film, Blender's, and the packed file.
BLENDER_BYTES_PER_PIXEL = 40
# Cameras, and control surfaces of each.
FILES = ((1, 2), (1, 10), (100, 2), (100, 10))
MEBIBYTE = 2**20
SECTION = "scale"


# Each of these runs in a process of its own and answers with figures.


def flat_scene(name: str, count: int) -> Scene:
    """A scene of the benchmarks, flat, in a sun without shadows; made without large arrays on the way."""
    from benchmarks.run import lit

    vertices, triangles = SCENES[name](12)
    small = lit((vertices, triangles))
    vertices, triangles = SCENES[name](count)
    normals = np.empty((len(triangles), 1, 3), np.float32)
    for first in range(0, len(triangles), 1 << 18):
        some = slice(first, first + (1 << 18))
        a, b, c = (vertices[triangles[some, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normals[some, 0] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    nought = np.zeros(len(triangles), np.int32)
    geometry = type(small.geometry)(vertices, triangles, normals, nought, nought)
    return Scene(geometry, small.materials, small.lights)


def triangles(name: str, count: int, pixel_error: float, free: float) -> dict[str, Any]:
    """A frame of many triangles. free: the bytes that the caster is to believe are free."""
    scene = flat_scene(name, count)
    before = peak_memory()
    settings = FrameSettings(*SIZE, samples=1, pixel_error=pixel_error, threads=THREADS)
    # For all that is built from here on.
    memory.available_memory = lambda: int(free)
    started = perf_counter()
    result: dict[str, Any] = {"triangles": len(scene.geometry.triangles)}
    try:
        frame = render_frame(bent_projection(2, math.radians(BEND)), scene, settings)
    except CastError as error:
        result["refused"] = str(error)
    else:
        assert frame is not None
        result |= {"build": frame.report.build_seconds, "built": frame.report.built}
    result |= {"seconds": perf_counter() - started, "scene": before, "memory": peak_memory()}
    return result


def image(width: int, height: int) -> dict[str, Any]:
    """A curved frame of few triangles, without Blender."""
    scene = flat_scene("boxes", FEW_TRIANGLES)
    projection = bent_projection(2, math.radians(BEND), width / height)
    small = FrameSettings(512, 512, samples=1, pixel_error=PIXEL_ERROR, threads=THREADS)
    render_frame(projection, scene, small)
    before = peak_memory()
    settings = FrameSettings(width, height, samples=1, pixel_error=PIXEL_ERROR, threads=THREADS)
    started = perf_counter()
    render_frame(projection, scene, settings)
    return {"seconds": perf_counter() - started, "before": before, "memory": peak_memory()}


WORKS = ("triangles", "image", "blender_image", "file_of")


def work(name: str, arguments: list[Any]) -> dict[str, Any]:
    """One of WORKS, in this process."""
    if name in ("triangles", "image"):
        return triangles(*arguments) if name == "triangles" else image(*arguments)
    with tempfile.TemporaryDirectory(prefix="scfpf-scale-", ignore_cleanup_errors=True) as folder:
        # Blender passes over a folder that is not there.
        profile = Path(folder, "profile")
        profile.mkdir()
        os.environ["BLENDER_USER_RESOURCES"] = str(profile)
        from benchmarks import scale_files

        enable_add_on(Path(folder))
        measured = getattr(scale_files, name)(*arguments)
        assert isinstance(measured, dict)
        return measured


def in_own_process(name: str, *arguments: Any) -> dict[str, Any]:
    """``work`` in a process of its own, whose memory has held nothing else."""
    command = [sys.executable, __file__, "--one", name, json.dumps(arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{name} {arguments} could not be measured:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print(name, *arguments, found, flush=True)
    return found


def measure_triangles(most: float, quick: bool) -> list[str]:
    """The table of ten million triangles."""
    count = TRIANGLES // (10 if quick else 1)
    lines = [
        f"| {count // 10**6} million triangles, 60°, 1920 × 1080 | seconds | of these building "
        "| memory | bytes a triangle |",
        "|---|---|---|---|---|",
    ]
    asked = (("boxes", PIXEL_ERROR, most), ("terrain", PIXEL_ERROR, most), ("terrain", 0.0, most))
    for name, error, free in (*asked, ("terrain", 0.0, LITTLE)):
        found = in_own_process("triangles", name, count, error, free)
        title = f"{name}, {f'{error:g} px' if error else 'exact'}"
        if "refused" in found:
            title = f"{title}, {free / 1e9:g} GB free: *{found['refused']}*"
            lines.append(f"| {title} | {found['seconds']:.1f} | | {_gb(found)} | |")
            continue
        share, each = found["built"] / found["triangles"], found["memory"] / found["triangles"]
        lines.append(
            f"| {title}, {share:.0%} in reach | {found['seconds']:.1f} | {found['build']:.1f} "
            f"| {_gb(found)} | {each:.0f} |"
        )
    return lines


def _gb(found: dict[str, Any]) -> str:
    return f"{found['memory'] / 1e9:.1f} GB"


def measure_images(most: float, quick: bool) -> list[str]:
    """The table of large images."""
    lines = [
        "| pixels | the image alone | above it | by the Render button, Blender's image and packed file "
        "included | bytes a pixel |",
        "|---|---|---|---|---|",
    ]
    for side in SIDES[: 1 if quick else None]:
        found = in_own_process("image", side, side)
        image = BYTES_PER_PIXEL * side * side
        above = found["memory"] - found["before"] - image
        heights = [side, side // 2] if side == SIDES[-1] else [side]
        fits = [high for high in heights if BLENDER_BYTES_PER_PIXEL * side * high <= most]
        by_button = "more than may be used here | "
        if fits:
            of_blender = in_own_process("blender_image", side, fits[0])
            taken = of_blender["memory"] - of_blender["before"]
            what = "" if fits[0] == side else f"{side} × {fits[0]}: "
            packed = of_blender["packed"] / MEBIBYTE
            kept = f"packed {packed:.0f}" if packed else "too large to be packed"
            by_button = f"{what}{taken / MEBIBYTE:.0f} MB, {kept} | {taken / (side * fits[0]):.0f}"
        lines.append(
            f"| {side} × {side} | {image / MEBIBYTE:.0f} MB | {above / MEBIBYTE:.0f} MB | {by_button} |"
        )
    return lines


# What is measured of a file, and how it is called in the table.
FILE_ROWS = {
    "unrelated": "an unrelated edit",
    "surface": "an edit of one surface",
    "selection": "a click on another object",
    "structure": "an object more, all relations anew",
    "lines read": "an edit of one surface, and the volumes read for their lines",
    "panel": "our panel drawn",
    "undo": "undo",
    "opening": "the file opened",
}


def measure_files(_most: float, quick: bool) -> list[str]:
    """The table of many cameras."""
    files = FILES[:: 2 if quick else 1]
    found = [in_own_process("file_of", *file) for file in files]
    titles = (f"{a} × {b} surfaces" for a, b in files)
    lines = [f"| ms, by cameras | {' | '.join(titles)} |", "|---" * (len(files) + 1) + "|"]
    for key, title in FILE_ROWS.items():
        cells = []
        for row in found:
            alone = row.get(f"{key}, Blender alone")
            cells.append(
                f"{row[key]:.2f}" if alone is None else f"{row[key]:.2f} ({alone:.2f} without the add-on)"
            )
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return lines


PARTS = {"triangles": measure_triangles, "pictures": measure_images, "cameras": measure_files}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the tables there too")
    parser.add_argument("--markdown", metavar="FILE", help="put the tables into a document")
    parser.add_argument("--quick", action="store_true", help="the smaller half of each part")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--most", type=float, default=8.0, metavar="GB", help="memory that may be used, 8 GB")
    parser.add_argument("--one", nargs=2, metavar=("WORK", "ARGUMENTS"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    sections = [f"{SECTION}: {name}" for name in options.only]
    check_files(parser, written=options.json, document=options.markdown, sections=sections)
    if options.one:
        print(json.dumps(work(options.one[0], json.loads(options.one[1]))))
        return
    tables = {name: PARTS[name](1e9 * options.most, options.quick) for name in options.only}
    print("\n\n".join("\n".join(lines) for lines in tables.values()))
    if options.json:
        options.json.write_text(json.dumps(tables, indent=1), encoding="utf-8")
    if options.markdown:
        for name, lines in tables.items():
            replace_section(options.markdown, f"{SECTION}: {name}", lines)


if __name__ == "__main__":
    main()
