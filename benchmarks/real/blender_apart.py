# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements in a Blender of their own: figures do not depend on what another one has left in memory.

A script that measures calls itself with options that its help does not show, and prints its figures as the
last line that begins with a brace. What Blender prints beside them is left out, unless the measurement fails.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

# Characters of a failed measurement's output that are shown.
SHOWN = 2000


def run_apart(script: str, *arguments: str) -> dict[str, Any]:
    """The figures that a script prints when another Python runs it; exits if it fails."""
    command = [sys.executable, script, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{arguments} could not be measured:\n{done.stdout[-SHOWN:]}{done.stderr[-SHOWN:]}")
    return json.loads(next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{")))
