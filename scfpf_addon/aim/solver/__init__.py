# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver of Aim: energies of the control net, and Gauss–Newton steps that make them small."""
