# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: a dataclass field declares one, and everything that shows or reads it is made from it.

A frozen dataclass declares its fields by `setting`, in SI units and float64. From the declaration
follow the check of its bounds (`check_settings`), its key in JSON files (typed_json.py), its
command-line option (`add_arguments`), its field in Blender's window (blender/rig_settings) and its
row in the reference (`settings_table`).

A setting has one stem. The field ends with its SI unit (``carrier_hz``), the window and the command
line with the unit that people use (``carrier_ghz``, ``--carrier-ghz``). Options leave plain
metres, seconds, kelvins, watts and pixels out (``--ring-step`` sets ``ring_step_m``).

At the end are the options that say who does the frames of a command (`Share`).
"""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import functools
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from decimal import Decimal
from typing import Any, Literal, NoReturn, TypeVar

from .errors import ConfigError

#: Unit that is shown -> SI unit, power of ten between them, ending of names.
_SHOWN_UNITS: dict[str, tuple[str, int, str]] = {
    "GHz": ("Hz", 9, "ghz"),
    "MHz": ("Hz", 6, "mhz"),
    "kHz": ("Hz", 3, "khz"),
    "ms": ("s", -3, "ms"),
    "us": ("s", -6, "us"),
    "ns": ("s", -9, "ns"),
    "%": ("", -2, ""),
}
#: Endings of field names that an option leaves out.
_SILENT_ENDINGS = ("_m", "_s", "_mps", "_k", "_w", "_px")
#: What no quantity exceeds, and no positive one falls below, in SI: its square is a number, too.
_MOST, _LEAST = 1e30, 1e-30
#: Largest length: beyond it, float64 holds no path to a metre [m].
MAX_LENGTH_M = 1e15
#: The same in decibels.
_MOST_DB = 300.0
_SMALL_WORDS = ("by", "for", "from", "of", "per")
_KEY = "radarsim"
Record = TypeVar("Record")
_DECLARED: dict[Any, Mapping[str, Declared]] = {}

Choices = tuple[tuple[str, str, str], ...]
"""Values of a setting that is chosen from a list: value, label, tooltip."""


@dataclass(frozen=True)
class Setting:
    """The declaration of a field, in addition to its name, type and default. Bounds are in SI."""

    label: str  # in the window, without unit; a noun in sentence case
    help: str  # tooltip and help of the option: verb first, no final full stop
    unit: str = ""  # SI unit of the value; "" for a number without one
    shown_in: str = ""  # unit in the window and on the command line, if another one, such as "GHz"
    minimum: float | None = None  # closed bounds; None: none
    maximum: float | None = None
    above: float | None = None  # open lower bound; None: none
    soft_maximum: float | None = None  # where a slider of the window ends; None: at the maximum
    #: Allowed values of text or whole numbers, as text; empty: any. Files hold the position of the
    #: value: add new ones at the end.
    choices: Choices = ()
    lists: bool = False  # whether a list of numbers is allowed in place of a choice
    initial: object = None  # value in the window at first; None: the field's default
    on: bool = False  # whether the window gives this value at first, where the default is None
    hint: str = ""  # what to do about a wrong value: one sentence at the end of the error
    flag: str = ""  # option, where it cannot follow from the field's name
    metavar: str = ""  # placeholder of the option's value in its help
    parse: Callable[[str], Any] | None = None  # for values that are no number, text or choice
    digits: int = 3  # decimals in the window
    path: Literal["", "FILE", "DIR"] = ""  # the text names a file or a folder
    window: bool = True  # whether the window shows it

    def __post_init__(self) -> None:
        if self.shown_in:
            object.__setattr__(self, "unit", _SHOWN_UNITS[self.shown_in][0])
        if self.unit in ("dB", "dBi"):
            for name, most in (("minimum", -_MOST_DB), ("maximum", _MOST_DB)):
                if getattr(self, name) is None:
                    object.__setattr__(self, name, most)


def setting(label: str, help: str, default: Any = MISSING, **declaration: Any) -> Any:
    """Return a dataclass field that declares a setting; `declaration` are attributes of `Setting`.

    Without a default (in SI), the field must be given.
    """
    return dataclasses.field(default=default, metadata={_KEY: Setting(label, help, **declaration)})


@dataclass(frozen=True)
class Declared:
    """A setting with the name, type and default of its field."""

    name: str  # of the field; JSON key
    kind: Any  # type of a value: float, int, bool, str or another one
    optional: bool  # whether None is a value
    default: object  # ``dataclasses.MISSING``: none
    of: Setting

    @property
    def exponent(self) -> int:
        """Power of ten from the unit that is shown to SI."""
        return _SHOWN_UNITS[self.of.shown_in][1] if self.of.shown_in else 0

    @property
    def shown_unit(self) -> str:
        """Unit in the window and on the command line; "" for none."""
        return self.of.shown_in or self.of.unit

    @property
    def shown_name(self) -> str:
        """Name that ends with the unit that is shown, such as ``carrier_ghz``."""
        if not self.exponent or not self.of.unit:
            return self.name
        return f"{self.name.rpartition('_')[0]}_{_SHOWN_UNITS[self.of.shown_in][2]}"

    @property
    def shown_label(self) -> str:
        """Label in Blender's title case, with unit, such as "Chirp Duration [us]"."""
        words = [
            word.capitalize() if word.islower() and word not in _SMALL_WORDS else word
            for word in self.of.label.split()
        ]
        return " ".join([*words, f"[{self.shown_unit}]"] if self.shown_unit else words)

    @property
    def flag(self) -> str:
        """Option of the command line, such as ``--carrier-ghz``."""
        stem = self.shown_name
        for ending in () if self.exponent and self.of.unit else _SILENT_ENDINGS:
            stem = stem.removesuffix(ending)
        return self.of.flag or f"--{stem.replace('_', '-')}"

    @functools.cached_property
    def number(self) -> Any:
        """int or float, also for a pair of them; None for what is no number."""
        kind = self.kind
        if typing.get_origin(kind) is tuple:
            kind = typing.get_args(kind)[0]
        return kind if kind in (int, float) else None

    @property
    def values(self) -> list[Any]:
        """The values to choose from, of the setting's type; empty: any."""
        return [self.kind(value) for value, _, _ in self.of.choices]

    @property
    def initial(self) -> Any:
        """Value in the window before anybody changes it."""
        return self.default if self.of.initial is None else self.of.initial

    def from_shown(self, value: float) -> float:
        """Convert a number from the shown unit to SI; no decimal digit is changed by rounding."""
        if not self.exponent or not math.isfinite(value):
            return float(value)
        return float(Decimal(repr(float(value))).scaleb(self.exponent))

    def to_shown(self, value: float) -> float:
        """Convert a number from SI to the shown unit; no decimal digit is changed by rounding."""
        return float(Decimal(repr(float(value))).scaleb(-self.exponent))

    @property
    def expected(self) -> str:
        """Description of allowed values, for messages: "a whole number from 1 to 64"."""
        of = self.of
        if of.choices:
            return f"one of {', '.join(map(repr, self.values))}"
        if self.kind is bool:
            return "true or false"
        if self.kind is str:
            return "text"
        if self.number is None:
            return of.metavar or "another value"
        words = "whole number" if self.number is int else "finite number"
        return (f"a {words}" if self.kind is self.number else f"two {words}s") + self.bounds

    @property
    def bounds(self) -> str:
        """The bounds in words: " from 1 to 64", " above 0 Hz"; "" without any."""
        return self._bounds_text(self.of.unit, lambda value: value)

    def _bounds_text(self, unit: str, shown: Callable[[float], float]) -> str:
        low, above, high = (
            None if value is None else f"{shown(value):.12g}"
            for value in (self.of.minimum, self.of.above, self.of.maximum)
        )
        unit = f" {unit}" if unit else ""
        if above is not None:
            return f" above {above}{'' if high is None else f', at most {high}'}{unit}"
        if low is not None:
            return f" from {low}{'' if high is None else f' to {high}'}{unit}"
        return "" if high is None else f" of at most {high}{unit}"

    def check(self, value: object) -> None:
        """Raise a ConfigError unless `value` (SI) has the type and is within the bounds."""
        if value is None and self.optional:
            return
        if self.fits(value):
            return
        unit = f" {self.of.unit}" if self.of.unit and isinstance(value, int | float) else ""
        hint = f" {self.of.hint}" if self.of.hint else ""
        none = ", or none" if self.optional else ""
        raise ConfigError(
            f"{self.of.label} is {value!r:.60}{unit}; expected {self._expected(value)}{none}.{hint}"
        )

    def _expected(self, value: object) -> str:
        """Return the description of allowed values for a message about this refused value."""
        most, unit = self._most, f" {self.of.unit}" if self.of.unit else ""
        huge = (
            self.number is not None
            and self.of.maximum is None
            and isinstance(value, int | float)
            and most < abs(value) < math.inf
        )
        return f"a number of at most {most:g}{unit}" if huge else self.expected

    @property
    def _most(self) -> float:
        """Largest magnitude of a value if no maximum is declared."""
        return MAX_LENGTH_M if self.of.unit == "m" else _MOST

    def typed(self, text: str, value: object) -> str:
        """Return the reason to refuse a number (SI) that was typed in the shown unit. Empty: it is
        allowed.
        """
        if self._in_bounds(value):
            return ""
        expected = self._expected(value)
        if expected == self.expected:
            words = "whole number" if self.number is int else "number"
            expected = f"a {words}{self._bounds_text(self.shown_unit, self.to_shown)}"
        unit = f" {self.shown_unit}" if self.shown_unit else ""
        hint = f" {self.of.hint}" if self.of.hint else ""
        return f"{text}{unit} is out of bounds; expected {expected}.{hint}"

    def fits(self, value: object) -> bool:
        """Return True if a value (SI) has the type and is within the bounds."""
        of = self.of
        if of.choices:
            listed = of.lists and isinstance(value, list | tuple)
            return listed or (type(value) is self.kind and value in self.values)
        if self.number is None:
            return self.kind not in (bool, str) or isinstance(value, self.kind)
        if self.kind is not self.number:
            return isinstance(value, tuple) and len(value) == 2 and all(map(self._in_bounds, value))
        return self._in_bounds(value)

    def _in_bounds(self, value: object) -> bool:
        of = self.of
        kinds = int if self.number is int else (int, float)
        if isinstance(value, bool) or not isinstance(value, kinds):
            return False
        low = -self._most if of.minimum is None else of.minimum
        high = self._most if of.maximum is None else of.maximum
        return low <= value <= high and (of.above is None or value > max(of.above, _LEAST))


