# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder to its products, frame by frame.

    for event in process_run("out/paper"):
        print(event)

yields a :class:`Progress` after each step and a :class:`FrameResult` after each frame. Memory is
bounded by one frame, however many there are, as long as the caller lets go of the results.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ...atomic_files import make_folder, remove_file
from ...contract import PRODUCTS_DIR
from ...errors import FrameFileError, OutputError, RadarSimError
from ..decoding import iter_path_chunks
from ..detection import (
    SLOWEST_CELLS,
    FrameBudget,
    FrameResult,
    ProcessOptions,
    Progress,
    StatisticsSum,
    detect_targets,
    find_edges,
    find_moving_targets,
    received_recording,
    statistics_warnings,
)
from ..echoes import (
    Echoes,
    EchoOptions,
    apply_receiver,
    check_window,
    interpolate_renders,
    render_times_s,
    synthesizer_for,
)
from ..maps import (
    ProfileAccumulator,
    dynamics_db,
    expected_power,
    map_noise_gain,
    mti_cancel,
    power_unit,
    range_doppler,
    range_process,
)
from ..pictures import (
    ANTENNA_PICTURE,
    MapFile,
    animate_maps,
    draw_results,
    plot_antennas,
    save_figure,
)
from ..pictures import figure as figures
from ..products import remove_stale, write_products, write_results
from ..radar import Radar, find_suspicious_parameters, make_system
from ..runs import RadarFrame, Run, open_run
from ..scattering import FrameSpeckle

#: The moving picture of all frames' maps, in the folder of the products.
ANIMATION_FILE = "range_doppler.gif"

__all__ = ["FrameResult", "ProcessOptions", "Progress", "process_run"]

#: Carriers that differ by more than this are worth a word about materials.
_CARRIER_SLACK = 0.01


def process_run(
    path: str | Path,
    options: ProcessOptions | None = None,
    *,
    out: str | Path | None = None,
    frames: Sequence[int] | None = None,
    allow_incomplete: bool = False,
) -> Iterator[Progress | FrameResult]:
    """Process a run frame by frame.

    Parameters
    ----------
    path
        Folder that holds ``run.json``.
    options
        How; the defaults where None.
    out
        Folder for the products, made where missing; default ``products`` in the run's folder.
    frames
        Frames to process; all where None.
    allow_incomplete
        Skip frames whose renders are not all there, instead of raising.

    Yields
    ------
    Progress or FrameResult
        Files of a frame, in `out`: ``frame_0001_amplitude_t0.exr`` and the other three products;
        ``_profile.npz`` (range_m, expected_power, coherent_power); ``_map.npz`` (doppler_hz,
        velocity_mps, range_m, power [Doppler, range]); ``_summary.json``; where asked for
        ``_detections.csv`` and ``.json``, ``.h5``, ``.sigmf-data`` and ``.sigmf-meta``; pictures
        ``_rings.png``, ``_echo.png``, ``_range_profile.png``, ``_range_doppler.png``. With a
        system ``antennas.png``, once; with several frames ``range_doppler.gif`` in the end.

    Raises
    ------
    RadarSimError
        One of its named kinds, see :mod:`radarsim_addon.errors`.
    """
    run = open_run(path)
    options = (options or ProcessOptions()).for_run(run)
    chosen = [run.frame(n) for n in frames] if frames is not None else list(run.frames())
    folder = make_folder(Path(out) if out is not None else run.path / PRODUCTS_DIR)
    try:
        yield from _process_frames(run, chosen, folder, options, allow_incomplete)
    except RadarSimError:
        # What cannot be read or written is no error of its own where all is gone.
        for place, kind in ((run.path, FrameFileError), (folder, OutputError)):
            if not place.is_dir():
                raise kind(
                    f"The folder {place} has vanished during the processing: it was removed or "
                    "renamed, or its drive is gone. Put it back, or process again."
                ) from None
        raise


