# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder to its products, frame by frame.

    for event in process_run("out/paper"):
        print(event)

yields a :class:`Progress` after each step and a :class:`FrameResult` after each frame. Memory is
bounded by one frame, however many there are, as long as the caller lets go of the results.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..contract import PRODUCTS_DIR, SystemRecord
from ..errors import ConfigError, FrameFileError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from . import plots
from .antennaplot import ANTENNA_PICTURE, plot_antennas
from .budget import BudgetReport, FrameBudget
from .compress import Compressed, PowerProfile, ProfileAccumulator, compress
from .config import Radar
from .detect import LeadingEdge, Peak, find_peaks, leading_edges
from .doppler import MAX_SPEED_MPS
from .echoes import Echoes, check_window
from .families import synthesizer_for
from .files import make_folder, write_arrays, write_json
from .frames import RadarFrame, Run, open_run
from .framestats import FrameStatistics, StatisticsSum, statistics_warnings
from .link import Link
from .nufft import Backend
from .paths import Weighting, iter_paths
from .products import write_products
from .rangedoppler import RangeDopplerMap, range_doppler
from .scatterers import SpeckleReport
from .specklestage import FrameSpeckle
from .synthesis import TOLERANCE, Method
from .system import make_system, weighting_of
from .uncertainty import ExpectedPower, expected_power
from .waveform_files import waveform_to_dict

#: Below the strongest cell by more than this is rounding, not an echo: float32 renders. Less where
#: the tolerance of the synthesis is coarse [dB].
_MAP_DYNAMICS_DB = 160.0


@dataclass(frozen=True)
class Progress:
    """`done` of `total` steps of the whole run are done; `text` says which was the last."""

    done: int
    total: int
    text: str


@dataclass(frozen=True)
class FrameResult:
    """All that was computed of one radar frame, and the files that hold it.

    `expected` (expected power with standard errors) is there for the acquisition "paths", whose
    sub-pixel shifts are replicates.
    """

    frame: int
    time_s: float
    statistics: FrameStatistics
    echoes: Echoes
    compressed: Compressed
    profile: PowerProfile
    rd_map: RangeDopplerMap
    edges: list[LeadingEdge]
    movers: list[Peak]
    warnings: list[str]
    files: list[Path]
    expected: ExpectedPower | None = None
    budget: BudgetReport | None = None
    speckle: SpeckleReport | None = None


