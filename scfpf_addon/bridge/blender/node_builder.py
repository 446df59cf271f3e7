# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups built in code, with a layout that is readable in the node editor."""

from __future__ import annotations

import bpy


class NodeBuilder:
    """Builds a node group: each call adds one node, laid out by depth, inside the open frame.

    row: height of a row, in the node editor's units; a taller node takes several rows.
    """

    COLUMN = 190
    # Heights of a node's title with its settings, of a socket, and of a vector's three values.
    TITLE, SOCKET, VALUES = 80, 22, 66
    # Whether nodes are named by their labels, to be looked up. Naming updates the whole tree.
    NAMED = True

    def __init__(self, tree, row: int = 170):
        self.tree = tree
        self._row = row
        self._frame = None
        self._first_column = 0
        self._columns: dict[str, int] = {}
        self._filled: dict[int, int] = {}

    def open_frame(self, label: str) -> None:
        """Put the next nodes into a new frame, to the right of all others."""
        self.close_frame()
        self._frame = self.tree.nodes.new("NodeFrame")
        self._frame.label = self._frame.name = label

    def close_frame(self) -> None:
        self._frame = None
        self._first_column = max(self._columns.values(), default=-1) + 1

    def node(self, kind: str, label: str, inputs: dict, **settings):
        """Add a node. inputs: values or output sockets by name. settings: attributes of the node."""
        node = self.tree.nodes.new(kind)
        node.label = label
        if self.NAMED:
            node.name = label
        node.parent = self._frame
        # Every setting updates the whole tree, even one that the node has already.
        for key, value in settings.items():
            if getattr(node, key, None) != value:
                setattr(node, key, value)
        column = self._first_column
        for key, value in inputs.items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[key])
                column = max(column, self._columns[value.node.name] + 1)
            else:
                self._set_default(node.inputs[key], value)
        self._columns[node.name] = column
        row = self._filled.get(column, 0)
        self._filled[column] = row + self._rows(node)
        self.place(node, self.COLUMN * column, -self._row * row)
        return node

    def place(self, node, x: float, y: float) -> None:
        """Move a node to a place in the editor."""
        node.location = x, y

    @staticmethod
    def _set_default(socket, value) -> None:
        present = socket.default_value
        if (tuple(present) if isinstance(value, tuple) else present) != value:
            socket.default_value = value

    def _rows(self, node) -> int:
        """The number of rows of a node, estimated: Blender knows sizes only after drawing."""
        visible = [socket for socket in (*node.outputs, *node.inputs) if socket.enabled]
        open_vectors = [s for s in node.inputs if s.enabled and s.type == "VECTOR" and not s.is_linked]
        height = self.TITLE + self.SOCKET * len(visible) + self.VALUES * len(open_vectors)
        return max(1, -(-height // self._row))

    def math(self, operation: str, a, b=0.0, label: str = ""):
        name = label or operation.replace("_", " ").title()
        return self.node("ShaderNodeMath", name, {0: a, 1: b}, operation=operation).outputs[0]

    def vector(self, x, y, z, label: str):
        return self.node("ShaderNodeCombineXYZ", label, {0: x, 1: y, 2: z}).outputs[0]

    def centred(self, parameter, extent, label: str):
        """(parameter - ½) · extent."""
        return self.math("MULTIPLY", self.math("SUBTRACT", parameter, 0.5), extent, label)

    def between(self, start, end, parameter, label: str):
        """start + (end - start) · parameter."""
        along = self.math("MULTIPLY", self.math("SUBTRACT", end, start), parameter)
        return self.math("ADD", start, along, label)