def _process_frames(
    run: Run,
    chosen: Sequence[RadarFrame],
    folder: Path,
    options: ProcessOptions,
    allow_incomplete: bool,
) -> Iterator[Progress | FrameResult]:
    draws = figures.has_matplotlib() if options.plots is None else options.plots
    if options.link_budget is not None and draws:
        wavelength_m = (options.radar or run.radar).waveform.wavelength_m
        system = make_system(options.link_budget, wavelength_m)
        save_figure(plot_antennas(system), folder / ANTENNA_PICTURE)
    steps = run.record.rings + 3
    total, finished, complete = steps * len(chosen), 0, 0
    maps: list[MapFile] = []
    noise_power, unit = 0.0, ""
    for frame in chosen:
        gaps = frame.missing()
        if gaps and not allow_incomplete:
            raise FrameFileError(_gaps_text(frame, len(gaps), gaps[0].reason))
        if gaps:
            finished += steps
            text = f"frame {frame.number} skipped: {len(gaps)} of its renders are missing"
            yield Progress(finished, total, text)
            continue
        complete += 1
        for event in _process_frame(run, frame, folder, options):
            if isinstance(event, FrameResult):
                remove_stale(folder, event.frame, event.files)
                stem = f"frame_{event.frame:04d}"
                maps.append(MapFile(folder / f"{stem}_map.npz", event.frame, event.time_s))
                noise_power = event.map_noise_power
                unit = power_unit(event.echoes.amplitude_model)
                yield event
            else:
                finished += 1
                yield Progress(finished, total, event)
    if not complete:
        raise FrameFileError(
            f"{run.path} has no complete frame to process. Render the run again: it goes on where "
            "it stopped."
        )
    if options.animate or (options.animate is None and draws and len(maps) > 1):
        path = animate_maps(maps, folder / ANIMATION_FILE, noise_power=noise_power, unit=unit)
        yield Progress(total, total, f"animation: {path}")
    else:
        remove_file(folder / ANIMATION_FILE)


def _gaps_text(frame: RadarFrame, count: int, first: str) -> str:
    return (
        f"{frame.path} lacks {count} of {frame.planned} renders; the first: "
        f"{first}. Render the run again: it goes on where it stopped. Or process only what is "
        "complete with --allow-incomplete."
    )


def _process_frame(
    run: Run, frame: RadarFrame, folder: Path, options: ProcessOptions
) -> Iterator[str | FrameResult]:
    range_limits_m = check_window(options.range_limits_m or run.range_limits_m)
    assert options.amplitude_model is not None and options.radar is not None  # by `for_run`
    radar = options.radar
    budget = FrameBudget(frame, radar, options.link_budget)
    seed = options.speckle_seed if options.amplitude_model == "radar-equation" else None
    speckle = FrameSpeckle(frame, radar, seed, options.speckle_cell_size_m)
    synthesizer = _synthesizer(radar, range_limits_m, options, seed)
    accumulator = ProfileAccumulator(
        radar,
        range_limits_m,
        window=options.range_taper,
        amplitude_model=options.amplitude_model,
        receiver_gain=options.receiver_gain,
        method=options.nufft_backend,
    )
    total = StatisticsSum(radar, options.receiver_gain)
    # What is expected of a pixel is spread over all that it covers, where that is known.
    spread = frame.sampling_mode == "paths" and options.amplitude_model == "radar-equation"
    for ring, paths in enumerate(
        iter_path_chunks(frame, max_range_rate_mps=options.max_range_rate_mps)
    ):
        paths = budget.apply(paths)
        synthesizer.add(speckle.apply(paths))
        if not spread:
            accumulator.add(paths)
        total.add(paths)
        if frame.sampling_mode == "rings":
            yield f"frame {frame.number}: ring {ring + 1} of {frame.rings}"
    incoming = synthesizer.result()
    if frame.visibility_updates > 1:
        others = (
            _echoes_of_render(frame.of_burst(number), range_limits_m, options, seed)
            for number in range(1, frame.visibility_updates)
        )
        incoming = interpolate_renders(itertools.chain([incoming], others), render_times_s(frame))
    reception = apply_receiver(incoming, options.receiver)
    echoes = reception.echoes
    compressed = range_process(echoes, options.range_taper)
    filtered = mti_cancel(compressed, options.mti) if options.mti else compressed
    rd_map = range_doppler(filtered, options.doppler_taper)
    expected = None
    if spread:
        expected = expected_power(
            frame,
            radar,
            range_limits_m,
            window=options.range_taper,
            doppler_taper=options.doppler_taper,
            receiver_gain=options.receiver_gain,
            link=budget.link,
            points_to=accumulator.add,
        )
    profile = accumulator.result()
    statistics = total.result(echoes.outside)
    scatterers = speckle.report()
    report = budget.report(
        statistics.power_w,
        options.range_taper,
        options.doppler_taper,
        range_limits_m=range_limits_m,
        mti=options.mti,
    )
    heard = received_recording(echoes, rd_map, options.mti)
    result = FrameResult(
        frame=frame.number,
        time_s=frame.time_s,
        statistics=statistics,
        echoes=echoes,
        compressed=compressed,
        profile=profile,
        rd_map=rd_map,
        edges=find_edges(profile),
        moving_targets=find_moving_targets(
            echoes,
            rd_map,
            options.mti,
            tolerance=options.tolerance,
            # rounding follows the strong echoes: from pulse to pulse it may add up in phase
            noise_power=(reception.noise_power_w + reception.rounding_power_w * radar.burst.pulses)
            * map_noise_gain(radar, options.range_taper, options.doppler_taper),
            # what is blended over the burst has sidelobes of its own beside 0 Hz
            slowest_cells=SLOWEST_CELLS if frame.visibility_updates == 1 else 3.0,
            noisy_columns=options.receiver.phase_noise is not None
            or options.receiver.adc_bits is not None,
            recording=heard,
        ),
        warnings=statistics_warnings(statistics, radar)
        + report.warnings
        + speckle.warnings
        + (expected.warnings if expected is not None else [])
        + _inexact(echoes)
        + (scatterers.warnings if scatterers is not None else [])
        + _radar_warnings(run, radar, range_limits_m, statistics.power_w > 0)
        + _reception_warnings(reception.clipped, echoes.samples.size),
        files=[],
        expected=expected,
        budget=report,
        speckle=scatterers,
        reception=reception,
        detections=None
        if options.cfar is None
        else detect_targets(
            rd_map, options.cfar, dynamics_db(options.tolerance), wide=heard.rd_map
        ),
    )
    yield f"frame {frame.number}: echoes, map"
    result.files.extend(write_results(result, folder, options))
    if options.products and frame.sampling_mode == "rings":
        result.files.extend(write_products(frame, folder))
    yield f"frame {frame.number}: products"
    if figures.has_matplotlib() if options.plots is None else options.plots:
        result.files.extend(draw_results(frame, result, folder, options))
    yield f"frame {frame.number}: pictures"
    yield result


