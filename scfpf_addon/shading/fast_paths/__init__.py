# SPDX-License-Identifier: GPL-3.0-or-later
"""Fast paths for straight projectors that are lit by suns alone."""
