# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of one checkout in a file, so that they need not be measured again."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.reading import Place, Values

Results = dict[str, dict[Place, Values]]
"""By case, then by place."""


@dataclass(frozen=True)
class Record:
    """Results, and under which versions of Blender, Python and numpy they were measured."""

    versions: dict[str, str]
    results: Results


def write_record(path: Path, record: Record) -> None:
    """Write a record as compressed .npz; ``numpy.load`` needs no pickle for it."""
    places = [(case, place) for case, found in record.results.items() for place in found]
    index = {
        "versions": record.versions,
        "cases": list(record.results),
        "places": [[case, place.file, place.key] for case, place in places],
    }
    arrays: dict[str, Any] = {
        f"a{n}": record.results[case][place] for n, (case, place) in enumerate(places)
    }
    with path.open("wb") as stream:
        np.savez_compressed(stream, index=np.array(json.dumps(index)), **arrays)


def read_record(path: Path) -> Record:
    """Read a record.

    Raises
    ------
    OSError, ValueError, KeyError
        No such file, or no record.
    """
    with np.load(path, allow_pickle=False) as arrays:
        index = json.loads(str(arrays["index"]))
        results: Results = {case: {} for case in index["cases"]}
        for number, (case, file, key) in enumerate(index["places"]):
            results[case][Place(file, key)] = arrays[f"a{number}"]
    return Record(index["versions"], results)
