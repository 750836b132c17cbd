# SPDX-License-Identifier: GPL-3.0-or-later
"""Example scenes: each module has ``build()``, which makes its scene in an empty file.

``python scripts/make_examples.py`` writes them to blend_examples/, with their pictures if asked.
"""

from . import drone, indoor, sea, street

EXAMPLES = {"street": street, "sea": sea, "drone": drone, "indoor": indoor}
"""Modules of the scenes by the names of their files."""
