# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that places the sheets, and the materials that send rays on.

Nodes compute them from the table of projectors, so that they follow the surfaces and the frame in any
Blender, without the add-on.
"""

from __future__ import annotations

import bpy

from ...bridge.blender.drivers import add_property, new_driver
from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.nodes.geometry_nodes import GeometryBuilder, defines_group, remove_attributes
from ...scanline.nodes.solve_nodes import TABLE_INPUTS, corner_projectors, find_cell
from ...scanline.remap.place_nodes import view_inputs
from . import lens_nodes, pass_nodes
from .sheets import (
    BREAKS,
    FAR_SLOT,
    JUMP_SLOT,
    PLAIN_SLOT,
    REPEATED,
    SCREEN_SLOT,
    SHEET_SLOT,
    SURROUND_SLOT,
    SURROUNDS,
)

# Attribute of the sheets before the nodes: the chord that a ray goes on along from a vertex, n for none.
ONWARD = "scfpf_onward"
# How far the screen is moved back at a vertex: ``Portals.depth``.
DEPTH = "scfpf_depth"
# After the nodes: where a ray continues and its direction, world space; where a ray begins that the portal
# turns, and the tolerance of that place; of the surround, the longest ray from the rig's camera.
POSITION, DIRECTION, ORIGIN = "scfpf_position", "scfpf_direction", "scfpf_origin"
TOLERANCE = "scfpf_tolerance"
# Where a vertex will be; removed as it gets there.
PLACE = "scfpf_there"

# The surround of the screen is behind it by this factor of the distance from the camera.
SURROUND_FACTOR = 1.1
# Rays that have come this share of the way between scene and screen are not from the rig's camera.
STRAY = 0.5
# Rays that have left the volume go on from this far away, where they meet only the world.
TELEPORT = 1e8
# A portal turns rays that begin where its chord does: within this share of the chord's length, or of the
# coordinates, which float32 rounds.
CHORD_SHARE, PLACE_SHARE = 5e-3, 2e-5
# Rays of a lens begin anywhere.
ANYWHERE = 1e30


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
        "Width": ("Float", 1.0, "Width of the screen, as the camera that looks at it sees it"),
        "Passes": ("Bool", False, "Does the picture have passes of t, depth, u and v?"),
        "Chords": ("Float", 1.0, "The number of chords"),
        "Skip": ("Bool", False, "Do rays skip the chords that were empty?"),
        "Probe": ("Bool", False, "Shall vertices be at the ends of the chords, without attributes?"),
    }
    | lens_nodes.INPUTS
    # New inputs come last: drivers of rigs in files refer to the identifiers of these.
    | {"Away": ("Float", 1.0, "How far the rig's camera is below the scene")}
    | {"Along Axis": ("Bool", False, "Is depth measured along the camera's axis?")},
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
    open_lens = given["Straight"] & (given["Lens Radius"] > 0.0)
    skips = given["Skip"] & ~open_lens
    found = nodes.call(_sheets_group(), "Sheets", {"Skip": skips}, given)
    geometry, sheet = found["Geometry"], found["Sheet"]
    x, y, number = nodes.position().parts()
    nodes.open_frame("Ends of the chord before, and of the next")
    onward, count = nodes.attribute(ONWARD), given["Chords"]
    far = nodes.switch(onward > count - 0.5, 0.0, 1.0, "FLOAT", "Is It the Last?")
    chord = onward.min(count - 1.0)
    numbers = {"Before": (number - 1.0).max(0.0), "Here": number, "Start": chord, "End": chord + 1.0}
    ends, times = {}, {}
    for label, wanted in numbers.items():
        t, shift, _ = nodes.at_index(nodes.position(), wanted, "POINT", "FLOAT_VECTOR").parts()
        inputs = {"Position": nodes.xyz(x, y, t, "x, y, t"), "Shift": shift}
        end = nodes.call(chord_end_group(), f"Chord {label}", inputs, view)["Position"]
        ends[label], times[label] = nodes.point(end, matrix, "In the World"), t
    probe = nodes.set_position(geometry, ends["Here"], "Ends of the Chords")
    polar = view["Numbers"].parts()[2]
    screen = nodes.call(_screen_group(), "Screen", {"Polar": polar}, given)["Position"]
    inputs = {"Geometry": geometry, "Far": far, "Lens": open_lens, "Number": number}
    inputs["Stray"] = given["Away"] * STRAY
    geometry = nodes.call(_rays_group(), "Rays", inputs, ends)["Geometry"]
    here, along = (nodes.attribute(name, "FLOAT_VECTOR") for name in (POSITION, DIRECTION))
    nodes.open_frame("Only where they are asked for")
    inputs = {"Geometry": geometry, "Matrix": matrix, "Start": here, "Chord": along, "Screen": screen}
    with_lens = nodes.call(lens_nodes.lens_group(), "Lens", inputs, given)["Geometry"]
    geometry = nodes.switch(open_lens, geometry, with_lens, "GEOMETRY", "Depth of Field?")
    before, sheet_place = (nodes.attribute(name, "FLOAT_VECTOR") for name in (ORIGIN, PLACE))
    inputs = {"Geometry": geometry, "Far": far, "Number": number, "Sheet": sheet, "Skips": skips}
    inputs["Place"] = nodes.xyz(x, y, polar, "x, y, polar")
    inputs |= {"Start Before": before, "Chord Before": sheet_place - before}
    inputs |= {"t Before": times["Before"], "Step Before": times["Here"] - times["Before"]}
    inputs |= {"Start Onward": here, "Chord Onward": along}
    inputs |= {"t Onward": times["Start"], "Step Onward": times["End"] - times["Start"]}
    inputs["Matrix"] = matrix
    with_passes = nodes.call(pass_nodes.passes_group(), "Passes", inputs, given)["Geometry"]
    geometry = nodes.switch(given["Passes"], geometry, with_passes, "GEOMETRY", "Passes?")
    is_sheet = number > 0.5
    place = nodes.switch(
        is_sheet, screen, nodes.attribute(PLACE, "FLOAT_VECTOR"), "VECTOR", "Sheet or Screen"
    )
    placed = nodes.set_position(geometry, place, "In Place")
    placed = _instance_for_own_bvh(nodes, remove_attributes(nodes, placed, PLACE))
    return {"Geometry": nodes.switch(given["Probe"], placed, probe, "GEOMETRY", "Probe?")}


def _instance_for_own_bvh(nodes: GeometryBuilder, geometry: Value) -> Value:
    """Instances of the sheets in renders, so that Cycles puts them into a tree of their own.

    A second instance, of no size, brings that about. Cycles merges a mesh with one user into the scene's,
    where all rays pass its boxes, shadow rays included.
    """
    nodes.open_frame("Apart from the scene")
    instance = nodes.out("GeometryNodeGeometryToInstance", "Instance", {0: geometry})
    inputs = {"Instances": instance, "Scale": (0.0, 0.0, 0.0)}
    apart = nodes.join(instance, nodes.out("GeometryNodeScaleInstances", "Of No Size", inputs))
    is_viewport = nodes.out("GeometryNodeIsViewport", "Viewport", {})
    return nodes.switch(is_viewport, apart, geometry, "GEOMETRY", "Viewport?")


@defines_group(
    "SCFPF Portal Sheets",
    {
        "Geometry": ("Geometry", None, "Sheets: x, y and the number of the sheet as positions"),
        "Chords": ("Float", 1.0, "The number of chords"),
        "Skip": ("Bool", False, "Do rays skip the chords that were empty?"),
    },
    {"Geometry": "Geometry", "Sheet": "Int"},
)
def _sheets_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Sheets that skip chords or whole ones, and the number of a whole one's vertices."""
    number = nodes.position().parts()[2]
    repeated, skipping = nodes.separate(given["Geometry"], number < REPEATED + 0.5, "The Repeated", "POINT")
    nodes.open_frame("One whole sheet for each break")
    others, _ = nodes.separate(skipping, number < SURROUNDS + 0.5, "Breaks and Surround", "POINT")
    breaks, _ = nodes.separate(others, number < BREAKS + 0.5, "Breaks", "POINT")
    at = nodes.set_position(breaks, nodes.xyz(0.0, 0.0, nodes.index(), "Number"), "At Their Numbers")
    x, y, _ = nodes.position().parts()
    sheet = nodes.set_position(repeated, nodes.xyz(x, y, 0.0, "x, y"), "At 0")
    inputs = {"Points": at, "Instance": sheet}
    placed = nodes.out("GeometryNodeInstanceOnPoints", "A Sheet at Each", inputs)
    whole = nodes.out("GeometryNodeRealizeInstances", "Whole Sheets", {0: placed})
    whole = nodes.store(whole, ONWARD, number, "FLOAT")
    for slot, selection in ((SCREEN, number < 0.5), (FAR, number > given["Chords"] - 0.5)):
        inputs = {"Geometry": whole, "Selection": selection, "Material Index": slot}
        whole = nodes.out("GeometryNodeSetMaterialIndex", "Its Material", inputs)
    whole = nodes.join(others, whole)
    geometry = nodes.switch(given["Skip"], whole, skipping, "GEOMETRY", "Skip?")
    return {"Geometry": geometry, "Sheet": nodes.domain_size(repeated, "Point Count")}


