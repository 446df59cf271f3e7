# SPDX-License-Identifier: GPL-3.0-or-later
"""Property-based tests: no time limits (machines differ), and the same examples every time in CI.

What one Blender is enough for is marked here.
"""

import os
import pathlib

import pytest
from hypothesis import HealthCheck, settings

SLOW = [HealthCheck.too_slow]
settings.register_profile("scfpf", max_examples=50, deadline=None, suppress_health_check=SLOW)
settings.register_profile("scfpf-ci", settings.get_profile("scfpf"), derandomize=True)
settings.load_profile("scfpf-ci" if os.environ.get("CI") else "scfpf")

TESTS = pathlib.Path(__file__).parent
# Files, folders and tests that get the mark "once": they take long, and what they show hardly depends on the
# version of Blender, Python or NumPy. Shorter ones call the same code on all versions.
ONCE = (
    "aim/test_aim_judge.py",
    "aim/test_contradictions.py",
    "aim/test_detours.py",
    "aim/test_rounds.py",
    "aim/test_sight.py",
    "aim/test_survey.py",
    "blender/aim/test_drag_operator.py",
    "blender/aim/test_drags.py",
    "blender/aim/test_keyed_targets.py::test_a_fault_at_a_key_names_its_frame_and_changes_nothing",
    "blender/aim/test_keyed_targets.py::test_a_keyed_volume_is_solved_again_and_freed",
    "blender/aim/test_outcomes.py",
    "blender/aim/test_solving.py",
    "blender/aim/test_verdict.py",
    "blender/camera/test_screen_camera.py::test_image_on_its_screen_is_what_a_camera_at_the_eye_sees",
    "blender/cycles/test_cycles_any_volume.py::test_the_rig_shows_what_the_exact_caster_sees",
    "blender/cycles/test_cycles_cautions.py::test_a_node_is_named_if_its_picture_differs",
    "blender/cycles/test_cycles_cautions.py::test_a_node_of_the_world_is_named_if_its_picture_differs",
    "blender/cycles/test_cycles_denoising.py",
    "blender/cycles/test_cycles_follows.py::test_sheets_follow_every_kind_of_surface",
    "blender/cycles/test_cycles_light.py::test_the_light_is_that_of_cycles_own_cameras[equirectangular]",
    "blender/cycles/test_cycles_light.py::test_the_light_is_that_of_cycles_own_cameras[stereographic]",
    "blender/cycles/test_cycles_materials.py",
    "blender/cycles/test_cycles_moving.py::test_a_moving_volume_skips_frame_by_frame",
    "blender/cycles/test_cycles_moving.py::test_an_animation_of_a_moving_volume_in_a_window",
    "blender/cycles/test_cycles_moving.py::test_blurred_things_are_seen",
    "blender/cycles/test_cycles_rig.py::test_cycles_sees_what_the_exact_caster_sees[others]",
    "blender/cycles/test_cycles_skipped_things.py",
    "blender/cycles/test_cycles_skipping.py",
    "blender/cycles/test_street_portals.py",
    "blender/interface/test_languages.py",
    "blender/interface/test_operators.py::test_every_shipped_preset_can_be_added_and_applied",
    "blender/interface/test_ways.py::test_the_price_of_cycles_is_told_before_and_is_the_rigs",
    "blender/layers/test_layers_cycles.py::test_a_layer_seen_by_the_cameras_own_twin_is_the_plain_render",
    "blender/render/test_blenders_own_drawing.py::test_blenders_drawing_is_shown_where_it_fits_the_view",
    "blender/render/test_render_engine.py::test_processes_make_the_parts_of_one_image",
    "blender/render/test_sampling.py",
    "blender/render/test_stylised.py::test_a_drawn_image_has_the_passes_of_a_plain_one",
    "blender/scanline/test_scanline_folds.py::test_faces_that_no_ray_reaches_wholly_are_counted",
    "blender/scanline/test_scanline_pictures.py::test_random_one_to_one_volumes",
    "blender/scanline/test_scanline_pictures.py::test_undivided_checkered_quads_look_as_the_caster_draws_them",
    "blender/scanline/test_scanline_pictures.py::test_volumes_with_folds_pieces_and_seams",
    "blender/scanline/test_scanline_remap.py::test_curved_kinds_are_exact_from_their_parameters",
    "blender/scanline/test_scanline_remap.py::test_random_one_to_one_volumes_of_every_basis",
    "blender/scene/test_hard_scenes.py::test_there_is_an_image",
    "blender/scene/test_light_settings.py",
    "blender/scene/test_rough_reflections.py",
    "blender/scene/test_see_through.py",
    "blender/scene/test_shadow_catchers.py",
    "blender/scene/test_world.py",
    "blender/surfaces/test_surface_tools.py::test_as_many_points_as_keep_the_image_if_nothing_else_is_said",
    "blender/surfaces/test_surface_tools.py::test_equalised_steps_are_even_on_the_same_surface",
    "blender/surfaces/test_surface_tools.py::test_surface_to_patch_to_grid_without_changing_the_image",
    "blender/whole/test_all_or_nothing.py",
    "blender/whole/test_compositions.py",
    "blender/whole/test_corpus.py",
    "blender/whole/test_demo.py",
    "blender/whole/test_gallery.py",
    "blender/whole/test_gallery_figures.py",
    "blender/whole/test_malformed_properties.py",
    "blender/whole/test_real_benchmarks.py",
    "blender/whole/test_recipes.py",
    "casting/cells/test_float32_rays.py::test_no_ray_hits_anything_in_an_empty_chord",
    "casting/cells/test_occupied_chords.py",
    "casting/curves/test_chord_plan.py::test_points_of_chords_are_seen_where_their_pixel_is",
    "casting/exact/test_b_spline_projectors.py",
    "casting/exact/test_bound.py",
    "casting/exact/test_exact_extremes.py",
    "casting/exact/test_exact_million.py",
    "casting/exact/test_exact_reference.py",
    "casting/exact/test_rational_projectors.py",
    "casting/scene/test_large_things.py::test_exact_silhouettes_beside_one_large_thing",
    "casting/scene/test_large_things.py::test_silhouettes_beside_one_large_thing",
    "casting/exact/test_thin_things.py",
    "casting/layers/test_layered_cast.py::test_the_nearest_key_of_all_is_in_front",
    "casting/scene/test_culling.py::test_what_is_seen_is_the_same",
    "casting/scene/test_occupancy.py",
    "casting/whole/test_cast_reference.py",
    "casting/whole/test_cast_volumes.py::test_a_scene_far_from_the_origin_looks_the_same",
    "casting/whole/test_counts.py",
    "projection/presets/test_preset_folder.py::test_no_preset_folds_or_mirrors",
    "projection/surfaces/test_kinds_high_precision.py",
    "projection/surfaces/test_nurbs.py::test_basis_functions_are_those_of_the_definition",
    "projection/volume/test_folds.py::test_no_preset_folds_in_float32",
    "projection/volume/test_inverse.py::test_every_preset_gives_back_the_place_in_the_image",
    "shading/frame/test_adaptive.py::test_it_comes_near_the_image_of_all_samples_with_fewer",
    "shading/frame/test_adaptive.py::test_samples_of_a_moment_are_cast_together_and_the_same",
    "shading/frame/test_pass_vectors.py::test_cryptomattes_are_shares_of_the_image",
    "shading/frame/test_stopping_frames.py::test_tiles_look_before_all_rays",
    "shading/frame/test_stylised.py::test_a_balls_outline_lies_on_its_silhouette",
    "shading/frame/test_stylised.py::test_a_border_and_threads_make_no_difference",
    "shading/lights/test_light_culling.py::test_no_light_that_reaches_something_is_culled",
    "shading/lights/test_sky.py::test_occlusion_of_the_sky_is_unbiased",
    "shading/lights/test_sky_model.py",
    "shading/picking/test_seen.py",
    "test_architecture.py",
    "test_dev.py",
    "test_documents.py",
)


def pytest_collection_modifyitems(items):
    """Mark what one Blender is enough for. A test's name stands for it with all of its parameters."""
    for entry in ONCE:
        assert (TESTS / entry.partition("::")[0]).exists(), (
            f"tests/conftest.py marks what is not there: {entry}"
        )
    for item in items:
        place = item.path.relative_to(TESTS).as_posix() if item.path.is_relative_to(TESTS) else ""
        names = {f"{place}::{item.name}", f"{place}::{item.name.partition('[')[0]}", place}
        names |= {folder.as_posix() for folder in pathlib.PurePosixPath(place).parents}
        if names & set(ONCE):
            item.add_marker(pytest.mark.once)
