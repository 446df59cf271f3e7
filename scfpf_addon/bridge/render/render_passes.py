# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a view layer: one list for Blender, the compositor, the files and the renderer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy
from bpy.props import BoolProperty, PointerProperty

from ...projection.user_error import Message
from ...shading.passes.cryptomatte import CRYPTO_PASS, MOST_LAYERS, manifest, name_hash
from ...shading.passes.light_passes import LIGHT_PASSES
from ..blender import versions
from ..scene.read_materials import listing
from ..settings.property_options import OVERRIDABLE

# Names of the passes, as in Cycles.
CRYPTO_NAMES = {"OBJECT": "CryptoObject", "MATERIAL": "CryptoMaterial"}


class RenderPass(NamedTuple):
    """A pass that Blender, the compositor and files take.

    name: in Blender. channels: a letter each. type: VALUE, VECTOR or COLOR. source: of
    ``shading.passes.PASSES``, empty for the image itself.
    """

    name: str
    channels: str
    type: str
    source: str


class PassSwitch(NamedTuple):
    """A switch of a view layer, and the pass that it adds.

    property: of the view layer, or of the ``SCFPF_ViewLayer`` in it. heading: of its group in the panel.
    label: in the panel, if not the property's name.
    """

    property: str
    heading: str
    render_pass: RenderPass
    label: str = ""

    def owner(self, view_layer):
        """The data of a view layer that has the property."""
        return view_layer.scfpf if self.property in SCFPF_ViewLayer.__annotations__ else view_layer


def _switches() -> tuple[PassSwitch, ...]:
    """The switches in the order in which passes are delivered."""
    object_index, material_index = versions.index_pass_names()
    emission, environment = versions.light_pass_names()
    rows = (
        ("use_pass_diffuse", "Light", "Diffuse", "RGB", "COLOR", "DIFFUSE"),
        ("use_pass_specular", "Light", "Specular", "RGB", "COLOR", "SPECULAR"),
        ("use_pass_emit", "Light", emission, "RGB", "COLOR", "EMISSION"),
        ("use_pass_environment", "Light", environment, "RGB", "COLOR", "ENVIRONMENT"),
        ("use_pass_shadow", "Light", "Shadow", "RGB", "COLOR", "SHADOW"),
        ("use_pass_shadow_catcher", "Light", "Shadow Catcher", "RGB", "COLOR", "SHADOW_CATCHER"),
        ("use_pass_z", "Data", "Depth", "Z", "VALUE", "DEPTH"),
        ("use_pass_position", "Data", "Position", "XYZ", "VECTOR", "POSITION"),
        ("use_pass_normal", "Data", "Normal", "XYZ", "VECTOR", "NORMAL"),
        ("use_pass_vector", "Data", "Vector", "XYZW", "VECTOR", "VECTOR"),
        ("use_pass_uv", "Data", "UV", "UVA", "VECTOR", "UV"),
        ("use_pass_object_index", "Indices", object_index, "X", "VALUE", "OBJECT_INDEX"),
        ("use_pass_material_index", "Indices", material_index, "X", "VALUE", "MATERIAL_INDEX"),
        ("use_pass_parameters", "Projectors", "ProjectorParameters", "UVT", "VECTOR", "PARAMETERS"),
        ("use_pass_perspective_depth", "Projectors", "PerspectiveDepth", "Z", "VALUE", "PERSPECTIVE_DEPTH"),
        ("use_pass_tangent", "Projectors", "ProjectorTangent", "XYZ", "VECTOR", "TANGENT"),
        ("use_pass_chord_count", "Projectors", "ChordCount", "X", "VALUE", "CHORD_COUNT"),
        ("use_pass_chord_error", "Projectors", "ChordError", "X", "VALUE", "CHORD_ERROR"),
    )
    labels = {"use_pass_emit": "Emission"}
    return tuple(
        PassSwitch(switch, heading, RenderPass(*render_pass), labels.get(switch, ""))
        for switch, heading, *render_pass in rows
    )


# The one list of passes with a switch of their own, for Blender, files and the panel.
PASS_SWITCHES = _switches()


# The properties of a view layer, and of Cycles' settings of it, that switch passes.
SWITCH_PREFIXES = "use_pass_", "pass_debug_", "pass_render_", "denoising_store_"
MADE_SWITCHES = {each.property for each in PASS_SWITCHES} | {
    "use_pass_combined",
    *(f"use_pass_cryptomatte_{kind}" for kind in ("object", "material", "accurate")),
}
ABSENT = Message(
    "Passes that Flexible Projection does not make (use Cycles through the rig of the Cycles panel): "
)
# What Depth measures, in files.
ALONG_AXIS = "Distance from the camera along its axis"
ALONG_PROJECTORS = "Length of the projector from the near surface"
FREESTYLE = Message(
    "Freestyle's lines are left out, as it only draws what an ordinary camera sees: use Drawn Style "
    "instead of it"
)


