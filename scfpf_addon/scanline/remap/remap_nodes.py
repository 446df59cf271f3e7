# SPDX-License-Identifier: GPL-3.0-or-later
"""The node groups of the nodes preview: the view of a flexible camera, as geometry in its viewbox.

The viewbox stands in the camera's space: x from -½ to ½ across the image, y from -½/aspect to ½/aspect up it,
z from -1 (near surface) to -2 (far surface). A child camera of the flexible one frames it exactly if it is
orthographic and has the identity as local matrix, sensor fit HORIZONTAL, ortho scale 1 and clip range 1 to 2.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group, remove_attributes
from ..table.table_sheets import BRANCHES
from .branch_nodes import with_branches
from .draft_nodes import draft_group
from .place_nodes import BOX, own_point, store_places, view_inputs
from .realize_nodes import NORMAL, realize_group
from .refine_nodes import REFINE_INPUTS, refine_group

# Attribute of the finished mesh: the numbers of faces without a place, and of folded samples.
COUNTS = "SCFPF Left Out"

# The input that a viewport's preview has on while things move.
DRAFT = "Draft"

REMAP_INPUTS = {
    "Table": ("Object", None, "The table object of a flexible camera"),
    "Aspect": ("Float", 16 / 9, "Width over height of the picture"),
    "Pixel Error": ("Float", 0.5, "How far, in pixels, edges and what is on faces may be off"),
    "Picture Width": ("Float", 1000.0, "Pixels across the picture"),
    "Rounds": ("Int", 12, "How often large faces are divided, at most"),
    DRAFT: ("Bool", False, "Only in viewports: quickly and roughly, while things move"),
}


@defines_group("SCFPF Whole", REFINE_INPUTS, {"Mesh": "Geometry"})
def whole_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The mesh with the places of its vertices: large faces divided, in all branches, less what has no place.

    A group of its own: Blender evaluates the sides of one Switch behind another one, needed or not.
    """
    nodes.open_frame("Where its vertices are in the viewbox")
    placed = store_places(nodes, given["Mesh"], given | {"Point": own_point(nodes, given)})
    nodes.open_frame("Large faces are divided, what has no place goes")
    single = nodes.call(refine_group(), "Refine", {"Mesh": placed}, given)
    refined = with_branches(nodes, given, single)
    return {"Mesh": nodes.store(refined["Mesh"], COUNTS, refined["Left Out"], "FLOAT_VECTOR")}


@defines_group(
    "SCFPF Remap",
    {"Geometry": ("Geometry", None, "What the camera looks at")} | REMAP_INPUTS,
    {"Geometry": "Geometry"},
    modifier=True,
)
def remap_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The view of a flexible camera: a mesh as the camera sees it, in the camera's viewbox.

    Table: of ``table_object``. Aspect: width / height of the image. Picture Width: pixels. Usable in any
    modifier stack: positions are in the modified object's space, the viewbox stands in the table's.
    """
    nodes.open_frame("The camera's table")
    table, matrix = nodes.object_info(given["Table"])
    view = view_inputs(nodes, table, given["Aspect"])
    nodes.open_frame("The scene's mesh, with its shading")
    mesh = nodes.call(realize_group(), "Realize", {}, given)["Mesh"]
    # Where all projectors lie in one surface there is no inverse.
    flat = nodes.sample_attribute(view["Cloud"], BRANCHES, 0, "Branches").parts()[2]
    mesh = nodes.switch(flat > 0.5, mesh, None, "GEOMETRY", "Nothing if Flat")
    inverse = nodes.out("FunctionNodeInvertMatrix", "Into Camera's Space", {0: matrix})
    inputs = {"Mesh": mesh, "Inverse": inverse}
    nodes.open_frame("Whole, or in viewports a draft while things move")
    whole = nodes.call(whole_group(), "Whole", inputs, given | view)["Mesh"]
    draft = nodes.call(draft_group(), "Draft", inputs, given | view)["Mesh"]
    in_viewport = nodes.out("GeometryNodeIsViewport", "In a Viewport?", {})
    drawn = nodes.switch(given[DRAFT] & in_viewport, whole, draft, "GEOMETRY", "Draft?")
    nodes.open_frame("Into the viewbox, with the shading of the scene")
    place = nodes.point(nodes.attribute(BOX, "FLOAT_VECTOR"), matrix, "In Own Space")
    mesh = nodes.set_position(drawn, place, "Into the Viewbox")
    mesh = nodes.out(
        "GeometryNodeSetMeshNormal",
        "Shading Normals",
        {"Mesh": mesh, "Custom Normal": nodes.attribute(NORMAL, "FLOAT_VECTOR")},
        mode="FREE",
        domain="CORNER",
    )
    return {"Geometry": remove_attributes(nodes, mesh, "scfpf_*")}


@defines_group(
    "SCFPF Preview",
    {"Collection": ("Collection", None, "What the camera looks at")} | REMAP_INPUTS,
    {"Geometry": "Geometry"},
    modifier=True,
)
def preview_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The view of a flexible camera: a collection as the camera sees it, in the camera's viewbox.

    The object that carries it must be a child of the camera with the identity as its local matrix, and must
    not be in the collection.
    """
    seen = nodes.out(
        "GeometryNodeCollectionInfo",
        "Scene",
        {"Collection": given["Collection"], "Separate Children": True},
        transform_space="RELATIVE",
    )
    return nodes.call(remap_group(), "Remap", {"Geometry": seen}, given)


def remap_counts(evaluated_object) -> dict[str, int]:
    """The numbers of faces and samples that an evaluated object's remap left out; zero without a remap.

    ``unreachable``: faces without a place, though their surroundings have one. In a folded volume, faces with
    a corner in the image and another one beyond the fold, which no ray reaches; 0 in a volume in pieces.
    ``folded``: samples where the volume is turned inside out, of 2,304, or of 4,608 in a volume in pieces.
    """
    attribute = evaluated_object.data.attributes.get(COUNTS)
    if attribute is None or not len(attribute.data):
        return {"unreachable": 0, "folded": 0}
    unreachable, folded, _ = attribute.data[0].vector
    return {"unreachable": round(unreachable), "folded": round(folded)}


def is_flat(evaluated_table) -> bool:
    """Return whether all projectors of an evaluated table lie in one surface and have no inverse."""
    attribute = evaluated_table.data.attributes.get(BRANCHES)
    return attribute is not None and bool(len(attribute.data)) and attribute.data[0].vector[2] > 0.5