def declared(kind: type) -> Mapping[str, Declared]:
    """Return the settings of a dataclass by field name, in the order of the fields; read only."""
    if kind in _DECLARED:
        return _DECLARED[kind]
    hints = typing.get_type_hints(kind)
    found = {}
    for item in dataclasses.fields(kind):
        if _KEY in item.metadata:
            values, optional = value_type(hints[item.name])
            found[item.name] = Declared(
                item.name, values, optional, item.default, item.metadata[_KEY]
            )
    return _DECLARED.setdefault(kind, types.MappingProxyType(found))


def value_type(hint: object) -> tuple[Any, bool]:
    """Return the type of the values that an annotation allows, and whether None is one.

    It is the first type apart from None; str for a Literal.
    """
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        inner = [item for item in typing.get_args(hint) if item is not type(None)]
        return value_type(inner[0])[0], len(inner) < len(typing.get_args(hint))
    if typing.get_origin(hint) is Literal:
        return str, False
    return hint, False


def check_settings(record: object) -> None:
    """Check every setting of a dataclass instance; ConfigError for the first that does not fit."""
    for name, item in declared(type(record)).items():
        item.check(getattr(record, name))


def documented(kind: type[Record]) -> type[Record]:
    """Add the settings of a dataclass to its docstring, in a section "Parameters" at the end.

    Where it has this section, that must be the last one.
    """
    lines = [""]
    for name, item in declared(kind).items():
        unit = f" [{item.of.unit}]" if item.of.unit else ""
        lines += [name, f"    {item.of.label}{unit}. {item.of.help}."]
    doc = inspect.cleandoc(kind.__doc__ or "")
    title = "" if "Parameters\n" in doc else "\n\nParameters\n----------"
    kind.__doc__ = doc + title + "\n".join(lines) + "\n"
    return kind


