# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that earlier versions have saved keep their values and their images."""

import json

import bpy
import earlier_file
import numpy as np
import pytest

FILES = sorted(earlier_file.FOLDER.glob("version_*.blend"))
# Of a channel: float16 keeps 1/2000 of it.
TOLERANCE = 2e-3


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_of_an_earlier_version_opens_and_renders_as_before(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    found = earlier_file.values()
    for name, value in json.loads(path.with_suffix(".json").read_text()).items():
        assert found.get(name) == value, name
    rendered = earlier_file.images()
    with np.load(path.with_suffix(".npz")) as before:
        assert set(rendered) == set(before)
        for name in before:
            change = np.abs(rendered[name].astype(np.float64) - before[name].astype(np.float64))
            assert change.max() < TOLERANCE, f"{name}: {change.max():.3g}"
