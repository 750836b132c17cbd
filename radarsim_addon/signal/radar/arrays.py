# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna arrays: their elements, and the times at which the transmitters send.

With several transmitters, the pulse interval is divided into slots. Either each transmitter has a
slot of its own (time division, TDM). Or all send in all slots, each with phases of its own, by
which a receiver tells them apart: phases that rise evenly shift each transmitter's Doppler (DDM),
phases of 0 and 180 degrees are rows of a Hadamard matrix (BPM). A pair of transmitter and receiver
is a channel. To
a distant target it acts as one element at the sum of both positions, the virtual element (Bliss and
Forsythe, 37th Asilomar Conference, 54, 2003). Channels are numbered by transmitter, then receiver.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from ...arrays import Real
from ...errors import ConfigError
from ...typed_json import from_json
from .config import SINGLE_CHANNEL, Burst, Channel, Element

#: More channels than this are a mistake: the largest radars on one board have 12 x 16.
MAX_CHANNELS = 4096
#: Elements nearer to one another than this are one element entered twice [m].
_APART_M = 1e-6


#: How transmitters share the pulse interval, see the module.
Schedule = Literal["tdm", "ddm", "bpm"]


@dataclass(frozen=True)
class AntennaArray:
    """Elements of a radar with several antennas.

    Attributes
    ----------
    transmitters, receivers
        Elements, in the axes of the transmitting and of the receiving antenna: x right, y up,
        z back [m].
    slot_s
        Time from the start of one transmitter's pulse to that of the next one's [s]; None: the
        slots share the pulse interval evenly.
    schedule
        How transmitters share the pulse interval: "tdm", "ddm" or "bpm".

    Raises
    ------
    ConfigError
        No element, two elements in one place, too many channels, a slot that is not above 0, or one
        that is given where transmitters send at once.
    """

    transmitters: tuple[Element, ...]
    receivers: tuple[Element, ...]
    slot_s: float | None = None
    schedule: Schedule = "tdm"

    def __post_init__(self) -> None:
        for name, elements in (("transmitters", self.transmitters), ("receivers", self.receivers)):
            if not elements:
                raise ConfigError(f"The array has no {name}; expected at least one.")
            places = np.array([element.position_m for element in elements])
            apart_m = np.linalg.norm(places[:, None] - places[None], axis=2)
            same = np.argwhere(np.triu(apart_m < _APART_M, 1))
            if same.size:
                one, other = same[0].tolist()
                raise ConfigError(
                    f"Elements {one} and {other} of the array's {name} are both at "
                    f"{elements[one].position_m} m. Give each element a place of its own."
                )
        count = len(self.transmitters) * len(self.receivers)
        if count > MAX_CHANNELS:
            raise ConfigError(
                f"An array of {len(self.transmitters)} transmitters and {len(self.receivers)} "
                f"receivers has {count} channels; expected at most {MAX_CHANNELS}."
            )
        if self.slot_s is not None and not self.slot_s > 0:
            raise ConfigError(f"slot_s of the array is {self.slot_s!r} s; expected above 0.")
        if self.schedule not in get_args(Schedule):
            raise ConfigError(
                f"Schedule of the array is {self.schedule!r:.40}; expected one of "
                f"{', '.join(get_args(Schedule))}."
            )
        if self.slot_s is not None and self.schedule != "tdm":
            raise ConfigError(
                f"slot_s of the array goes with the schedule tdm alone; with {self.schedule} the "
                "slots share the pulse interval evenly. Leave slot_s out."
            )

    def channels(self, burst: Burst, pulse_s: float = 0.0) -> tuple[Channel, ...]:
        """Return a channel for each pair of transmitter and receiver.

        Parameters
        ----------
        burst
            Its PRF is that of the whole cycle, in which each transmitter sends once.
        pulse_s
            Time that one transmitter needs, the waveform's `duration_s` [s].

        Returns
        -------
        tuple of Channel
            By transmitter, then receiver.

        Raises
        ------
        ConfigError
            The transmitters do not fit into the pulse interval one after another.
        """
        count, interval_s = len(self.transmitters), 1 / burst.prf_hz
        if self.schedule != "tdm" and count > 1:
            return self._coded(interval_s)
        slot_s = interval_s / count if self.slot_s is None else self.slot_s
        needed_s = (count - 1) * max(self.slot_s or 0.0, pulse_s) + pulse_s
        if count > 1 and needed_s > interval_s * (1 + 1e-6):
            raise ConfigError(
                f"{count} transmitters in turn need {needed_s * 1e6:.4g} us, and the pulse "
                f"interval is {interval_s * 1e6:.4g} us. Lower the PRF to at most "
                f"{math.floor(1 / needed_s):g} Hz, or shorten the chirp."
            )
        if slot_s < pulse_s * (1 - 1e-6):
            raise ConfigError(
                f"slot_s of the array is {slot_s:g} s, and a pulse takes {pulse_s:g} s. Give each "
                "transmitter a slot of at least this time, or leave slot_s out."
            )
        return tuple(
            Channel(tx, rx, number * slot_s)
            for number, tx in enumerate(self.transmitters)
            for rx in self.receivers
        )

    def _coded(self, interval_s: float) -> tuple[Channel, ...]:
        """Return channels of transmitters that send at once. Those of blocks of pulses have the
        time of a block's middle.
        """
        count = len(self.transmitters)
        if self.schedule == "ddm":
            turns, later_s = np.outer(np.arange(count), np.arange(count)) / count % 1.0, 0.0
        else:
            slots = 1 << (count - 1).bit_length()
            # rows of a Hadamard matrix
            odd = [[(row & slot).bit_count() % 2 for slot in range(slots)] for row in range(count)]
            turns = np.array(odd) / 2
            later_s = (slots - 1) / (2 * slots) * interval_s
        return tuple(
            Channel(tx, rx, later_s, code_turns=tuple(own.tolist()))
            for tx, own in zip(self.transmitters, turns, strict=True)
            for rx in self.receivers
        )

    @property
    def virtual_m(self) -> Real:
        """Places of the virtual elements, (channels, 3) [m]."""
        return np.array(
            [
                np.add(tx.position_m, rx.position_m)
                for tx in self.transmitters
                for rx in self.receivers
            ]
        )


