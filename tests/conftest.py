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
# Files and folders whose tests get the mark "once": they take long, and what they show hardly depends on the
# version of Blender, Python or NumPy. Other tests call the same code on all versions.
ONCE = (
    "blender/aim/test_solving.py",
    "blender/aim/test_verdict.py",
    "blender/cycles/test_cycles_skipping.py",
    "blender/cycles/test_street_portals.py",
    "blender/interface/test_languages.py",
    "blender/whole/test_compositions.py",
    "blender/whole/test_gallery.py",
    "blender/whole/test_gallery_figures.py",
    "blender/whole/test_real_benchmarks.py",
    "blender/whole/test_recipes.py",
    "casting/aim",
    "casting/cells/test_occupied_chords.py",
    "casting/exact/test_b_spline_projectors.py",
    "casting/exact/test_bound.py",
    "casting/exact/test_exact_extremes.py",
    "casting/exact/test_exact_million.py",
    "casting/exact/test_exact_reference.py",
    "casting/exact/test_rational_projectors.py",
    "casting/scene/test_occupancy.py",
    "casting/whole/test_cast_reference.py",
    "shading/picking/test_seen.py",
    "test_architecture.py",
    "test_dev.py",
    "test_documents.py",
)


def pytest_collection_modifyitems(items):
    missing = [name for name in ONCE if not (TESTS / name).exists()]
    assert not missing, f"tests/conftest.py marks what is not there: {missing}"
    once = [TESTS / name for name in ONCE]
    for item in items:
        if any(item.path.is_relative_to(path) for path in once):
            item.add_marker(pytest.mark.once)