def list_render_passes(view_layer) -> Iterator[RenderPass]:
    """The passes that are switched on for a view layer, the image first."""
    yield RenderPass("Combined", "RGBA", "COLOR", "")
    for each in PASS_SWITCHES:
        if getattr(each.owner(view_layer), each.property):
            yield each.render_pass
    # Each layer has two names, the last one perhaps one.
    layers = min((view_layer.pass_cryptomatte_depth + 1) // 2, MOST_LAYERS)
    for kind in _crypto_kinds(view_layer):
        for layer in range(layers):
            name = f"{CRYPTO_NAMES[kind]}{layer:02d}"
            yield RenderPass(name, "rgba", "COLOR", CRYPTO_PASS.format(kind, layer))


def _crypto_kinds(view_layer) -> Iterator[str]:
    """The kinds of cryptomattes that are switched on."""
    for kind in CRYPTO_NAMES:
        if getattr(view_layer, f"use_pass_cryptomatte_{kind.lower()}"):
            yield kind


def layer_warnings(render, view_layer, is_ordinary: bool) -> Iterator[str]:
    """Warnings about passes that this engine does not make, and about lines that F12's image lacks.

    render, view_layer: evaluated. is_ordinary: see ``RenderInputs``.
    """
    names = [each.name for each in (*view_layer.aovs, *view_layer.lightgroups)]
    for owner in (view_layer, getattr(view_layer, "cycles", None)):
        for each in owner.bl_rna.properties if owner else ():
            is_switch = each.type == "BOOLEAN" and each.identifier.startswith(SWITCH_PREFIXES)
            is_made = owner == view_layer and each.identifier in MADE_SWITCHES
            if is_switch and not is_made and getattr(owner, each.identifier):
                names.append(each.name)
    if names:
        yield Message("{0}{1}", ABSENT, listing(names, most=8))
    if not is_ordinary and render.use_freestyle and view_layer.use_freestyle:
        yield FREESTYLE


def crypto_names(scene) -> dict[str, list[str]]:
    """The names of objects and materials in the cryptomattes of a ``Scene``, by number."""
    # Cryptomattes have names without libraries.
    plain = {obj.name_full: obj.name for obj in bpy.data.objects}
    return {
        "OBJECT": [plain.get(name, name) for name in scene.geometry.object_names],
        "MATERIAL": list(scene.material_names),
    }


def transparency_warning(scene, passes: tuple[str, ...]) -> str:
    """The warning about data passes of a ``Scene`` with transparent materials, "" without such passes.

    passes: names of ``shading.passes.PASSES``.
    """
    clear = [number for number, graph in scene.materials.graphs.items() if graph.lets_through]
    if not clear or all(name in LIGHT_PASSES for name in passes):
        return ""
    names = listing([scene.material_names[number] for number in clear])
    return Message("Data passes treat transparent objects as opaque: {0}", names)


def stamp_manifests(result, view_layer, names: dict[str, list[str]]) -> None:
    """Write the names in a view layer's cryptomattes into a bpy.types.RenderResult, and so into files."""
    for kind in _crypto_kinds(view_layer):
        name = f"{view_layer.name}.{CRYPTO_NAMES[kind]}"
        for field, value in (
            ("name", name),
            ("hash", "MurmurHash3_32"),
            ("conversion", "uint32_to_float32"),
            ("manifest", manifest(names[kind])),
        ):
            result.stamp_data_add_field(f"cryptomatte/{name_hash(name):08x}"[:19] + f"/{field}", value)


def stamp_depths(result, view_layer, inputs) -> None:
    """Write into a bpy.types.RenderResult, and so into files, what the pass Depth measures.

    inputs: ``RenderInputs``. Each layer of the image has a field of its own.
    """
    if view_layer.use_pass_z:
        wanted, names = inputs.settings.passes, inputs.image_layers.names
        planes = wanted.depth_plane, *wanted.layer_planes
        for name, plane in zip(("", *names), planes, strict=True):
            field = f"{view_layer.name}.Depth" + (f" of {name}" if name else "")
            result.stamp_data_add_field(field, ALONG_PROJECTORS if plane is None else ALONG_AXIS)


def _update_passes(self, _context):
    """Update the compositor: Blender does so for its own switches only."""
    for view_layer in self.id_data.view_layers:
        view_layer.update_render_passes()


def _switch(name, description):
    """The switch of a pass, off."""
    return BoolProperty(
        name=name,
        description=description,
        default=False,
        update=_update_passes,
        override=OVERRIDABLE,
    )


class SCFPF_ViewLayer(bpy.types.PropertyGroup):
    """Passes of a view layer that only the engine Flexible Projection has."""

    use_pass_diffuse: _switch(
        "Diffuse",
        "Light scattered by surfaces, with their color: from lights and the world; with Specular, "
        "Emission and Environment it adds up to the picture",
    )
    use_pass_specular: _switch(
        "Specular",
        "Highlights of lights, and all that is seen in mirrors and through glass",
    )
    use_pass_shadow_catcher: _switch(
        "Shadow Catcher",
        "Light that shadows leave on shadow catchers, white elsewhere: multiply footage by it and put the "
        "picture, which then has no shadows on catchers, over that",
    )
    use_pass_parameters: _switch(
        "Projector Parameters",
        "Position of each pixel's hit in the viewing volume: u, v and t, 0 where nothing is hit",
    )
    use_pass_perspective_depth: _switch(
        "Perspective Depth",
        "Depth from 0 at the near to 1 at the far surface, in the steps of linear perspective: finer than "
        "t near the camera, and equal to it where projectors are parallel",
    )
    use_pass_tangent: _switch(
        "Projector Tangent",
        "Direction of each pixel's projector at its hit, in world space, away from the viewer",
    )
    use_pass_chord_count: _switch(
        "Chord Count",
        "Number of straight chords of each pixel's projector up to its hit: more take longer",
    )
    use_pass_chord_error: _switch(
        "Chord Error",
        "Distance in pixels between chord and curve at each pixel's hit: silhouettes are displaced "
        "by less. 0 for straight projectors",
    )


def register():
    bpy.utils.register_class(SCFPF_ViewLayer)
    bpy.types.ViewLayer.scfpf = PointerProperty(type=SCFPF_ViewLayer)


def unregister():
    del bpy.types.ViewLayer.scfpf
    bpy.utils.unregister_class(SCFPF_ViewLayer)
