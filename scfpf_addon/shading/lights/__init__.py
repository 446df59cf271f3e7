# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights, the sky, shadows, and which of them a frame needs."""
