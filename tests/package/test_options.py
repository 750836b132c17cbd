# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that a dataclass declares: bounds, JSON, command line, table. Needs no Blender."""

from __future__ import annotations

import argparse
import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest

from radarsim_addon.blender.plan import shortest_decimal
from radarsim_addon.errors import ConfigError, FrameFileError
from radarsim_addon.options import (
    CommandParser,
    add_arguments,
    check_settings,
    declared,
    finite_number,
    given,
    setting,
    settings_table,
)
from radarsim_addon.typed_json import from_json

KINDS = (("lfm", "LFM pulse", "Linear chirp"), ("fmcw", "FMCW", "De-chirp"))


@dataclass(frozen=True)
class Example:
    """One setting of each type."""

    carrier_hz: float = setting(
        "Carrier",
        "Set the carrier frequency",
        initial=1e9,
        shown_in="GHz",
        above=0.0,
        maximum=1e13,
        hint="Check the unit.",
    )
    max_standard_error: float = setting(
        "Max standard error", "Stop below this", 0.0, shown_in="%", minimum=0.0
    )
    snapshot_interval_s: float = setting("Snapshot interval", "Set", 0.01, shown_in="ms")
    ring_step_m: float = setting("Ring step", "Set the width", 250.0, unit="m", above=0)
    pulses: int = setting("Pulses", "Set 100 % of them", 128, minimum=1, maximum=4096)
    kind: Literal["lfm", "fmcw"] = setting("Kind", "Choose one", "lfm", choices=KINDS)
    snapshots: int = setting(
        "Snapshots", "Choose how many", 2, choices=(("1", "One", ""), ("2", "Two", ""))
    )
    real_adc: bool = setting("Real ADC", "Use one channel", False)
    gain_dbi: float | None = setting("Gain", "Set", None, unit="dBi", initial=20.0)
    not_a_setting: str = ""

    def __post_init__(self) -> None:
        check_settings(self)


def parsed(*words: str) -> dict[str, Any]:
    parser = argparse.ArgumentParser(allow_abbrev=False)
    add_arguments(parser, declared(Example), defaults=True)
    return given(parser.parse_args(words), declared(Example))


def test_names_follow_from_field_and_unit() -> None:
    found = {name: (item.shown_name, item.flag) for name, item in declared(Example).items()}
    assert found == {
        "carrier_hz": ("carrier_ghz", "--carrier-ghz"),
        "max_standard_error": ("max_standard_error", "--max-standard-error"),
        "snapshot_interval_s": ("snapshot_interval_ms", "--snapshot-interval-ms"),
        "ring_step_m": ("ring_step_m", "--ring-step"),
        "pulses": ("pulses", "--pulses"),
        "kind": ("kind", "--kind"),
        "snapshots": ("snapshots", "--snapshots"),
        "real_adc": ("real_adc", "--real-adc"),
        "gain_dbi": ("gain_dbi", "--gain-dbi"),
    }
    assert declared(Example)["carrier_hz"].shown_label == "Carrier [GHz]"
    assert declared(Example)["max_standard_error"].shown_label == "Max Standard Error [%]"
    assert declared(Example)["gain_dbi"].initial == 20.0


@pytest.mark.parametrize(
    ("value", "si"), [(77.1, 77.1e9), (5.3, 5.3e9), (1e-7, 100.0), (76.543210987, 76543210987.0)]
)
def test_a_shift_of_the_decimal_point_rounds_nothing(value: float, si: float) -> None:
    carrier = declared(Example)["carrier_hz"]
    assert carrier.from_shown(value) == si
    assert carrier.to_shown(si) == value


@pytest.mark.parametrize(
    ("value", "exponent", "expected"),
    [(77.0, 9, 77e9), (5.3, 9, 5.3e9), (2.5, -6, 2.5e-6), (0.1, 0, 0.1), (1e-4, -3, 1e-7)],
)
def test_float32_becomes_what_was_typed(value: float, exponent: int, expected: float) -> None:
    assert shortest_decimal(float(np.float32(value)), exponent) == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"carrier_hz": 0.0}, "Carrier is 0.0 Hz; expected a finite number above 0, at most "),
        ({"carrier_hz": 77e15}, "at most 1e+13 Hz. Check the unit."),
        ({"carrier_hz": math.nan}, "Carrier is nan Hz"),
        ({"carrier_hz": "77"}, "Carrier is '77'; expected a finite number"),
        ({"carrier_hz": True}, "Carrier is True"),
        ({"ring_step_m": -1}, "Ring step is -1 m; expected a finite number above 0 m."),
        ({"pulses": 0}, "Pulses is 0; expected a whole number from 1 to 4096."),
        ({"pulses": 2.0}, "Pulses is 2.0"),
        ({"kind": "lfm "}, "Kind is 'lfm '; expected one of 'lfm', 'fmcw'."),
        ({"snapshots": 3}, "Snapshots is 3; expected one of 1, 2."),
        ({"snapshots": "2"}, "Snapshots is '2'; expected one of 1, 2."),
        ({"real_adc": 1}, "Real ADC is 1; expected true or false."),
        (
            {"gain_dbi": math.inf},
            "Gain is inf dBi; expected a finite number from -300 to 300 dBi, or none.",
        ),
        ({"max_standard_error": -0.1}, "Max standard error is -0.1; expected a finite number"),
    ],
)
def test_what_does_not_fit_is_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Example(**{"carrier_hz": 1e9, **change})
    assert message in str(caught.value)