@dataclass(frozen=True)
class ProcessOptions:
    """How a run is processed.

    Attributes
    ----------
    weighting
        "radar-equation" or "paper", see :func:`.paths.path_amplitude`; None: the system's, or
        "radar-equation" without one.
    receiver_gain
        G_r, linear, for runs without a system.
    window, doppler_window
        Windows over the band and over the pulses, see :mod:`.windows`.
    window_m
        One-way ranges (start, stop) [m]; None: what the rings cover.
    max_speed_mps
        Limit of a believable |range rate| between the passes [m/s].
    method
        Engine of the non-uniform FFT.
    tolerance
        Relative L2 error of the echoes' spectrum against the direct sum.
    synthesis
        "auto", "type3", "per-pulse" or "direct", see :class:`.synthesis.SpectrumAccumulator`.
    speckle_seed
        Of the random phases of rough scatterers, "radar-equation" only; None: no such phases, see
        :mod:`.scatterers`.
    speckle_cell_m
        Edge of the cells that hold one scatterer each [m]; None: from the pixels' footprints.
    products
        Whether to write the four EXR products.
    plots
        Whether to draw pictures; None: where matplotlib is installed.
    system
        Power budget, see :mod:`.system`; None: the run's own.
    """

    weighting: Weighting | None = None
    receiver_gain: float = 1.0
    window: str = "hamming"
    doppler_window: str = "hamming"
    window_m: tuple[float, float] | None = None
    max_speed_mps: float = MAX_SPEED_MPS
    method: Backend = "auto"
    tolerance: float = TOLERANCE
    synthesis: Method = "auto"
    speckle_seed: int | None = 0
    speckle_cell_m: float | None = None
    products: bool = True
    plots: bool | None = None
    system: SystemRecord | None = None

    def for_run(self, run: Run) -> ProcessOptions:
        """These options with what the run itself says filled in.

        Raises
        ------
        ConfigError
            A receiver gain beside a system, which has one already.
        """
        system = self.system or run.record.system
        if system is not None and self.receiver_gain != 1:
            raise ConfigError(
                f"A receiver gain of {self.receiver_gain:g} is given, and a system, whose receiver "
                "antenna has one. Set gain_dbi there, or leave the receiver gain out."
            )
        weighting = self.weighting or weighting_of(system)
        return dataclasses.replace(self, weighting=weighting, system=system)


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
        velocity_mps, range_m, power [Doppler, range]); ``_summary.json``; pictures
        ``_rings.png``, ``_echo.png``, ``_matched_filter.png``, ``_range_doppler.png``. With a
        system ``antennas.png``, once.

    Raises
    ------
    RadarSimError
        One of its named kinds, see :mod:`radarsim_addon.errors`.
    """
    options = options or ProcessOptions()
    run = open_run(path)
    options = options.for_run(run)
    chosen = [run.frame(n) for n in frames] if frames is not None else list(run.frames())
    folder = make_folder(Path(out) if out is not None else run.path / PRODUCTS_DIR)
    draws = plots.has_matplotlib() if options.plots is None else options.plots
    if options.system is not None and draws:
        system = make_system(options.system, run.radar.waveform.wavelength_m)
        plots.save(plot_antennas(system), folder / ANTENNA_PICTURE)
    steps = run.record.rings + 3
    total, finished, complete = steps * len(chosen), 0, 0
    for frame in chosen:
        gaps = frame.missing()
        if gaps and not allow_incomplete:
            raise FrameFileError(_gaps_text(run, frame, len(gaps), gaps[0].reason))
        if gaps:
            finished += steps
            text = f"frame {frame.number} skipped: {len(gaps)} of its renders are missing"
            yield Progress(finished, total, text)
            continue
        complete += 1
        for event in _process_frame(run, frame, folder, options):
            if isinstance(event, FrameResult):
                yield event
            else:
                finished += 1
                yield Progress(finished, total, event)
    if not complete:
        raise FrameFileError(
            f"{run.path} has no complete frame to process. Render the run again: it goes on where "
            "it stopped."
        )


def _gaps_text(run: Run, frame: RadarFrame, count: int, first: str) -> str:
    return (
        f"{frame.path} lacks {count} of {run.record.rings * run.record.passes} renders; the first: "
        f"{first}. Render the run again: it goes on where it stopped. Or process only what is "
        "complete with --allow-incomplete."
    )


def _process_frame(
    run: Run, frame: RadarFrame, folder: Path, options: ProcessOptions
) -> Iterator[str | FrameResult]:
    window_m = check_window(options.window_m or run.window_m)
    assert options.weighting is not None  # by `for_run`
    budget = FrameBudget(frame, run.radar, options.system)
    seed = options.speckle_seed if options.weighting == "radar-equation" else None
    speckle = FrameSpeckle(frame, run.radar, seed, options.speckle_cell_m)
    synthesizer = synthesizer_for(
        run.radar,
        window_m,
        weighting=options.weighting,
        receiver_gain=options.receiver_gain,
        method=options.method,
        tolerance=options.tolerance,
        synthesis=options.synthesis,
        speckle_seed=seed,
    )
    accumulator = ProfileAccumulator(
        run.radar,
        window_m,
        window=options.window,
        weighting=options.weighting,
        receiver_gain=options.receiver_gain,
        method=options.method,
    )
    total = StatisticsSum(run.radar, options.receiver_gain)
    for ring, paths in enumerate(iter_paths(frame, max_speed_mps=options.max_speed_mps)):
        paths = speckle.apply(budget.apply(paths))
        synthesizer.add(paths)
        accumulator.add(paths)
        total.add(paths)
        if frame.acquisition == "rings":
            yield f"frame {frame.number}: ring {ring + 1} of {frame.rings}"
    echoes = synthesizer.result()
    compressed = compress(echoes, options.window)
    rd_map = range_doppler(compressed, options.doppler_window)
    profile = accumulator.result()
    statistics = total.result(echoes.outside)
    # windows are at most three cells wide to each side: what is slower hides in the stripe
    slowest_mps = 3 * run.radar.velocity_resolution_mps
    scatterers = speckle.report()
    report = budget.report(statistics.power_w, options.window, options.doppler_window)
    result = FrameResult(
        frame=frame.number,
        time_s=frame.time_s,
        statistics=statistics,
        echoes=echoes,
        compressed=compressed,
        profile=profile,
        rd_map=rd_map,
        edges=_edges(profile),
        movers=_movers(rd_map, slowest_mps, options.tolerance),
        warnings=statistics_warnings(statistics, run.radar)
        + report.warnings
        + speckle.warnings
        + _inexact(echoes)
        + (scatterers.warnings if scatterers is not None else []),
        files=[],
        expected=_expected(frame, run, window_m, options, budget.link),
        budget=report,
        speckle=scatterers,
    )
    yield f"frame {frame.number}: echoes, map"
    result.files.extend(_write_results(result, folder, options))
    if options.products and frame.acquisition == "rings":
        result.files.extend(write_products(frame, folder))
    yield f"frame {frame.number}: products"
    if plots.has_matplotlib() if options.plots is None else options.plots:
        result.files.extend(_draw(frame, result, folder))
    yield f"frame {frame.number}: pictures"
    yield result


def _inexact(echoes: Echoes) -> list[str]:
    """A warning where the echoes may miss their tolerance."""
    text = None if echoes.report is None else echoes.report.accuracy_warning()
    return [text] if text else []


def _expected(
    frame: RadarFrame,
    run: Run,
    window_m: tuple[float, float],
    options: ProcessOptions,
    link: Link | None,
) -> ExpectedPower | None:
    if frame.acquisition != "paths" or options.weighting != "radar-equation":
        return None
    return expected_power(
        frame,
        run.radar,
        window_m,
        window=options.window,
        doppler_window=options.doppler_window,
        receiver_gain=options.receiver_gain,
        link=link,
    )


def _paired_reach_m(radar: Radar) -> float:
    """How far from a strong echo its paired echoes may lie: a pulse's length."""
    if radar.waveform.family != "pulse":
        return 0.0
    return SPEED_OF_LIGHT_MPS * radar.waveform.duration_s / 2


