# SPDX-License-Identifier: GPL-3.0-or-later
"""The array type of shading arithmetic and of the film."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Single: TypeAlias = NDArray[np.float32]
