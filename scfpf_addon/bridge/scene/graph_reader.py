# SPDX-License-Identifier: GPL-3.0-or-later
"""The values of sockets as operations of a graph: links followed, groups expanded, types converted."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ...shading.nodes.graph import MaterialGraph, Ref
from ..blender.shader_nodes import resolve
from .graph_builder import GraphBuilder

# The outputs of a node by identifier.
Outputs = dict[str, Ref]
# Channels of layers, by the beginning of their name.
LAYER_CHANNELS = {"UV": 2, "GENERATED": 3}
# The value of an unsupported colour or number.
GREY = 0.5


class GraphReader:
    """Reads the values of one node tree into ``builder``.

    nodes: for each supported type of node the function that makes its outputs. An unsupported node passes an
    input of its kind through, as if it were muted, or gives middle grey, and is noted.
    """

    def __init__(self, nodes: Mapping[str, Callable[[NodeInputs], Outputs]]) -> None:
        self.nodes = nodes
        self.builder = GraphBuilder()
        self._known: dict[tuple, Outputs] = {}

    def note(self, node, text: str = "") -> None:
        """Note that a node is not shown as it is."""
        self.builder.notes[f"{node.bl_label}{text}"] = None

    def value(self, socket, groups: tuple, wanted: str) -> Ref | None:
        """The value linked to an input socket, converted to type ``wanted``; None without a link."""
        source, groups = resolve(socket, groups)
        if source.is_output:
            refs = self._outputs(source.node, groups)
            return self.builder.convert(refs[source.identifier], source.type, wanted)
        if source == socket:
            return None
        # An unlinked input of a group.
        return self.default(source, wanted)

    def default(self, socket, wanted: str) -> Ref:
        """A socket's own value, converted to type ``wanted``."""
        if not hasattr(socket, "default_value"):
            return self.builder.constant(*(0.0,) * (1 if wanted == "VALUE" else 3))
        value = np.array(socket.default_value, np.float64).reshape(-1)[:3]
        return self.builder.convert(self.builder.constant(*value), socket.type, wanted)

    def _outputs(self, node, groups: tuple) -> Outputs:
        """All outputs of a node."""
        # The nodes that feed a node are read before it. A list holds them: trees may exceed Python's stack.
        waiting, opened = [(node, groups)], set()
        while waiting:
            here, around = waiting[-1]
            key = _key(here, around)
            if key in self._known:
                waiting.pop()
            elif key in opened:
                self._known[key] = self._read(here, around)
            else:
                opened.add(key)
                waiting.extend(self._sources(here, around, opened))
        return self._known[_key(node, groups)]

    def _sources(self, node, groups: tuple, opened: set) -> list[tuple]:
        """The nodes that feed a node and were not opened before."""
        sources = (resolve(socket, groups) for socket in node.inputs if socket.is_linked)
        return [
            (socket.node, around)
            for socket, around in sources
            if socket.is_output and socket.type != "SHADER" and _key(socket.node, around) not in opened
        ]

    def _read(self, node, groups: tuple) -> Outputs:
        inputs = NodeInputs(self, node, groups)
        read = self.nodes.get(node.type)
        if read and _maps_coordinates(node):
            self.note(node, ": Texture Mapping")
        found = read(inputs) if read else {}
        for output in node.outputs:
            if output.identifier not in found and output.type != "SHADER":
                # The function of a supported node leaves out only outputs without links.
                found[output.identifier] = self.builder.constant(0.0) if read else inputs.passed(output)
        return found


def _maps_coordinates(node) -> bool:
    """Return whether a texture node moves, turns, scales or swaps its coordinates by settings of its own."""
    mapping = getattr(node, "texture_mapping", None)
    if mapping is None:
        return False
    axes = mapping.mapping_x, mapping.mapping_y, mapping.mapping_z
    moved = any(mapping.translation) or any(mapping.rotation) or any(each != 1.0 for each in mapping.scale)
    return moved or axes != ("X", "Y", "Z")


def _key(node, groups: tuple) -> tuple:
    """A node within groups."""
    return (node.as_pointer(), *(group.as_pointer() for group in groups))


class NodeInputs:
    """The inputs of one node of a tree, as operations of the reader's builder."""

    def __init__(self, reader: GraphReader, node, groups: tuple) -> None:
        self._reader, self.node, self._groups = reader, node, groups
        self.builder = reader.builder
        self._by_identifier: dict[str, object] | None = None

    def _socket(self, name: str | int):
        if isinstance(name, int):
            return self.node.inputs[name]
        if self._by_identifier is None:
            self._by_identifier = {one.identifier: one for one in self.node.inputs}
        return self._by_identifier.get(name)

    def _read(self, name: str | int, wanted: str) -> Ref:
        found = self._linked(name, wanted)
        return self._reader.default(self._socket(name), wanted) if found is None else found

    def _linked(self, name: str | int, wanted: str) -> Ref | None:
        socket = self._socket(name)
        return None if socket is None else self._reader.value(socket, self._groups, wanted)

    def value(self, name: str | int) -> Ref:
        """The number at an input, by identifier or index."""
        return self._read(name, "VALUE")

    def color(self, name: str | int) -> Ref:
        """The colour at an input."""
        return self._read(name, "RGBA")

    def vector(self, name: str | int) -> Ref:
        """The vector at an input."""
        return self._read(name, "VECTOR")

    def coordinates(self, layer: str) -> Ref:
        """The Vector input of a texture, or a layer if nothing is linked."""
        found = self._linked("Vector", "VECTOR")
        return self.builder.layer(layer, LAYER_CHANNELS[layer.split(":")[0]])[0] if found is None else found

    def normal(self, name: str = "Normal") -> Ref:
        """The normal at an input, or the surface's if nothing is linked."""
        found = self._linked(name, "VECTOR")
        # An unlinked input of a group is 0, which has no direction.
        return self.builder.normal() if found is None or self.builder.is_always(found, 0.0) else found

    def apart(self, name: str) -> tuple[MaterialGraph, Ref] | None:
        """The number linked to an input, as a graph of its own and an output in it; None without a link."""
        reader = GraphReader(self._reader.nodes)
        found = reader.value(self._socket(name), self._groups, "VALUE")
        self.builder.notes.update(reader.builder.notes)
        return None if found is None else reader.builder.apart(found)

    def linked_outputs(self) -> set[str]:
        """The identifiers of the node's outputs that are linked."""
        return {one.identifier for one in self.node.outputs if one.is_linked}

    def note(self, text: str = "") -> None:
        """Note that the node is not shown as it is."""
        self._reader.note(self.node, text)

    def passed(self, output) -> Ref:
        """The stand-in for an output of an unsupported node: its first linked input of that type, or grey."""
        self.note()
        if output.name == "Normal":
            return self.normal()
        for socket in self.node.inputs:
            if socket.type == output.type and socket.is_linked:
                found = self._reader.value(socket, self._groups, output.type)
                if found is not None:
                    return found
        if output.type == "VECTOR":
            return self.builder.layer("GENERATED", 3)[0]
        return self.builder.constant(*(GREY,) * (3 if output.type == "RGBA" else 1))
