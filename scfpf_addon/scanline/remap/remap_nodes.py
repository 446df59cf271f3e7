# SPDX-License-Identifier: GPL-3.0-or-later
"""The node groups of the live preview: what a flexible camera sees, as geometry in its viewbox.

The viewbox stands in the camera's space: x from -½ to ½ across the picture, y
from -½/aspect to ½/aspect up it, z from -1 (near surface) to -2 (far surface). An
orthographic camera that is a child of the flexible one with the identity as
its local matrix, sensor fit HORIZONTAL, ortho scale 1 and clip range 1 to 2 frames it exactly.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group, remove_attributes
from ..table.table_object import table_object
from ..table.table_sheets import BRANCHES
from .branch_nodes import with_branches
from .place_nodes import BOX, store_places, view_inputs
from .realize_nodes import NORMAL, realize_group
from .refine_nodes import refine_group

__all__ = ["COUNTS", "is_flat", "preview_group", "remap_counts", "remap_group", "table_object"]

# The attribute of the finished mesh that says what was left out: faces without a place, folded samples.
COUNTS = "SCFPF Left Out"

REMAP_INPUTS = {
    "Table": ("Object", None, "The table object of a flexible camera"),
    "Aspect": ("Float", 16 / 9, "Width over height of the picture"),
    "Pixel Error": ("Float", 0.5, "How far, in pixels, edges and what is on faces may be off"),
    "Picture Width": ("Float", 1000.0, "Pixels across the picture"),
    "Rounds": ("Int", 12, "How often large faces are divided, at most"),
}


def remap_group():
    """The node group "SCFPF Remap": geometry → what the camera of a table sees of it, in the viewbox.

    Inputs: Geometry, Table (Object, of ``table_object``), Aspect (width / height of the picture),
    Pixel Error, Picture Width (pixels). Usable in any modifier stack: positions are
    taken from the modified object's space, the viewbox stands in the table's. Found in the file or built.
    """
    inputs = {"Geometry": ("Geometry", None, "What the camera looks at")} | REMAP_INPUTS
    text = "What a flexible camera sees of a mesh, in the camera's viewbox"
    return node_group("SCFPF Remap", text, inputs, {"Geometry": "Geometry"}, _build_remap, modifier=True)


def _build_remap(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    nodes.open_frame("The camera's table")
    info = {"Object": given["Table"]}
    table = nodes.out("GeometryNodeObjectInfo", "Table", info, "Geometry")
    matrix = nodes.out("GeometryNodeObjectInfo", "Camera", info, "Transform", transform_space="RELATIVE")
    view = view_inputs(nodes, table, given["Aspect"])
    nodes.open_frame("The scene's mesh, with its shading")
    mesh = nodes.call(realize_group(), "Realize", {"Geometry": given["Geometry"]})["Mesh"]
    # Where all projectors lie in one surface there is no inverse.
    branches = nodes.attribute(BRANCHES, "FLOAT_VECTOR")
    flat = nodes.sample(view["Cloud"], branches, 0, "FLOAT_VECTOR", "Branches").parts()[2]
    mesh = nodes.switch(flat > 0.5, mesh, None, "GEOMETRY", "Nothing if Flat")
    nodes.open_frame("Where its vertices are in the viewbox")
    position = nodes.out("GeometryNodeInputPosition", "Position", {})
    inverse = nodes.out("FunctionNodeInvertMatrix", "Into Camera's Space", {0: matrix})
    point = {"Point": nodes.point(position, inverse, "In Camera's Space")}
    options = {key: given[key] for key in ("Pixel Error", "Picture Width", "Rounds")} | {"Inverse": inverse}
    placed = store_places(nodes, mesh, view | point)
    nodes.open_frame("Large faces are divided, what has no place goes")
    single = nodes.call(refine_group(), "Refine", view | options | {"Mesh": placed})
    refined = with_branches(nodes, view, options | {"Mesh": mesh}, single)
    nodes.open_frame("Into the viewbox, with the shading of the scene")
    place = nodes.point(nodes.attribute(BOX, "FLOAT_VECTOR"), matrix, "In Own Space")
    mesh = nodes.out(
        "GeometryNodeSetPosition", "Into the Viewbox", {"Geometry": refined["Mesh"], "Position": place}
    )
    mesh = nodes.out(
        "GeometryNodeSetMeshNormal",
        "Shading Normals",
        {"Mesh": mesh, "Custom Normal": nodes.attribute(NORMAL, "FLOAT_VECTOR")},
        mode="FREE",
        domain="CORNER",
    )
    mesh = nodes.store(mesh, COUNTS, refined["Left Out"], "FLOAT_VECTOR")
    return {"Geometry": remove_attributes(nodes, mesh, "scfpf_*")}


def preview_group(camera):
    """The node group of the camera's whole preview: Collection → viewbox geometry.

    Inputs: Collection, Table (Object), Aspect, Pixel Error, Picture Width. The object that carries it must
    be a child of the camera with the identity as its local matrix, and in none of the collections that
    it shows.
    """
    inputs = {"Collection": ("Collection", None, "What the camera looks at")} | REMAP_INPUTS

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        seen = nodes.out(
            "GeometryNodeCollectionInfo",
            "Scene",
            {"Collection": given["Collection"], "Separate Children": True},
            transform_space="RELATIVE",
        )
        options = {key: given[key] for key in REMAP_INPUTS}
        return nodes.call(remap_group(), "Remap", options | {"Geometry": seen})

    text = "What a flexible camera sees of a collection, in the camera's viewbox"
    return node_group("SCFPF Preview", text, inputs, {"Geometry": "Geometry"}, build, modifier=True)


def remap_counts(evaluated_object) -> dict[str, int]:
    """What an evaluated object's remap left out.

    Keys: ``unreachable`` (faces without a place though their surroundings have one; of a volume with folds
    the faces with a corner in the picture and another one that no ray reaches, since the volume ends
    in a fold before it; not counted where it is in pieces), ``folded`` (samples of the volume, of 2,304,
    or of 4,608 if it is in pieces, where it is turned inside out). Zero where there is no remap.
    """
    attribute = evaluated_object.data.attributes.get(COUNTS)
    if attribute is None or not len(attribute.data):
        return {"unreachable": 0, "folded": 0}
    unreachable, folded, _ = attribute.data[0].vector
    return {"unreachable": round(unreachable), "folded": round(folded)}


def is_flat(evaluated_table) -> bool:
    """Whether all projectors of an evaluated table lie in one surface: nothing can be inverted then."""
    attribute = evaluated_table.data.attributes.get(BRANCHES)
    return attribute is not None and bool(len(attribute.data)) and attribute.data[0].vector[2] > 0.5
