# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators of Aim: targets added, moved and removed, and the volume solved for them."""
