# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewing volume Q(u, v, t): bases, evaluation, inverse, folds, re-parameterisation."""
