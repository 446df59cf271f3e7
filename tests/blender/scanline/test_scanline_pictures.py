# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the nodes preview, drawn by Workbench, against the exact caster."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from made_cameras import FOLDER, PRESETS
from mathutils import Euler, Matrix

pytestmark = pytest.mark.usefixtures("built_groups")

WIDTH = 240
# Pixels nearer than this to a silhouette are not compared.
SILHOUETTE = 1.5
NOTHING = -1
BACKGROUND = (128, 128, 128)
CHECKS = 40


@pytest.fixture
def scanline(addon):
    """The preview's node groups, and the object with the table."""
    table_object = addon("scanline.table.table_object").table_object
    return SimpleNamespace(**vars(addon("scanline.remap.remap_nodes")), table_object=table_object)


@pytest.fixture
def seen():
    """The collection that the preview shows, excluded from the view so that only the preview is drawn."""
    made = bpy.data.collections.new("Seen")
    bpy.context.scene.collection.children.link(made)
    bpy.context.view_layer.layer_collection.children["Seen"].exclude = True
    return made


@pytest.fixture
def flexible_camera(addon):
    """A camera with a preset of this repository, and its picture's height."""
    flexible, presets = addon("bridge.camera.flexible_camera"), addon("projection.presets.preset")

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
    cast_frame, cast_scene = (addon(f"casting.{module}") for module in ("frame", "scene.cast_scene"))
    read = addon("bridge.camera.read_projection").read_projection

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
    versions = addon("bridge.blender.versions")

    def draw(camera, collection, height, colours="MATERIAL", pixel_error=0.25):
        preview = bpy.data.objects.new("Preview", bpy.data.meshes.new("Preview"))
        view = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
        for each in (preview, view):
            each.parent = camera
            bpy.context.scene.collection.objects.link(each)
        modifier = preview.modifiers.new("Preview", "NODES")
        group = modifier.node_group = scanline.preview_group()
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


def add_wall(collection, z):
    """One undivided square behind things, larger than a picture; its colour."""
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata([(-40, -40, z), (40, -40, z), (40, 40, z), (-40, 40, z)], [], [(0, 1, 2, 3)])
    mesh.materials.append(bpy.data.materials.new("Wall"))
    mesh.materials[0].diffuse_color = (1.0, 0.9, 0.5, 1.0)
    collection.objects.link(bpy.data.objects.new("Wall", mesh))
    return np.rint(np.array([[1.0, 0.9, 0.5]]) * 255).astype(int)


@pytest.fixture
def compared(addon, scanline, seen, caster, drawn):
    """Things seen by preview and caster: pixels that are wrong, pixels compared, what was left out."""
    read = addon("bridge.camera.read_projection").read_projection

    def compare(camera, height, count=24, wall=None):
        projection = read(camera, bpy.context.evaluated_depsgraph_get(), WIDTH / height)
        colours = add_things(projection, seen, count)
        if wall is not None:
            colours = np.vstack([colours, add_wall(seen, wall)])
        projection, hits, numbers, _ = caster(camera, seen, height)
        expected = np.where(hits.triangle >= 0, numbers, NOTHING)
        regions = np.where(hits.mask, expected, -2).reshape(height, WIDTH)
        picture, preview = drawn(camera, seen, height)
        table = np.vstack([colours, BACKGROUND])
        number = np.abs(picture[:, :, None] - table).sum(axis=-1).argmin(axis=-1)
        number[number == len(colours)] = NOTHING
        far = ~near_borders(regions)
        wrong = far & (number != expected.reshape(height, WIDTH))
        assert len(np.unique(number)) > 6
        evaluated = preview.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return wrong.sum(), far.sum(), scanline.remap_counts(evaluated)

    return compare


# One whose rays go fifty times as fast in their last part as before, so that samples are far apart there.
UNEVEN = FOLDER / "occlusion_camera.json"
# Beside a near surface that is a point float32 depth is coarse there: where things meet, pixels may be wrong.
COARSE_DEPTH = 1e-4


@pytest.mark.parametrize("path", [*PRESETS, UNEVEN], ids=lambda path: path.stem)
def test_preview_and_caster_see_the_same_objects(flexible_camera, compared, path):
    wrong, count, counts = compared(*flexible_camera(path))
    assert wrong <= (COARSE_DEPTH * count if path == UNEVEN else 0)
    assert set(counts) == {"unreachable", "folded"}


def bare_camera():
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    return made


def add_plane(flexible, camera, z, width, height):
    size = {"width": width, "height": height}
    flexible.add_surface(camera, "PLANE", matrix=Matrix.Translation((0, 0, z)), parameters=size)


