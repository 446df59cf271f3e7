# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera: control surfaces, projector bases, viewing volume, re-parameterisation.

Pure NumPy, float64. See paper §3 and §4.1.
"""
