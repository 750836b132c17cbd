# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of scripts/validate.py: the program's own chain against closed forms."""
