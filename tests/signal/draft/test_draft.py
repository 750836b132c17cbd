# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts against the radar equation, and messages between two processes."""

from __future__ import annotations

import dataclasses
import io
import math
import os
import threading
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import LinkBudget, ReceiverRecord, TransmitterRecord
from radarsim_addon.messages import read_message, write_message
from radarsim_addon.physics.radar_equation import (
    lambert_plate_rcs_m2,
    monostatic_power_w,
    noise_power_w,
)
from radarsim_addon.physics.rough import facet_brightness, sigma0
from radarsim_addon.physics.weather import rain_attenuation_db_per_km
from radarsim_addon.signal.draft import (
    DRAFT,
    FAULT,
    LEVELS,
    DraftLevel,
    DraftScene,
    make_draft,
    mesh_message,
    scene_message,
)
from radarsim_addon.signal.draft.draft import scene_of
from radarsim_addon.signal.draft.worker import serve
from radarsim_addon.signal.radar import Burst, Radar, Waveform, Weather
from radarsim_addon.signal.scene import Clutter, Mesh, Shader, Surface

WAVEFORM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
SIDE_M, RANGE_M, TILT = 2.0, 40.0, math.radians(30.0)
#: Looks along +Y, +Z up.
POSE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
#: A material of Blender of albedo 0.5.
GREY = Surface(output=Shader("Diffuse", {}, albedo=0.5))
SEA = Surface(kind="physical", n=2.0, kappa=0.0, roughness=0.0, clutter=Clutter("no such"))
#: What moves the plate in a millisecond: 12 m/s, receding.
RATE_MPS = 12.0


def plate() -> Mesh:
    """A square tilted back about X."""
    half = SIDE_M / 2
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    points = np.column_stack(
        [corners[:, 0], corners[:, 1] * math.sin(TILT), corners[:, 1] * math.cos(TILT)]
    )
    numbers, zero = np.arange(4, dtype=np.int32), np.zeros(1, dtype=np.int32)
    return Mesh(points, zero, numbers, numbers, zero)


def scene(**changes: Any) -> DraftScene:
    matrix, move = np.eye(4), np.eye(4)
    matrix[1, 3], move[1, 3] = RANGE_M, RATE_MPS * 1e-3
    values: dict[str, Any] = {
        "radar": Radar(WAVEFORM, Burst(2000.0, 32)),
        "link_budget": None,
        "weather": Weather(),
        "receiver": ReceiverRecord("perspective", POSE.tolist(), -0.06, 0.06, -0.06, 0.06, 1e-6),
        "transmitter": TransmitterRecord(POSE.tolist(), 1e3),
        "range_limits_m": (0.0, 100.0),
        "polarisation": "average",
        "surfaces": [GREY],
        "meshes": [7],
        "matrices": matrix[None],
        "slots": [[0]],
        "met": np.ones((2, 1), dtype=bool),
        "moves": np.stack([move, np.eye(4), np.eye(4)]),
        "interval_s": 1e-3,
    }
    return DraftScene(**(values | changes))


def test_a_lambert_plate_has_its_radar_cross_section() -> None:
    """4 rho A cos^2 in the radar equation: within 0.1 dB at the peak and in all, in its cells."""
    given = scene()
    found = make_draft(given, {7: plate()}, DraftLevel(4096, 2))
    rcs_m2 = lambert_plate_rcs_m2(0.5, SIDE_M**2, math.cos(TILT))
    expected_w = float(monostatic_power_w(1e3, rcs_m2, RANGE_M, WAVEFORM.wavelength_m))
    peak = int(np.argmax(found.profile_w))
    assert abs(10 * math.log10(found.profile_w[peak] / expected_w)) < 0.1
    assert abs(found.range_m[peak] - RANGE_M) <= WAVEFORM.sample_spacing_m
    row, column = np.unravel_index(np.argmax(found.map_w), found.map_w.shape)
    assert abs(found.range_m[column] - RANGE_M) <= WAVEFORM.sample_spacing_m
    step_mps = found.velocity_mps[1] - found.velocity_mps[0]
    assert step_mps > 0
    assert abs(found.velocity_mps[row] - RATE_MPS) <= step_mps / 2 + 1e-9
    assert 0 < found.peak_error_db < 0.1


