# SPDX-License-Identifier: GPL-3.0-or-later
"""The spectrum engine against the sum it stands for, in extended precision."""

import itertools
import math

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError, PathDataError
from radarsim_addon.signal.motion import LinearMotion, join_motion
from radarsim_addon.signal.spectrum import (
    FrequencyGrid,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
)
from radarsim_addon.signal.spectrum import all_pulses as synthesis_linear
from tests.signal.spectrum_oracle import Function, direct_sum, relative

TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10, 1e-12]

#: 512 MHz at 5.3 GHz, 60 m of unambiguous path; 40 pulses at 1 kHz.
GRID = FrequencyGrid(5.3e9 - 32 * 5e6, 5e6, 65)
TIMES_S = np.arange(40) * 1e-3


def sum_up(motion, amplitude, grid=GRID, times_s=TIMES_S, **options) -> Spectrum:
    accumulator = SpectrumAccumulator(grid, times_s, **options)
    accumulator.add(motion, amplitude)
    return accumulator.result()


def linear_paths(count: int = 150, seed: int = 0) -> tuple[LinearMotion, np.ndarray]:
    """Half of them still, amplitudes over 200 dB."""
    rng = np.random.default_rng(seed)
    rate = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-30, 30, count))
    amplitude = 10 ** rng.uniform(-5, 5, count) * np.exp(2j * np.pi * rng.random(count))
    return LinearMotion(rng.uniform(0, 60, count), rate), amplitude


def exact_lengths(motion: LinearMotion):
    length, rate = (x.astype(np.longdouble) for x in (motion.length_m, motion.range_rate_mps))
    return lambda t: length + 2 * rate * t


MOTION, AMPLITUDE = linear_paths()
EXPECTED = direct_sum(GRID, TIMES_S, exact_lengths(MOTION), AMPLITUDE)


def ways(spectrum: Spectrum) -> set[tuple[str, str]]:
    return {(step.motion, step.transform) for step in spectrum.report.steps}


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("method", ["auto", "type3", "per-pulse"])
def test_tolerance_holds(method, tolerance) -> None:
    found = sum_up(MOTION, AMPLITUDE, method=method, tolerance=tolerance)
    error = relative(found.values, EXPECTED)
    assert error <= tolerance
    # what the report says of the error is true, and not said to be safe
    assert error <= found.report.error_bound
    assert found.report.error_estimate <= tolerance
    assert ("still", "once") in ways(found)
    way = "type 3" if method == "type3" else "pulse by pulse"
    if method != "auto":
        assert ("linear", way) in ways(found)


def test_direct_method_is_the_sum() -> None:
    found = sum_up(MOTION, AMPLITUDE, method="direct")
    assert relative(found.values, EXPECTED) < 1e-12
    assert {way for _, way in ways(found)} == {"direct sum"}
    assert found.report.backend == "direct"


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_curved_and_oscillating_motion(tolerance) -> None:
    """Straight, bent, and shaken faster than any fit can follow."""
    rng = np.random.default_rng(1)
    length, rate, bend = rng.uniform(5, 50, 60), rng.uniform(-20, 20, 60), rng.uniform(0, 9, 60)
    bend[:20], rate[:5] = 0, 0
    shake = np.where(np.arange(60) >= 40, 0.02, 0.0)
    amplitude = rng.normal(size=60)

    def lengths(t):
        return length + rate * t + bend * t**2 + shake * np.sin(2 * np.pi * 170 * t)

    # the direct sum of the motion's own float64 lengths
    expected = direct_sum(GRID, TIMES_S, lambda t: lengths(float(t)), amplitude)
    moving = (rate != 0) | (bend != 0) | (shake != 0)
    found = sum_up(Function(lengths, moving), amplitude, tolerance=tolerance)
    assert relative(found.values, expected) <= tolerance
    kinds = {motion for motion, _ in ways(found)}
    if tolerance >= 1e-8:
        assert {"still", "smooth", "sampled"} <= kinds
        smooth = [s.paths for s in found.report.steps if s.motion in ("smooth", "linear")]
        assert sum(smooth) == 35
    assert [s.paths for s in found.report.steps if s.motion == "still"] == [5]


