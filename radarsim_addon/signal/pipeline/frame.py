# SPDX-License-Identifier: GPL-3.0-or-later
"""One radar frame: from its input to its result, without a file.

Paths of the frame get the gains of the link budget and, where they are rough, random phases; the
synthesizer adds up their echoes, weather and receiver change them. Then come range profiles and the
range-Doppler map, and in parallel what is expected on average over the speckle. Moving targets are
found in the first channel, detections in all of them, with their directions. With several
visibility updates in a burst the echoes of all updates are interpolated.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Collection, Generator
from typing import Any

import numpy as np

from ...arrays import Mask, Real
from ...errors import ConfigError
from ...findings import NO_ECHO_CODES, Finding, finding
from ..angles import ArrayGeometry
from ..decoding import FrameInput, iter_path_chunks
from ..detection import (
    MAX_EDGES,
    SLOWEST_CELLS,
    BudgetReport,
    Cfar,
    Detections,
    DopplerFolds,
    FrameBudget,
    FrameStatistics,
    PathFinder,
    Peak,
    StatisticsSum,
    detect_in_directions,
    detect_targets,
    find_edges,
    find_moving_targets,
    matching_objects,
    named_in_directions,
    paths_of_objects,
    received_recording,
    statistics_findings,
)
from ..echoes import (
    Echoes,
    ReceivedSignal,
    apply_receiver,
    crosstalk,
    interpolate_renders,
    pulses_of_render,
    recorded_together,
    render_times_s,
    separate,
    synthesizer_for,
)
from ..maps import (
    ExpectedPower,
    ProfileAccumulator,
    RangeDopplerMap,
    RangeProfiles,
    Recording,
    Spectrogram,
    dynamics_db,
    expected_power,
    map_noise_gain,
    map_noise_rows,
    mti_cancel,
    range_doppler,
    range_process,
    spectrogram,
)
from ..motion import AntennaMotion, axes_of, places_m
from ..paths import PathRows, Paths, TableFootprints
from ..products import FrameResult
from ..radar import Radar, Weather, find_suspicious_parameters
from ..scattering import FrameSpeckle, rain_paths, rain_rows, table_footprints
from .options import ResolvedOptions

#: Carriers that differ by more than this are worth a word about materials.
_CARRIER_SLACK = 0.01
#: Slowest moving target, in Doppler cells, where echoes are blended over the burst: blending
#: makes sidelobes next to 0 Hz.
_SLOWEST_BLENDED_CELLS = 3.0

#: Sine of the angle up to which an array without grating lobes measures.
_WHOLE_SECTOR = 0.95
#: Share of one transmitter in another, in amplitude, from which on it is worth a word: -40 dB.
_LEAST_LEAK = 0.01


def process_frame(frame_input: FrameInput, options: ResolvedOptions) -> FrameResult:
    """Process one radar frame.

    Parameters
    ----------
    frame_input
        The frame, see :func:`.decoding.open_frame`. Its radar, link budget and range limits count.
    options
        How, see :meth:`.options.ProcessOptions.for_run`.

    Returns
    -------
    FrameResult
        Without files.

    Notes
    -----
    Pure: it writes and prints nothing and opens nothing but what the input holds. The same input
    and options give the same bits on any number of threads.
    """
    steps = frame_steps(frame_input, options)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: FrameResult = end.value
            return result


def frame_steps(
    frame_input: FrameInput, options: ResolvedOptions
) -> Generator[str, None, FrameResult]:
    """Process a radar frame step by step, as `process_frame` does. Yield a text about each step."""
    number, radar = frame_input.frame.number, frame_input.radar
    statistics_sum = StatisticsSum(radar, options.receiver_gain, frame_input.range_limits_m)
    folds = DopplerFolds(radar)
    profile_sum = ProfileAccumulator(
        radar,
        frame_input.range_limits_m,
        range_taper=options.range_taper,
        amplitude_model=options.amplitude_model,
        receiver_gain=options.receiver_gain,
        nufft_backend=options.nufft_backend,
    )
    # What is expected of a pixel is spread over all that it covers, where that is known.
    spread = bool(frame_input.tables) and options.amplitude_model == "radar-equation"
    budget = FrameBudget(frame_input, options.weather)
    speckled = frame_input.tables and options.echo_options.speckle_seed is not None
    footprints = table_footprints(frame_input) if speckled else None
    expected, rain = None, _rain(frame_input, options)
    if spread:
        expected = expected_power(
            frame_input,
            range_taper=options.range_taper,
            doppler_taper=options.doppler_taper,
            receiver_gain=options.receiver_gain,
            link=budget.link,
            points_to=profile_sum.add,  # the points of it make the profile
            footprints=footprints,
            volume=rain,
        )
    wanted = _pulses_of_update(frame_input, 0)
    echo_sum = _EchoSum(frame_input, options, budget, footprints, wanted)
    chunks = iter_path_chunks(frame_input, max_range_rate_mps=options.max_range_rate_mps)
    for ring, chunk in enumerate(chunks):
        paths = echo_sum.add(chunk)
        statistics_sum.add(paths)
        folds.add(paths)
        if not spread:
            profile_sum.add(paths)
        if not frame_input.tables:
            yield f"frame {number}: ring {ring + 1} of {frame_input.frame.rings}"
    echo_sum.add_rain(rain)
    echoes = echo_sum.result()
    if len(frame_input.tables) > 1:
        later = (_echoes_of(frame_input, n, options) for n in range(1, len(frame_input.tables)))
        echoes = interpolate_renders(itertools.chain([echoes], later), render_times_s(frame_input))
    if radar.slots > 1:
        received = separate(
            apply_receiver(recorded_together(echoes, radar), options.receiver), radar
        )
    else:
        received = apply_receiver(echoes, options.receiver)
    compressed = range_process(received.echoes, options.range_taper)
    filtered = mti_cancel(compressed, options.mti) if options.mti else compressed
    rd_map = range_doppler(filtered, options.doppler_taper)
    profile = profile_sum.result()
    statistics = statistics_sum.result(received.echoes.outside)
    report = echo_sum.budget.report(
        statistics.power_w,
        options.range_taper,
        options.doppler_taper,
        range_limits_m=frame_input.range_limits_m,
        mti=options.mti,
        expected=expected,
        receiver_gain=options.receiver_gain,
    )
    # of several channels detections take all, moving targets the first
    first_map = rd_map.channel(0)
    recording = received_recording(
        received.echoes.channel(0), first_map, options.mti, compressed.channel(0)
    )
    shown_rain = _shows_rain(frame_input, options.weather)
    shown_weather = dataclasses.replace(options.weather, rain_echo=shown_rain)
    moving = _moving_targets(frame_input, options, received, first_map, recording, folds)
    array = _array_of(echo_sum.budget, received.echoes, statistics.nearest_m)
    if array is None:
        detections = _detections(options, received, first_map, recording, folds)
    else:
        yield f"frame {number}: echoes and maps of {len(radar.channels)} channels"
        detections = _array_detections(options, received, rd_map, compressed, folds, array)
    if frame_input.tables and (moving or (detections is not None and detections.targets)):
        finder = PathFinder(frame_input, budget.link)
        moving = finder.named(moving)
        if detections is not None:
            watts = options.amplitude_model == "radar-equation"
            targets: list[Any] = (
                finder.named(detections.targets)
                if array is None
                else [*named_in_directions(finder, detections.targets, *array, watts)]
            )
            detections = dataclasses.replace(detections, targets=targets)
    listed: list[Any] = [*moving, *(detections.targets if detections is not None else [])]
    fastest_mps = max(
        (abs(one.unfolded_velocity_mps or one.velocity_mps) for one in listed), default=0.0
    )
    speckle, edges = echo_sum.speckle, find_edges(profile_sum.result(within=True))
    result = FrameResult(
        source=frame_input,
        options=options.record(),
        statistics=statistics,
        received=received,
        compressed=compressed,
        profile=profile,
        rd_map=rd_map,
        mti=options.mti,
        edges=edges[:MAX_EDGES],
        moving_targets=moving,
        budget=report,
        findings=findings_of_frame(
            frame_input, statistics, report, speckle, expected, received, shown_weather
        )
        + _array_findings(frame_input, echo_sum.budget.antennas, array, fastest_mps),
        expected=expected,
        speckle=speckle.report(),
        detections=detections,
        spectrogram=_spectrogram(frame_input, options, compressed),
        edges_left_out=max(len(edges) - MAX_EDGES, 0),
    )
    yield f"frame {number}: {'echoes, map' if array is None else 'directions'}"
    return result


class _EchoSum:
    """Echoes of one render of a burst: adds up paths with their amplitudes."""

    def __init__(
        self,
        frame_input: FrameInput,
        options: ResolvedOptions,
        budget: FrameBudget,
        footprints: TableFootprints | None = None,
        wanted: Mask | None = None,
    ) -> None:
        echo_options, receiver = options.echo_options, options.receiver
        self._input, self._options, self.budget = frame_input, options, budget
        self.speckle = FrameSpeckle(
            frame_input, echo_options.speckle_seed, options.speckle_cell_size_m, footprints
        )
        self._synthesizer = synthesizer_for(
            frame_input.radar,
            frame_input.range_limits_m,
            echo_options,
            phase_noise=receiver.phase_noise,
            phase_noise_seed=receiver.phase_noise_seed,
            link=self.budget.link,
            antennas=self.budget.antennas,
            wanted=wanted,
        )

    def add(self, paths: Paths) -> Paths:
        """Add paths; return them with the gains of the antennas."""
        paths = self.budget.apply(paths, of_table=bool(self._input.tables))
        self._synthesizer.add(self.speckle.apply(paths))
        return paths

    def add_rain(self, rows: PathRows | None) -> None:
        """Add points of rain, which belong to no surface."""
        if rows is not None and rows.size:
            paths = rain_paths(rows, self._input, _rain_seed(self._input, self._options))
            self._synthesizer.add(self.budget.apply(paths))

    def result(self) -> Echoes:
        return self._synthesizer.result()


def _pulses_of_update(frame_input: FrameInput, number: int) -> Mask | None:
    """Return the pulses that a visibility update takes part in; None: all."""
    if len(frame_input.tables) < 2:
        return None
    return pulses_of_render(frame_input.radar.sent, render_times_s(frame_input), number)


def _echoes_of(
    frame_input: FrameInput,
    number: int,
    options: ResolvedOptions,
    objects: Collection[str] | None = None,
) -> Echoes:
    """Return the echoes of one visibility update. With `objects`, use only paths that end at one of
    them.
    """
    update, wanted = frame_input.of_update(number), _pulses_of_update(frame_input, number)
    echo_sum = _EchoSum(update, options, FrameBudget(update, options.weather), wanted=wanted)
    for paths in iter_path_chunks(update, max_range_rate_mps=options.max_range_rate_mps):
        echo_sum.add(paths if objects is None else paths_of_objects(update, paths, objects))
    if objects is None:
        echo_sum.add_rain(_rain(update, options))
    return echo_sum.result()


def _rain(frame_input: FrameInput, options: ResolvedOptions) -> PathRows | None:
    """Return points of the rain of a frame; None without. Every frame has drops of its own."""
    if not (_shows_rain(frame_input, options.weather) and options.weather.rain_mm_per_h):
        return None
    return rain_rows(frame_input, options.weather, _rain_seed(frame_input, options))


def _shows_rain(frame_input: FrameInput, weather: Weather) -> bool:
    """Return whether the echo of rain is wanted, and known for this kind of frame."""
    known = bool(frame_input.tables) and frame_input.receiver.kind != "orthographic"
    return weather.rain_echo and known


def _rain_seed(frame_input: FrameInput, options: ResolvedOptions) -> int:
    seed = options.echo_options.speckle_seed or 0
    return seed * 1_000_003 + frame_input.frame.number


def _moving_targets(
    frame_input: FrameInput,
    options: ResolvedOptions,
    received: ReceivedSignal,
    rd_map: RangeDopplerMap,
    recording: Recording,
    folds: DopplerFolds,
) -> list[Peak]:
    radar, receiver = frame_input.radar, options.receiver
    # rounding follows the strong echoes: from pulse to pulse it may add up in phase
    noise_w = received.noise_power_w + received.rounding_power_w * radar.burst.pulses
    blended = len(frame_input.tables) > 1
    found = find_moving_targets(
        received.echoes.channel(0),
        rd_map,
        options.mti,
        tolerance=options.tolerance,
        noise_power=noise_w * map_noise_gain(radar, options.range_taper, options.doppler_taper),
        slowest_cells=_SLOWEST_BLENDED_CELLS if blended else SLOWEST_CELLS,
        noisy_columns=receiver.phase_noise is not None or receiver.adc_bits is not None,
        recording=recording,
        folds=folds,
    )
    return folds.unfolded(found)


def _detections(
    options: ResolvedOptions, received: ReceivedSignal, rd_map: RangeDopplerMap,
    recording: Recording, folds: DopplerFolds,
) -> Detections | None:  # fmt: skip
    if options.cfar is None:
        return None
    known = received.noise_power_w > 0 and options.receiver.phase_noise is None
    gain = map_noise_rows(rd_map, options.range_taper, options.doppler_taper, options.mti)
    found = detect_targets(
        rd_map, options.cfar, dynamics_db(options.tolerance), wide=recording.rd_map,
        noise_power=received.floor_power_w * gain if known else None,
    )  # fmt: skip
    return dataclasses.replace(found, targets=folds.unfolded(found.targets))


def _array_of(
    budget: FrameBudget, echoes: Echoes, nearest_m: float | None
) -> tuple[ArrayGeometry, Real] | None:
    """Return the elements of an array, and the receiver's pose, in the middle of the burst; None:
    the channels measure no angles (`_why_no_angles`). ConfigError: an echo is within the array.
    """
    radar, antennas = echoes.radar, budget.antennas
    if len(radar.channels) < 2 or _why_no_angles(radar, antennas):
        return None
    offset_s = float(np.mean([channel.start_offset_s for channel in radar.channels]))
    middle_s = (radar.burst.pulses - 1) / (2 * radar.burst.prf_hz) + offset_s
    geometry = ArrayGeometry.of(radar, antennas, middle_s)
    if nearest_m is not None and nearest_m <= geometry.reach_m:
        raise ConfigError(
            f"The array reaches {geometry.reach_m:g} m from the antenna's origin, and the nearest "
            f"echo is at {nearest_m:g} m. Positions are in metres: put the elements closer "
            "together, or the radar farther away."
        )
    pose, at = np.eye(4), np.array([middle_s])
    pose[:3, :3] = axes_of(antennas.receiver, at)[0]
    pose[:3, 3] = places_m(antennas.receiver, at)[0]
    return geometry, pose


def _why_no_angles(radar: Radar, antennas: AntennaMotion) -> str:
    """Return why channels measure no angles; empty: they do."""
    if antennas.orthographic:
        return "an orthographic camera receives parallel rays"
    if any(channel.active is not None for channel in radar.channels):
        return "some channels are silent at some pulses"
    if not any(ArrayGeometry.of(radar, antennas).measures):
        return "the virtual elements lie within a quarter of a wavelength"
    return ""


def _array_findings(
    frame_input: FrameInput, antennas: AntennaMotion, array: tuple[ArrayGeometry, Real] | None,
    fastest_mps: float,
) -> list[Finding]:  # fmt: skip
    """Name angles that are not measured, with more than one answer, or disturbed by transmitters
    that send at once, and elements that may see other surfaces than those of the paths.
    `fastest_mps` is the largest range rate of a target.
    """
    radar, frame = frame_input.radar, frame_input.frame.number
    if len(radar.channels) < 2:
        return []
    if array is None:
        reason = _why_no_angles(radar, antennas)
        missing = finding("angles-not-measured", channels=len(radar.channels), reason=reason)
        return [missing.in_frame(frame)]
    found, geometry = [], array[0]
    checked_m = min((one.record.array_reach_m for one in frame_input.tables), default=math.inf)
    reach_m = radar.array_reach_m
    if reach_m > checked_m * (1 + 1e-9):
        found.append(finding("array-not-checked", reach_m=reach_m, checked_m=checked_m))
    sectors = zip(("azimuth", "elevation"), geometry.unambiguous_sines(), strict=True)
    for axis, sine in sectors:
        if sine < _WHOLE_SECTOR:
            sector_deg = math.degrees(math.asin(sine))
            found.append(finding("angles-ambiguous", axis=axis, sector_deg=sector_deg))
    leak = crosstalk(radar, fastest_mps) if radar.slots > 1 else 0.0
    if leak > _LEAST_LEAK:
        leak_db = 20 * math.log10(leak)
        found.append(finding("transmitters-leak", rate_mps=fastest_mps, leak_db=leak_db))
    return [item.in_frame(frame) for item in found]


def _array_detections(
    options: ResolvedOptions, received: ReceivedSignal, rd_map: RangeDopplerMap,
    compressed: RangeProfiles, folds: DopplerFolds, array: tuple[ArrayGeometry, Real],
) -> Detections:  # fmt: skip
    known = received.noise_power_w > 0 and options.receiver.phase_noise is None
    gain = map_noise_rows(
        rd_map.channel(0), options.range_taper, options.doppler_taper, options.mti
    )
    found = detect_in_directions(
        rd_map, *array, options.cfar or Cfar(), dynamics_db(options.tolerance),
        wide=received_recording(received.echoes, rd_map, options.mti, compressed).rd_map,
        noise_power=received.floor_power_w * gain if known else None,
    )  # fmt: skip
    return dataclasses.replace(found, targets=folds.unfolded(found.targets))


def _spectrogram(
    frame_input: FrameInput, options: ResolvedOptions, compressed: RangeProfiles
) -> Spectrogram | None:
    """Return the spectrogram of all echoes, or of the echoes of some objects. None: no spectrogram
    is wanted.
    """
    wanted = options.spectrogram
    if wanted is None:
        return None
    if wanted.object_name is not None:
        objects = frozenset(matching_objects(frame_input, wanted.object_name))
        updates = range(len(frame_input.tables))
        parts = [_echoes_of(frame_input, number, options, objects) for number in updates]
        times_s = render_times_s(frame_input)
        echoes = interpolate_renders(parts, times_s) if len(parts) > 1 else parts[0]
        received = apply_receiver(echoes, options.receiver).echoes
        compressed = range_process(received, options.range_taper)
    return spectrogram(compressed.channel(0), wanted, options.doppler_taper)


def findings_of_frame(
    frame_input: FrameInput,
    statistics: FrameStatistics,
    budget: BudgetReport,
    speckle: FrameSpeckle,
    expected: ExpectedPower | None,
    received: ReceivedSignal,
    weather: Weather,
) -> list[Finding]:
    """Collect the findings of all stages about a frame. `weather` has the echo of rain only if the
    frame shows it.
    """
    scatterers, report = speckle.report(), received.echoes.report
    mode = frame_input.frame.sampling_mode
    rendered = [*frame_input.frame.record.findings]
    rendered += itertools.chain(*(table.record.findings for table in frame_input.tables))
    explained = any(item.code in NO_ECHO_CODES for item in rendered)
    unranged = frame_input.table.record.unranged_power_fraction if frame_input.tables else 0.0
    of_paths = statistics_findings(
        statistics, frame_input.radar, mode, frame_input.range_limits_m, unranged
    )
    found = itertools.chain(
        rendered,
        (item for item in of_paths if item.code != "no-echo" or not explained),
        weather.findings(frame_input.radar.waveform.carrier_hz),
        budget.findings,
        speckle.findings,
        [] if expected is None else expected.findings,
        [] if report is None else report.accuracy_findings(),
        [] if scatterers is None else scatterers.findings,
        _radar_findings(frame_input, statistics.power_w > 0),
        received.findings,
    )
    return [item.in_frame(frame_input.frame.number) for item in found]


def _radar_findings(frame_input: FrameInput, echoing: bool) -> list[Finding]:
    radar, stop_m = frame_input.radar, frame_input.range_limits_m[1]
    # A run without an echo ends where it begins: its range limits tell nothing of a scene.
    found = find_suspicious_parameters(radar, stop_m if echoing else None)
    own_hz, now_hz = frame_input.frame.run.radar.waveform.carrier_hz, radar.waveform.carrier_hz
    if abs(now_hz / own_hz - 1) > _CARRIER_SLACK:
        found.append(finding("carrier-differs-from-run", carrier_hz=now_hz, run_carrier_hz=own_hz))
    unambiguous_m = radar.waveform.unambiguous_range_m
    if stop_m > unambiguous_m * (1 + 1e-9):
        numbers = {"range_limit_m": stop_m, "unambiguous_range_m": unambiguous_m}
        if radar.waveform.kind == "fmcw":
            found.append(finding("range-limits-beyond-sampled-band", **numbers))
        else:
            found.append(finding("range-limits-beyond-unambiguous-range", **numbers))
    return found
