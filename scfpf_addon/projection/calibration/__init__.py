# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrated cameras: read from files of other programs, and framed."""
