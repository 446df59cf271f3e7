# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes, targets, placement and errors of all operators."""
