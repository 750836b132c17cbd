#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Name each number that differs between two checkouts of radarsim, and by how much.

    python scripts/compare_results.py OLD_CHECKOUT NEW_CHECKOUT [--only CASE ...]
    python scripts/compare_results.py OLD_CHECKOUT --record FILE
    python scripts/compare_results.py NEW_CHECKOUT --against FILE

Both render and process the same scenes (tests/data/compare); every number in their files is
compared, to the last bit. What is called otherwise in the new version is said in
scripts/comparison/renames.json, see the README there. A record is of one version of Blender.

Exit codes: 0 all numbers are the same, 1 some differ or are missing, 2 something cannot be run.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from scripts.comparison.cases import CASES, Case, chosen_cases  # noqa: E402
from scripts.comparison.differences import Comparison, compare  # noqa: E402
from scripts.comparison.names import Renames, compared, read_renames  # noqa: E402
from scripts.comparison.reading import Place  # noqa: E402
from scripts.comparison.record import Record, Results, read_record, write_record  # noqa: E402
from scripts.comparison.running import (  # noqa: E402
    CannotRunError,
    Checkout,
    open_checkout,
    results_of,
)

SAME, DIFFERENT, CANNOT_RUN = 0, 1, 2


def parse_arguments(argv: list[str] | None) -> argparse.Namespace:
    """Options of the command line; argparse exits with 2 for bad ones."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkouts", nargs="*", type=Path, metavar="CHECKOUT", help="old, new")
    parser.add_argument("--only", nargs="+", metavar="CASE", help="these cases [all but slow ones]")
    parser.add_argument("--slow", action="store_true", help="the slow cases too")
    parser.add_argument("--list", action="store_true", help="name the cases")
    parser.add_argument(
        "--python", default=sys.executable, metavar="PY", help="Python with bpy [this one]"
    )
    parser.add_argument("--keep", type=Path, metavar="DIR", help="new folder that keeps all files")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep one checkout's numbers")
    parser.add_argument("--against", type=Path, metavar="FILE", help="compare with such a record")
    parser.add_argument("--texts", action="store_true", help="list the texts that differ, too")
    chosen = parser.parse_args(argv)
    if chosen.record and chosen.against:
        parser.error("--record and --against do not go together")
    expected = 1 if chosen.record or chosen.against else 2
    if not chosen.list and len(chosen.checkouts) != expected:
        parser.error(f"{len(chosen.checkouts)} checkouts given; expected {expected}")
    return chosen


def main(argv: list[str] | None = None) -> int:
    """Entry of the script; the exit code."""
    chosen = parse_arguments(argv)
    if chosen.list:
        for case in CASES:
            print(f"{case.name:24}{case.what}{' (slow)' if case.slow else ''}")
        return SAME
    try:
        cases = chosen_cases(chosen.only, chosen.slow)
        renames = read_renames()
        with tempfile.TemporaryDirectory(prefix="radarsim-compare-") as temporary:
            work = chosen.keep.absolute() if chosen.keep else Path(temporary)
            work.mkdir(parents=True, exist_ok=True)
            if any(work.iterdir()):
                raise CannotRunError(f"{work} is not empty. Give a new folder to --keep.")
            return _run(chosen, cases, renames, work)
    except (CannotRunError, ValueError, KeyError, OSError) as error:
        print(f"compare_results: {error}", file=sys.stderr)
        return CANNOT_RUN


def _run(chosen: argparse.Namespace, cases: list[Case], renames: Renames, work: Path) -> int:
    names = ["old", "new"] if len(chosen.checkouts) == 2 else ["new"]
    opened = [
        open_checkout(root, chosen.python, work / name)
        for name, root in zip(names, chosen.checkouts)
    ]
    before: Results | None = None
    if chosen.against:
        before = recorded(chosen.against, opened[0])
        cases = recorded_cases(before, chosen.only)
    measured: list[Results] = []
    for name, checkout in zip(names, opened):
        found: Results = {}
        for case in cases:
            try:
                found[case.name] = results_of(case, checkout, work / name / case.name, renames)
            except CannotRunError as error:
                print(f"{case.name}: cannot run under {checkout.root}: {error}", file=sys.stderr)
        measured.append(found)
    complete = all(len(found) == len(cases) for found in measured)
    same = True
    if chosen.record:
        if complete:
            write_record(chosen.record, Record(opened[0].versions, measured[0]))
    else:
        old = measured[0] if before is None else before
        same = report(old, measured[-1], renames, chosen.texts)
    if not complete:
        return CANNOT_RUN
    return SAME if same else DIFFERENT


def recorded(path: Path, checkout: Checkout) -> Results:
    """Results of a record of the checkout's Blender; what was excluded later is left out."""
    record = read_record(path)
    require_same_blender(record, checkout)
    return {case: compared(found) for case, found in record.results.items()}


def recorded_cases(results: Results, only: list[str] | None) -> list[Case]:
    """The cases of a record, or those of them that were asked for."""
    strange = [name for name in only or [] if name not in results]
    if strange:
        raise CannotRunError(f"The record holds no {', '.join(strange)}, only {', '.join(results)}")
    return chosen_cases(only or list(results), slow=True)


def require_same_blender(record: Record, checkout: Checkout) -> None:
    """Raise CannotRunError where a record is of another Blender; warn of other libraries."""
    for what, old in record.versions.items():
        new = checkout.versions.get(what)
        if new == old:
            continue
        said = f"The record was measured with {what} {old}; here is {new}."
        if what == "blender":
            raise CannotRunError(f"{said} Numbers differ between versions of Blender.")
        print(f"compare_results: warning: {said}", file=sys.stderr)


def report(old: Results, new: Results, renames: Renames, texts: bool) -> bool:
    """Print a comparison of the cases that both have; returns whether all numbers are the same."""
    same = True
    for case in old:
        if case not in new:
            continue
        result = compare(old[case], new[case], renames)
        same = same and result.same
        for line in case_lines(case, result, texts):
            print(line)
    return same


def case_lines(case: str, result: Comparison, texts: bool = False) -> list[str]:
    """The report of one case; one line where all is the same."""
    notes = [
        f"{len(found)} {what}"
        for found, what in (
            (result.removed, "removed on purpose"),
            (result.added, "only in new"),
            (result.texts, "texts differ"),
        )
        if found
    ]
    aside = f" ({', '.join(notes)})" if notes else ""
    if result.same:
        head = f"{case}: {result.numbers} numbers are the same{aside}"
    else:
        head = (
            f"{case}: {len(result.differences)} places differ, {len(result.missing)} are missing, "
            f"of {result.numbers} numbers{aside}"
        )
    return [
        head,
        *(f"  {difference}" for difference in result.differences),
        *_grouped("only in old", result.missing),
        *_grouped("only in new", result.added),
        *(f"  text: {text}" for text in result.texts if texts),
    ]


def _grouped(what: str, places: Iterable[Place]) -> list[str]:
    """Places that are on one side, those of one file in one line."""
    listed = list(places)
    counts = Counter(place.file for place in listed)
    lines = []
    for file in counts:
        keys = [place.key for place in listed if place.file == file]
        shown = ", ".join(keys[:6]) + (f" and {len(keys) - 6} more" if len(keys) > 6 else "")
        lines.append(f"  {what}: {file}: {shown}")
    return lines


if __name__ == "__main__":
    sys.exit(main())
