# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting of Blender and Cycles is shown as by Cycles, named in a warning, or without effect.

``settings.txt`` and ``node_settings.txt`` decide on each; the tests walk Blender's own lists of properties.
A property that a new Blender adds fails here until somebody decides on it.
"""

import contextlib
import pathlib
import re
from collections import Counter
from typing import NamedTuple

import bpy
import numpy as np
import pytest
from engine_images import f12
from shown_materials import add, both, emit, new_material, scene_with_camera, show, wavy_sheet

HERE = pathlib.Path(__file__).parent
TESTS = HERE.parent
KINDS = "shown", "warned", "named", "none"
# Settings of any node.
ANY = "*"
# Reasons of rows of settings that change neither image; those that change what Blender edits or renders.
INERT = "EEVEE", "viewport only", "editor only", "Cycles does not read it"
EDITING = "mode", "engine", "use_single_layer", "show_only_shape_key"
FLIPPABLE = "BOOLEAN", "ENUM", "INT", "FLOAT"
NODE_PREFIXES = "ShaderNode", "FunctionNode", "GeometryNode", "Node"


class Row(NamedTuple):
    """Settings that are decided alike. kind: of KINDS. text: after it. names: (owner, setting, value)."""

    kind: str
    text: str
    names: list[tuple[str, str, str]]


def table(path):
    """The rows of a table, in order."""
    rows, section, owner = [], "", ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            section = line.strip("[]")
        elif line.startswith(" "):
            for token in filter(None, map(str.strip, line.split(","))):
                kind, colon, rest = token.rpartition(":")
                owner = kind if colon else owner
                name, _, value = rest.strip().partition("=")
                rows[-1].names.append((owner, name, value))
        elif line and not line.startswith("#"):
            kind, _, text = line.partition(" ")
            assert kind in KINDS, line
            rows.append(Row(kind, text, []))
            owner = section
    return rows


SETTINGS, NODES = table(HERE / "settings.txt"), table(HERE / "node_settings.txt")


def properties(owner, base):
    """The properties of an RNA owner, without those of its base and of this add-on."""
    known = {"rna_type", *(each.identifier for each in (base.bl_rna.properties if base else ()))}
    return [
        each
        for each in owner.bl_rna.properties
        if each.identifier not in known and not each.identifier.startswith("scfpf")
    ]


def owners():
    """By name in settings.txt: the owners of settings, and the bases whose properties are not theirs."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    obj, world = bpy.data.objects["Ball"], bpy.data.worlds["World"]
    material, identity = obj.active_material, bpy.types.ID
    found = {
        "Light": ([each.data for each in bpy.data.objects if each.type == "LIGHT"], identity),
        "World": ([world], identity),
        "World.cycles_visibility": ([world.cycles_visibility], bpy.types.PropertyGroup),
        "Material": ([material], identity),
        "Object": ([obj], identity),
        "ViewLayer": ([layer], None),
        "RenderSettings": ([scene.render], None),
        "Scene.cycles_curves": ([scene.cycles_curves], bpy.types.PropertyGroup),
    }
    for name, data in (
        ("Light", bpy.data.lights["POINT"]),
        ("World", world),
        ("Material", material),
        ("Object", obj),
        ("ViewLayer", layer),
        ("Scene", scene),
    ):
        found[f"{name}.cycles"] = [data.cycles], bpy.types.PropertyGroup
    return found


@pytest.fixture
def stage():
    """A scene in which each setting has the others that it needs: lamps, a world of nodes, blur, Simplify."""
    scene = scene_with_camera(12)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=6, radius=0.5)
    ball = bpy.context.object
    ball.name = "Ball"
    material = new_material("Paint")
    ball.data.materials.append(material)
    show(
        material.node_tree, add(material.node_tree, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.7, 0.6)).outputs[0]
    )
    ball.modifiers.new("Smooth", "SUBSURF").render_levels = 1
    for kind in ("POINT", "SUN", "SPOT", "AREA"):
        lamp = bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind))
        lamp.location, lamp.data.energy = (0.2, -0.3, 2.0), 3.0
        scene.collection.objects.link(lamp)
    tree = scene.world.node_tree
    sky = add(tree, "ShaderNodeTexGradient", Vector=add(tree, "ShaderNodeTexCoord").outputs["Generated"])
    background = next(each for each in tree.nodes if each.type == "BACKGROUND")
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    ball.cycles.use_camera_cull = ball.cycles.use_distance_cull = True
    render, cycles = scene.render, scene.cycles
    render.film_transparent = render.use_motion_blur = render.use_simplify = True
    cycles.fast_gi_method = "ADD"
    if hasattr(cycles, "feature_set"):
        cycles.feature_set = "EXPERIMENTAL"
    return scene


