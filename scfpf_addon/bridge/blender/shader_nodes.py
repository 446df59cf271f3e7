# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow the links of a shader node tree to the source of a socket's value: a node or a constant."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...projection.colors import LUMINANCE

# A socket or a node, and the group nodes around it, outermost first.
Place = tuple[object, tuple]


def resolve(socket, groups: tuple = ()) -> Place:
    """The source of an input socket's value, through reroutes and node groups.

    Returns the output socket of a node, or the unlinked input socket whose own value counts. Muted and
    invalid links are ignored; a muted node passes values on by its internal links.
    """
    while not socket.is_output:
        link = _link(socket)
        if link is None:
            break
        node, output = link.from_node, link.from_socket
        inside = _group_output(node) if node.type == "GROUP" else None
        if node.mute:
            passed = next((one.from_socket for one in node.internal_links if one.to_socket == output), None)
            # Cycles does not pass on an input without a link.
            if passed is None or _link(passed) is None:
                break
            socket = passed
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif inside is not None:
            socket = _by_identifier(inside.inputs, output.identifier)
            groups = (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            socket = _by_identifier(groups[-1].inputs, output.identifier)
            groups = groups[:-1]
        else:
            socket = output
    return socket, groups


def _link(socket):
    """The link that feeds an input, if any."""
    # ``links`` searches all links of the tree.
    if not socket.is_linked:
        return None
    return next((one for one in socket.links if one.is_valid and not one.is_muted), None)


def _group_output(node):
    nodes = node.node_tree.nodes if node.node_tree else ()
    return next((one for one in nodes if one.type == "GROUP_OUTPUT" and one.is_active_output), None)


def _by_identifier(sockets, identifier: str):
    return next(socket for socket in sockets if socket.identifier == identifier)


def output_node(tree):
    """The active output node of a shader node tree: one for Cycles, else one for EEVEE, or None."""
    return tree.get_output_node("CYCLES") or tree.get_output_node("EEVEE")


def is_fed(socket, groups: tuple = ()) -> bool:
    """Return whether a node, or a value of a group other than a shader, feeds an input socket."""
    source, _ = resolve(socket, groups)
    if source.is_output:
        # A group that has no output passes nothing on.
        return source.node.type != "GROUP"
    return source != socket and source.type != "SHADER"


def output_shaders(tree, name: str = "Surface") -> Iterator[Place]:
    """The shader nodes behind an input of the active output node, as (node, groups).

    Mix and Add nodes are entered, depth first, upper input before lower. An
    output for Cycles is preferred to one for EEVEE.
    """
    output = output_node(tree)
    if output is not None:
        yield from _shaders(output.inputs[name], ())


def _shaders(socket, groups: tuple) -> Iterator[Place]:
    socket, groups = resolve(socket, groups)
    if not socket.is_output:
        return
    node = socket.node
    if node.type in {"MIX_SHADER", "ADD_SHADER"}:
        for branch in node.inputs:
            if branch.type == "SHADER":
                yield from _shaders(branch, groups)
    else:
        yield node, groups


def _constant(node, groups: tuple, name: str):
    socket, _ = resolve(node.inputs[name], groups)
    if socket.is_output and socket.node.type not in {"RGB", "VALUE"}:
        return None
    return socket.default_value


def constant_glow(tree):
    """The constant colour that is linked in place of a surface's shader, (3,) float64, or None."""
    output = output_node(tree)
    if output is None or not is_fed(output.inputs["Surface"]):
        return None
    source, _ = resolve(output.inputs["Surface"])
    return None if source.type == "SHADER" else color_input(output, (), "Surface")


def color_input(node, groups: tuple, name: str):
    """An input's constant colour, (3,) float64, or None if a texture or a sum feeds it."""
    value = _constant(node, groups, name)
    return None if value is None else np.resize(np.array(value, np.float64), 4)[:3]


def value_input(node, groups: tuple, name: str) -> float | None:
    """An input's constant number, or None if a texture or a sum feeds it."""
    value = _constant(node, groups, name)
    if value is None or isinstance(value, (int, float)):
        return value
    return float(np.dot(np.array(value, np.float64)[:3], LUMINANCE))


def has_node(tree, is_meant: Callable[[object], bool], known: dict[int, bool]) -> bool:
    """Return whether a tree, or a group in it, has a node that is meant. known: results by its session id."""
    key = tree.session_uid
    if key not in known:
        groups = [node.node_tree for node in tree.nodes if node.type == "GROUP" and node.node_tree]
        known[key] = any(map(is_meant, tree.nodes)) or any(has_node(each, is_meant, known) for each in groups)
    return known[key]