def test_choice_by_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    times_s = np.arange(64) * 1e-3
    many, amplitude = linear_paths(20_000)
    assert ("linear", "type 3") in ways(sum_up(many, amplitude, times_s=times_s))
    few, amplitude = linear_paths(20)
    monkeypatch.setattr(synthesis_linear, "_PULSE_1", 1.0)
    assert ("linear", "type 3") in ways(sum_up(few, amplitude))
    monkeypatch.setattr(synthesis_linear, "_PULSE_1", 1e-9)
    assert ("linear", "pulse by pulse") in ways(sum_up(few, amplitude))


@pytest.mark.parametrize("largest", [1 << 23, 2_000])
def test_type3_in_blocks_of_pulses(largest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synthesis_linear, "_MAX_GRID", largest)
    found = sum_up(MOTION, AMPLITUDE, method="type3", tolerance=1e-9)
    assert relative(found.values, EXPECTED) <= 1e-9
    transforms = next(s.transforms for s in found.report.steps if s.transform == "type 3")
    assert transforms > 10 if largest == 2_000 else transforms < 10


def test_parts_chunks_and_threads_change_nothing_beyond_the_tolerance() -> None:
    def form(parts: int, **options) -> Spectrum:
        accumulator = SpectrumAccumulator(GRID, TIMES_S, **options)
        for part in np.array_split(np.arange(AMPLITUDE.size), parts):
            accumulator.add(MOTION.select(part), AMPLITUDE[part])
        return accumulator.result()

    for parts, chunk in itertools.product((1, 3, 150), (1, 7, 1 << 17)):
        assert relative(form(parts, chunk=chunk).values, EXPECTED) <= 1e-6
    # and threads change nothing at all
    one, three = (form(1, chunk=8, threads=n).values for n in (1, 3))
    assert np.array_equal(one, three)


def test_joined_motion_is_taken_apart() -> None:
    bent = Function(lambda t: np.array([10 + 3 * t + 5 * t**2]), np.array([True]))
    both = join_motion([MOTION, bent])  # type: ignore[list-item]
    amplitude = np.append(AMPLITUDE, 1e5)
    expected = EXPECTED + direct_sum(
        GRID, TIMES_S, lambda t: np.array([10 + 3 * t + 5 * t**2]), amplitude[-1:]
    )
    assert relative(sum_up(both, amplitude).values, expected) <= 1e-6


def test_phase_of_a_hundred_million_wavelengths() -> None:
    """400 km at 77 GHz, r/lambda 1e8: the phase is that of the float64 length."""
    rng = np.random.default_rng(2)
    length = 8e5 + rng.uniform(0, 20, 50)
    grid = FrequencyGrid(77e9, 5e6, 40)
    expected = direct_sum(grid, np.zeros(1), lambda t: length, np.ones(50))
    motion = LinearMotion(length, np.zeros(50))
    found = sum_up(motion, np.ones(50), grid, np.zeros(1), tolerance=1e-10)
    assert relative(found.values, expected) <= 1e-10


def test_extra_cycles_as_of_a_residual_video_phase() -> None:
    rate = 2e13

    def extra(delay):
        return rate * delay**2 / 2

    expected = direct_sum(GRID, TIMES_S, exact_lengths(MOTION), AMPLITUDE, extra)
    assert relative(expected, EXPECTED) > 0.5
    found = sum_up(MOTION, AMPLITUDE, extra_cycles=extra, tolerance=1e-8)
    assert relative(found.values, expected) <= 1e-8


@pytest.mark.parametrize("count", [1, 2, 7])
def test_small_and_descending_grids(count) -> None:
    grid = FrequencyGrid(5.3e9, -3.3e6, count)
    expected = direct_sum(grid, TIMES_S[:3], exact_lengths(MOTION), AMPLITUDE)
    found = sum_up(MOTION, AMPLITUDE, grid, TIMES_S[:3])
    assert relative(found.values, expected) <= 1e-6


