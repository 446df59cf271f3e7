# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the live preview, drawn by Workbench, against the exact caster."""

import pathlib

import bpy
import numpy as np
import pytest

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "presets"
# A choice: each costs seconds.
PRESETS = [
    FOLDER / f"{stem}.json"
    for stem in (
        "angular_fisheye",
        "around_the_car",
        "cylindrical_panorama",
        "inverted_perspective",
        "nonlinear_twist",
        "orthographic",
        "perspective",
    )
]
WIDTH = 240
# Pixels nearer than this to a silhouette are not compared.
SILHOUETTE = 1.5
NOTHING = -1
BACKGROUND = (128, 128, 128)
CHECKS = 40


@pytest.fixture
def scanline(addon):
    return addon("scfpf_addon.scanline.remap_nodes")


@pytest.fixture
def seen():
    """What the preview shows; excluded from the view, so that only the preview is drawn."""
    made = bpy.data.collections.new("Seen")
    bpy.context.scene.collection.children.link(made)
    bpy.context.view_layer.layer_collection.children["Seen"].exclude = True
    return made


@pytest.fixture
def flexible_camera(addon):
    """A camera with a preset of this repository, and its picture's height."""
    flexible, presets = (
        addon(f"scfpf_addon.{name}") for name in ("bridge.flexible_camera", "projection.preset")
    )

    def make(path):
        preset = presets.load_preset(path.read_text(encoding="utf-8"))
        made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        bpy.context.scene.collection.objects.link(made)
        height = round(WIDTH / preset.aspect)
        flexible.apply_preset(made, preset, WIDTH / height)
        bpy.context.view_layer.update()
        return made, height

    return make


@pytest.fixture
def caster(addon):
    """Casts a picture of the triangles of all objects of a collection: hits, objects, corners."""
    cast_frame, cast_scene = (addon(f"scfpf_addon.casting.{module}") for module in ("frame", "scene"))
    read = addon("scfpf_addon.bridge.read_projection").read_projection

    def cast(camera, collection, height):
        vertices, triangles, numbers, first = [], [], [], 0
        for number, thing in enumerate(collection.objects):
            mesh = thing.data
            mesh.calc_loop_triangles()
            points = np.array([vertex.co for vertex in mesh.vertices], np.float64)
            matrix = np.array(thing.matrix_basis, np.float64)
            vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
            triangles.append(np.array([t.vertices for t in mesh.loop_triangles], np.int32) + first)
            numbers.append(np.full(len(triangles[-1]), number))
            first += len(points)
        corners = np.concatenate(triangles).astype(np.int32)
        scene = cast_scene.CastScene(np.concatenate(vertices), corners)
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), WIDTH / height)
        hits = cast_frame.cast_frame(scene, projection, WIDTH, height, 0.02)
        return projection, hits, np.concatenate(numbers)[hits.triangle], corners[hits.triangle]

    return cast


@pytest.fixture
def drawn(addon, scanline, tmp_path):
    """The preview as Workbench draws it, flat and without anti-aliasing: (H, W, 3) int, row 0 below."""
    versions = addon("scfpf_addon.bridge.versions")

    def draw(camera, collection, height, colours="MATERIAL", pixel_error=0.25):
        preview = bpy.data.objects.new("Preview", bpy.data.meshes.new("Preview"))
        view = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
        for each in (preview, view):
            each.parent = camera
            bpy.context.scene.collection.objects.link(each)
        modifier = preview.modifiers.new("Preview", "NODES")
        group = modifier.node_group = scanline.preview_group(camera)
        values = {
            "Collection": collection,
            "Table": scanline.table_object(camera),
            "Aspect": WIDTH / height,
            "Picture Width": float(WIDTH),
            "Pixel Error": pixel_error,
        }
        for item in group.interface.items_tree:
            if item.in_out == "INPUT" and item.name in values:
                versions.set_modifier_input(modifier, item.identifier, values[item.name])
        modifier.node_group = group
        lens = view.data
        lens.type, lens.sensor_fit, lens.ortho_scale = "ORTHO", "HORIZONTAL", 1.0
        lens.clip_start, lens.clip_end = 1.0, 2.0
        scene = bpy.context.scene
        scene.camera = view
        return render(scene, height, colours, tmp_path), preview

    return draw


