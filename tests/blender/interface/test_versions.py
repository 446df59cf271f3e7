# SPDX-License-Identifier: GPL-3.0-or-later
"""Node-modifier inputs through one interface on every Blender version; properties as declared."""

import bpy
import pytest

SOCKETS = {
    "Float": ("NodeSocketFloat", 0.5, 2.25),
    "Int": ("NodeSocketInt", 3, 7),
    "Object": ("NodeSocketObject", None, "Target"),
}


@pytest.fixture
def versions(addon):
    return addon("bridge.blender.versions")


@pytest.fixture
def modifier():
    """A node modifier with one input of each type, whose group has the identifiers by name."""
    group = bpy.data.node_groups.new("Group", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for name, (socket_type, default, _) in SOCKETS.items():
        socket = group.interface.new_socket(name, in_out="INPUT", socket_type=socket_type)
        if default is not None:
            socket.default_value = default
    owner = bpy.data.objects.new("Owner", bpy.data.meshes.new("Owner"))
    bpy.context.scene.collection.objects.link(owner)
    made = owner.modifiers.new("Nodes", "NODES")
    made.node_group = group
    return made


def identifier(modifier, name):
    return modifier.node_group.interface.items_tree[name].identifier


@pytest.mark.parametrize("name", SOCKETS)
def test_an_input_reads_back(versions, modifier, name):
    _, default, value = SOCKETS[name]
    if name == "Object":
        value = bpy.data.objects.new(value, None)
    assert versions.modifier_input(modifier, identifier(modifier, name)) == default
    versions.set_modifier_input(modifier, identifier(modifier, name), value)
    assert versions.modifier_input(modifier, identifier(modifier, name)) == value


def test_an_input_is_keyed_and_driven_through_its_property(versions, modifier):
    owner, path = versions.modifier_input_property(modifier, identifier(modifier, "Float"))
    for frame, value in ((1, 1.0), (11, 3.0)):
        versions.set_modifier_input(modifier, identifier(modifier, "Float"), value)
        assert owner.keyframe_insert(path, frame=frame)
    owner, path = versions.modifier_input_property(modifier, identifier(modifier, "Int"))
    owner.driver_add(path).driver.expression = "frame * 2"
    for frame, value in ((1, 1.0), (6, 2.0), (11, 3.0)):
        bpy.context.scene.frame_set(frame)
        now = modifier.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get()).modifiers[0]
        assert versions.modifier_input(now, identifier(modifier, "Float")) == pytest.approx(value)
        assert versions.modifier_input(now, identifier(modifier, "Int")) == 2 * frame


def test_every_property_has_a_tooltip_and_can_be_overridden(addon):
    modules = (addon(f"bridge.settings.{name}_properties") for name in ("camera", "aim"))
    for cls in (cls for module in modules for cls in module.CLASSES):
        for name in (name for base in cls.__mro__ for name in vars(base).get("__annotations__", ())):
            # By its place: Blender's own property of a group is also called "name".
            (*_, rna) = (found for found in cls.bl_rna.properties if found.identifier == name)
            assert rna.name and rna.description and rna.is_overridable, name


def test_an_edit_from_python_reaches_the_depsgraph():
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for name, value in (
        ("pixel_error", 0.5),
        ("u_range", (0.25, 0.5)),
        ("basis", "POLYLINE"),
        ("samples", 9),
    ):
        depsgraph.update()
        setattr(camera.scfpf, name, value)
        depsgraph.update()
        read = getattr(camera.evaluated_get(depsgraph).scfpf, name)
        assert (tuple(read) if name == "u_range" else read) == value


def test_limits_hold():
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    settings = camera.scfpf
    settings.pixel_error, settings.samples, settings.u_range = -1.0, 0, (-1.0, 2.0)
    assert settings.pixel_error == 0.0 and settings.samples == 1
    assert tuple(settings.u_range) == (0.0, 1.0)
    assert (settings.basis, settings.reparameterisation, tuple(settings.v_range)) == (
        "BEZIER",
        "RECTANGLE",
        (0, 1),
    )


@pytest.mark.parametrize(
    ("kind", "socket", "setting", "value"),
    [
        ("GeometryNodeRemoveAttribute", "Pattern Mode", "pattern_mode", "WILDCARD"),
        ("GeometryNodeTriangulate", "Quad Method", "quad_method", "FIXED"),
    ],
)
def test_a_menu_of_a_node_is_chosen_by_its_identifier(addon, kind, socket, setting, value):
    node = bpy.data.node_groups.new("Group", "GeometryNodeTree").nodes.new(kind)
    addon("bridge.blender.versions").set_node_menu(node, socket, setting, value)
    chosen = getattr(node, setting) if hasattr(node, setting) else node.inputs[socket].default_value
    assert chosen in {value, value.title()}
