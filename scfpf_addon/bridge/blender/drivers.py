# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers made in code, without Python: Blender itself evaluates such simple expressions."""

from __future__ import annotations


def new_driver(owner, name: str, expression: str = "", index: int = -1):
    """Return the driver of a property, without variables and modifiers.

    It evaluates an expression, or else the mean of its variables. A driver that the property already has is
    used again. index: of the value in a vector.
    """
    curve = owner.driver_add(name) if index < 0 else owner.driver_add(name, index)
    driver = curve.driver
    for items in (curve.modifiers, driver.variables):
        for old in list(items):
            items.remove(old)
    if expression:
        driver.expression = expression
    else:
        driver.type = "AVERAGE"
    return driver


def add_property(driver, owner, path: str, name: str = "value", id_type: str = "OBJECT"):
    """Add a property of a datablock to a driver's variables; return the variable's target."""
    variable = driver.variables.new()
    variable.name, variable.type = name, "SINGLE_PROP"
    target = variable.targets[0]
    if id_type != "OBJECT":
        target.id_type = id_type
    target.id, target.data_path = owner, path
    return target


def add_scene_property(driver, path: str, name: str):
    """Add a property of the rendered scene to a driver's variables; return the variable's target."""
    variable = driver.variables.new()
    variable.name, variable.type = name, "CONTEXT_PROP"
    target = variable.targets[0]
    target.context_property, target.data_path = "ACTIVE_SCENE", path
    return target


def follow_property(owner, name: str, source, path: str) -> None:
    """Let a property follow one of the add-on's, which files have only where the add-on is installed.

    Without the add-on the property keeps its present value. An enum counts as its number.
    """
    target = add_property(new_driver(owner, name), source, path)
    value = source.path_resolve(path)
    if isinstance(value, str):
        choices = source.path_resolve("scfpf").bl_rna.properties[path.rpartition(".")[2]].enum_items
        value = choices[value].value
    target.use_fallback_value, target.fallback_value = True, float(value)
