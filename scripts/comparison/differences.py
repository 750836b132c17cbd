# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of two versions side by side: which differ, by how much, and which are on one side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.comparison.names import Renames
from scripts.comparison.reading import Place, Values

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Difference:
    """Numbers in one place that differ.

    Attributes
    ----------
    place
        In the old version.
    differing, total
        How many numbers differ, of how many.
    largest, largest_relative
        Largest |new - old|, and that over |old|; NaN where neither can be told.
    index
        Of the first that differs.
    old, new
        The two numbers there.
    reason
        Where the arrays cannot be compared number by number: why.
    """

    place: Place
    differing: int
    total: int
    largest: float = np.nan
    largest_relative: float = np.nan
    index: tuple[int, ...] = ()
    old: Any = None
    new: Any = None
    reason: str = ""

    def __str__(self) -> str:
        if self.reason:
            return f"{self.place}: {self.reason}"
        at = f" at {list(self.index)}" if self.index else ""
        return (
            f"{self.place}: {self.differing} of {self.total} differ, by at most "
            f"{self.largest:.3g} (relative {self.largest_relative:.3g}); first{at}: "
            f"{self.old!s} -> {self.new!s}"
        )


@dataclass
class Comparison:
    """What came of comparing two sets of results."""

    numbers: int = 0
    differences: list[Difference] = field(default_factory=list)
    missing: list[Place] = field(default_factory=list)
    removed: list[Place] = field(default_factory=list)
    added: list[Place] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def same(self) -> bool:
        """Whether no number differs and none is missing; new ones and texts do not count."""
        return not self.differences and not self.missing


def is_text(values: Values) -> bool:
    """Whether an array holds something else than numbers and truth values."""
    return values.dtype.kind not in "biufc"


def without_channel(old: Values, new: Values) -> Values:
    """`new` without its leading axis where that is one channel that `old` has no axis for."""
    if new.ndim == old.ndim + 1 and new.shape[0] == 1:
        return np.asarray(new[0])
    return new


def unequal(old: Values, new: Values) -> Mask:
    """Which numbers of two arrays of one shape are not the same to the last bit.

    NaN equals NaN, whatever its bits. Where the types differ, values are compared.
    """
    if old.dtype != new.dtype:
        return np.asarray((old != new) & ~_both_nan(old, new))
    bits = np.dtype((np.void, old.dtype.itemsize))
    plain = [np.ascontiguousarray(part).reshape(-1).view(bits) for part in (old, new)]
    return np.asarray((plain[0] != plain[1]).reshape(old.shape) & ~_both_nan(old, new))


def _both_nan(old: Values, new: Values) -> Mask:
    return np.asarray((old != old) & (new != new))


def compare_arrays(place: Place, old: Values, new: Values) -> Difference | None:
    """The difference of two arrays of numbers, None where there is none.

    Parameters
    ----------
    place
        Of the old array.
    old, new
        Numbers. A leading axis of one channel in `new` alone is left out.
    """
    new = without_channel(old, new)
    if is_text(new):
        return Difference(place, old.size, old.size, reason=f"numbers became text {new!s:.60}")
    if old.shape != new.shape:
        reason = f"shape {old.shape} became {new.shape}"
        return Difference(place, max(old.size, new.size), old.size, reason=reason)
    wrong = unequal(old, new)
    if not wrong.any():
        return None
    index = tuple(int(number) for number in np.argwhere(wrong)[0])
    wide = np.complex128 if "c" in old.dtype.kind + new.dtype.kind else np.float64
    before, after = (part[wrong].astype(wide) for part in (old, new))
    with np.errstate(all="ignore"):
        off = np.abs(after - before)
        relative = off / np.abs(before)
    return Difference(
        place=place,
        differing=int(wrong.sum()),
        total=old.size,
        largest=_largest(off),
        largest_relative=_largest(relative),
        index=index,
        old=old[index],
        new=new[index],
    )


def _largest(values: Values) -> float:
    """Largest number that is not NaN; NaN where all are."""
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


def compare(
    old: Mapping[Place, Values], new: Mapping[Place, Values], renames: Renames
) -> Comparison:
    """Compare the results of one case, without what is excluded.

    Parameters
    ----------
    old, new
        Arrays by place.
    renames
        What places are called in the new version. What already has its new name, as in a record
        of a later version, is found under that.
    """
    result = Comparison()
    left = dict(new)
    for place, before in old.items():
        there = renames.new_place(place)
        if there not in left and place in left:
            there = place
        after = left.pop(there, None)
        if after is None:
            (result.removed if renames.is_removed(place) else result.missing).append(place)
        elif is_text(before):
            if before.shape != after.shape or bool(np.any(before != after)):
                result.texts.append(f"{place}: {before!s:.60} -> {after!s:.60}")
        else:
            result.numbers += before.size
            difference = compare_arrays(place, before, after)
            if difference is not None:
                result.differences.append(difference)
    result.added = sorted(left)
    # A text that is not written any more is no number that is missing.
    gone = [place for place in result.missing if is_text(old[place])]
    result.texts += [f"{place}: only in old" for place in gone]
    result.missing = [place for place in result.missing if place not in set(gone)]
    return result
