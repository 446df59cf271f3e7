# SPDX-License-Identifier: GPL-3.0-or-later
"""The image datablock: exact, reused, packed, undoable, and written as a render is."""

import contextlib
import os

import bpy
import numpy as np
import pytest


@pytest.fixture
def module(addon):
    return addon("bridge.render.result_image")


@pytest.fixture
def files(addon):
    return addon("bridge.render.image_file")


def picture(width=40, height=30, seed=0):
    """Premultiplied pixels (H, W, 4) with every kind of alpha, tiny, huge and negative values."""
    generator = np.random.default_rng(seed)
    pixels = generator.random((height, width, 4)).astype(np.float32)
    pixels[..., :3] *= pixels[..., 3:]
    pixels[0, :, 3] = 0.5
    pixels[1] = 0
    pixels[2, :, 3] = 1
    pixels[3, :, :3] *= 1e-6
    pixels[4, :, :3] *= 1e5
    pixels[5, :, :3] *= -1
    pixels[6, :, :3] = 0.7
    pixels[6, :, 3] = 0
    return pixels


def content(image):
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)


def same(image, pixels):
    return content(image).tobytes() == pixels.tobytes()


def save_and_reload(tmp_path):
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)


def test_settings_of_the_datablock(module):
    image = module.write_result(picture())
    assert image.name == "SCFPF Render" and tuple(image.size) == (40, 30)
    assert image.is_float and image.alpha_mode == "PREMUL" and image.use_view_as_render
    assert image.colorspace_settings.name == "Linear Rec.709"
    assert image.packed_file and image.users == 1
    assert module.result_image() == image


def test_pixels_survive_save_and_reload_bit_for_bit(module, tmp_path):
    pixels = picture()
    assert same(module.write_result(pixels), pixels)
    for _ in range(2):
        save_and_reload(tmp_path)
        image = module.result_image()
        assert same(image, pixels)
        assert image.alpha_mode == "PREMUL" and image.use_view_as_render and image.is_float
    larger = picture(64, 48, seed=1)
    module.write_result(larger)
    save_and_reload(tmp_path)
    assert same(module.result_image(), larger)


def test_the_datablock_is_reused_and_resized(module):
    image = module.write_result(picture())
    pointer = image.as_pointer()
    for size in ((64, 16), (7, 90), (7, 90)):
        pixels = picture(*size, seed=size[0])
        again = module.write_result(pixels)
        assert again.as_pointer() == pointer and same(again, pixels)
        assert len(again.packed_files) == 1
    assert [one.name for one in bpy.data.images] == ["SCFPF Render"]


def test_row_0_is_at_the_bottom(module):
    pixels = np.zeros((3, 2, 4), np.float32)
    pixels[0, 1] = 1
    image = module.write_result(pixels)
    assert list(image.pixels[4:8]) == [1, 1, 1, 1] and sum(image.pixels) == 4


def test_pixels_of_any_memory_layout_are_taken(module):
    pixels = picture()
    assert same(module.write_result(np.asfortranarray(pixels.astype(np.float64))), pixels)


def test_progress_is_shown_and_can_be_discarded(module):
    first, second = picture(), picture(50, 20, seed=1)
    module.show_progress(first)
    assert same(module.result_image(), first) and not module.result_image().packed_file
    module.discard_progress()
    assert module.result_image() is None
    module.write_result(first)
    module.show_progress(second)
    assert same(module.result_image(), second)
    module.discard_progress()
    assert same(module.result_image(), first)
    module.discard_progress()
    assert same(module.result_image(), first)


def undo_context():
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0])