def decided(rows):
    """Each (owner, setting) with the number of its rows."""
    return Counter((owner, name) for row in rows for owner, name, _ in row.names)


def test_every_setting_is_in_exactly_one_row(stage):
    rows = decided(SETTINGS)
    assert [key for key, count in rows.items() if count > 1] == []
    undecided = {
        f"{name}: {each.identifier}"
        for name, (data, base) in owners().items()
        for one in data
        for each in properties(one, base)
        if (name, each.identifier) not in rows
    }
    assert not undecided


def node_types():
    """The types of nodes that a material's tree takes."""
    tree = new_material("Trial").node_tree
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        if name.startswith(NODE_PREFIXES) and isinstance(kind, type) and issubclass(kind, bpy.types.Node):
            with contextlib.suppress(RuntimeError):
                yield tree.nodes.new(name)


def test_every_setting_of_a_node_is_in_exactly_one_row():
    rows = decided(NODES)
    whole = {owner for row in NODES if row.kind != "shown" for owner, name, _ in row.names if not name}
    known = {owner for owner, _ in rows}
    undecided, twice = set(), [key for key, count in rows.items() if count > 1]
    for node in node_types():
        kind = node.bl_idname
        if kind in whole:
            twice += [(owner, name) for owner, name in rows if owner == kind and name]
            continue
        names = [each.identifier for each in properties(node, bpy.types.Node)]
        names += [each.identifier for each in node.inputs if each.identifier != "__extend__"]
        undecided |= {f"{kind}: {name}" for name in names if not rows[kind, name] + rows[ANY, name]}
        undecided |= {kind} - known
    assert not undecided and not twice


def test_tests_that_the_tables_name_exist():
    for row in (*SETTINGS, *NODES):
        if row.kind in {"shown", "named"}:
            file, _, function = row.text.partition("::")
            assert re.search(rf"^def {function}\(", (TESTS / file).read_text(encoding="utf-8"), re.M), (
                row.text
            )


def altered(prop, value, given):
    """Another value of a property: the ``given`` one, or any; None if there is none."""
    if prop.is_readonly or getattr(prop, "is_array", False) or prop.type not in FLIPPABLE:
        return None
    if prop.type == "BOOLEAN":
        return not value
    if prop.type == "ENUM":
        others = [each.identifier for each in prop.enum_items if each.identifier != value]
        return given or (others[-1] if others and not prop.is_enum_flag else None)
    if not given:
        given = value + 1 if value + 1 <= prop.hard_max else prop.hard_min
    return int(given) if prop.type == "INT" else float(given)


@pytest.fixture
def warnings(addon):
    """Return the warnings of F12."""
    prepare, passes = addon("bridge.render.render_inputs").prepare, addon("bridge.render.render_passes")

    def of_f12():
        scene, layer = bpy.context.scene, bpy.context.view_layer
        read = prepare(scene, layer, scene.camera).scene.warnings
        return [*read, *passes.layer_warnings(scene.render, layer, is_ordinary=False)]

    return of_f12


def test_warned_settings_are_named(stage, warnings):
    """Each is changed alone, where all that it needs is on."""
    known, tried = warnings(), 0
    for row in SETTINGS:
        for name, setting, given in row.names if row.kind == "warned" else ():
            assert not any(line.startswith(row.text) for line in known), row.text
            for one in owners()[name][0]:
                prop = one.bl_rna.properties.get(setting)
                if prop is None:
                    continue
                before = getattr(one, setting)
                setattr(one, setting, altered(prop, before, given))
                assert any(line.startswith(row.text) for line in warnings()), (name, setting)
                setattr(one, setting, before)
                tried += 1
    assert tried > 40 and warnings() == known