def test_special_sets_of_paths() -> None:
    nothing = sum_up(LinearMotion(np.empty(0), np.empty(0)), np.empty(0))
    assert nothing.values.shape == (40, 65)
    assert not nothing.values.any()
    assert nothing.report.error_estimate == 0
    for length, rate in ((0.0, 0.0), (0.0, 3.0), (30.0, -4.0)):  # one path; delay 0
        motion = LinearMotion(np.array([length]), np.array([rate]))
        expected = direct_sum(GRID, TIMES_S, exact_lengths(motion), np.ones(1))
        assert relative(sum_up(motion, np.ones(1)).values, expected) <= 1e-6
    equal = LinearMotion(np.full(1000, 12.3), np.zeros(1000))
    expected = 1000 * direct_sum(GRID, TIMES_S, lambda t: np.array([12.3]), np.ones(1))
    assert relative(sum_up(equal, np.ones(1000)).values, expected) <= 1e-6
    silent = sum_up(MOTION, np.zeros(150))
    assert not silent.values.any()


def test_cancellation_is_noticed_and_overcome() -> None:
    """Weights chosen to cancel in the band: the transform's own error does not cancel."""
    rng = np.random.default_rng(3)
    length = np.sort(rng.uniform(0, 55, 80))
    grid = FrequencyGrid(5.3e9, 5e6, 24)
    matrix = np.exp(-2j * np.pi * grid.frequencies_hz[:, None] * (length / 299_792_458))
    _, _, rows = np.linalg.svd(matrix)
    # in the null space of the sum, but for a hundred thousandth
    quiet = rows[24:].conj().T @ rng.normal(size=56) + 1e-5 * rng.normal(size=80)
    still = np.zeros(80)
    expected = direct_sum(grid, np.zeros(1), lambda t: length, quiet)
    found = sum_up(LinearMotion(length, still), quiet, grid, np.zeros(1))
    assert (found.report.cancellation_db or 0) < -80
    assert relative(found.values, expected) <= 1e-6
    # the same from two parts of which each is strong: nothing can be done then but to say so
    accumulator = SpectrumAccumulator(grid, np.zeros(1), tolerance=1e-4)
    for part in (slice(0, 40), slice(40, 80)):
        accumulator.add(LinearMotion(length[part], still[part]), quiet[part])
        accumulator.result()
    report = accumulator.result().report
    assert report.error_estimate > 1e-4
    assert [item.code for item in report.accuracy_findings()] == ["echoes-cancel"]


@pytest.mark.parametrize("pulses", [1, 7])
def test_cancellation_is_that_of_one_pulse(pulses: int) -> None:
    """Two echoes at one place, 1 and -0.6, and two that move together, 2 and 1."""
    for rate_mps, weights, ratio in ((0.0, (1, -0.6), 0.4**2 / 1.36), (3.0, (2, 1), 3**2 / 5)):
        motion = LinearMotion(np.full(2, 20.0), np.full(2, rate_mps))
        report = sum_up(motion, np.array(weights), times_s=TIMES_S[:pulses]).report
        assert report.cancellation_db == pytest.approx(10 * math.log10(ratio), abs=1e-3)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("what", ["length", "amplitude", "range rate", "curved"])
def test_a_bad_row_is_named(value, what) -> None:
    length, rate, amplitude = np.full(30, 20.0), np.full(30, 2.0), np.ones(30)
    rate[:10] = 0
    {"length": length, "range rate": rate, "curved": length, "amplitude": amplitude}[what][17] = (
        value
    )
    motion = LinearMotion(length, rate)
    if what == "curved":
        motion = Function(lambda t: length + rate * t**2, rate != 0)
    accumulator = SpectrumAccumulator(GRID, TIMES_S)
    accumulator.add(MOTION, AMPLITUDE)
    name = "length" if what == "curved" else what
    with pytest.raises(PathDataError, match=f"Row {150 + 17} .* {name} {value}"):
        accumulator.add(motion, amplitude)