def test_undo_takes_back_renders_one_by_one_and_nothing_else(module):
    """As the operator does it: one undo push after each write."""
    first, second = picture(), picture(50, 20, seed=1)
    with undo_context():
        bpy.ops.ed.undo_push(message="Start")
    for pixels in (first, second):
        module.write_result(pixels)
        with undo_context():
            bpy.ops.ed.undo_push(message="Render")
            bpy.ops.object.empty_add()
            bpy.ops.ed.undo_push(message="Add")
    with undo_context():
        bpy.ops.ed.undo()
    assert same(module.result_image(), second) and len(bpy.data.objects) == 1
    with undo_context():
        bpy.ops.ed.undo()
    assert same(module.result_image(), first) and len(bpy.data.objects) == 1
    with undo_context():
        bpy.ops.ed.undo()
        assert same(module.result_image(), first) and len(bpy.data.objects) == 0
        bpy.ops.ed.undo()
        assert module.result_image() is None
        for _ in range(4):
            bpy.ops.ed.redo()
    assert same(module.result_image(), second) and len(bpy.data.objects) == 2


@pytest.mark.parametrize("before", ["nothing", "a smaller picture"])
def test_an_image_that_no_file_can_hold_is_only_in_memory(module, addon, monkeypatch, before):
    """Blender counts a packed file's bytes in 31 bits and keeps the beginning of larger ones."""
    packing = addon("bridge.blender.packing")
    small, large = picture(), picture(50, 40, seed=1)
    if before != "nothing":
        module.write_result(small)
        with undo_context():
            bpy.ops.ed.undo_push(message="Small")
    monkeypatch.setattr(packing, "LARGEST_FILE", packing.BESIDES_PIXELS + large.nbytes)
    assert not module.only_in_memory()
    module.show_progress(large)
    assert "Save As" in module.keep_result() and "2 GB" in module.keep_result()
    image = module.result_image()
    assert same(image, large) and not image.packed_file and module.only_in_memory()
    with undo_context():
        bpy.ops.ed.undo_push(message="Large")
    assert same(module.result_image(), large)
    if before != "nothing":
        with undo_context():
            bpy.ops.ed.undo()
        assert same(module.result_image(), small) and not module.only_in_memory()
        with undo_context():
            bpy.ops.ed.redo()
        # It is lost, and the small one does not stand for it.
        assert not module.result_image().has_data and not module.only_in_memory()
    # One that fits is packed again.
    assert same(module.write_result(small), small) and module.result_image().packed_file


def test_an_image_that_was_saved_as_a_file_comes_back_after_a_cancelled_one(
    module, addon, tmp_path, monkeypatch
):
    packing = addon("bridge.blender.packing")
    monkeypatch.setattr(packing, "LARGEST_FILE", packing.BESIDES_PIXELS)
    first, second = picture(), picture(seed=1)
    image = module.write_result(first)
    assert module.only_in_memory()
    image.file_format = "OPEN_EXR"
    image.save(filepath=str(tmp_path / "saved.exr"))
    image.filepath_raw, image.source = str(tmp_path / "saved.exr"), "FILE"
    assert not image.packed_file and not module.only_in_memory()
    module.show_progress(second)
    module.discard_progress()
    # Saving has put the colours into another space.
    assert np.allclose(content(module.result_image())[..., 3], first[..., 3], atol=2e-3)
    assert not np.allclose(first[..., 3], second[..., 3], atol=2e-3)


@pytest.mark.parametrize("kind", ["byte", "packed byte", "float without alpha", "missing file"])
def test_an_image_of_the_name_that_cannot_hold_the_image_is_set_aside(module, tmp_path, kind):
    other = bpy.data.images.new("SCFPF Render", 8, 8, float_buffer=kind.startswith("float"))
    other.use_fake_user = True
    other.pixels[:] = before = [0.5] * 8 * 8 * 4
    if kind != "byte":
        other.pack()
    if kind == "missing file":
        other.unpack(method="REMOVE")
        other.source, other.filepath = "FILE", str(tmp_path / "none.png")
    pixels = picture()
    image = module.write_result(pixels)
    assert image != other and image.name == "SCFPF Render" and other.name == "SCFPF Render (other)"
    if kind != "missing file":
        assert list(other.pixels) == pytest.approx(before, abs=0.51 / 255)
    save_and_reload(tmp_path)
    assert same(module.result_image(), pixels)


