# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of t, depth and (u, v, t) through the Cycles rig, against the exact caster."""

import bpy
import numpy as np
import pytest
from cycles_scenes import RIG_PRESETS, clear_scene, fill_volume, make_volume, switch
from exr import near_edges, read_exr, write_multilayer_exr
