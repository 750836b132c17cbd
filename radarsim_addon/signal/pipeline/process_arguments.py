# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments of ``radarsim process``, and the options that they make."""

from __future__ import annotations

import argparse
import math
from typing import Any, get_args

from ...contract import AmplitudeModel
from ...physics.constants import REFERENCE_TEMPERATURE_K
from ..decoding import MAX_RANGE_RATE_MPS
from ..detection import Cfar, CfarKind, ProcessOptions
from ..echoes import Receiver, load_phase_noise
from ..radar import WINDOW_NAMES, Burst, load_radar, read_system
from ..runs import open_run
from ..spectrum import TOLERANCE, Backend, Method


def frame_numbers(text: str) -> list[int]:
    """ "3", "1:10" or "1:10,15" as a list of frames, ends included."""
    numbers: list[int] = []
    for part in text.split(","):
        ends = [int(end) for end in part.split(":")]
        if len(ends) > 2 or ends[-1] < ends[0] or ends[-1] - ends[0] > 1_000_000:
            raise ValueError(part)
        numbers.extend(range(ends[0], ends[-1] + 1))
    return numbers


def range_window(text: str) -> tuple[float, float]:
    """ "0:5250" as two ranges in metres."""
    start, stop = (finite(end) for end in text.split(":"))
    return start, stop


def seed(text: str) -> int | None:
    """ "7" or "none"."""
    return None if text == "none" else int(text)


