# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of volumes and surfaces as mathematics."""
