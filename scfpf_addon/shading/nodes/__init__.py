# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes as operations on arrays."""
