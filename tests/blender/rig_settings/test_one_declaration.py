# SPDX-License-Identifier: GPL-3.0-or-later
"""Each setting has one declaration: dataclass, JSON, command line, window and docs agree."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.plan import (
    Measurement,
    PathOptions,
    RunSettings,
    given_settings,
    merged,
    parse_render_arguments,
    render_settings,
    shortest_decimal,
)
from radarsim_addon.blender.rig_settings import RADAR_SETTINGS, settings
from radarsim_addon.blender.scene import setup_rig
from radarsim_addon.contract import AntennaRecord, LinkBudget
from radarsim_addon.options import Declared, add_arguments, declared, given
from radarsim_addon.signal import Cfar, ProcessOptions, Receiver
from radarsim_addon.signal.radar import PATTERNS, WAVEFORM_KINDS, Burst, Weather
from radarsim_addon.typed_json import from_json
from scripts.make_settings_page import PAGE, page

pytestmark = pytest.mark.blender

KINDS = [
    RunSettings, Burst, Measurement, PathOptions, LinkBudget, AntennaRecord, ProcessOptions,
    Receiver, Cfar, Weather, *WAVEFORM_KINDS.values(), *PATTERNS.values(),
]  # fmt: skip
ALL = [(kind, item) for kind in KINDS for item in declared(kind).values()]
IDS = [f"{kind.__name__}.{item.name}" for kind, item in ALL]
#: Options that are no shortened name: they name a file or folder, or choose a whole record.
OTHER_FLAGS = {"--out", "--waveform", "--cfar", "--cfar-guard", "--cfar-train", "--cfar-rank"}


def other_value(item: Declared) -> Any:
    """A value within the bounds that is not the one at first; numbers of four digits."""
    of = item.of
    if of.choices:
        return next(value for value in item.values if value != item.initial)
    if item.kind is bool:
        return not item.initial
    if item.kind is str:
        return "some text"
    low = of.minimum if of.minimum is not None else of.above if of.above is not None else -40.0
    high = of.maximum if of.maximum is not None else max(low, 1e-9) * 3 + 40
    value = low + (min(high, max(abs(low), 1e-9) * 10 + 1000) - low) * 0.37
    if item.number is int:
        value = int(value) + (int(value) == item.initial)
    else:
        value = shortest_decimal(float(f"{value:.4g}"))
    return value if item.kind is item.number else (value, value)


@pytest.fixture
def radar(addon: Any) -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return setup_rig(bpy.context.scene)


def test_there_are_many() -> None:
    assert len(ALL) > 120
    assert set(RADAR_SETTINGS) >= {"carrier_hz", "adc_rate_hz", "max_standard_error", "seed"}


def test_words_and_names(subtests: pytest.Subtests) -> None:
    """Verb first, no full stop; the option's stem is that of the name."""
    for kind, item in ALL:
        with subtests.test(f"{kind.__name__}.{item.name}"):
            assert item.of.help[0].isupper() and not item.of.help.endswith(".")
            assert item.of.label[0].isupper() and not item.of.label.endswith("]")
            assert item.name in {field.name for field in dataclasses.fields(kind)}
            assert item.of.help in (kind.__doc__ or "")
            stem = item.flag.removeprefix("--").replace("-", "_")
            assert item.flag in OTHER_FLAGS or item.shown_name.startswith(stem)
            if item.of.unit in ("Hz", "s", "m", "dB", "dBi", "deg", "K", "W"):
                assert item.name.endswith(f"_{item.of.unit.lower()}")
            initial = item.initial
            if initial is not None and initial is not dataclasses.MISSING and item.number:
                item.check(initial)


def test_window_and_python(radar: Any, subtests: pytest.Subtests) -> None:
    for name in RADAR_SETTINGS:
        with subtests.test(name):
            item = RADAR_SETTINGS[name]
            group, view = radar.radarsim, settings(radar)
            shown = group.bl_rna.properties[item.shown_name]
            assert (shown.name, shown.description) == (item.shown_label, item.of.help)
            value = other_value(item)
            setattr(view, name, value)
            assert getattr(view, name) == value
            in_window = getattr(group, item.shown_name)
            if item.kind is float:
                assert in_window == pytest.approx(item.to_shown(value), rel=1e-6)
                setattr(group, item.shown_name, item.to_shown(value))  # through float32
                assert getattr(view, name) == value
            else:
                assert in_window == (str(value) if item.of.choices else value)


def test_render_option(subtests: pytest.Subtests) -> None:
    for name in render_settings():
        with subtests.test(name):
            item = render_settings()[name]
            value = other_value(item)
            shown = item.to_shown(value) if item.kind is float else value
            words = [item.flag.replace("--", "--no-", 1)] if value is False else [item.flag]
            words += [] if item.kind is bool else [repr(shown) if item.number else str(shown)]
            found = given_settings(parse_render_arguments(["a.blend", *words]))
            found.pop("sampling_mode", None) if name != "sampling_mode" else None
            assert found == {name: value}


@pytest.mark.parametrize("kind", [ProcessOptions, Receiver, Cfar])
def test_process_option(kind: Any) -> None:
    for name, item in declared(kind).items():
        if item.of.parse is not None:
            continue
        value = other_value(item)
        text = str(value)
        if item.kind is not item.number and item.number:
            text = item.of.metavar[1].join(map(repr, value))
        word = f"{item.flag}={text}"
        if item.kind is bool:
            word = item.flag if value else item.flag.replace("--", "--no-", 1)
        parser = argparse.ArgumentParser()
        add_arguments(parser, declared(kind))
        chosen = parser.parse_args([word])
        assert given(chosen, declared(kind)) == {name: value}


@pytest.mark.parametrize(
    "kind", [Burst, LinkBudget, *(k for n, k in WAVEFORM_KINDS.items() if n != "arbitrary")]
)
def test_json(kind: Any) -> None:
    needed = {
        name: item.initial
        for name, item in declared(kind).items()
        if item.default is dataclasses.MISSING
    }
    for name, item in declared(kind).items():
        given_value = item.initial if item.default is dataclasses.MISSING else other_value(item)
        assert getattr(from_json(kind, {**needed, name: given_value}, "file"), name) == given_value


def test_the_page_is_up_to_date() -> None:
    """If this fails: python scripts/make_settings_page.py."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_what_the_window_holds_is_declared_once() -> None:
    assert merged(
        RunSettings, Burst, *(k for n, k in WAVEFORM_KINDS.items() if n != "arbitrary"),
        LinkBudget, Measurement, PathOptions, Weather,
    ) == RADAR_SETTINGS  # fmt: skip
