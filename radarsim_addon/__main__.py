# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m radarsim_addon`` is the ``radarsim`` command."""

import sys

from .signal.pipeline import main

sys.exit(main())
