# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylised images: lines, hatching, tones in steps, paper."""