def _edges(profile: PowerProfile) -> list[LeadingEdge]:
    """Leading edges, without the paired echoes of stronger ones: see `_movers`."""
    reach_m = _paired_reach_m(profile.radar)
    found = leading_edges(profile, 12, by="prominence")
    return [
        edge
        for edge in found
        if not any(
            abs(edge.peak_range_m - other.peak_range_m) <= 1.02 * reach_m
            and edge.level_db < other.level_db - 28
            for other in found
        )
    ][:5]


def _movers(rd_map: RangeDopplerMap, slowest_mps: float, tolerance: float) -> list[Peak]:
    """Peaks off the 0 Hz stripe; none where there are too few pulses to tell.

    A chirp of low time-bandwidth product has paired echoes up to its own length away, some 38 dB
    down whatever the window (the Fresnel ripple of its spectrum): peaks 30 dB below a stronger
    one at the same speed within that distance are taken for these, and at any speed those 40 dB
    below it, where the Doppler window has its sidelobes.
    """
    if rd_map.radar.burst.pulses < 16:
        return []
    reach_m = _paired_reach_m(rd_map.radar)
    same_mps = 2 * rd_map.radar.velocity_resolution_mps
    kept: list[Peak] = []
    dynamics_db = min(_MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))
    floor_db = float(rd_map.power_db.max()) - dynamics_db
    for peak in find_peaks(rd_map, 20, min_speed_mps=slowest_mps, min_above_db=10.0):
        if peak.level_db < floor_db:
            continue
        near = [other for other in kept if abs(peak.range_m - other.range_m) < reach_m]
        hidden = any(
            peak.level_db < other.level_db - 40
            or (
                peak.level_db < other.level_db - 30
                and abs(peak.velocity_mps - other.velocity_mps) < same_mps
            )
            for other in near
        )
        if not hidden:
            kept.append(peak)
    return kept[:5]


def _write_results(result: FrameResult, folder: Path, options: ProcessOptions) -> list[Path]:
    stem = folder / f"frame_{result.frame:04d}"
    profile, rd_map = result.profile, result.rd_map
    names = [stem.with_name(stem.name + s) for s in ("_profile.npz", "_map.npz", "_summary.json")]
    write_arrays(
        names[0],
        {
            "range_m": profile.range_m,
            "expected_power": profile.power,
            "coherent_range_m": result.compressed.range_m,
            "coherent_power": np.mean(np.abs(result.compressed.values) ** 2, axis=0),
        },
    )
    write_arrays(
        names[1],
        {
            "doppler_hz": rd_map.doppler_hz,
            "velocity_mps": rd_map.velocity_mps,
            "range_m": rd_map.range_m,
            "power": rd_map.power,
        },
    )
    write_json(
        names[2],
        {
            "frame": result.frame,
            "time_s": result.time_s,
            "options": dataclasses.asdict(options),
            "waveform": waveform_to_dict(rd_map.radar.waveform),
            "burst": dataclasses.asdict(rd_map.radar.burst),
            "sign_convention": "range rate positive = receding; Doppler = -2 v / wavelength",
            "synthesis": dataclasses.asdict(result.echoes.report) if result.echoes.report else None,
            "statistics": dataclasses.asdict(result.statistics),
            "leading_edges": [dataclasses.asdict(edge) for edge in result.edges],
            "movers": [dataclasses.asdict(peak) for peak in result.movers],
            "speckle": None if result.speckle is None else dataclasses.asdict(result.speckle),
            "budget": None if result.budget is None else result.budget.summary(),
            "warnings": result.warnings,
        },
    )
    if result.expected is not None:
        names.append(_write_expected(stem, result.expected))
    return names


def _write_expected(stem: Path, expected: ExpectedPower) -> Path:
    path = stem.with_name(stem.name + "_expected.npz")
    write_arrays(path, {f.name: getattr(expected, f.name) for f in dataclasses.fields(expected)})
    return path


def _draw(frame: RadarFrame, result: FrameResult, folder: Path) -> list[Path]:
    def name(what: str) -> Path:
        return folder / f"frame_{result.frame:04d}_{what}.png"

    title = f"frame {result.frame}"
    rings = []
    if frame.acquisition == "rings":
        rings.append(plots.save(plots.plot_rings(frame), name("rings")))
    return [
        *rings,
        plots.save(plots.plot_echo(result.echoes, f"Raw echo, {title}"), name("echo")),
        plots.save(
            plots.plot_matched_filter(
                result.compressed,
                result.profile,
                result.edges,
                f"Matched filter, {title}",
                expected=result.expected,
            ),
            name("matched_filter"),
        ),
        plots.save(
            plots.plot_range_doppler(
                result.rd_map, result.movers[:1], f"Range-Doppler map, {title}"
            ),
            name("range_doppler"),
        ),
    ]
