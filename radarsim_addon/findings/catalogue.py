# SPDX-License-Identifier: GPL-3.0-or-later
"""All codes of findings with their texts, from ``catalogue.md`` in this folder.

The file has a heading for each topic (``# Motion``) and each code (``## echoes-cancel (caution)``).
Three paragraphs follow a code: what happened, why it matters, what to do. They name the finding's
numbers in braces, with Python's format specifications or those of records.py (``percent``,
``length``, ``frequency``, ``#noun``, ``is|are``); ``{subjects}`` lists the names.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

Severity = Literal["info", "caution", "error"]


@dataclass(frozen=True)
class Kind:
    """Severity and templates (what happened, why it matters, what to do) of a kind of finding.

    "info": nothing is wrong; "caution": a result may not mean what you expect; "error": the
    results concerned are wrong or empty.
    """

    severity: Severity
    text: str
    cause: str
    remedy: str


def read_topics(text: str) -> dict[str, dict[str, Kind]]:
    """Return the kinds of findings by topic and code, in the order of a text like the catalogue.

    ValueError: a code occurs twice, or does not have a severity and three paragraphs.
    """
    topics: dict[str, dict[str, Kind]] = {}
    for chapter in text.split("\n# ")[1:]:
        topic, *entries = chapter.split("\n## ")
        kinds = topics[topic.strip()] = {}
        for entry in entries:
            heading, *paragraphs = (" ".join(part.split()) for part in entry.strip().split("\n\n"))
            code, _, severity = heading.rstrip(")").partition(" (")
            taken = any(code in others for others in topics.values())
            if taken or severity not in get_args(Severity) or len(paragraphs) != 3:
                raise ValueError(
                    f"Finding {heading!r} has {len(paragraphs)} paragraphs; expected a code that "
                    f"is not taken, one of {', '.join(get_args(Severity))}, and 3 paragraphs."
                )
            kinds[code] = Kind(cast(Severity, severity), *paragraphs)
    return topics


#: Codes by topic, in the order of the reference page.
TOPICS = read_topics(Path(__file__).with_suffix(".md").read_text(encoding="utf-8"))
#: Codes that say why a frame has no echo.
NO_ECHO_CODES = frozenset(TOPICS["No echo"]) | {"no-echo"}
CATALOGUE: dict[str, Kind] = {
    code: kind for topic in TOPICS.values() for code, kind in topic.items()
}
"""All kinds of findings by their code."""