def warned_of(read, tree, node):
    """By output of a node that a surface can take, the warnings about a material that shows it."""
    for output in node.outputs:
        for each in list(tree.nodes):
            if each != node:
                tree.nodes.remove(each)
        (show if output.type == "SHADER" else emit)(tree, output)
        if output.enabled and all(link.is_valid for link in tree.links):
            yield read().warnings


def change(node, name, given):
    """Change a setting of a node."""
    prop = node.bl_rna.properties.get(name)
    if name == "texture_mapping":
        node.texture_mapping.scale[0] = 2.0
    elif prop:
        setattr(node, name, altered(prop, getattr(node, name), given))
    else:
        socket = next(each for each in node.inputs if each.identifier == name)
        color, number = (1.0, 0.5, 0.5, 1.0), True if socket.type == "BOOLEAN" else 0.5
        socket.default_value = color if socket.type == "RGBA" else number


def test_warned_settings_of_nodes_are_named(read):
    wavy_sheet().data.materials.append(new_material("Paint"))
    tree = bpy.data.materials["Paint"].node_tree
    here = {node.bl_idname: [each.identifier for each in node.inputs] for node in node_types()}
    whole = {owner for row in NODES for owner, name, _ in row.names if not name and row.kind == "warned"}
    tried = 0
    for row in NODES:
        for owner, name, given in row.names if row.kind == "warned" else ():
            for kind in set(here) - whole if owner == ANY else {owner} & set(here):
                settings = getattr(bpy.types, kind).bl_rna.properties
                if name and name not in (*here[kind], *settings.keys()):
                    continue
                tree.nodes.clear()
                node = tree.nodes.new(kind)
                text = row.text.replace("NODE", node.bl_label).replace("NAME", name)
                if name:
                    assert not any(text in lines for lines in warned_of(read, tree, node))
                    change(node, name, given)
                found = list(warned_of(read, tree, node))
                named = [any(line.startswith(text) for line in lines) for lines in found]
                assert any(named) if name else all(named), (kind, name)
                tried += bool(found)
    assert tried > 60


def test_inert_settings_change_neither_image(stage, tmp_path):
    """All of them at once."""
    stage.render.use_motion_blur = False
    before = both(stage, tmp_path)
    changed = 0
    for row in SETTINGS:
        for name, setting, _ in row.names if row.kind == "none" and row.text in INERT else ():
            for one in owners()[name][0] if setting not in EDITING else ():
                prop = one.bl_rna.properties.get(setting)
                value = altered(prop, getattr(one, setting), "") if prop else None
                if value is not None:
                    setattr(one, setting, value)
                    changed += 1
    assert changed > 100
    for image, same in zip(before, both(stage, tmp_path), strict=True):
        assert np.array_equal(image, same) and image[..., :3].any()


def test_f12_reports_its_warnings(engine_scene, capfd):
    engine_scene.cycles.sample_clamp_direct = 1.0
    bpy.context.view_layer.use_pass_mist = True
    f12(engine_scene)
    told = capfd.readouterr()
    for text in ("Clamping of Direct Light", "rig of the Cycles panel): Mist"):
        assert (told.out + told.err).count(text) == 1


def test_passes_of_a_layers_own_are_named(stage, warnings):
    layer = bpy.context.view_layer
    layer.aovs.add().name = "Wetness"
    layer.lightgroups.add(name="Windows")
    (line,) = (each for each in warnings() if each.startswith("Passes"))
    assert line.endswith(": Wetness, Windows")


def test_hair_of_particles_is_named(stage, warnings):
    ball = bpy.data.objects["Ball"]
    modifier = ball.modifiers.new("Fur", "PARTICLE_SYSTEM")
    assert not any("hair" in line for line in warnings()), "particles"
    ball.particle_systems[0].settings.type = "HAIR"
    assert any(line.startswith("Not shown") and "hair" in line and "Ball" in line for line in warnings())
    bpy.context.view_layer.use_strand = False
    assert not any("hair" in line for line in warnings())
    bpy.context.view_layer.use_strand, modifier.show_render = True, False
    assert not any("hair" in line for line in warnings())