def test_json_there_and_back() -> None:
    record = Example(77e9, kind="fmcw", gain_dbi=3.5)
    assert from_json(Example, dataclasses.asdict(record), "a.json") == record
    read = from_json(
        Example,
        {"carrier_hz": 77000000000, "snapshot_interval_s": 1, "pulses": 64.0, "gain_dbi": None},
        "a.json",
    )
    assert read == Example(77e9, pulses=64, snapshot_interval_s=1.0)
    assert isinstance(read.carrier_hz, float)
    assert isinstance(read.pulses, int)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], r"a.json is \[\]; expected a JSON object"),
        ({"carrier_hz": 1e9, "puls": 1}, "unknown field 'puls'.*Do you mean 'pulses'"),
        ({"pulses": 3}, "a.json lacks carrier_hz; its fields are carrier_hz, max_standard"),
        ({"carrier_hz": "1 GHz"}, "a.json: carrier_hz: Carrier is '1 GHz'"),
        ({"carrier_hz": 1e9, "pulses": 1.5}, "a.json: pulses: Pulses is 1.5"),
        ({"carrier_hz": 1e9, "not_a_setting": 3}, "not_a_setting is 3; expected text"),
        (
            {"carrier_hz": 1e9, "snapshot_interval_s": "a"},
            "a.json: snapshot_interval_s: Snapshot interval is 'a'",
        ),
    ],
)
def test_json_that_does_not_fit_is_named(data: Any, message: str) -> None:
    with pytest.raises(FrameFileError, match=message):
        from_json(Example, data, "a.json", FrameFileError)


def test_options_are_in_si_and_only_those_given() -> None:
    assert parsed() == {}
    assert parsed("--carrier-ghz", "77.1", "--max-standard-error", "2.5", "--no-real-adc") == {
        "carrier_hz": 77.1e9,
        "max_standard_error": 0.025,
        "real_adc": False,
    }
    found = parsed("--carrier-ghz=24", "--kind", "fmcw", "--snapshots=1")
    assert found == {"carrier_hz": 24e9, "kind": "fmcw", "snapshots": 1}


@pytest.mark.parametrize(
    "words", [("--carrier-ghz", "nan"), ("--pulses", "1.5"), ("--kind", "am"), ("--carrier", "1")]
)
def test_options_that_cannot_be_read(words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit, match="2"):
        parsed(*words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["work", "--loss-db", "3"],
            "unrecognized arguments: --loss-db 3. radar --help lists all.\n",
        ),
        (["work", "--noise-figur=5"], ". Did you mean --noise-figure? radar --help lists all.\n"),
        (["work", "--xyzzy"], "radar: error: unrecognized arguments: --xyzzy. radar --help"),
        (["work", "--noise-figure", "5dB"], "'5dB' is no number. Give the number alone, without"),
        (["wrok"], "choose from 'rest', 'work'"),
    ],
)
def test_errors_of_commands_are_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    parser = CommandParser(prog="radar")
    commands = parser.add_subparsers(required=True)
    commands.add_parser("rest").add_argument("--loss-db")
    command = commands.add_parser("work", allow_abbrev=False)
    command.add_argument("--noise-figure", type=finite_number)
    command.add_argument("--noise-figures", help=argparse.SUPPRESS)
    with pytest.raises(SystemExit, match="2"):
        parser.parse_args(words)
    found = capsys.readouterr().err
    assert said in found and found.count("\n") == 1


def test_help_and_table_tell_the_same_sentence() -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser, declared(Example), defaults=True)
    shown = " ".join(parser.format_help().split())
    table = settings_table(Example, ["carrier_hz"])
    for item in declared(Example).values():
        assert item.of.help + (" [" if item.name != "carrier_hz" else "") in shown
        assert f"{item.of.help.removeprefix('Set the ')}.".lower() in table.lower()
    assert "--carrier-ghz GHZ" in shown
    assert "| `carrier_hz`<br>`--carrier-ghz` | required; above 0, at most" in table
    assert "carrier_hz" not in settings_table(Example, leave_out=["carrier_hz"])
