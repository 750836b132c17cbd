# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of scripts/compare_results.py: cases, runs, reading of files, names, differences."""