def test_adaptive_subdivision_is_named(stage, warnings):
    """From Blender 5.0 the modifier has the switch, before that the object."""
    ball = bpy.data.objects["Ball"]
    owner = ball.cycles if hasattr(ball.cycles, "use_adaptive_subdivision") else ball.modifiers["Smooth"]
    assert not any("Subdivision" in line for line in warnings())
    owner.use_adaptive_subdivision = True
    assert any(line.startswith("Not shown as it is: Adaptive Subdivision") for line in warnings())


def test_images_that_move_or_have_tiles_are_named(read, addon, tmp_path):
    sheet = wavy_sheet()
    for source in ("TILED", "SEQUENCE"):
        image = bpy.data.images.new(source, 4, 4, tiled=source == "TILED")
        if source == "SEQUENCE":
            image.filepath_raw, image.file_format = str(tmp_path / "image1.png"), "PNG"
            image.save()
            image.source = source
        material = new_material(source)
        emit(material.node_tree, add(material.node_tree, "ShaderNodeTexImage", {"image": image}).outputs[0])
        sheet.data.materials.append(material)
    _, lines = addon("bridge.scene.read_images").read_images(["TILED", "SEQUENCE"])
    assert any("first tile" in line and "TILED" in line for line in lines)
    assert "SEQUENCE" in "".join(lines)


def test_materials_without_nodes_are_as_in_cycles(tmp_path):
    """Blender 5 has none: it shows the nodes of such a material, which here make the same."""
    scene = scene_with_camera()
    scene.cycles.samples = 16
    material = bpy.data.materials.new("Plain")
    material.diffuse_color, material.metallic, material.roughness = (0.8, 0.3, 0.1, 1.0), 0.7, 0.3
    if bpy.app.version >= (5, 0, 0):
        material = new_material("Plain")
        shader = add(material.node_tree, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.1))
        show(material.node_tree, shader.outputs[0])
    wavy_sheet().data.materials.append(material)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler, sun.data.energy = (0.5, 0.3, 0.0), 3.0
    scene.collection.objects.link(sun)
    scene.world.node_tree.nodes.clear()
    ours, cycles = both(scene, tmp_path)
    assert ours.mean(axis=(0, 1)) == pytest.approx(cycles.mean(axis=(0, 1)), rel=0.01)


def test_lamps_behind_glass_are_named(stage, warnings):
    def named():
        return [line for line in warnings() if line.startswith("Lamps are seen in mirrors")]

    assert not named()
    glass = new_material("Glass")
    show(glass.node_tree, add(glass.node_tree, "ShaderNodeBsdfGlass", Roughness=0.0).outputs[0])
    bpy.data.objects["Ball"].data.materials[0] = glass
    (line,) = named()
    assert line.endswith(": SUN, AREA")
    for name in ("AREA", "SUN"):
        bpy.data.objects[name].visible_transmission = False
    assert not named()


@pytest.mark.parametrize("wanted", [True, False])
def test_worlds_of_one_color_cast_shadows_or_are_named(stage, addon, wanted):
    """A faint one beside lamps does neither: Cycles' image differs by hundredths."""
    prepare = addon("bridge.render.render_inputs").prepare
    stage.scfpf_sampling.world_shadows = wanted

    def shadowed():
        scene = prepare(stage, bpy.context.view_layer, stage.camera).scene
        named = any(line.startswith("The world is one color") for line in scene.warnings)
        assert not (named and (wanted or scene.world is not None))
        return named or scene.world is not None

    tree = stage.world.node_tree
    background = next(each for each in tree.nodes if each.type == "BACKGROUND")
    tree.links.remove(background.inputs["Color"].links[0])
    background.inputs["Color"].default_value = (0.2, 0.2, 0.2, 1.0)
    assert shadowed()
    background.inputs["Color"].default_value = (0.05, 0.05, 0.05, 1.0)
    assert not shadowed()
    for each in bpy.data.objects:
        each.hide_render = each.type == "LIGHT"
    assert shadowed()
