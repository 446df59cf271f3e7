# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs for render farms: Open Job Description templates, a job type for Flamenco, and the task that both run.

``template`` and ``flamenco`` import no bpy.
"""
