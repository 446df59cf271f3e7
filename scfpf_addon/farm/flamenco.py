# SPDX-License-Identifier: GPL-3.0-or-later
"""The job type for Flamenco 3: a script in JavaScript with the task that workers run. Imports no bpy."""

from __future__ import annotations

import json
from pathlib import Path

from .template import SCRIPT

NAME = "scfpf_render.js"
SOURCE = Path(__file__).with_name(NAME)
# The place of the task in the source.
PLACE = '"@TASK@"'


def job_type() -> str:
    """The script that Flamenco's manager loads."""
    task = json.dumps(SCRIPT.read_text(encoding="utf-8"))
    return SOURCE.read_text(encoding="utf-8").replace(PLACE, task)
