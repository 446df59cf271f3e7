# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that places the sheets, and the materials that send rays on.

Nodes compute them from the table of projectors, so that they follow the surfaces and the frame in any
Blender, without the add-on.
"""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...bridge.blender.drivers import add_property, new_driver
from ...bridge.blender.rig_mark import WIDTH
from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.nodes.geometry_nodes import GeometryBuilder, defines_group
from ...scanline.nodes.solve_nodes import TABLE_INPUTS, corner_projectors, find_cell
from ...scanline.remap.place_nodes import view_inputs
from . import lens_nodes, pass_nodes

# Attributes of the sheets before the nodes: t and shift at the start and at the end of a vertex' chord. The
# third value of START is 1 on the far sheet, that of END the number of vertices of a sheet.
START, END = "scfpf_start", "scfpf_end"
# After the nodes: where a ray continues and its direction, world space; how many portals it has passed.
POSITION, DIRECTION, DEPTH = "scfpf_position", "scfpf_direction", "scfpf_depth"

# The screen is this far below the scene, and WIDTH wide or a little more. float32 resolves 16 million places
# across it at any distance.
AWAY = 2.5e5
TO_SCREEN = 1e4
# Rays begin this far before the screen, since the fog of a world is there too: twice float32's step at AWAY.
BEFORE_SCREEN = 0.03125
TO_SURROUND = 1.1e4
# Rays that have left the volume go on from this far away, where they meet only the world.
TELEPORT = 1e8
# A ray shorter than this share of its chord is still at the portal that it came from.
SAME_PLACE = 1e-3
# Tolerance of a portal's depth against its attribute: less than half.
DEPTH_SLACK = 0.4


@defines_group(
    "SCFPF Chord End",
    TABLE_INPUTS
    | {
        "Position": ("Vector", None, "x, y and t"),
        "Shift": ("Float", 0.0, "Factor of the bend"),
    },
    {"Position": "Vector"},
)
def chord_end_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The end of a projector's chord, Q - shift · Q'' at (x, y, t), in the table's space."""
    first, place = find_cell(nodes, given)
    a, b, t = place.parts()
    spans = given["Size"].parts()[2]
    nodes.open_frame("The four projectors there")
    t2 = t * t
    bend = nodes.xyz(0.0, 2.0, t * 6.0, "Second derivatives") * (spans * spans * given["Shift"])
    powers = nodes.xyz(t, t2, t2 * t, "t, t², t³") - bend
    corners = corner_projectors(nodes, given, first)
    points = [nodes.point(powers, matrix, f"Point {label}") for label, matrix in corners]
    nodes.open_frame("Blended")
    low, high = (nodes.mix(a, *points[i : i + 2]) for i in (0, 2))
    return {"Position": nodes.mix(b, low, high)}


