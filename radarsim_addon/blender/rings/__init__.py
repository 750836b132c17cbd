# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring sampling, the acquisition of the paper: render results as EXR files, checked."""

from .ring_job import RingJob

__all__ = ["RingJob"]
