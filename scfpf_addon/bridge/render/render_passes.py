# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a view layer: one list for Blender, the compositor, the files and the renderer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy
from bpy.props import BoolProperty, PointerProperty

from ...shading.passes.cryptomatte import MOST_LAYERS, manifest, name_hash
from ...shading.passes.data_passes import CRYPTO_PASS
from ...shading.passes.light_passes import LIGHT_PASSES
from ..blender import versions
from ..scene.read_materials import listing

# As Cycles calls them.
CRYPTO_NAMES = {"OBJECT": "CryptoObject", "MATERIAL": "CryptoMaterial"}


class RenderPass(NamedTuple):
    """name: in Blender. channels: a letter each. type: how Blender takes it. source: of
    ``shading.passes.PASSES``, empty for the picture itself.
    """

    name: str
    channels: str
    type: str
    source: str


def list_render_passes(view_layer) -> Iterator[RenderPass]:
    """The passes that are switched on for a view layer, the picture first."""
    yield RenderPass("Combined", "RGBA", "COLOR", "")
    own = view_layer.scfpf
    object_index, material_index = versions.index_pass_names()
    emission, environment = versions.light_pass_names()
    for switch, each in (
        (own.use_pass_diffuse, RenderPass("Diffuse", "RGB", "COLOR", "DIFFUSE")),
        (own.use_pass_specular, RenderPass("Specular", "RGB", "COLOR", "SPECULAR")),
        (view_layer.use_pass_emit, RenderPass(emission, "RGB", "COLOR", "EMISSION")),
        (view_layer.use_pass_environment, RenderPass(environment, "RGB", "COLOR", "ENVIRONMENT")),
        (view_layer.use_pass_shadow, RenderPass("Shadow", "RGB", "COLOR", "SHADOW")),
        (own.use_pass_shadow_catcher, RenderPass("Shadow Catcher", "RGB", "COLOR", "SHADOW_CATCHER")),
        (view_layer.use_pass_z, RenderPass("Depth", "Z", "VALUE", "DEPTH")),
        (view_layer.use_pass_position, RenderPass("Position", "XYZ", "VECTOR", "POSITION")),
        (view_layer.use_pass_normal, RenderPass("Normal", "XYZ", "VECTOR", "NORMAL")),
        (view_layer.use_pass_vector, RenderPass("Vector", "XYZW", "VECTOR", "VECTOR")),
        (view_layer.use_pass_uv, RenderPass("UV", "UVA", "VECTOR", "UV")),
        (view_layer.use_pass_object_index, RenderPass(object_index, "X", "VALUE", "OBJECT_INDEX")),
        (view_layer.use_pass_material_index, RenderPass(material_index, "X", "VALUE", "MATERIAL_INDEX")),
        (own.use_pass_parameters, RenderPass("ProjectorParameters", "UVT", "VECTOR", "PARAMETERS")),
        (
            own.use_pass_perspective_depth,
            RenderPass("PerspectiveDepth", "Z", "VALUE", "PERSPECTIVE_DEPTH"),
        ),
        (own.use_pass_tangent, RenderPass("ProjectorTangent", "XYZ", "VECTOR", "TANGENT")),
        (own.use_pass_chord_count, RenderPass("ChordCount", "X", "VALUE", "CHORD_COUNT")),
        (own.use_pass_chord_error, RenderPass("ChordError", "X", "VALUE", "CHORD_ERROR")),
    ):
        if switch:
            yield each
    # An odd number of names still takes a whole layer.
    layers = min((view_layer.pass_cryptomatte_depth + 1) // 2, MOST_LAYERS)
    for switch, kind in (
        (view_layer.use_pass_cryptomatte_object, "OBJECT"),
        (view_layer.use_pass_cryptomatte_material, "MATERIAL"),
    ):
        for layer in range(layers if switch else 0):
            name = f"{CRYPTO_NAMES[kind]}{layer:02d}"
            yield RenderPass(name, "rgba", "COLOR", CRYPTO_PASS.format(kind, layer))


def crypto_names(scene) -> dict[str, list[str]]:
    """The names that cryptomattes of a ``shading.scene.Scene`` show, by number."""
    # Cryptomattes know no libraries.
    plain = {thing.name_full: thing.name for thing in bpy.data.objects}
    return {
        "OBJECT": [plain.get(name, name) for name in scene.geometry.object_names],
        "MATERIAL": list(scene.material_names),
    }


def transparency_warning(scene, passes: tuple[str, ...]) -> str:
    """Return the warning about data passes of a ``shading.scene.Scene`` with things that are seen through.

    passes: names of ``shading.passes.PASSES``. "" where none shows such things.
    """
    clear = [number for number, graph in scene.materials.graphs.items() if graph.lets_through]
    if not clear or all(name in LIGHT_PASSES for name in passes):
        return ""
    names = listing([scene.material_names[number] for number in clear])
    return f"Data passes treat transparent objects as opaque: {names}"


def stamp_manifests(result, view_layer, names: dict[str, list[str]]) -> None:
    """Tell a bpy.types.RenderResult, and so the files, what the cryptomattes of a view layer show."""
    for kind, switch in (
        ("OBJECT", view_layer.use_pass_cryptomatte_object),
        ("MATERIAL", view_layer.use_pass_cryptomatte_material),
    ):
        if not switch:
            continue
        name = f"{view_layer.name}.{CRYPTO_NAMES[kind]}"
        for field, value in (
            ("name", name),
            ("hash", "MurmurHash3_32"),
            ("conversion", "uint32_to_float32"),
            ("manifest", manifest(names[kind])),
        ):
            result.stamp_data_add_field(f"cryptomatte/{name_hash(name):08x}"[:19] + f"/{field}", value)


def _switched(self, _context):
    # Blender tells the compositor by itself for its own switches only.
    for view_layer in self.id_data.view_layers:
        view_layer.update_render_passes()


class SCFPF_ViewLayer(bpy.types.PropertyGroup):
    """Passes of a view layer that only the SCFPF engine has."""

    use_pass_diffuse: BoolProperty(
        name="Diffuse",
        description="Light scattered by surfaces, with their color: from lights and the world. Diffuse, "
        "Specular, Emission and Environment add up to the picture",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_specular: BoolProperty(
        name="Specular",
        description="Highlights of lights, and all that is seen in mirrors and through glass",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_shadow_catcher: BoolProperty(
        name="Shadow Catcher",
        description="Light that shadows leave on shadow catchers, white elsewhere: multiply footage by it "
        "and put the"
        " picture over that. The picture itself then has no shadows on catchers",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_parameters: BoolProperty(
        name="Projector Parameters",
        description="Position of each pixel's hit in the viewing volume: u, v and t, 0 where nothing is hit",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_perspective_depth: BoolProperty(
        name="Perspective Depth",
        description="Depth from 0 at the near to 1 at the far surface, in the steps of linear perspective: "
        "finer than t near the camera. It equals t where projectors are parallel",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_tangent: BoolProperty(
        name="Projector Tangent",
        description="Direction of each pixel's projector at its hit, in world space, away from the viewer",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_chord_count: BoolProperty(
        name="Chord Count",
        description="Number of straight chords of each pixel's projector up to its hit: more take longer",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_chord_error: BoolProperty(
        name="Chord Error",
        description="Distance in pixels between chord and curve at each pixel's hit: silhouettes are "
        "displaced by "
        "less. 0 for straight projectors",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )


def register():
    bpy.utils.register_class(SCFPF_ViewLayer)
    bpy.types.ViewLayer.scfpf = PointerProperty(type=SCFPF_ViewLayer)


def unregister():
    del bpy.types.ViewLayer.scfpf
    bpy.utils.unregister_class(SCFPF_ViewLayer)
