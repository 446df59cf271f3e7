# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of Geometry Nodes modifiers, by the names that their node groups give them."""

from __future__ import annotations

from . import versions


def input_identifiers(group) -> dict[str, str]:
    """Identifiers of a node group's inputs by name."""
    return {
        item.name: item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT"
    }


def set_inputs(modifier, values: dict[str, object]) -> None:
    """Set a modifier's inputs by name, those that differ. Vectors are always set."""
    identifiers = input_identifiers(modifier.node_group)
    for name, value in values.items():
        identifier = identifiers[name]
        if isinstance(value, tuple) or versions.modifier_input(modifier, identifier) != value:
            versions.set_modifier_input(modifier, identifier, value)


def input_property(modifier, name: str) -> tuple[object, str]:
    """The owner and the name of the property of a modifier's input, to be driven."""
    return versions.modifier_input_property(modifier, input_identifiers(modifier.node_group)[name])


def renew_relations(modifier) -> None:
    """Have the depsgraph's relations rebuilt for what a modifier's inputs point to.

    Assigning the node group once more does so in every Blender; setting an input does not in 4.5.
    """
    modifier.node_group = modifier.node_group