def add_grid(flexible, camera, place, columns, rows):
    """A surface through place(u, v) → x, y, z."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    flexible.add_surface(camera, "GRID", points=np.stack(np.broadcast_arrays(*place(u, v)), axis=-1))


def folded_volume(flexible, camera):
    """The far surface goes back and forth along u: up to three places in the picture for one in space."""
    add_plane(flexible, camera, -2.0, 3.0, 2.0)

    def place(u, v):
        return 18 * (u - 0.5) - 5.5 * np.sin(2 * np.pi * u), 12 * (v - 0.5), -20.0

    add_grid(flexible, camera, place, 41, 2)


def add_tiles(flexible, camera, tiles, z, size, generator, spread):
    """A UV mesh of polygons, ((u, v), ...) each, turned and moved for themselves around a plane at z."""
    places, uv, faces = [], [], []
    for corners in tiles:
        corners = np.array(corners)
        turn = np.array(Euler(generator.uniform(-0.25, 0.25, 3) * spread).to_matrix())
        centre = corners.mean(axis=0)
        flat = np.column_stack([(corners - centre) * size, np.zeros(len(corners))])
        middle = np.array([*((centre - 0.5) * size), z]) + generator.uniform(-1, 1, 3) * spread
        faces.append(range(len(places), len(places) + len(corners)))
        places += (middle + flat @ turn.T).tolist()
        uv += corners.tolist()
    mesh = bpy.data.meshes.new("Tiles")
    mesh.from_pydata(places, [], [list(face) for face in faces])
    mesh.uv_layers.new(name="Tiles").uv.foreach_set("vector", np.array(uv, np.float32).ravel())
    made = bpy.data.objects.new("Tiles", mesh)
    bpy.context.scene.collection.objects.link(made)
    made.parent = camera
    flexible.attach_surface(camera, made)


def tiles_with_holes(flexible, camera):
    """Triangles and others with gaps of several shapes between them, where nothing is seen."""
    add_plane(flexible, camera, -2.0, 3.0, 2.0)
    tiles = [
        [(0, 0), (0.45, 0.05), (0.3, 0.5), (0, 0.6)],
        [(0.55, 0), (1, 0), (0.8, 0.55)],
        [(0.35, 0.55), (0.75, 0.65), (0.7, 1), (0.1, 1)],
        [(0.85, 0.6), (1, 0.4), (1, 1)],
        [(0.85, 0.6), (1, 1), (0.8, 1)],
    ]
    add_tiles(flexible, camera, tiles, -20.0, (18, 12), np.random.default_rng(3), 0.8)


def pieces_of_two_surfaces(flexible, camera):
    """The near surface is in two tiles, the far one in three, with other borders, slanted, that cross."""
    near = [[(0, 0), (1, 0), (1, 0.4), (0, 0.55)], [(0, 0.55), (1, 0.4), (1, 1), (0, 1)]]
    far = [
        [(0, 0), (0.4, 0), (0.25, 1), (0, 1)],
        [(0.4, 0), (0.7, 0), (0.8, 1), (0.25, 1)],
        [(0.7, 0), (1, 0), (1, 1), (0.8, 1)],
    ]
    add_tiles(flexible, camera, near, -2.0, (3, 2), np.random.default_rng(5), 0.1)
    add_tiles(flexible, camera, far, -20.0, (18, 12), np.random.default_rng(6), 0.8)


def part_of_a_turn(flexible, camera):
    for z, radius in ((-2.0, 1.5), (-20.0, 9.0)):
        matrix = Matrix.Translation((0, 0, z))
        flexible.add_surface(camera, "DISC", matrix=matrix, parameters={"radius": radius})
    settings = camera.scfpf
    settings.reparameterisation, settings.u_range, settings.v_range = "POLAR", (0.1, 0.6), (0.2, 1.0)


def closed_along_v(flexible, camera):
    for radius, length in ((1.0, 1.5), (9.0, 12.0)):

        def place(u, v, radius=radius, length=length):
            angle = 2 * np.pi * v
            return length * (u - 0.5), radius * np.sin(angle), -radius * np.cos(angle)

        add_grid(flexible, camera, place, 9, 65)


# Share of pixels that may be wrong, at creases and in tiles' corners; whether a wall is behind things.
VOLUMES = [
    (folded_volume, 2e-4, False),
    (tiles_with_holes, 2e-4, True),
    (pieces_of_two_surfaces, 2e-4, True),
    (part_of_a_turn, 2e-4, True),
    (closed_along_v, 0.0, False),
]


def test_volumes_with_folds_pieces_and_seams(addon, compared):
    """All in one file: node groups are built once."""
    flexible = addon("bridge.camera.flexible_camera")
    for make, share, has_wall in VOLUMES:
        bpy.data.batch_remove(list(bpy.data.objects))
        camera = bare_camera()
        make(flexible, camera)
        bpy.context.view_layer.update()
        wrong, count, counts = compared(camera, 160, 10, -14.0 if has_wall else None)
        assert wrong <= share * count, make.__name__
        # Where the volume folds, faces reach beyond it.
        assert (counts["unreachable"] > 0) == (make is folded_volume), make.__name__
        assert (counts["folded"] > 100) == (make is folded_volume), make.__name__


def random_surface(flexible, camera, generator, kind, index, count):
    """One of a row of surfaces along -Z, turned, moved and bent a little."""
    size = 2.0 + index + generator.uniform(-0.3, 0.3)
    matrix = np.array(Euler(generator.uniform(-0.12, 0.12, 3)).to_matrix().to_4x4())
    matrix[:3, 3] = [*generator.uniform(-0.3, 0.3, 2), -1.0 - 8.0 * index / (count - 1)]
    if kind == "PLANE":
        parameters = {"width": 1.5 * size, "height": size}
        flexible.add_surface(camera, kind, matrix=matrix, parameters=parameters)
        return
    corners = np.linspace(0, 1, {"PATCH": 2, "GRID": 9, "NURBS": 4}[kind])
    u, v = np.meshgrid(corners, corners)
    bent = 0.25 * size * np.sin(generator.uniform(0, 6) + 3 * u) * np.cos(generator.uniform(0, 6) + 3 * v)
    if kind == "PATCH":
        bent = generator.uniform(-0.3, 0.3, u.shape)
    points = np.stack([1.5 * size * (u - 0.5), size * (v - 0.5), 0.4 * bent], axis=-1)
    flexible.add_surface(camera, kind, matrix=matrix, points=points)


RANDOM = [
    *(("BEZIER", count) for count in range(2, 7)),
    ("POLYLINE", 3),
    ("B_SPLINE", 5),
    ("NURBS", 4),
]


def test_random_one_to_one_volumes(addon, compared):
    """All in one file: node groups are built once."""
    flexible = addon("bridge.camera.flexible_camera")
    for seed, (basis, count) in enumerate(RANDOM):
        bpy.data.batch_remove(list(bpy.data.objects))
        wrong, _, counts = compared(random_volume(flexible, seed, basis, count), 160, 10)
        assert wrong == 0, (basis, count)
        assert counts == {"unreachable": 0, "folded": 0}


def random_volume(flexible, seed, basis, count):
    """A camera with surfaces of several kinds."""
    generator, camera = np.random.default_rng(seed), bare_camera()
    kinds = generator.permutation(["PLANE", "PATCH", "GRID", "NURBS", "GRID", "PATCH"])[:count]
    for index, kind in enumerate(kinds):
        random_surface(flexible, camera, generator, str(kind), index, count)
    camera.scfpf.basis = basis
    for slot, weight in zip(camera.scfpf.surfaces, generator.uniform(0.6, 1.5, count), strict=True):
        slot.weight = weight
    bpy.context.view_layer.update()
    return camera


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


def lenses(camera):
    """A magnified part, and a distortion that leaves the corners empty."""
    settings = camera.scfpf
    lens, distortion = settings.mappings.add(), settings.mappings.add()
    lens.kind, lens.centre, lens.radius = "LENS", (0.4, 0.55), 0.7
    lens.magnification, lens.falloff = 2.0, 0.7
    distortion.kind, distortion.radius, distortion.numerator = "DISTORTION", 1.5, (0.15, 0.02, 0.0)


def rim_stays(camera):
    """Enlarge the centre of a fisheye; its rim stays in place."""
    mapping = camera.scfpf.mappings.add()
    mapping.kind = "RADIAL_CURVE"
    widget = mapping.curve.nodes["Curve"].mapping
    widget.curves[0].points.new(0.5, 0.35)
    widget.update()


@pytest.mark.parametrize(
    ("preset", "make", "share"),
    [("perspective", lenses, 5e-4), ("angular_fisheye", rim_stays, 0.0)],
)
def test_preview_and_caster_see_the_same_through_image_mappings(addon, compared, preset, make, share):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = WIDTH, 180
    camera = bare_camera()
    presets = addon("projection.presets.preset")
    read = presets.read_preset(next(path for path in PRESETS if path.stem == preset))
    addon("bridge.camera.flexible_camera").apply_preset(camera, read, WIDTH / 180)
    make(camera)
    bpy.context.view_layer.update()
    wrong, count, counts = compared(camera, 180, 12)
    assert wrong <= share * count
    assert counts["unreachable"] == 0
