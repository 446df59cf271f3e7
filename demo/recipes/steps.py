# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of recipes: what a page tells, and the operator or the setting that does it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import NamedTuple

from ..render_demo import ROOT

Number3 = tuple[float, float, float]


class Step(NamedTuple):
    """One step: its text in Markdown, and what it does in Blender."""

    text: str
    act: Callable[[], object]


class Recipe(NamedTuple):
    """A job, told and performed.

    stem: of its page, its image and its .blend. seek: the words that people search for.
    build: makes the scene. more: a paragraph under the steps.
    """

    stem: str
    title: str
    seek: str
    build: Callable[[], object]
    steps: tuple[Step, ...]
    more: str


def begin(recipe: Recipe, percentage: int = 100):
    """Build the scene of a recipe as its reader has it, and return it. percentage: of the resolution."""
    scene = recipe.build()
    scene.render.resolution_percentage = percentage
    for obj in scene.objects:
        obj.select_set(False)
    return scene


def prepare(recipe: Recipe, percentage: int = 100):
    """Build the scene of a recipe, do its steps but the last one, which renders, and return the scene.

    percentage: of the resolution. Raises RuntimeError if a step fails.
    """
    import bpy

    scene = begin(recipe, percentage)
    for step in recipe.steps[:-1]:
        step.act()
        bpy.context.view_layer.update()
    return scene


def perform(recipe: Recipe, percentage: int = 100, samples: int = 4):
    """Build the scene of a recipe, do its steps, and return its camera.

    percentage, errors: see ``prepare``. samples: per pixel of the image.
    """
    scene = prepare(recipe, percentage)
    scene.camera.scfpf.samples = samples
    recipe.steps[-1].act()
    return scene.camera


def size(width: int, height: int) -> Step:
    """Set the resolution."""

    def act() -> None:
        import bpy

        render = bpy.context.scene.render
        render.resolution_x, render.resolution_y = width, height

    return Step(f"In *Output Properties* set the resolution to {width} × {height}.", act)


def place(location: Number3, turn: float = 0.0, down: float = 0.0) -> Step:
    """Place the active camera. turn: about the vertical, down: below level, in degrees."""

    def act() -> None:
        import bpy

        camera = bpy.context.object
        camera.location, camera.rotation_euler = (
            location,
            (
                math.radians(90.0 - down),
                0.0,
                math.radians(turn),
            ),
        )

    numbers = ", ".join(f"{value:g}" for value in location)
    angles = f"{90 - down:g}°, 0°, {turn:g}°"
    more = "The camera is level: in a scene of yours choose the place alone."
    if down:
        more = f"Look {'down' if down > 0.0 else 'up'} a little."
    text = f"Press N. In the tab *Item* enter *Location* {numbers} and *Rotation* {angles}. {more}"
    return Step(text, act)


def scale(factor: float) -> Step:
    """Scale the active camera, and its volume with it."""

    def act() -> None:
        import bpy

        bpy.context.object.scale = (factor,) * 3

    return Step(f"Scale the camera by {factor:g} (S {factor:g} Enter).", act)


def menu_path(stem: str) -> str:
    """A preset's place in the menu of presets."""
    preset = json.loads((ROOT / "presets" / f"{stem}.json").read_text(encoding="utf-8"))
    return f"{preset['group']} › {preset['name']}"


def add(stem: str) -> Step:
    """Add a camera with a preset."""

    def act() -> None:
        import bpy

        done(bpy.ops.scfpf.camera_add(preset=stem))

    return Step(f"Choose *Add › Camera › Flexible Camera Preset › {menu_path(stem)}*.", act)


def add_as_made(stem: str) -> tuple[Step, Step]:
    """Add a camera, and give it a preset in the size that it was made for."""

    def act() -> None:
        import bpy

        done(bpy.ops.scfpf.camera_add(preset="VIEW"))

    def apply() -> None:
        import bpy

        done(bpy.ops.scfpf.preset_apply(preset=stem, fit=False))

    return (
        Step("Choose *Add › Camera › Flexible Camera*.", act),
        Step(
            f"Choose *Projection Preset › {menu_path(stem)}* in the panel. At the bottom left open "
            "*Adjust Last Operation* and switch *Fit to Scene* off, so that the volume keeps its size.",
            apply,
        ),
    )


def select(text: str, *names: str, collection: str = "") -> Step:
    """Select objects by their names, or those of a collection; the last one is active."""

    def act() -> None:
        import bpy

        for obj in bpy.context.selected_objects:
            obj.select_set(False)
        inside = bpy.data.collections[collection].objects if collection else ()
        for obj in [*inside, *(bpy.data.objects[name] for name in names)]:
            obj.select_set(True)
            bpy.context.view_layer.objects.active = obj

    return Step(text, act)


def render() -> Step:
    """Render as the button does."""

    def act() -> None:
        import bpy

        done(bpy.ops.scfpf.render(camera=bpy.context.scene.camera.name))

    return Step("Press *Render* in the panel. *Image › Save As* keeps the picture.", act)


def render_with_eevee() -> Step:
    """Join the picture from renders by EEVEE, as the button does."""

    def act() -> None:
        import bpy

        scene = bpy.context.scene
        scene.eevee.taa_render_samples, scene.view_settings.view_transform = 1, "Standard"
        done(bpy.ops.scfpf.joined_render(camera=scene.camera.name, engine="EEVEE"))

    return Step("Press *Render with EEVEE* in the panel. *Image › Save As* keeps the picture.", act)


def done(result: set[str]) -> None:
    """Raise RuntimeError unless an operator has finished."""
    if result != {"FINISHED"}:
        raise RuntimeError(f"a step ended with {result}")
