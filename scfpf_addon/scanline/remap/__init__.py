# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that place scene geometry in the viewbox."""
