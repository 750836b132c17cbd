# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for the types of numpy arrays. Each states the element type; shapes are in docstrings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
Int32 = NDArray[np.int32]
Indices = NDArray[np.intp]
