# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on a camera's image layers."""