def test_bad_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    for grid in ((0.0, 0.0, 4), (0.0, 1.0, 0), (math.nan, 1.0, 3), (0.0, 1.0, 2.5)):
        with pytest.raises(ConfigError):
            FrequencyGrid(*grid)
    for options, text in (
        ({"tolerance": 0}, "1e-13"),
        ({"method": "fast"}, "fast"),
        ({"backend": "fftw"}, "fftw"),
        ({"chunk": 0}, "Chunk"),
    ):
        with pytest.raises(ConfigError, match=text):
            SpectrumAccumulator(GRID, TIMES_S, **options)
    for times in ([0.0, 0.0], [1.0, 0.5], [math.nan]):
        with pytest.raises(ConfigError, match="rising"):
            SpectrumAccumulator(GRID, np.array(times))
    for window in ((1.0, 1.0), (math.nan, 1.0)):
        with pytest.raises(ConfigError, match="first < last"):
            ReceiveWindow(*window)
    with pytest.raises(ConfigError, match="two ends"):
        ReceiveWindow(period_s=1e-3)
    with pytest.raises(PathDataError, match="149 amplitudes for 150"):
        sum_up(MOTION, AMPLITUDE[1:])


def folded_oracle(listening: ReceiveWindow, lengths, amplitude, times_s=TIMES_S) -> np.ndarray:
    """Each echo at every place where it is received, one after the other."""
    result = np.zeros((times_s.size, GRID.count), dtype=complex)
    offset = GRID.frequencies_hz - listening.reference_hz
    for m, time_s in enumerate(times_s):
        for length, a in zip(lengths(np.longdouble(time_s)), amplitude, strict=True):
            true = direct_sum(GRID, np.zeros(1), lambda t, x=length: np.array([x]), np.ones(1))[0]
            orders = range(-5, 50) if listening.period_s else [0]
            for q in orders:
                shift = q * (listening.period_s or 0)
                if listening.first_s < float(length) / 299_792_458 - shift < listening.last_s:
                    result[m] += a * true * np.exp(2j * np.pi * offset * shift)
    return result


@pytest.mark.parametrize("method", ["type3", "per-pulse"])
@pytest.mark.parametrize(
    "listening",
    [
        ReceiveWindow(30e-9, 90e-9),  # no folding: what is outside is left out
        ReceiveWindow(30e-9, 90e-9, 137e-9, 5.3e9),  # gaps between the windows
        ReceiveWindow(-10e-9, 150e-9, 50e-9, 5.31e9),  # windows longer than the interval
    ],
)
def test_window_and_folding(listening, method) -> None:
    rng = np.random.default_rng(5)
    length = rng.uniform(1, 400, 30)
    rate = np.where(np.arange(30) < 15, 0, rng.uniform(-80, 80, 30))
    motion, amplitude = LinearMotion(length, rate), rng.normal(size=30)
    times_s = TIMES_S[::6]
    lengths = exact_lengths(motion)
    expected = folded_oracle(listening, lengths, amplitude, times_s)
    found = sum_up(
        motion, amplitude, times_s=times_s, listening=listening, method=method, tolerance=1e-9
    )
    assert relative(found.values, expected) <= 1e-9
    delays = np.array([lengths(np.longdouble(t)) for t in times_s]).astype(float) / 299_792_458
    if listening.period_s is None:
        received = (delays > 30e-9) & (delays < 90e-9)
        assert found.report.outside == pytest.approx(30 - received.sum() / times_s.size)
        assert found.report.range_ambiguous_count == 0
    else:
        assert found.report.range_ambiguous_count > 0
        # counted once, however often its echo is in the window
        after = (delays - 30e-9) % listening.period_s
        received = (after < 60e-9) | (listening.last_s - listening.first_s > listening.period_s)
        assert found.report.outside == pytest.approx(30 - received.sum() / times_s.size, abs=1e-9)


def test_doppler_folding_is_counted() -> None:
    limit = 299_792_458 / 5.3e9 * 1000 / 4
    for factor, count in ((0.9, 0), (1.1, 3)):
        rate = np.full(3, factor * limit)
        spectrum = sum_up(LinearMotion(np.full(3, 20.0), rate), np.ones(3))
        assert spectrum.report.doppler_ambiguous_count == count
        bent = Function(lambda t, v=rate: 20 + 2 * v * t + 0.1 * np.sin(9 * t), rate > 0)
        assert sum_up(bent, np.ones(3)).report.doppler_ambiguous_count == count
