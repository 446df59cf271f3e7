# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials made of nodes: plain operations in order, evaluated for all hits of a material at once."""
