# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and operators: they draw and report, nothing else."""

__all__ = []
