# SPDX-License-Identifier: GPL-3.0-or-later
"""Property-based tests: no time limits (machines differ), and the same examples every time in CI."""

import os

from hypothesis import HealthCheck, settings

SLOW = [HealthCheck.too_slow]
settings.register_profile("scfpf", max_examples=50, deadline=None, suppress_health_check=SLOW)
settings.register_profile("scfpf-ci", settings.get_profile("scfpf"), derandomize=True)
settings.load_profile("scfpf-ci" if os.environ.get("CI") else "scfpf")