def test_another_colour_space_is_set_right(module, tmp_path):
    module.write_result(picture(seed=4)).colorspace_settings.name = "sRGB"
    pixels = picture()
    assert same(module.write_result(pixels), pixels)
    save_and_reload(tmp_path)
    assert same(module.result_image(), pixels)


def test_a_linked_image_of_the_name_is_left_alone(module, tmp_path):
    linked = picture(seed=2)
    module.write_result(linked)
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.images = ["SCFPF Render"]
    pixels = picture()
    image = module.write_result(pixels)
    assert image.library is None and same(image, pixels)
    other = next(one for one in bpy.data.images if one.library)
    assert same(other, linked)


def test_editors_that_show_the_image_go_on_showing_it(module):
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = image = module.write_result(picture())
    module.write_result(picture(64, 48))
    assert area.spaces.active.image == image


def load_as_stored(path):
    """The values in a file, unconverted."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    pixels = content(image)
    bpy.data.images.remove(image)
    return pixels


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def plain_picture():
    """Values between 0 and 1 with alphas that leave the division of 8-bit files exact enough."""
    generator = np.random.default_rng(3)
    pixels = generator.random((20, 30, 4)).astype(np.float32)
    pixels[..., 3] = 0.25 + 0.75 * pixels[..., 3]
    pixels[..., :3] *= pixels[..., 3:]
    return pixels


def test_png_holds_the_view_transform_of_the_pixels(module, files, tmp_path):
    scene = bpy.context.scene
    scene.render.dither_intensity = 0.0
    pixels = plain_picture()
    image = module.write_result(pixels)
    straight = pixels[..., :3].astype(np.float64) / pixels[..., 3:]
    scene.view_settings.view_transform = "Standard"
    standard = load_as_stored(files.save_result(image, str(tmp_path / "standard.png"), scene))
    # Half a step of 8 bits, and a little for float32.
    assert standard[..., :3] == pytest.approx(srgb(straight), abs=0.51 / 255)
    assert standard[..., 3] == pytest.approx(pixels[..., 3], abs=0.51 / 255)
    scene.view_settings.view_transform = "Raw"
    raw = load_as_stored(files.save_result(image, str(tmp_path / "raw.png"), scene))
    assert raw[..., :3] == pytest.approx(straight, abs=0.51 / 255)


def test_the_scenes_view_transform_is_that_of_a_render(module, files, tmp_path):
    """The same colour by Cycles and by SCFPF gives the same PNG under AgX."""
    scene = bpy.context.scene
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.exposure = 0.3
    scene.render.engine, scene.render.dither_intensity = "CYCLES", 0
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 4, 4, 100
    scene.render.image_settings.file_format = "PNG"
    world = scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    color = (0.9, 0.3, 0.05)
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*color, 1)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.filepath = str(tmp_path / "cycles.png")
    bpy.ops.render.render(write_still=True)
    pixels = np.ones((4, 4, 4), np.float32)
    pixels[..., :3] = color
    ours = files.save_result(module.write_result(pixels), str(tmp_path / "ours.png"), scene)
    theirs = load_as_stored(tmp_path / "cycles.png")
    # One step of 8 bits, should the two round apart.
    assert load_as_stored(ours) == pytest.approx(theirs, abs=1.01 / 255)
    assert np.abs(load_as_stored(ours)[..., :3] - srgb(np.array(color))).max() > 0.05


def test_exr_holds_the_pixels_themselves(module, files, tmp_path):
    scene = bpy.context.scene
    scene.view_settings.view_transform = "AgX"
    pixels = picture()
    written = files.save_result(module.write_result(pixels), str(tmp_path / "linear.exr"), scene)
    assert load_as_stored(written).tobytes() == pixels.tobytes()


def settings_of(scene):
    names = ("file_format", "color_mode", "color_depth", "compression", "media_type")
    return {name: getattr(scene.render.image_settings, name, None) for name in names}


def test_the_extension_chooses_the_format_and_the_scene_keeps_its_own(module, files, tmp_path):
    scene = bpy.context.scene
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode, scene.render.image_settings.color_depth = "BW", "16"
    before = settings_of(scene)
    image = module.write_result(plain_picture())
    starts = {".png": b"\x89PNG", ".exr": b"v/1\x01", ".jpg": b"\xff\xd8", ".tif": b"II*", ".webp": b"RIFF"}
    for extension, start in starts.items():
        path = tmp_path / f"picture{extension}"
        assert files.save_result(image, str(path), scene) == str(path)
        assert path.read_bytes().startswith(start)
        assert settings_of(scene) == before
    # PNG is the scene's own format: its grey and 16 bits count.
    assert (tmp_path / "picture.png").read_bytes()[24:26] == bytes([16, 0])
    assert files.save_result(image, str(tmp_path / "bare"), scene) == str(tmp_path / "bare.png")


def test_a_path_that_cannot_be_written_is_one_clear_error(module, files, tmp_path):
    scene = bpy.context.scene
    image = module.write_result(plain_picture())
    before = settings_of(scene)
    (tmp_path / "folder.png").mkdir()
    blocked = tmp_path / "file"
    blocked.write_text("")
    cases = {
        tmp_path / "none" / "picture.png": "no folder",
        tmp_path / "folder.png": "it is a folder",
        blocked / "picture.png": "no folder",
        tmp_path / "picture.abc": "use one of",
        tmp_path / f"{'x' * 300}.exr": "Cannot write",
    }
    for path, message in cases.items():
        with pytest.raises(files.UserError, match=message) as caught:
            files.save_result(image, str(path), scene)
        assert "\n" not in str(caught.value)
        assert settings_of(scene) == before


@contextlib.contextmanager
def full_disk(left):
    """Limit files to a number of bytes, as on a full disk."""
    # Not on Windows; Blender is told by an error there as well as here.
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (left, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("ending", [".png", ".exr", ".jpg", ".tif", ".webp"])
def test_a_full_disk_is_reported_and_the_earlier_image_stays(module, files, addon, tmp_path, ending):
    """Blender 4.5 and 5.2 report no error for an incomplete PNG, WebP or TIFF."""
    is_whole = addon("bridge.blender.atomic_files").is_complete_image
    scene = bpy.context.scene
    path = tmp_path / f"picture{ending}"
    image = module.write_result(picture(160, 120))
    assert files.save_result(image, str(path), scene) == str(path)
    whole = path.read_bytes()
    assert is_whole(path)
    path.write_bytes(b"an earlier picture")
    for left in (0, 3, len(whole) // 2, len(whole) - 1000):
        with full_disk(left), pytest.raises(files.UserError, match="annot write"):
            files.save_result(image, str(path), scene)
        assert path.read_bytes() == b"an earlier picture"
    assert os.listdir(tmp_path) == [path.name], "nothing else is left behind"
    files.save_result(image, str(path), scene)
    assert path.stat().st_size == len(whole) and is_whole(path)
    if ending != ".exr":  # Blender itself reports an EXR that it could not write.
        for end in {*range(0, 40), *range(len(whole) - 40, len(whole)), *range(0, len(whole), 997)}:
            path.write_bytes(whole[:end])
            assert not is_whole(path), end


def test_the_image_goes_where_a_link_points_and_keeps_the_file_s_permissions(module, files, tmp_path):
    scene, image = bpy.context.scene, module.write_result(plain_picture())
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "real.png", tmp_path / "link.png"
    target.write_bytes(b"")
    target.chmod(0o640)
    link.symlink_to(target)
    files.save_result(image, str(link), scene)
    assert link.is_symlink() and target.stat().st_mode & 0o777 == 0o640
    assert target.read_bytes()[:4] == b"\x89PNG"
