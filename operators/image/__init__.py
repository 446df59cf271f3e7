# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on the image: render, pick, find."""
