# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of dev.py. They need only the standard library and Python 3.9."""
