# SPDX-License-Identifier: GPL-3.0-or-later
"""Names: what is called otherwise in the new version, and what is not compared, with the reason."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.comparison.reading import Place, Values

RENAMES_FILE = Path(__file__).with_name("renames.json")


@dataclass(frozen=True)
class Removed:
    """Numbers that the new version no longer writes: patterns of file and key, and the reason."""

    file: str
    key: str
    reason: str


@dataclass(frozen=True)
class Renames:
    """Old names and the new ones; patterns are regular expressions that fit the whole name.

    Attributes
    ----------
    options
        Option of ``process`` (``--name``, or ``--name=value``) -> what it is called in versions
        whose ``--help`` does not list the old one.
    files
        (pattern, new name); ``\\1`` in the new name is the first group of the pattern.
    keys
        (pattern of the old file, pattern of the key, new key).
    removed
        What is missing on purpose.
    """

    options: Mapping[str, str] = field(default_factory=dict)
    files: tuple[tuple[str, str], ...] = ()
    keys: tuple[tuple[str, str, str], ...] = ()
    removed: tuple[Removed, ...] = ()

    def new_place(self, old: Place) -> Place:
        """The place in the new version; rules apply one after another."""
        file, key = old
        for pattern, new in self.files:
            file = _replaced(pattern, new, file)
        for file_pattern, pattern, new in self.keys:
            if re.fullmatch(file_pattern, old.file):
                key = _replaced(pattern, new, key)
        return Place(file, key)

    def is_removed(self, old: Place) -> bool:
        """Whether the new version leaves this out on purpose."""
        return any(
            re.fullmatch(rule.file, old.file) and re.fullmatch(rule.key, old.key)
            for rule in self.removed
        )


def _replaced(pattern: str, new: str, name: str) -> str:
    match = re.fullmatch(pattern, name)
    return name if match is None else match.expand(new)


def read_renames(path: Path = RENAMES_FILE) -> Renames:
    """Renames from a JSON file; see ``scripts/comparison/README.md`` for its form.

    Raises
    ------
    ValueError
        Not JSON, an unknown entry, or a pattern that is no regular expression.
    """
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    strange = sorted(set(data) - {"options", "files", "keys", "removed"})
    if strange:
        raise ValueError(f"{path} holds {', '.join(strange)}; expected options, files, keys...")
    renames = Renames(
        options=dict(data.get("options", {})),
        files=tuple((old, new) for old, new in data.get("files", [])),
        keys=tuple((file, old, new) for file, old, new in data.get("keys", [])),
        removed=tuple(Removed(*rule) for rule in data.get("removed", [])),
    )
    patterns = [
        *(old for old, _ in renames.files),
        *(pattern for rule in renames.keys for pattern in rule[:2]),
        *(pattern for gone in renames.removed for pattern in (gone.file, gone.key)),
    ]
    for pattern in patterns:
        try:
            re.compile(pattern)
        except re.error as error:
            raise ValueError(f"{path}: {pattern!r} is no regular expression ({error}).") from error
    return renames


#: What differs from run to run or from version to version, though all that was measured is alike:
#: patterns of file and key, and the reason.
EXCLUDED: tuple[Removed, ...] = (
    Removed(r".*", r"(.*[.@])?versions\..*", "versions of the programs"),
    Removed(r".*", r"(.*[.@:])?(schema|schema_version|layout_version)", "version of the format"),
    Removed(r".*\.h5", r"@software", "version of the program"),
    Removed(r".*\.sigmf-meta", r"global\.core:(recorder|version)", "version of the program"),
    Removed(r".*", r"(.*\.)?\w+_sha256(\..*)?", "hash of a file whose content is compared"),
    Removed(r".*\.sigmf-meta", r"global\.core:sha512", "hash of a file whose content is compared"),
    Removed(r".*", r"(.*\.)?\w*fingerprint", "hash of settings and meshes by their names"),
    Removed(r".*", r"(.*\.)?blend_file", "where the scene lies"),
    Removed(r".*", r"(.*\.)?render_time_s", "how long it took"),
    Removed(r".*", r"(.*\.)?(cpu_s|wall_s)", "how long it took"),
    Removed(r".*", r"(.*[.@])?(warnings|findings)(\..*|\[.*)?", "texts for people"),
    Removed(r"demo/summary\.json", r"time_s\..*", "how long it took"),
    Removed(r"demo/summary\.json", r"peak_memory_mib\..*", "how much memory it took"),
)


def compared(
    results: Mapping[Place, Values], excluded: Iterable[Removed] = EXCLUDED
) -> dict[Place, Values]:
    """Results without what is excluded."""
    rules = [(re.compile(rule.file), re.compile(rule.key)) for rule in excluded]
    return {
        place: values
        for place, values in results.items()
        if not any(f.fullmatch(place.file) and k.fullmatch(place.key) for f, k in rules)
    }
