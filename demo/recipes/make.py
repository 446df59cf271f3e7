# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the recipes' pages, pictures and .blend files, or some by their names.

    python demo/recipes/make.py [RECIPE ...]

It runs under a Python that has bpy; `python3 dev.py recipes` finds or makes one. Pages and pictures go to
docs/recipes/, files to demo/output/recipes/.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from demo.recipes.jobs import RECIPES  # noqa: E402
from demo.recipes.pages import FOLDER, write  # noqa: E402
from demo.recipes.steps import Recipe, perform  # noqa: E402
from demo.render_demo import ENGINE, MODULE, enable_add_on, open_on, scratch_profile  # noqa: E402
from demo.render_gallery import save_jpeg  # noqa: E402

OUTPUT = ROOT / "demo" / "output" / "recipes"
SAMPLES = 16


def make(recipe: Recipe) -> None:
    """Perform a recipe, and write its picture and its file."""
    import bpy

    camera = perform(recipe, samples=SAMPLES)
    results, files = (
        importlib.import_module(f"{MODULE}.scfpf_addon.bridge.render.{name}")
        for name in ("result_image", "image_file")
    )
    raw = OUTPUT / f"{recipe.stem}.png"
    files.save_result(bpy.data.images[results.IMAGE_NAME], str(raw), bpy.context.scene)
    save_jpeg(raw, FOLDER / f"{recipe.stem}.jpg")
    bpy.data.images.remove(bpy.data.images[results.IMAGE_NAME])
    # F12 then renders it, too.
    bpy.context.scene.render.engine = ENGINE
    open_on(bpy.context.scene)
    path = OUTPUT / f"{recipe.stem}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    print(f"{recipe.stem}: {camera.scfpf.report}, {path.stat().st_size / 1e6:.1f} MB", flush=True)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    stems = [recipe.stem for recipe in RECIPES]
    parser.add_argument("recipes", nargs="*", metavar="RECIPE", help=f"one of {', '.join(stems)}")
    wanted = parser.parse_args(arguments).recipes
    if unknown := sorted(set(wanted) - set(stems)):
        parser.error(f"no recipe is named {', '.join(unknown)}")
    write()
    OUTPUT.mkdir(parents=True, exist_ok=True)
    with scratch_profile() as scratch:
        enable_add_on(scratch)
        for recipe in RECIPES:
            if not wanted or recipe.stem in wanted:
                make(recipe)


if __name__ == "__main__":
    main(sys.argv[1:])
