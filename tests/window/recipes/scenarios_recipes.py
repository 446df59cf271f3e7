# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of all recipes, as their pages tell them, each drawn before the next one."""

import time

import bpy
from driver import PATIENCE

from demo.recipes.jobs import RECIPES
from demo.recipes.steps import begin

# Of the resolution, in percent; the standard deviation of colors that a picture has at least.
SMALL, COLORFUL = 8, 0.03


def _follow(driver, recipe):
    """Generator: perform a recipe's steps in the 3D viewport, a last one that renders by its button."""
    scene = begin(recipe, SMALL)
    yield 0.1
    *steps, last = recipe.steps
    for step in steps:
        with driver.override():
            step.act()
        yield 0.1
    scene.camera.scfpf.samples = 1
    if "EEVEE" in last.text:
        # By software OpenGL it takes minutes.
        return
    if "*Render*" in last.text:
        driver.start_render()
        end = time.monotonic() + PATIENCE
        while bpy.ops.scfpf.render_cancel.poll():
            assert time.monotonic() < end, "the render hangs"
            yield 0.1
    else:
        with driver.override():
            last.act()
    yield 0.5
    deviation = driver.pixels().reshape(-1, 4)[:, :3].std()
    assert deviation > COLORFUL, f"{recipe.stem}: the picture is empty"


def recipes(driver):
    """Every step of every page."""
    for recipe in RECIPES:
        yield from _follow(driver, recipe)


SCENARIOS = (recipes,)
