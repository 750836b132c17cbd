# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of ``make bench``; scripts/bench.py runs them and prints the table."""
