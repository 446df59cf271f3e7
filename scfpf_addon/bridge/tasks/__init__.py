# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in threads: a task, and a painter of the latest request."""
