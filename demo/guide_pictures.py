# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the screenshots of README.md and docs/guide.md in a Blender with a window: `python3 dev.py pictures`.

The driver of tests/window runs these scenarios. Screenshots are cropped to their subjects.
"""

import importlib
import math
import subprocess

import bpy
import numpy as np
from driver import DRAW, IMAGE, surfaces
from mathutils import Matrix, Vector

# The scale of Blender's interface, which stays legible in a smaller image.
UI_SCALE = 1.3
# The width in pixels of screenshots in the text, and their JPEG quality.
WHOLE_WIDTH, QUALITY = 1200, 76
# Options of ImageMagick for small files of images with few colours.
FEW = ("-colors", "64")
# The margin of cropped images, in pixels.
MARGIN = 5
# The endings of the names of panels with an image of their own: of the camera, and of the engine.
PANELS = ("surfaces", "projectors", "mappings", "quality", "display", "drawn")
ENGINE_PANELS = ("camera", "pattern", "passes")
# Passes that are switched on in their image.
PASSES = ("use_pass_z", "use_pass_vector", "use_pass_cryptomatte_object")
OWN_PASSES = ("use_pass_diffuse", "use_pass_specular", "use_pass_parameters")
# The rows of the camera's panel in which it offers the ways to a picture.
WAYS_ROWS = (10, 268)
# Menus, by the names of their images.
MENUS = {"menu-presets": "SCFPF_MT_presets_group_1", "menu-tools": "SCFPF_MT_surface_specials"}
# The height of the little planet's camera, and the size of its image in pixels.
ABOVE, PLANET_SIZE = 7.0, 900
# The shift and rotation (degrees) of the middle surface in the last step.
PULL, TURN = 45.0, 40.0
SURFACE_COLOR = (0.35, 1.0, 0.45, 1.0)
# The surfaces in a row, their distance and size, and the scale of the lattice.
ACROSS, APART, SIZE, LATTICE_SHARE = 6, 3.2, 2.3, 0.35


def save(driver, name, box=None, width=None, more=()):
    """Save the screen, or a box of it (x, y from the bottom, width, height)."""
    command = ["import", "-window", "root"]
    if box is not None:
        x, y, wide, high = box
        command += ["-crop", f"{wide}x{high}+{x}+{driver.window.height - y - high}", "+repage"]
    if width is not None:
        command += ["-resize", f"{width}x>"]
    command += [*more, "-strip", "-depth", "8", "-quality", str(QUALITY), str(driver.folder / name)]
    subprocess.run(command, check=True)


def region_box(region):
    return region.x, region.y, region.width, region.height


def area_box(area):
    return area.x, area.y, area.width, area.height


def screen(driver):
    """The pixels of the window, (H, W, 3) from 0 to 255, row 0 at the top."""
    wide, high = driver.window.width, driver.window.height
    command = ["import", "-window", "root", "-crop", f"{wide}x{high}+0+0", "-depth", "8", "rgb:-"]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
    return np.frombuffer(done.stdout, np.uint8).reshape(high, wide, 3).astype(np.int16)


def still(driver):
    """Generator: wait until the window stops changing; returns its ``screen``."""
    yield 2 * DRAW
    before = screen(driver)
    while True:
        yield DRAW
        now = screen(driver)
        if np.array_equal(now, before):
            return now
        before = now


def popped_up(driver, before, name, least=60, part=None):
    """Save the popup that appeared in the window after ``before``, or a part of it: two rows from its top."""
    changed = np.abs(screen(driver) - before).max(axis=2) > 3
    # Editors below the viewport may be redrawn at any time.
    changed[driver.window.height - driver.area("VIEW_3D").y :] = False
    rows = np.flatnonzero(changed.sum(axis=1) > least)
    columns = np.flatnonzero(changed.sum(axis=0) > least)
    assert len(rows) and len(columns), f"nothing came up for {name}"
    top, left = max(int(rows[0]) - MARGIN, 0), max(int(columns[0]) - MARGIN, 0)
    wide, high = int(columns[-1]) + MARGIN - left, int(rows[-1]) + MARGIN - top
    if part is not None:
        top, high = top + part[0], part[1] - part[0]
    save(driver, name, (left, driver.window.height - top - high, wide, high))


def look_from(driver, direction, centre, distance):
    view = driver.area("VIEW_3D").spaces.active.region_3d
    view.view_perspective = "PERSP"
    view.view_rotation = Vector(direction).to_track_quat("Z", "Y")
    view.view_location, view.view_distance = centre, distance


def prepare(driver):
    """Open the tutorial's scene with larger letters, as a newcomer sees it."""
    bpy.context.preferences.view.ui_scale = UI_SCALE
    with driver.override():
        bpy.ops.scfpf.tutorial_scene("EXEC_DEFAULT", True)
    space = driver.area("VIEW_3D").spaces.active
    space.shading.color_type = "MATERIAL"
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    look_from(driver, (0.55, -1.0, 0.75), (0, 0, 0), 75)


