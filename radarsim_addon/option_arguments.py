# SPDX-License-Identifier: GPL-3.0-or-later
"""Command-line options and reference tables, made from the settings that dataclasses declare."""

from __future__ import annotations

import argparse
import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from typing import Any, NoReturn

from .options import Declared, declared

_TEXTS: dict[Any, str] = {True: "on", False: "off", None: "none", MISSING: ""}
_MAX_WORKERS = 1024


class CommandParser(argparse.ArgumentParser):
    """A parser whose errors are a sentence with a hint, without the list of all options."""

    def error(self, message: str) -> NoReturn:
        """Print the message, with the nearest option if one is unknown; exit with 2."""
        kind, _, words = message.partition("unrecognized arguments: ")
        near = [] if kind or not words else self._near(words.split()[0].partition("=")[0])
        hint = f". Did you mean {' or '.join(near)}?" if near else "."
        text = f"{self.prog}: error: {message.rstrip('.')}{hint} {self.prog} --help lists all.\n"
        self.exit(2, text)

    def _near(self, word: str) -> list[str]:
        """Options of this parser and of its commands that resemble a word."""
        commands = [
            command
            for action in self._actions
            if isinstance(action, argparse._SubParsersAction)
            for command in action.choices.values()
        ]
        flags = {
            flag: None
            for parser in (self, *commands)
            for action in parser._actions
            if action.help != argparse.SUPPRESS
            for flag in action.option_strings
            if flag != word  # of another command
        }
        return difflib.get_close_matches(word, flags, n=2, cutoff=0.7)


def finite_number(text: str) -> float:
    """Return a number that is neither NaN nor infinite."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number. Give the number alone, without its unit"
        ) from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def add_arguments(
    parser: argparse._ActionsContainer,
    settings: Mapping[str, Declared],
    *names: str,
    defaults: bool = False,
) -> None:
    """Add an option for each setting of `names` (none: all), in their order.

    Values that are given are in SI, see :func:`given`.
    With `defaults` the help tells the defaults: they hold where an option is left out.
    """
    for name in names or settings:
        item = settings[name]
        shown = item.of.help
        if defaults and item.default is not MISSING:
            shown, _, unset = shown.partition(". None: ")
            if text := unset or (item.default is not None and _default_text(item)):
                shown += f" [{text}]"
        options = {"dest": name, "default": argparse.SUPPRESS, **_reading(item)}
        # argparse takes % for a format
        parser.add_argument(item.flag, help=shown.replace("%", "%%"), **options)


def _reading(item: Declared) -> dict[str, Any]:
    """How argparse reads the text of an option."""
    if item.kind is bool:
        return {"action": argparse.BooleanOptionalAction}
    if item.of.choices:
        return {"type": item.kind, "choices": item.values}
    if item.of.parse is not None:
        return {"type": item.of.parse, "metavar": item.of.metavar}
    reader: Callable[[str], Any] = str
    if item.number:

        def reader(text: str) -> float:
            value = int(text) if item.number is int else item.from_shown(finite_number(text))
            if refusal := item.typed(text[:60], value):
                raise argparse.ArgumentTypeError(refusal)
            return value

        # argparse names the type in its message
        reader.__name__ = "whole number" if item.number is int else "finite number"
    if item.number and item.kind is not item.number:
        return {"type": _pair_reader(reader, item.of.metavar), "metavar": item.of.metavar}
    unit = item.shown_unit.replace("%", "percent").upper()
    letters = {float: unit or "X", int: "N"}.get(item.kind, item.of.path or "TEXT")
    return {"type": reader, "metavar": item.of.metavar or letters}


def _pair_reader(reader: Callable[[str], Any], metavar: str) -> Callable[[str], Any]:
    """Reader of two numbers, between them what is between those of the placeholder "A:B"."""

    def pair(text: str) -> tuple[Any, Any]:
        first, second = (reader(part) for part in text.split(metavar[1]))
        return first, second

    pair.__name__ = f"pair of numbers ({metavar})"
    return pair


def given(arguments: argparse.Namespace, settings: Iterable[str]) -> dict[str, Any]:
    """Return the settings that were given on the command line by their names, in SI."""
    return {name: getattr(arguments, name) for name in settings if hasattr(arguments, name)}


def _default_text(item: Declared) -> str:
    """Return the default in the unit that is shown, as text; empty where a value must be given."""
    value = item.default
    if isinstance(value, bool) or value in (None, MISSING):
        return _TEXTS[value]
    if isinstance(value, float):
        unit = f" {item.shown_unit}" if item.shown_unit else ""
        return f"{item.to_shown(value):.12g}{unit}"
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


def settings_table(kind: type[Any], with_flags: Iterable[str] = ()) -> str:
    """Return a Markdown table of the settings of a dataclass; `with_flags`: those with options."""
    flags = frozenset(with_flags)
    rows = ["| setting | option | default | allowed | meaning |", "|---|---|---|---|---|"]
    for name, item in declared(kind).items():
        option = f"`{item.flag}`" if name in flags else ""
        allowed = ", ".join(f"`{value}`" for value in item.values) or item.bounds.strip()
        unit = f" ({item.shown_unit} in the window)" if item.of.shown_in else ""
        default = (
            "must be given" if item.default is MISSING else f"`{_default_text(item) or 'none'}`"
        )
        rows.append(
            f"| `{name}` | {option} | {default} | {allowed} | {item.of.help}.{unit} |"
        )  # fmt: skip
    return "\n".join(rows) + "\n"


@dataclass(frozen=True)
class Share:
    """Who does the frames of a command: worker processes, a Dask cluster, one of several shards."""

    workers: int | None = None
    dask: str | None = None
    shard: tuple[int, int] | None = None

    @property
    def by_workers(self) -> bool:
        """Whether other processes do the frames."""
        return self.workers is not None or self.dask is not None

    @property
    def words(self) -> list[str]:
        """The options that make it."""
        given = {"--workers": self.workers, "--dask": self.dask}
        given["--shard"] = "/".join(map(str, self.shard)) if self.shard else None
        return [text for name, value in given.items() if value for text in (name, str(value))]

    def part(self, frames: Sequence[int]) -> list[int]:
        """Frames of this shard: every n-th, so that all shards have as much to do."""
        index, count = self.shard or (1, 1)
        return list(frames[index - 1 :: count])


def add_share_arguments(parser: argparse._ActionsContainer) -> None:
    """Add the options that make a `Share`."""
    who = parser.add_mutually_exclusive_group()
    who.add_argument(
        "--workers",
        type=_worker_count,
        metavar="N",
        help="Do the frames in N processes of one thread each",
    )
    who.add_argument(
        "--dask", metavar="ADDRESS", help="Do the frames on the Dask cluster with this scheduler"
    )
    parser.add_argument(
        "--shard", type=_shard, metavar="I/N", help="Do the I-th of N parts of the frames, from 1"
    )


def share_of(arguments: argparse.Namespace) -> Share:
    """Return the `Share` of parsed arguments."""
    return Share(arguments.workers, arguments.dask, arguments.shard)


def _worker_count(text: str) -> int:
    number = int(text)
    if not 1 <= number <= _MAX_WORKERS:
        raise argparse.ArgumentTypeError(f"{text}: expected 1 to {_MAX_WORKERS}")
    return number


def _shard(text: str) -> tuple[int, int]:
    index, count = (int(part) for part in text.split("/"))
    if not 1 <= index <= count:
        raise argparse.ArgumentTypeError(f"{text}: expected I/N with I from 1 to N, such as 3/16")
    return index, count


_worker_count.__name__, _shard.__name__ = "number of workers", "shard (like 3/16)"