def render(scene, height, colours, folder):
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, height
    scene.render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Raw"
    shading = scene.display.shading
    scene.display.render_aa = "OFF"
    shading.light, shading.color_type = "FLAT", colours
    shading.show_object_outline = shading.show_cavity = False
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.5, 0.5, 0.5)
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(folder / "picture.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(WIDTH * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return np.rint(pixels.reshape(height, WIDTH, 4)[..., :3] * 255).astype(int)


def near_borders(regions):
    """Pixels nearer than SILHOUETTE to one of another region, or to the picture's border."""
    padded, near = np.pad(regions, 2, constant_values=-3), np.zeros(regions.shape, bool)
    for down in range(-2, 3):
        for right in range(-2, 3):
            if down**2 + right**2 <= SILHOUETTE**2:
                rows, columns = slice(2 + down, 2 + down + len(regions)), slice(2 + right, 2 + right + WIDTH)
                near |= padded[rows, columns] != regions
    return near


def add_things(projection, collection, count=24):
    """Boxes and balls all over a volume, of sizes that suit it, each with a colour of its own."""
    generator = np.random.default_rng(4)
    x, y = generator.uniform(0.15, 0.85, (2, count))
    t = generator.uniform(0.15, 0.9, count)
    image = projection.parameters(x, y)
    sample = projection.volume.evaluate(image.u, image.v, t)
    by_x = sample.du * image.jacobian[0, 0] + sample.dv * image.jacobian[1, 0]
    by_y = sample.du * image.jacobian[0, 1] + sample.dv * image.jacobian[1, 1]
    sizes = np.abs(np.einsum("cn,cn->n", np.cross(by_x, by_y, axis=0), sample.dt)) ** (1 / 3)
    colours = []
    for number in range(count):
        place, size = sample.position[:, number].tolist(), sizes[number] * generator.uniform(0.04, 0.15)
        if number % 2:
            bpy.ops.mesh.primitive_cube_add(
                size=size, location=place, rotation=generator.uniform(0, 6, 3).tolist()
            )
        else:
            bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=size / 2, location=place)
        thing = bpy.context.object
        bpy.context.scene.collection.objects.unlink(thing)
        collection.objects.link(thing)
        material = bpy.data.materials.new(str(number))
        colours.append((number % 5 * 0.25, number // 5 * 0.2, float(number % 2)))
        material.diffuse_color = (*colours[-1], 1.0)
        thing.data.materials.append(material)
    return np.rint(np.array(colours) * 255).astype(int)


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_preview_and_caster_see_the_same_objects(addon, scanline, flexible_camera, seen, caster, drawn, path):
    camera, height = flexible_camera(path)
    read = addon("scfpf_addon.bridge.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), WIDTH / height)
    colours = add_things(projection, seen)
    projection, hits, numbers, _ = caster(camera, seen, height)
    expected = np.where(hits.triangle >= 0, numbers, NOTHING)
    regions = np.where(hits.mask, expected, -2).reshape(height, WIDTH)
    picture, preview = drawn(camera, seen, height)
    table = np.vstack([colours, BACKGROUND])
    number = np.abs(picture[:, :, None] - table).sum(axis=-1).argmin(axis=-1)
    number[number == len(colours)] = NOTHING
    compared = ~near_borders(regions)
    wrong = compared & (number != expected.reshape(height, WIDTH))
    assert len(np.unique(number)) > 8
    assert wrong.sum() <= FOLDED.get(path.stem, 0) * compared.sum()
    evaluated = preview.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert set(scanline.remap_counts(evaluated)) == {"unreachable", "folded"}


# Presets that fold, where one place in the scene has several in the picture: the share that may be wrong.
FOLDED: dict[str, float] = {}

GROUND = [(-50, -1.7, 50), (50, -1.7, 50), (50, -1.7, -50), (-50, -1.7, -50)]
WALL = [(-10, -6, -4), (6, -6, -24), (6, 6, -24), (-10, 6, -4)]


def add_checkered(points, collection, material):
    mesh = bpy.data.meshes.new("Quad")
    mesh.from_pydata(points, [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="Whatever").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    mesh.materials.append(material)
    collection.objects.link(bpy.data.objects.new("Quad", mesh))


def checkered_material():
    image = bpy.data.images.new("Checks", CHECKS, CHECKS)
    image.colorspace_settings.name = "Non-Color"
    row, column = np.mgrid[:CHECKS, :CHECKS]
    red = ((row + column) % 2).astype(np.float32)
    pixels = np.dstack([red, 1 - red, np.zeros_like(red), np.ones_like(red)])
    image.pixels.foreach_set(pixels.ravel())
    material = bpy.data.materials.new("Checks")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    material.node_tree.nodes.active = texture
    return material


@pytest.mark.parametrize(
    "name", ["perspective", "nonlinear_twist", "cylindrical_panorama", "angular_fisheye"]
)
def test_undivided_checkered_quads_look_as_the_caster_draws_them(flexible_camera, seen, caster, drawn, name):
    camera, height = flexible_camera(PRESETS[0].parent / f"{name}.json")
    material = checkered_material()
    for points in (GROUND, WALL):
        add_checkered(points, seen, material)
    _, hits, numbers, corners = caster(camera, seen, height)
    hit = hits.triangle >= 0
    weights = np.stack([1 - hits.barycentric.sum(axis=0), *hits.barycentric])
    uv = np.einsum("kn,nkc->cn", weights, np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[corners % 4])
    column, row = np.floor(uv * CHECKS).astype(int)
    check = np.where(hit, (column + row) % 2, NOTHING).reshape(height, WIDTH)
    regions = np.where(hit, numbers * CHECKS**3 + column * CHECKS + row, NOTHING)
    regions = np.where(hits.mask, regions, -2).reshape(height, WIDTH)
    picture, preview = drawn(camera, seen, height, "TEXTURE")
    got = np.where(np.abs(picture - BACKGROUND).sum(axis=-1) < 12, NOTHING, picture[..., 0] > 128)
    compared = ~near_borders(regions)
    assert (compared & (check >= 0)).sum() > 3000
    assert (compared & (got != check)).sum() == 0
    # Divided where it matters only.
    faces = preview.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.polygons
    assert len(faces) < 10_000