def show_beside(driver, kind):
    """Split the 3D viewport, and make the new half an editor of another kind."""
    with driver.override():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    new = max(
        (area for area in driver.window.screen.areas if area.type == "VIEW_3D"), key=lambda area: area.x
    )
    new.ui_type = kind


def planet(driver):
    """The tutorial's little planet, from the menu to the render."""
    prepare(driver)
    yield 2 * DRAW
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 3, region.y + region.height // 2
    yield from menu(driver, "VIEW3D_MT_camera_add", (x, y))
    save(driver, "tutorial-menu.jpg", (x - 300, y - 190, 860, 420))
    driver.key("ESC")
    yield DRAW
    driver.add_camera("mirror_ball")
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = PLANET_SIZE
    scene.render.resolution_percentage = 100
    scene.camera.location, scene.camera.rotation_euler = (0, 0, ABOVE), (0, 0, 0)
    # A selected camera would be drawn as a large orange arrow.
    scene.camera.select_set(False)
    yield from driver.show_sidebar()
    look_from(driver, (0.55, -1.0, 0.75), (0, 0, 0), 60)
    yield 2 * DRAW
    save(driver, "tutorial-camera.jpg", area_box(driver.area("VIEW_3D")), WHOLE_WIDTH)
    driver.area("VIEW_3D").spaces.active.show_region_ui = False
    show_beside(driver, "IMAGE_EDITOR")
    driver.show_data_tab()
    yield DRAW
    driver.start_render()
    yield from driver.finished()
    with bpy.context.temp_override(
        window=driver.window, area=driver.area("IMAGE_EDITOR"), region=driver.region("IMAGE_EDITOR")
    ):
        bpy.ops.image.view_all(fit_view=True)
    yield DRAW
    save(driver, "tutorial-render.jpg", width=WHOLE_WIDTH)
    path = str(driver.folder / "planet.png")
    bpy.data.images[IMAGE].save_render(path)
    finished = ["convert", path, "-background", "white", "-flatten", "-resize", "600x", "-strip"]
    subprocess.run([*finished, "-quality", str(QUALITY), path.replace(".png", ".jpg")], check=True)
    (driver.folder / "planet.png").unlink()


def bend(driver):
    """A camera with a third surface that bends its projectors, beside its preview."""
    prepare(driver)
    look_from(driver, (0.0, -1.0, 0.45), (0, 0, 2), 55)
    yield DRAW
    driver.add_camera()
    camera = bpy.context.scene.camera
    with driver.override():
        bpy.ops.scfpf.surface_add("EXEC_DEFAULT", True, kind="PLANE")
    middle = surfaces(camera)[1]
    middle.location.x += PULL
    middle.rotation_euler.z += math.radians(TURN)
    camera.scfpf.active_surface = 1
    with driver.override():
        bpy.ops.scfpf.surface_select("EXEC_DEFAULT", True, index=1)
    with driver.override():
        bpy.ops.scfpf.preview_toggle("INVOKE_DEFAULT", True)
    yield 4 * DRAW
    look_from(driver, (0.9, -0.9, 0.8), (15, -15, 2), 150)
    driver.area("VIEW_3D").spaces.active.show_gizmo = False
    yield 3 * DRAW
    save(driver, "tutorial-bend.jpg", width=WHOLE_WIDTH)


def menu(driver, identifier, place):
    """Generator: open a menu at a place in the window."""
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=place[0], y=place[1])
    yield 0.2
    with driver.override():
        bpy.ops.wm.call_menu(name=identifier)
    yield DRAW


def panels_and_menus(driver):
    """Each panel in a popup, and menus."""
    prepare(driver)
    driver.add_camera("nonlinear_twist")
    yield DRAW
    with driver.override():
        for kind in ("RADIAL_CURVE", "LENS"):
            bpy.ops.scfpf.mapping_add("EXEC_DEFAULT", True, kind=kind)
    for obj in bpy.context.scene.objects:
        obj.hide_set(True)
    space = driver.area("VIEW_3D").spaces.active
    space.overlay.show_overlays = space.show_gizmo = space.show_region_header = False
    space.show_region_tool_header = space.show_region_toolbar = False
    bpy.context.scene.scfpf_drawn.use_drawn = True
    bpy.context.scene.render.engine = "SCFPF"
    bpy.context.scene.scfpf_sampling.use_adaptive = True
    bpy.context.scene.camera.scfpf.samples = 64
    for owner, names in ((bpy.context.view_layer, PASSES), (bpy.context.view_layer.scfpf, OWN_PASSES)):
        for name in names:
            setattr(owner, name, True)
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 2, region.y + region.height - 60
    # The border of the editor under the mouse is lighter.
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    before = yield from still(driver)
    shown = {name: f"SCFPF_PT_view_{name}" for name in PANELS}
    shown |= {f"engine-{name}": f"SCFPF_PT_engine_{name}" for name in ENGINE_PANELS}
    shown["cycles"] = "SCFPF_PT_view_cycles"
    for name, identifier in shown.items():
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        yield 0.2
        if name == "cycles":
            # The panel is there once Cycles renders the camera.
            with driver.override():
                bpy.ops.scfpf.cycles_rig("EXEC_DEFAULT")
            driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
            before = yield from still(driver)
        with driver.override():
            bpy.ops.wm.call_panel(name=identifier)
        yield DRAW
        popped_up(driver, before, f"panel-{name}.png")
        driver.key("ESC")
        yield DRAW
    with driver.override():
        bpy.ops.scfpf.cycles_rig("EXEC_DEFAULT")
    bpy.context.scene.render.engine = "SCFPF"
    before = yield from still(driver)
    for name, identifier in MENUS.items():
        yield from menu(driver, identifier, (x, y))
        popped_up(driver, before, f"{name}.png")
        driver.key("ESC")
        yield DRAW
    with driver.override():
        bpy.ops.scfpf.view_live()
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    before = yield from still(driver)
    with driver.override():
        bpy.ops.wm.call_panel(name="SCFPF_PT_view")
    yield DRAW
    popped_up(driver, before, "panel-ways.png", part=WAYS_ROWS)
    driver.key("ESC")
    yield DRAW