@defines_group(
    "SCFPF Portal Rays",
    {
        "Geometry": ("Geometry", None, "Sheets"),
        "Far": ("Float", 0.0, "1 where a ray leaves the volume"),
        "Lens": ("Bool", False, "Has the camera a lens?"),
        "Number": ("Float", 0.0, "Of the sheet"),
        "Stray": ("Float", 1.0, "Longer rays to the surround are not from the rig's camera"),
        "Before": ("Vector", None, "Start of the chord before a vertex"),
        "Here": ("Vector", None, "Its end"),
        "Start": ("Vector", None, "Start of the next"),
        "End": ("Vector", None, "Its end"),
    },
    {"Geometry": "Geometry"},
)
def _rays_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Store which rays the portals turn, and where these go on."""
    geometry = given["Geometry"]
    nodes.open_frame("Each place once: fields are evaluated anew wherever they are used")

    def store(name: str, value: Value, kind: str = "FLOAT_VECTOR") -> None:
        nonlocal geometry
        geometry = nodes.store(geometry, name, value, kind)

    here, before, start, along = (
        nodes.attribute(name, "FLOAT_VECTOR") for name in (PLACE, ORIGIN, POSITION, DIRECTION)
    )
    store(PLACE, given["Here"])
    store(ORIGIN, given["Before"])
    store(POSITION, given["Start"])
    store(DIRECTION, given["End"] - start)
    nodes.open_frame("Where rays go on")
    unit = nodes.out("ShaderNodeVectorMath", "Normalized", {0: along}, operation="NORMALIZE")
    beyond = start + along + unit * TELEPORT
    store(POSITION, nodes.switch(given["Far"] > 0.5, start, beyond, "VECTOR", "Out of the Volume?"))
    nodes.open_frame("Which rays are turned")
    tolerance = (here - before).length() * CHORD_SHARE + here.length().max(before.length()) * PLACE_SHARE
    tolerance = nodes.switch(given["Lens"], tolerance, ANYWHERE, "FLOAT", "Rays of a Lens?")
    is_surround = given["Number"] < -0.5
    store(TOLERANCE, nodes.switch(is_surround, tolerance, given["Stray"], "FLOAT", "Surround?"), "FLOAT")
    return {"Geometry": geometry}


@defines_group(
    "SCFPF Portal Screen",
    {
        "Aspect": ("Float", 16 / 9, "Width over height of the picture"),
        "Width": ("Float", 1.0, "Width of the screen"),
        "Distance": ("Float", 1.0, "How far the screen is from its camera"),
        "Away": ("Float", 1.0, "How far the camera is below the scene"),
        "Parallel": ("Bool", True, "Is the camera orthographic?"),
        "Polar": ("Float", 0.0, "1 in a polar picture"),
    },
    {"Position": "Vector"},
)
def _screen_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The positions of the screen's vertices, and of the surround's."""
    x, y, number = nodes.position().parts()
    aspect, width, polar = given["Aspect"], given["Width"], given["Polar"]
    away, distance = given["Away"], given["Distance"]
    wide = aspect.max(1.0)
    across = nodes.mix(polar, width, width / wide)
    up = nodes.mix(polar, width / aspect, width / wide)
    back = nodes.switch(given["Parallel"], nodes.attribute(DEPTH), 0.0, "FLOAT", "Moved Back")
    depth = (distance + back) * nodes.switch(
        number < -0.5, 1.0, SURROUND_FACTOR, "FLOAT", "Screen or Surround"
    )
    z = -1.0 * away - depth
    nodes.open_frame("In the cone of the camera, by the depth that float32 has rounded")
    scale = nodes.switch(given["Parallel"], (-1.0 * z - away) / distance, 1.0, "FLOAT", "Parallel?")
    return {"Position": nodes.xyz((x - 0.5) * across * scale, (y - 0.5) * up * scale, z, "Screen")}


