# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between Blender versions, which no other module knows.

A node modifier's inputs are ID properties of the modifier up to Blender 5.1 and
RNA properties under ``modifier.properties.inputs`` from 5.2.
"""

from __future__ import annotations

import warnings

import bpy

RNA_INPUTS_SINCE = (5, 2, 0)
# The identifier of EEVEE as a render engine.
EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
# Formats of files whose colours are multiplied by alpha.
PREMULTIPLIED_FORMATS = {"OPEN_EXR", "OPEN_EXR_MULTILAYER"}


def modifier_input_property(modifier, identifier: str) -> tuple[object, str]:
    """The (owner, property) of a node modifier's input.

    ``layout.prop``, ``keyframe_insert`` and ``driver_add`` take this pair.
    identifier: the interface socket's, such as "Socket_2".
    """
    if bpy.app.version >= RNA_INPUTS_SINCE:
        return getattr(modifier.properties.inputs, identifier), "value"
    return modifier, f'["{identifier}"]'


def modifier_input(modifier, identifier: str):
    """The value of a node modifier's input. On an evaluated object: animated and driven."""
    if bpy.app.version >= RNA_INPUTS_SINCE:
        return getattr(modifier.properties.inputs, identifier).value
    return modifier[identifier]


def set_modifier_input(modifier, identifier: str, value) -> None:
    """Set a node modifier's input. Call ``id_data.update_tag()`` after the last one."""
    if bpy.app.version >= RNA_INPUTS_SINCE:
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value


def uses_nodes(owner) -> bool:
    """Return whether a material, world or lamp uses its nodes; in newer versions it does if it has a tree."""
    with warnings.catch_warnings():
        # From 5.0 (lamps: 5.2) the switch is always on, and deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        return owner.node_tree is not None and owner.use_nodes


def image_format_properties() -> tuple[str, ...]:
    """The properties of ImageFormatSettings that determine a format, in the order of setting them."""
    names = ("file_format", "color_mode", "color_depth")
    # From 5.0 the media type restricts the formats.
    return ("media_type", *names) if bpy.app.version >= (5, 0, 0) else names


def index_pass_names() -> tuple[str, str]:
    """The names of the passes of object and material indices in Blender's own engines."""
    since_5 = bpy.app.version >= (5, 0, 0)
    return ("Object Index", "Material Index") if since_5 else ("IndexOB", "IndexMA")


def light_pass_names() -> tuple[str, str]:
    """The names of the passes of emission and of the world in Blender's own engines."""
    return ("Emission", "Environment") if bpy.app.version >= (5, 0, 0) else ("Emit", "Env")


def set_node_menu(node, socket: str, setting: str, value: str) -> None:
    """Choose from a menu of a node: a setting of the node up to 4.5, a socket with titles from 5.0.

    value: the setting's identifier; the socket's item is found by it.
    """
    if hasattr(node, setting):
        setattr(node, setting, value)
    else:
        node.inputs[socket].default_value = value.replace("_", " ").title()


def settle_view_layers() -> None:
    """Update all view layers after a handler, or what it calls, has removed objects or scenes.

    Blender evaluates again after a handler, or begins a render. It crashes if view layers lag behind their
    objects: from 5.0 if a driver reads another scene, and in renders without compositor and sequencer.
    Reading the active object updates them.
    """
    for scene in bpy.data.scenes:
        for layer in scene.view_layers:
            _ = layer.objects.active


def lit_behind_transparent(limit: int) -> int:
    """The most transparent surfaces in front of a hit that Cycles still lights, by its limit of bounces."""
    return max(limit, 1) - 1 if bpy.app.version >= (5, 0, 0) else limit


def multiplies_by_alpha(image, is_file: bool) -> bool:
    """Return whether Cycles multiplies the colours of an image by its alpha.

    is_file: Cycles reads the image's file. Found by comparing images: from 5.2 the alpha mode decides, before
    that the file format.
    """
    if bpy.app.version >= (5, 2, 0):
        return image.alpha_mode == "STRAIGHT"
    return image.file_format not in PREMULTIPLIED_FORMATS if is_file else not image.is_float


def is_subdivided_adaptively(modifier, obj, scene) -> bool:
    """Return whether Cycles dices an object by a modifier: a setting of the object up to 4.5."""
    if hasattr(modifier, "use_adaptive_subdivision"):
        return modifier.use_adaptive_subdivision
    cycles, of_object = getattr(scene, "cycles", None), getattr(obj, "cycles", None)
    experimental = cycles is not None and getattr(cycles, "feature_set", "") == "EXPERIMENTAL"
    return experimental and getattr(of_object, "use_adaptive_subdivision", False)


def has_portal_depth() -> bool:
    """Return whether the Light Path node has the number of portals that a ray has passed: from 5.0."""
    return bpy.app.version >= (5, 0, 0)


def present_compositor_tree(scene):
    """The node tree of a scene's compositor, or None if it is not used."""
    if bpy.app.version >= (5, 0, 0):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def switch_writing_on(scene) -> None:
    """Let renders write the scene's output, which from Blender 5 on a file may leave to the compositor."""
    if hasattr(scene.render, "save_output"):
        scene.render.save_output = True


def strips(editor):
    """The strips of a sequence editor."""
    return editor.strips if hasattr(editor, "strips") else editor.sequences


def compositor_tree(scene, mark: str):
    """The node tree of a scene's compositor, or a new one that outputs the image unchanged.

    mark: custom property of a new tree.
    """
    tree = present_compositor_tree(scene)
    if tree is not None:
        return tree
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = True
        scene.node_tree[mark] = True
        if len(scene.node_tree.nodes) == 0:
            _output_image(scene, scene.node_tree, "CompositorNodeComposite")
        return scene.node_tree
    tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    tree[mark] = True
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    _output_image(scene, tree, "NodeGroupOutput")
    return tree


def _output_image(scene, tree, output: str) -> None:
    source, end = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new(output)
    source.scene = scene
    end.location.x = 300.0
    tree.links.new(source.outputs["Image"], end.inputs[0])


def drop_compositor_tree(scene, mark: str) -> None:
    """Remove a tree that ``compositor_tree`` has made, unless nodes were added to it."""
    tree = present_compositor_tree(scene)
    if tree is None or mark not in tree or len(tree.nodes) > 2:
        return
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = False
        tree.nodes.clear()
        del tree[mark]
    else:
        bpy.data.node_groups.remove(tree)