def shown_surfaces():
    """Yield an object of every kind of control surface and its name, in the menu's order."""
    module = next(name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf"))
    nodes = importlib.import_module(f"{module}.scfpf_addon.bridge.surfaces.surface_object")
    kinds = importlib.import_module(f"{module}.scfpf_addon.bridge.surfaces.kinds")
    x, y = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-0.8, 0.8, 6))
    wave = np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)], 2)
    saddle = np.stack([x[:4, ::2], y[1:5, ::2], 0.9 * x[:4, ::2] * y[1:5, ::2]], 2)
    how = {
        "PATCH": {"points": np.array([[[-1, -0.7, 0.5], [1, -0.7, -0.5]], [[-1, 0.7, -0.5], [1, 0.7, 0.5]]])},
        "CYLINDER": {"parameters": {"radius": 1.0, "arc": math.radians(250), "height": 1.4}},
        "GRID": {"points": wave},
        "NURBS": {"points": saddle},
    }
    for kind, name, *_ in kinds.KIND_ITEMS:
        if kind == "UV_MESH":
            bpy.ops.mesh.primitive_monkey_add()  # it has a UV map
            surface = bpy.context.object
            surface.display_type = "WIRE"
            surface.select_set(False)
        else:
            surface = nodes.new_surface(name, kind, **how.get(kind, {}))
            bpy.context.collection.objects.link(surface)
        yield surface, name


def kinds(driver):
    """Every kind of control surface side by side, each with its name."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    shown = list(shown_surfaces())
    bpy.context.view_layer.update()
    upright = Matrix.Rotation(math.radians(90), 4, "X")
    tilt = Matrix.Rotation(math.radians(20), 4, "X") @ Matrix.Rotation(math.radians(-28), 4, "Z")
    for number, (surface, name) in enumerate(shown):
        place = Vector(((number % ACROSS) * APART, 0.0, -(number // ACROSS) * APART))
        scale = SIZE / max(*surface.dimensions, 0.5)
        if name == "Point":
            surface = bpy.data.objects.new(name, None)
            surface.empty_display_type, scale = "SPHERE", 0.12
            bpy.context.collection.objects.link(surface)
        surface.matrix_world = Matrix.Translation(place) @ tilt @ upright @ Matrix.Scale(scale, 4)
        if name == "Lattice":
            surface.matrix_world @= Matrix.Scale(LATTICE_SHARE, 4)
        surface.color = SURFACE_COLOR
        text = bpy.data.curves.new(name, "FONT")
        text.body, text.align_x, text.size = name, "CENTER", 0.42
        label = bpy.data.objects.new(f"{name} label", text)
        label.location, label.rotation_euler = place - Vector((0, 0, 1.55)), (math.radians(90), 0, 0)
        label.color = (1, 1, 1, 1)
        bpy.context.collection.objects.link(label)
    space = driver.area("VIEW_3D").spaces.active
    space.show_gizmo = space.show_region_header = space.show_region_tool_header = False
    space.show_region_toolbar = False
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_text = space.overlay.show_cursor = space.overlay.show_object_origins = False
    space.shading.wireframe_color_type = space.shading.color_type = "OBJECT"
    space.shading.light = "FLAT"
    look_from(driver, (0.0, -1.0, 0.0), ((ACROSS - 1) * APART / 2, 0, -APART / 2 - 0.2), 14.5)
    space.region_3d.view_perspective = "ORTHO"
    # Lattices are drawn in the theme's colour.
    bpy.context.preferences.themes[0].view_3d.wire = SURFACE_COLOR[:3]
    yield 2 * DRAW
    region = driver.region("VIEW_3D")
    x, y, wide, high = region_box(region)
    half = int(wide / ACROSS * 0.95)
    save(driver, "kinds.png", (x, y + high // 2 - half, wide, 2 * half), WHOLE_WIDTH, FEW)


SCENARIOS = (planet, bend, panels_and_menus, kinds)