def choices_from(values: Iterable[str]) -> Choices:
    """Return choices whose labels need no more words than the values themselves."""
    return tuple((value, value.replace("-", " ").capitalize(), "") for value in values)


# -- options of the command line -------------------------------------------------------------------

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
        """Return options of this parser and of its commands that resemble a word."""
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

    Values that are given are in SI, see `given`.
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
    """Return the arguments of argparse that read the text of an option."""
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
    """Return a reader of two numbers. The separator is that of the placeholder, such as "A:B"."""

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


def settings_table(
    kind: type[Any], with_flags: Iterable[str] = (), leave_out: Iterable[str] = ()
) -> str:
    """Return a Markdown table of the settings of a dataclass; `with_flags`: those with options."""
    flags = frozenset(with_flags)
    rows = ["| setting | default; allowed | meaning |", "|---|---|---|"]
    for name, item in declared(kind).items():
        if name in leave_out:
            continue
        option = f"<br>`{item.flag}`" if name in flags else ""
        allowed = ", ".join(f"`{value}`" for value in item.values)
        allowed = allowed or re.sub("^from (.* to )", r"\1", item.bounds.strip())
        unit = f" ({item.shown_unit} in the window)" if item.of.shown_in and not option else ""
        default = "required" if item.default is MISSING else f"`{_default_text(item) or 'none'}`"
        text = re.sub(r"^(?:Set|Choose) the (.)", lambda m: m[1].upper(), item.of.help)
        values = f"{default}; {allowed}" if allowed else default
        rows.append(f"| `{name}`{option} | {values} | {text}.{unit} |")
    return "\n".join(rows) + "\n"


@dataclass(frozen=True)
class Share:
    """Who does the frames of a command: worker processes, a Dask cluster, one of several shards."""

    workers: int | None = None
    dask: str | None = None
    shard: tuple[int, int] | None = None

    @property
    def by_workers(self) -> bool:
        """True if other processes do the frames."""
        return self.workers is not None or self.dask is not None

    @property
    def words(self) -> list[str]:
        """The options that make it."""
        given = {"--workers": self.workers, "--dask": self.dask}
        given["--shard"] = "/".join(map(str, self.shard)) if self.shard else None
        return [text for name, value in given.items() if value for text in (name, str(value))]

    def part(self, frames: Sequence[int]) -> list[int]:
        """Return the frames of this shard: every n-th, so that all shards have as much to do."""
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
