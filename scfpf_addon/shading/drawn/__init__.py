# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as if drawn: lines, hatching, tones in steps, paper."""