@defines_group(
    "SCFPF Portals",
    {
        "Geometry": ("Geometry", None, "Sheets: x, y and the number of the sheet as positions"),
        "Table": ("Object", None, "The table object of a flexible camera"),
        "Aspect": ("Float", 16 / 9, "Width over height of the picture"),
        "Width": ("Float", WIDTH, "Width of the screen: the ortho scale of the camera that looks at it"),
        "Passes": ("Bool", False, "Does the picture have passes of t, depth, u and v?"),
    }
    | lens_nodes.INPUTS,
    {"Geometry": "Geometry"},
    modifier=True,
)
def portal_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The sheets that turn Cycles' rays from one chord of a projector into the next.

    Geometry: as ``sheets.portals`` makes it.
    """
    nodes.open_frame("The camera's table")
    table, matrix = nodes.object_info(given["Table"])
    view = view_inputs(nodes, table, given["Aspect"])
    x, y, number = nodes.position().parts()
    nodes.open_frame("Ends of the chord")
    (t, shift, far), (next_t, next_shift, sheet) = (
        nodes.attribute(name, "FLOAT_VECTOR").parts() for name in (START, END)
    )
    ends = []
    for label, end_t, end_shift in (("Start", t, shift), ("End", next_t, next_shift)):
        inputs = {"Position": nodes.xyz(x, y, end_t, "x, y, t"), "Shift": end_shift}
        end = nodes.call(chord_end_group(), f"Chord {label}", inputs, view)["Position"]
        ends.append(nodes.point(end, matrix, "In the World"))
    start, end = ends
    polar = view["Numbers"].parts()[2]
    screen = _screen(nodes, given, polar)
    nodes.open_frame("Where rays go on")
    geometry = given["Geometry"]
    for name, value in ((POSITION, nodes.mix(far, start, end)), (DIRECTION, end - start)):
        geometry = nodes.store(geometry, name, value, "FLOAT_VECTOR")
    geometry = nodes.store(geometry, DEPTH, number, "FLOAT")
    here, chord = (nodes.attribute(name, "FLOAT_VECTOR") for name in (POSITION, DIRECTION))
    with_lens = lens_nodes.store_lens(nodes, geometry, given | {"Start": here, "Chord": chord}, matrix)
    nodes.open_frame("Only where they are asked for")
    open_lens = given["Straight"] & (given["Lens Radius"] > 0.0)
    geometry = nodes.switch(open_lens, geometry, with_lens, "GEOMETRY", "Depth of Field?")
    of_passes = {"t": t, "Step": next_t - t, "Far": far, "Number": number, "Sheet": sheet}
    of_passes |= {"Start": here, "Chord": chord, "Place": nodes.xyz(x, y, polar, "x, y, polar")}
    with_passes = pass_nodes.store_added(nodes, geometry, of_passes)
    geometry = nodes.switch(given["Passes"], geometry, with_passes, "GEOMETRY", "Passes?")
    place = nodes.switch(number < 0.5, here, screen, "VECTOR", "Sheet or Screen")
    return {"Geometry": nodes.set_position(geometry, place, "In Place")}


def _screen(nodes: GeometryBuilder, given: dict[str, Value], polar: Value) -> Value:
    """The positions of the screen's vertices, and of the surround's."""
    x, y, number = nodes.position().parts()
    nodes.open_frame("The screen, and what surrounds it")
    aspect, width = given["Aspect"], given["Width"]
    wide = aspect.max(1.0)
    across = nodes.mix(polar, width, width / wide)
    up = nodes.mix(polar, width / aspect, width / wide)
    depths = (-AWAY - TO_SCREEN, -AWAY - TO_SURROUND)
    depth = nodes.switch(number < -0.5, *depths, "FLOAT", "Screen or Surround")
    return nodes.xyz((x - 0.5) * across, (y - 0.5) * up, depth, "Screen")


# Slots of the materials on the sheets' mesh.
SHEET, SCREEN, SURROUND, FAR = range(4)


def new_materials(gated: bool, scene, follow) -> list:
    """The new materials of sheets, screen, surround and far sheet, in the order of their slots.

    gated: a sheet turns only rays that have passed as many portals as its chord begins with. scene: its film,
    transparent or not, surrounds a round image. follow: (socket, property) drives a socket by the flexible
    camera.
    """
    return [
        _portal("SCFPF Sheet", gated, SHEET, follow),
        _portal("SCFPF Screen", gated, SCREEN, follow),
        _surround(scene),
        _portal("SCFPF Far", gated, FAR, follow),
    ]


def _new_material(name: str):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True  # from 5.0 every material has a tree, and the switch is deprecated
    material.node_tree.nodes.clear()
    return material, FieldBuilder(material.node_tree)


def _portal(name: str, gated: bool, slot: int, follow):
    material, nodes = _new_material(name)
    if slot == SCREEN:
        ray = (nodes.shader_attribute(name) for name in (POSITION, DIRECTION))
        position, direction = lens_nodes.aimed(nodes, *ray, TO_SCREEN)
        inputs = {"Position": position, "Direction": direction}
    elif slot == FAR:
        ray = nodes.node("ShaderNodeNewGeometry", "Ray", {}).outputs
        onward = Value(nodes, ray["Incoming"]) * -1.0
        inputs = {"Position": Value(nodes, ray["Position"]) + onward * TELEPORT, "Direction": onward}
    else:
        inputs = {"Direction": nodes.shader_attribute(DIRECTION)}
    # Up to 5.1 Cycles does not normalise it: rays of another length see no smoke and reflect too little.
    unit = {0: inputs["Direction"]}
    inputs["Direction"] = nodes.out("ShaderNodeVectorMath", "Unit", unit, operation="NORMALIZE")
    nodes.open_frame("The portal")
    shader, due = nodes.node("ShaderNodeBsdfRayPortal", "Ray Portal", inputs).outputs[0], None
    if gated:
        passed = nodes.node("ShaderNodeLightPath", "Light Path", {}).outputs["Portal Depth"]
        inputs = {0: passed, 1: nodes.shader_attribute(DEPTH, "Fac"), 2: DEPTH_SLACK}
        due = nodes.node("ShaderNodeMath", "Due", inputs, operation="COMPARE").outputs[0]
        through = nodes.node("ShaderNodeBsdfTransparent", "Not Due", {}).outputs[0]
        shader = nodes.node("ShaderNodeMixShader", "In Order", {0: due, 1: through, 2: shader}).outputs[0]
    nodes.node("ShaderNodeOutputMaterial", "Output", {"Surface": shader})
    if due is None and slot != SCREEN:
        # On an edge both triangles may turn a ray: that does no harm, but must not count twice.
        way = nodes.out("ShaderNodeLightPath", "Light Path", {}, "Ray Length")
        chord = nodes.shader_attribute(DIRECTION).length()
        due = nodes.combine("GREATER_THAN", way, chord * SAME_PLACE).socket
    pass_nodes.add_to_aovs(nodes, due, {SCREEN: 1.0, FAR: -1.0}.get(slot, 0.0), follow)
    return material


def _surround(scene):
    material, nodes = _new_material("SCFPF Surround")
    holdout = nodes.node("ShaderNodeHoldout", "Nothing", {}).outputs[0]
    black = nodes.node("ShaderNodeEmission", "Black", {"Strength": 0.0}).outputs[0]
    transparent = nodes.node("ShaderNodeValue", "Is Film Transparent", {}).outputs[0]
    driver = new_driver(transparent, "default_value")
    add_property(driver, scene, "render.film_transparent", id_type="SCENE")
    shader = nodes.node("ShaderNodeMixShader", "Around", {0: transparent, 1: black, 2: holdout}).outputs[0]
    # Rays of a lens may miss the far sheet, and come here from the scene.
    way = nodes.node("ShaderNodeLightPath", "Light Path", {}).outputs["Ray Length"]
    inputs = {0: way, 1: 2.0 * TO_SURROUND}
    stray = nodes.node("ShaderNodeMath", "From the Scene", inputs, operation="GREATER_THAN").outputs[0]
    through = nodes.node("ShaderNodeBsdfTransparent", "Beyond", {}).outputs[0]
    inputs = {0: stray, 1: shader, 2: through}
    shader = nodes.node("ShaderNodeMixShader", "Seen by the Rig's Camera", inputs).outputs[0]
    nodes.node("ShaderNodeOutputMaterial", "Output", {"Surface": shader})
    return material


def can_gate() -> bool:
    """Whether this Blender's materials know how many portals a ray has passed."""
    return versions.has_portal_depth()