def _synthesizer(
    radar: Radar, range_limits_m: tuple[float, float], options: ProcessOptions, seed: int | None
) -> Any:
    assert options.amplitude_model is not None  # by `for_run`
    return synthesizer_for(
        radar,
        range_limits_m,
        EchoOptions(
            amplitude_model=options.amplitude_model,
            receiver_gain=options.receiver_gain,
            method=options.nufft_backend,
            tolerance=options.tolerance,
            synthesis=options.slow_time_transform,
            speckle_seed=seed,
        ),
        phase_noise=options.receiver.phase_noise,
        phase_noise_seed=options.receiver.phase_noise_seed,
    )


def _echoes_of_render(
    render: RadarFrame,
    range_limits_m: tuple[float, float],
    options: ProcessOptions,
    seed: int | None,
) -> Echoes:
    """Echoes of one of the renders of a burst, for all pulses."""
    assert options.radar is not None  # by `for_run`
    budget = FrameBudget(render, options.radar, options.link_budget)
    speckle = FrameSpeckle(render, options.radar, seed, options.speckle_cell_size_m)
    synthesizer = _synthesizer(options.radar, range_limits_m, options, seed)
    for paths in iter_path_chunks(render, max_range_rate_mps=options.max_range_rate_mps):
        synthesizer.add(speckle.apply(budget.apply(paths)))
    echoes: Echoes = synthesizer.result()
    return echoes


def _inexact(echoes: Echoes) -> list[str]:
    """Warnings where the echoes may miss their tolerance."""
    if echoes.report is None:
        return []
    texts = [echoes.report.accuracy_warning(), echoes.report.ramp_warning()]
    return [text for text in texts if text]


def _radar_warnings(
    run: Run, radar: Radar, range_limits_m: tuple[float, float], echoing: bool
) -> list[str]:
    # A run without an echo ends where it begins: its window tells nothing of a scene.
    found = find_suspicious_parameters(radar, range_limits_m[1] if echoing else None)
    own_hz, now_hz = run.radar.waveform.carrier_hz, radar.waveform.carrier_hz
    if abs(now_hz / own_hz - 1) > _CARRIER_SLACK:
        found.append(
            f"The carrier is {now_hz / 1e9:g} GHz, the run was rendered for {own_hz / 1e9:g} GHz: "
            "materials are those of the latter. Render again where they depend on frequency."
        )
    if range_limits_m[1] > radar.waveform.unambiguous_range_m * (1 + 1e-9):
        found.append(
            f"The range window reaches to {range_limits_m[1]:g} m, the waveform to "
            f"{radar.waveform.unambiguous_range_m:.6g} m: profile and map end there."
        )
    return found


def _reception_warnings(clipped: int, samples: int) -> list[str]:
    if not clipped:
        return []
    text = f"The ADC clipped {clipped} values of I and Q of {samples} samples"
    return [f"{text}. Raise its full scale, or let it be chosen."]
