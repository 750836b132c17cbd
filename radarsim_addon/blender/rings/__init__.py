# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring sampling, the sampling mode of the paper (`ring_job`).

One Cycles render for each ring of ranges and snapshot, limited to the pixels that the ring can
fill, written as an EXR file and checked.
"""

from .ring_job import RingJob

__all__ = ["RingJob"]
