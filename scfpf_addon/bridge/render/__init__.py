# SPDX-License-Identifier: GPL-3.0-or-later
"""Render jobs, the render engine, passes and results."""
