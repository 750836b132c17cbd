# SPDX-License-Identifier: GPL-3.0-or-later
"""Changed inputs against the command line; ``python -m tests.fuzz`` or ``make fuzz``."""
