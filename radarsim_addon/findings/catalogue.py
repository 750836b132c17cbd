# SPDX-License-Identifier: GPL-3.0-or-later
"""Every code of a finding, declared once: severity, what happened, why it matters, what to do.

Templates name the finding's numbers in braces, with Python's format specifications or those of
:mod:`.texts` (``percent``, ``length``, ``frequency``, ``#noun``); ``{subjects}`` lists the names.
"""

from __future__ import annotations

from .kinds import Kind
from .path_kinds import MIRRORS, MOTION, NO_ECHO, PATHS
from .processing_kinds import COVERAGE, PROCESSING, ROUGHNESS
from .scene_kinds import SCENE
from .settings_kinds import RUNS, SETTINGS

#: Codes by topic, in the order of the reference page.
TOPICS: dict[str, dict[str, Kind]] = {
    "Scene and materials": SCENE,
    "Rough surfaces": ROUGHNESS,
    "Settings": SETTINGS,
    "Path measurement": PATHS,
    "Mirrors": MIRRORS,
    "Motion": MOTION,
    "No echo": NO_ECHO,
    "Processing": PROCESSING,
    "Coverage diagrams": COVERAGE,
    "Runs": RUNS,
}
#: Codes that say why a frame has no echo.
NO_ECHO_CODES = frozenset(NO_ECHO) | {"no-echo"}
CATALOGUE: dict[str, Kind] = {
    code: kind for topic in TOPICS.values() for code, kind in topic.items()
}
"""All kinds of findings by their code."""
