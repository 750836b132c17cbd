# SPDX-License-Identifier: GPL-3.0-or-later
"""Which groups of cases there are, in the order of the report."""

from __future__ import annotations

import importlib

from .case import Case, Group

#: Modules of this package that hold a GROUP.
MODULES = (
    "radiometric",
    "spheres",
    "rough_surfaces",
    "clutter",
    "fresnel",
    "materials",
    "slabs",
    "buildings",
    "scale",
    "antennas",
    "speckle",
    "paper_chain",
    "moving_echoes",
    "detection",
    "angles",
    "energy",
    "motion",
    "weather",
    "mirrors",
    "reverse_paths",
    "coverage",
    "other_programs",
)


def groups(names: list[str] | None = None, quick: bool = False) -> list[Group]:
    """Groups by key, all where None; those that hold a quick case, with these alone, if asked."""
    found = [importlib.import_module(f"{__package__}.{name}").GROUP for name in MODULES]
    if names:
        unknown = sorted(set(names) - {g.key for g in found})
        if unknown:
            known = ", ".join(g.key for g in found)
            raise KeyError(f"no group {', '.join(unknown)}; there are: {known}")
        found = [g for g in found if g.key in names]
    if not quick:
        return found
    kept = [(g, tuple(c for c in g.cases if c.quick)) for g in found]
    return [Group(g.key, g.title, g.text, cases) for g, cases in kept if cases]


def limit_s(found: list[Group]) -> float:
    """Processor time that the cases may take together [s]."""
    cases: list[Case] = [case for group in found for case in group.cases]
    return sum(case.limit_s for case in cases)