def test_noise_is_that_of_the_link_budget() -> None:
    """k T_0 F B of a sample; less in a bin by the matched filter, and in the map by the pulses."""
    given = scene(link_budget=LinkBudget(transmit_power_w=1e3, noise_figure_db=3.0))
    found = make_draft(given, {7: plate()}, DraftLevel(256, 2))
    sample_w = float(noise_power_w(60e6, 3.0, 290.0))
    samples = WAVEFORM.chirp_duration_s * 60e6
    # a Hamming taper's noise bandwidth is 1.36 bins, of range and of Doppler
    assert found.noise_w == pytest.approx(1.36 * sample_w / samples, rel=0.05)
    assert found.map_noise_w == pytest.approx(1.36 * found.noise_w / 32, rel=0.03)
    without = scene()
    found = make_draft(without, {7: plate()}, DraftLevel(64, 2))
    assert found.noise_w == found.map_noise_w == 0


def test_few_pulses_stand_for_a_map_of_too_many_cells() -> None:
    given = scene(radar=Radar(WAVEFORM, Burst(400.0, 4096)), range_limits_m=(0.0, 20e3))
    found = make_draft(given, {7: plate()}, DraftLevel(256, 2))
    assert found.map_w.size <= 1 << 19
    assert found.pulses == len(found.map_w) < 4096
    peak = int(np.argmax(found.profile_w))
    assert abs(found.range_m[peak] - RANGE_M) <= WAVEFORM.sample_spacing_m


def test_facets_are_as_bright_as_sigma0_and_reciprocal() -> None:
    cosine = np.cos(np.radians([0.0, 20.0, 45.0, 70.0]))
    here = facet_brightness(0.4, cosine, cosine, cosine)
    np.testing.assert_allclose(here * cosine, sigma0(1e9, 0.4, cosine, "cycles"), rtol=1e-12)
    there, back = (facet_brightness(0.4, a, b, 0.8) * b for a, b in ((0.9, 0.5), (0.5, 0.9)))
    np.testing.assert_allclose(there, back, rtol=1e-12)
    assert facet_brightness(0.4, -0.1, 0.5, 0.8) == facet_brightness(0.4, 0.5, 0.0, 0.8) == 0


def test_messages_keep_a_scene_and_end_where_they_are_cut() -> None:
    given = scene(
        surfaces=[
            Surface(kind="simple", n=1.5, kappa=0.1, specularity=0.3, unlinked={"roughness": 0.4}),
            dataclasses.replace(SEA, clutter=Clutter("constant_gamma", {"gamma_db": -10.0})),
            GREY,
        ],
        weather=Weather(rain_mm_per_h=20.0, air_temperature_c=5.0),
        link_budget=LinkBudget(20.0, receive_loss_db=2.0),
    )
    stream = io.BytesIO()
    write_message(stream, *scene_message(given))
    whole = stream.getvalue()
    stream.seek(0)
    message = read_message(stream)
    assert message is not None
    back = scene_of(message)
    for item in dataclasses.fields(DraftScene):
        value, other = getattr(back, item.name), getattr(given, item.name)
        if item.name == "surfaces":
            value, other = (list(map(vars, each)) for each in (value, other))
        assert np.array_equal(value, other) if isinstance(other, np.ndarray) else value == other
    for length in (0, 5, 60, len(whole) - 1):
        assert read_message(io.BytesIO(whole[:length])) is None


def test_rain_attenuates_on_both_ways() -> None:
    wet = scene(weather=Weather(rain_mm_per_h=50.0))
    powers = [
        make_draft(one, {7: plate()}, DraftLevel(256, 2)).profile_w.sum() for one in (scene(), wet)
    ]
    loss_db = 2e-3 * RANGE_M * float(rain_attenuation_db_per_km(WAVEFORM.carrier_hz, 50.0))
    assert 10 * math.log10(powers[0] / powers[1]) == pytest.approx(loss_db, rel=0.03)


def test_the_process_drafts_finer_and_finer_and_names_faults() -> None:
    inward, outward = os.pipe(), os.pipe()
    with (
        open(inward[0], "rb") as reading, open(inward[1], "wb") as to_process,
        open(outward[0], "rb") as answers, open(outward[1], "wb") as writing,
    ):  # fmt: skip
        process = threading.Thread(target=serve, args=(reading, writing))
        process.start()
        write_message(to_process, *mesh_message(7, plate()))
        for number, surface in (
            (3, SEA),
            (4, GREY),
        ):
            fields, arrays = scene_message(scene(surfaces=[surface]))
            write_message(to_process, fields | {"number": number}, arrays)
            found = [read_message(answers) for _ in range(1 if number == 3 else len(LEVELS))]
            kinds = [(one.fields["kind"], one.fields["number"]) for one in found if one]
            assert kinds == [(FAULT if number == 3 else DRAFT, number)] * len(found)
        levels = [one.fields["level"] for one in found if one]
        assert levels == list(range(len(LEVELS)))
        errors = [one.fields["peak_error_db"] for one in found if one]
        assert errors[2] < errors[0]
        to_process.close()
        process.join(timeout=20)
        assert not process.is_alive()