def linear_array(count: int, spacing_m: float, axis: int = 0) -> tuple[Element, ...]:
    """Return elements in a row, its middle at the antenna's origin.

    Parameters
    ----------
    count
        Number of elements.
    spacing_m
        Distance between neighbours [m].
    axis
        0: along x (to the right), 1: along y (upwards).

    Returns
    -------
    tuple of Element
        From left to right, or upwards.
    """
    places_m = (np.arange(count) - (count - 1) / 2) * spacing_m
    return tuple(Element(tuple((np.eye(3)[axis] * place).tolist())) for place in places_m)


def _placed(steps: Sequence[tuple[float, float]], wavelength_m: float) -> tuple[Element, ...]:
    """Return elements at places (right, up) in half wavelengths, their middle at the origin."""
    places = np.array(steps, dtype=np.float64)
    places = (places - (places.max(axis=0) + places.min(axis=0)) / 2) * wavelength_m / 2
    return tuple(Element((float(right), float(up), 0.0)) for right, up in places)


def _uniform(columns: int, rows: int) -> Callable[[float], AntennaArray]:
    steps = [(x, y) for y in range(rows) for x in range(columns)]
    return lambda wavelength_m: AntennaArray((Element(),), _placed(steps, wavelength_m))


def _single_chip(wavelength_m: float) -> AntennaArray:
    """Two transmitters in a row with the receivers, one raised by half a wavelength."""
    receivers = [(x, 0) for x in range(4)]
    return AntennaArray(
        _placed([(0, 0), (2, 1), (4, 0)], wavelength_m), _placed(receivers, wavelength_m)
    )


def _cascade(wavelength_m: float) -> AntennaArray:
    """Four chips: nine transmitters in a row, three raised, and sixteen receivers."""
    row = [(4 * x, 0) for x in range(9)]
    raised = [(9, 1), (10, 4), (11, 6)]
    receivers = [(x, 0) for start in (0, 11, 46, 50) for x in range(start, start + 4)]
    return AntennaArray(_placed(row + raised, wavelength_m), _placed(receivers, wavelength_m))


#: Arrays by name. The places of "3x4" and "12x16" are those of common 77 GHz evaluation boards
#: (Texas Instruments, AWR1843BOOST and TIDEP-01012), in half wavelengths.
ARRAY_PRESETS: dict[str, Callable[[float], AntennaArray]] = {
    "1x4": _uniform(4, 1),
    "1x8": _uniform(8, 1),
    "8x8": _uniform(8, 8),
    "3x4": _single_chip,
    "12x16": _cascade,
}