def finite(text: str) -> float:
    """A number that is neither NaN nor infinite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


seed.__name__ = "seed (a whole number or none)"
finite.__name__ = "finite number"
frame_numbers.__name__ = "frames (like 1:10)"  # argparse names the type in its message
range_window.__name__ = "range window (like 0:5250)"


def pair(text: str) -> tuple[int, int]:
    """ "4,8" as cells in Doppler and range."""
    first, second = (int(part) for part in text.split(","))
    return first, second


pair.__name__ = "cells (Doppler,range, like 4,8)"


def add_process_parser(commands: Any) -> None:
    """Add ``process`` to the commands."""
    process = commands.add_parser(
        "process",
        help="echo, range profile, range-Doppler map and products of every frame",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    process.add_argument("folder", metavar="DIR", help="folder that holds run.json")
    process.add_argument("--out", metavar="DIR", help="folder for the results [DIR/products]")
    process.add_argument("--frames", type=frame_numbers, metavar="A:B", help="frames [all]")
    process.add_argument(
        "--range-limits",
        "--range",
        type=range_window,
        metavar="A:B",
        help="range window in metres [all rings]",
    )
    process.add_argument(
        "--amplitude-model",
        "--weighting",
        choices=get_args(AmplitudeModel),
        help="[the system's, else radar-equation]",
    )
    process.add_argument(
        "--link-budget",
        "--system",
        metavar="FILE",
        help="power budget (JSON, see docs/system.md) [the run's own]",
    )
    process.add_argument(
        "--receive-antenna-gain-dbi",
        "--receiver-gain-db",
        type=finite,
        default=0.0,
        help="G_r in dBi",
    )
    process.add_argument(
        "--range-taper",
        "--window",
        default="hamming",
        help=f"over the band: {', '.join(WINDOW_NAMES)}",
    )
    process.add_argument(
        "--doppler-taper", "--doppler-window", default="hamming", help="over the pulses: the same"
    )
    process.add_argument(
        "--max-range-rate",
        "--max-speed",
        type=finite,
        default=MAX_RANGE_RATE_MPS,
        help="limit of a believable speed, m/s",
    )
    process.add_argument(
        "--nufft-backend",
        "--method",
        choices=get_args(Backend),
        default="auto",
        help="NUFFT engine",
    )
    process.add_argument(
        "--tolerance", type=finite, default=TOLERANCE, help="relative error of the echoes"
    )
    process.add_argument(
        "--slow-time-transform",
        "--synthesis",
        choices=get_args(Method),
        default="auto",
        help="way of moving paths",
    )
    process.add_argument(
        "--speckle-seed",
        type=seed,
        default=0,
        metavar="N",
        help="random phases of rough scatterers, a whole number or 'none'",
    )
    process.add_argument(
        "--speckle-cell-size",
        "--speckle-cell",
        type=finite,
        metavar="M",
        help="edge of a scatterer's cell in metres [from the pixels' footprints]",
    )
    _add_radar_group(process)
    _add_detection_group(process)
    _add_output_group(process)


def _add_radar_group(process: argparse.ArgumentParser) -> None:
    group = process.add_argument_group("radar and receiver (docs/waveforms.md, docs/receiver.md)")
    group.add_argument(
        "--waveform",
        "--radar",
        metavar="FILE",
        help="another waveform and burst (JSON) [the run's own]",
    )
    group.add_argument(
        "--thermal-noise", "--noise", action="store_true", help="thermal noise of the run's system"
    )
    group.add_argument(
        "--noise-figure-db", type=finite, metavar="DB", help="thermal noise of this figure [none]"
    )
    group.add_argument(
        "--antenna-temperature",
        type=finite,
        default=REFERENCE_TEMPERATURE_K,
        metavar="K",
        help="what the antenna sees",
    )
    group.add_argument("--noise-seed", type=int, default=0, metavar="N", help="of all noise")
    group.add_argument("--adc-bits", type=int, metavar="N", help="of each of I and Q [exact]")
    group.add_argument(
        "--adc-full-scale", type=finite, metavar="A", help="sqrt(W) at which it clips [largest]"
    )
    group.add_argument(
        "--phase-noise", metavar="FILE", help="oscillator (CSV: offset_hz, level_dbc_hz) [none]"
    )


def _add_detection_group(process: argparse.ArgumentParser) -> None:
    group = process.add_argument_group("detection (docs/detection.md)")
    group.add_argument(
        "--mti", type=int, choices=(0, 2, 3), default=0, help="canceller of 2 or 3 pulses"
    )
    group.add_argument("--cfar", choices=get_args(CfarKind), help="find targets [no]")
    group.add_argument("--pfa", type=finite, default=1e-6, help="false alarms per cell")
    group.add_argument("--cfar-guard", type=pair, default=(4, 8), metavar="D,R", help="guard cells")
    group.add_argument(
        "--cfar-train", type=pair, default=(4, 24), metavar="D,R", help="training cells"
    )


def _add_output_group(process: argparse.ArgumentParser) -> None:
    group = process.add_argument_group("files")
    group.add_argument("--hdf5", action="store_true", help="all results as HDF5 (h5py)")
    group.add_argument("--sigmf", action="store_true", help="raw I/Q as SigMF")
    group.add_argument("--no-products", action="store_true", help="write no EXR products")
    group.add_argument("--no-plots", action="store_true", help="draw no pictures")
    group.add_argument(
        "--animate",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="a GIF of all frames' range-Doppler maps [with several frames]",
    )
    group.add_argument(
        "--allow-incomplete", action="store_true", help="skip frames that are not all there"
    )


def process_options(chosen: argparse.Namespace) -> ProcessOptions:
    """Options from parsed arguments.

    Raises
    ------
    RadarSimError
        A file that they name cannot be read, or numbers that do not fit.
    """
    noise = chosen.phase_noise
    return ProcessOptions(
        amplitude_model=chosen.amplitude_model,
        receiver_gain=10 ** (chosen.receive_antenna_gain_dbi / 10),
        window=chosen.range_taper,
        doppler_taper=chosen.doppler_taper,
        range_limits_m=chosen.range_limits,
        max_range_rate_mps=chosen.max_range_rate,
        method=chosen.nufft_backend,
        tolerance=chosen.tolerance,
        synthesis=chosen.slow_time_transform,
        speckle_seed=chosen.speckle_seed,
        speckle_cell_size_m=chosen.speckle_cell_size,
        products=not chosen.no_products,
        plots=False if chosen.no_plots else None,
        animate=chosen.animate,
        system=None if chosen.link_budget is None else read_system(chosen.link_budget),
        radar=None
        if chosen.waveform is None
        else load_radar(chosen.waveform, own_burst(chosen.folder)),
        receiver=Receiver(
            noise_figure_db=chosen.noise_figure_db,
            antenna_temperature_k=chosen.antenna_temperature,
            adc_bits=chosen.adc_bits,
            full_scale=chosen.adc_full_scale,
            phase_noise=None if noise is None else load_phase_noise(noise),
            seed=chosen.noise_seed,
        ),
        system_noise=chosen.thermal_noise,
        mti=chosen.mti,
        cfar=_cfar(chosen),
        hdf5=chosen.hdf5,
        sigmf=chosen.sigmf,
    )


def own_burst(folder: str) -> Burst:
    """The burst of a run, for a radar file that holds none."""
    return open_run(folder).radar.burst


def _cfar(chosen: argparse.Namespace) -> Cfar | None:
    if chosen.cfar is None:
        return None
    return Cfar(chosen.cfar, chosen.pfa, chosen.cfar_guard, chosen.cfar_train)