# Slots of the materials on the sheets' mesh.
SHEET, SCREEN, SURROUND, FAR = SHEET_SLOT, SCREEN_SLOT, SURROUND_SLOT, FAR_SLOT
JUMP, PLAIN = JUMP_SLOT, PLAIN_SLOT


def new_materials(scene, follow) -> list:
    """The new materials of a rig's mesh, in the order of their slots.

    scene: its film, transparent or not, surrounds a round image. follow: (socket, property) drives a socket
    by the flexible camera.
    """
    return [
        _portal("SCFPF Sheet", SHEET, follow),
        _portal("SCFPF Screen", SCREEN, follow),
        _surround(scene),
        _portal("SCFPF Far", FAR, follow),
        _portal("SCFPF Jump", JUMP, follow),
        _portal("SCFPF Screen without Lens", PLAIN, follow),
    ]


def _new_material(name: str):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True  # from 5.0 every material has a tree, and the switch is deprecated
    material.node_tree.nodes.clear()
    # No shadow ray meets it, but where any shadow may be transparent Cycles looks behind all that cast one.
    material.use_transparent_shadow = False
    return material, FieldBuilder(material.node_tree)


def _portal(name: str, slot: int, follow):
    material, nodes = _new_material(name)
    nodes.open_frame("The ray")
    ray = nodes.node("ShaderNodeNewGeometry", "Ray", {}).outputs
    place, backwards = Value(nodes, ray["Position"]), Value(nodes, ray["Incoming"])
    if slot == SCREEN:
        onward = (nodes.shader_attribute(name) for name in (POSITION, DIRECTION))
        position, direction = lens_nodes.aimed(nodes, *onward)
        inputs = {"Position": position, "Direction": direction}
    elif slot == FAR:
        onward = backwards * -1.0
        inputs = {"Position": place + onward * TELEPORT, "Direction": onward}
    elif slot in (JUMP, PLAIN):
        inputs = {
            "Position": nodes.shader_attribute(POSITION),
            "Direction": nodes.shader_attribute(DIRECTION),
        }
    else:
        inputs = {"Direction": nodes.shader_attribute(DIRECTION)}
    # Up to 5.1 Cycles does not normalise it: rays of another length see no smoke and reflect too little.
    unit = {0: inputs["Direction"]}
    inputs["Direction"] = nodes.out("ShaderNodeVectorMath", "Unit", unit, operation="NORMALIZE")
    nodes.open_frame("The portal")
    shader, due = nodes.node("ShaderNodeBsdfRayPortal", "Ray Portal", inputs).outputs[0], None
    if slot not in (SCREEN, PLAIN):
        nodes.open_frame("Only for rays that begin where the chord before does")
        way = nodes.out("ShaderNodeLightPath", "Light Path", {}, "Ray Length")
        off = (place + backwards * way - nodes.shader_attribute(ORIGIN)).length()
        inputs = {0: off, 1: nodes.shader_attribute(TOLERANCE, "Fac")}
        due = nodes.node("ShaderNodeMath", "Due", inputs, operation="LESS_THAN").outputs[0]
        through = nodes.node("ShaderNodeBsdfTransparent", "Not Due", {}).outputs[0]
        shader = nodes.node("ShaderNodeMixShader", "In Order", {0: due, 1: through, 2: shader}).outputs[0]
    nodes.node("ShaderNodeOutputMaterial", "Output", {"Surface": shader})
    ray_direction = nodes.shader_attribute(DIRECTION) if slot in (SCREEN, PLAIN) else backwards
    pass_nodes.add_to_aovs(nodes, due, None if slot == SHEET else ray_direction, follow)
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
    inputs = {0: way, 1: nodes.shader_attribute(TOLERANCE, "Fac")}
    stray = nodes.node("ShaderNodeMath", "From the Scene", inputs, operation="GREATER_THAN").outputs[0]
    through = nodes.node("ShaderNodeBsdfTransparent", "Beyond", {}).outputs[0]
    inputs = {0: stray, 1: shader, 2: through}
    shader = nodes.node("ShaderNodeMixShader", "Seen by the Rig's Camera", inputs).outputs[0]
    nodes.node("ShaderNodeOutputMaterial", "Output", {"Surface": shader})
    return material