def array_preset(name: str, wavelength_m: float) -> AntennaArray:
    """Return an array by its name.

    Parameters
    ----------
    name
        "1x4" and "1x8": one transmitter, receivers in a row. "8x8": one transmitter, 64
        receivers. "3x4": a single chip, 8 virtual elements in a row and 4 above them. "12x16": four
        chips, 86 virtual elements in a row and others up to 3 wavelengths above them.
    wavelength_m
        Wavelength of the carrier; elements are multiples of half of it apart [m].

    Returns
    -------
    AntennaArray
        Its middle at the antennas' origins.

    Raises
    ------
    ConfigError
        Another name.
    """
    if name not in ARRAY_PRESETS:
        raise ConfigError(
            f"There is no array preset {name!r:.40}; expected one of {', '.join(ARRAY_PRESETS)}."
        )
    return ARRAY_PRESETS[name](wavelength_m)


def array_from_dict(data: object, wavelength_m: float) -> AntennaArray:
    """Return an array from the object "array" of a radar file.

    Parameters
    ----------
    data
        {"preset": NAME}, or {"transmitters": [...], "receivers": [...]}, of places [x, y, z] in
        metres or of objects with the fields of `Element`; both may have "slot_s" and "schedule".
    wavelength_m
        Wavelength of the carrier [m].

    Raises
    ------
    ConfigError
        Unknown or missing fields, or numbers that do not fit.
    """
    if not isinstance(data, dict):
        raise ConfigError(f'Array is {data!r:.60}; expected an object such as {{"preset": "3x4"}}.')
    slot_s = data.get("slot_s")
    if slot_s is not None and not (isinstance(slot_s, int | float) and slot_s > 0):
        raise ConfigError(f"Array: slot_s is {slot_s!r:.40}; expected seconds above 0.")
    schedule = data.get("schedule", "tdm")
    rest = set(data) - {"slot_s", "schedule"}
    if rest == {"preset"}:
        chosen = array_preset(
            data["preset"] if isinstance(data["preset"], str) else "", wavelength_m
        )
        return AntennaArray(chosen.transmitters, chosen.receivers, slot_s, schedule)
    both = {"transmitters", "receivers"}
    if rest != both:
        lacking, strange = sorted(both - rest), sorted(map(str, rest - both))
        wrong = f"has the unknown field {strange[0]!r:.60}" if strange else f"lacks {lacking[0]}"
        raise ConfigError(
            f"Array {wrong}; expected preset, or transmitters and receivers, and maybe slot_s "
            "and schedule."
        )
    elements = [_elements(data[name], f"Array: {name}") for name in ("transmitters", "receivers")]
    return AntennaArray(elements[0], elements[1], slot_s, schedule)


def channels_to_dict(channels: Sequence[Channel]) -> list[dict[str, Any]]:
    """Return channels as plain JSON; an empty list for a single one at the antennas' origins."""
    if tuple(channels) == (SINGLE_CHANNEL,):
        return []
    return [dataclasses.asdict(channel) for channel in channels]


def channels_from_dict(data: Sequence[dict[str, Any]]) -> tuple[Channel, ...]:
    """Return channels from plain JSON, see `channels_to_dict`.

    Raises
    ------
    ConfigError
        Too many channels, or fields that do not fit.
    """
    if len(data) > MAX_CHANNELS:
        raise ConfigError(f"There are {len(data)} channels; expected at most {MAX_CHANNELS}.")
    found = tuple(from_json(Channel, one, f"Channel {n}") for n, one in enumerate(data))
    return found or (SINGLE_CHANNEL,)


def _elements(data: object, where: str) -> tuple[Element, ...]:
    if not isinstance(data, list) or len(data) > MAX_CHANNELS:
        raise ConfigError(f"{where} is {data!r:.60}; expected a list of at most {MAX_CHANNELS}.")
    found = []
    for number, one in enumerate(data):
        given = {"position_m": one} if isinstance(one, list) else one
        try:
            found.append(from_json(Element, given, "Element"))
        except ConfigError as error:
            raise ConfigError(f"{where}[{number}]: {error}") from error
    return tuple(found)
