# SPDX-License-Identifier: GPL-3.0-or-later
"""The job type for Flamenco 3: a script in JavaScript with the task that workers run. Imports no bpy."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path

from .template import SCRIPT

NAME = "scfpf_render.js"
SOURCE = Path(__file__).with_name(NAME)
# The place of the task in the source.
PLACE = '"@TASK@"'


def job_type() -> str:
    """The script that Flamenco's manager loads."""
    # Windows passes at most 32,767 characters to a program.
    packed = zlib.compress(SCRIPT.read_bytes(), 9)
    task = json.dumps(base64.b64encode(packed).decode())
    return SOURCE.read_text(encoding="utf-8").replace(PLACE, task)
