# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference page of all findings: ``python -m radarsim_addon.findings > docs/findings.md``."""

from __future__ import annotations

import string

from .catalogue import TOPICS

_INTRODUCTION = """# Findings

A finding tells you what went wrong, or what to know before you trust a result. The console, the
panel and the JSON files (key `findings`) show the same findings. Each entry states what happened,
why it matters, and what to do (→). A name in `code style` stands for a number or a name.

- **info**: nothing is wrong. The finding explains how the result was made.
- **caution**: the result may not mean what you expect.
- **error**: the results concerned are wrong or empty.

Written by `python -m radarsim_addon.findings`; do not edit.
"""


def reference_page() -> str:
    """Return ``docs/findings.md``: every code with its texts, in Markdown."""
    parts = [_INTRODUCTION]
    for topic, kinds in TOPICS.items():
        parts.append(f"## {topic}\n")
        for code, kind in kinds.items():
            parts.append(f"### `{code}` ({kind.severity})\n")
            parts.append(f"{_readable(kind.text)} {_readable(kind.cause)}\n")
            parts.append(f"→ {_readable(kind.remedy)}\n")
    return "\n".join(parts).rstrip() + "\n"


def _readable(template: str) -> str:
    """Return a template with the names of its numbers in place of braces."""
    text = ""
    for before, name, spec, _ in string.Formatter().parse(template):
        text += before
        if name is not None:
            spec = spec or ""
            if "|" in spec:
                text += spec.partition("|")[2]
                continue
            text += f"`{name}`" + (f" {spec[1:]}s" if spec.startswith("#") else "")
            text += " %" if spec == "percent" else ""
    return text


if __name__ == "__main__":
    print(reference_page(), end="")
