# SPDX-License-Identifier: GPL-3.0-or-later
"""Random sessions in Blender, seed after seed, until the time is over.

    python3 dev.py bench --soak [--minutes 60] [--seed 1000] [--steps 150]

Each seed is a process of its own, so that a crash ends one session only; what it did last is printed, and
the same seed does the same again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TEST = "tests/blender/whole/test_random_sessions.py::test_random_session"
# The most seconds that one session may take.
LONGEST = 900


def session(seed: int, steps: int, folder: str) -> str:
    """Run one seed; what went wrong, or nothing."""
    chosen = {"SCFPF_SEEDS": f"{seed}:{seed + 1}", "SCFPF_STEPS": str(steps), "SCFPF_JOURNAL": folder}
    command = [sys.executable, "-X", "faulthandler", "-m", "pytest", "-q", "--tb=short", TEST]
    try:
        ran = subprocess.run(
            command, cwd=ROOT, env=os.environ | chosen, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return f"took more than {LONGEST} s"
    if ran.returncode == 0:
        return ""
    journal = Path(folder, f"{seed}.txt")
    last = journal.read_text().splitlines()[-5:] if journal.exists() else []
    # Where Blender itself ended: the first lines of what faulthandler writes, not the last.
    where = ran.stderr[:1500]
    return "\n".join([f"ended with {ran.returncode} after", *last, ran.stdout[-3000:], where])


def main() -> None:
    """The command line; the exit code is the number of seeds at fault."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1000, help="the first one")
    parser.add_argument("--steps", type=int, default=150)
    options = parser.parse_args()
    end, seed, faults = time.monotonic() + 60 * options.minutes, options.seed, 0
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < end:
            fault = session(seed, options.steps, folder)
            faults += bool(fault)
            print(f"seed {seed}: {fault or 'nothing wrong'}", flush=True)
            seed += 1
    took = os.times()
    minutes = (took.children_user + took.children_system) / 60
    print(
        f"{seed - options.seed} sessions of {options.steps} steps, {minutes:.0f} minutes of CPU time, "
        f"{faults} at fault"
    )
    sys.exit(min(faults, 99))


if __name__ == "__main__":
    main()
