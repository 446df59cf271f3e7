# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexible cameras: made, edited, and read as projections."""
