# SPDX-License-Identifier: GPL-3.0-or-later
"""How a run is processed: options, and what of them a run settles."""

from __future__ import annotations

import dataclasses
import difflib
from dataclasses import dataclass
from typing import Any, Literal, Self, TypeAlias, get_args

from ...contract import AMPLITUDE_MODEL, AmplitudeModel, LinkBudget
from ...errors import ConfigError, SettingNameError
from ...options import check_settings, choices_from, declared, documented, setting
from ..decoding import MAX_RANGE_RATE_MPS, FrameInput, open_frame
from ..detection import Cfar
from ..echoes import EchoOptions, Receiver, check_window, window_samples
from ..maps import SpectrogramOptions
from ..radar import WAVEFORM_KINDS, WINDOW_NAMES, Burst, Radar, Weather, read_system
from ..runs import RadarFrame, Run
from ..spectrum import TOLERANCE, Backend, Method

#: File that an animation of all frames is written as.
AnimationFormat: TypeAlias = Literal["gif", "mp4"]
#: Not choices: two of the names stand for patterns with numbers.
_TAPERS = ", ".join(WINDOW_NAMES)


def _seed_or_none(text: str) -> int | None:
    return None if text == "none" else int(text)


_seed_or_none.__name__ = "seed (a whole number or none)"  # argparse names the type


@documented
@dataclass(frozen=True)
class ProcessOptions:
    """How a run is processed.

    Parameters
    ----------
    radar
        Another waveform and burst than the run's own: nothing of the renders depends on them but
        materials on the carrier.
    receiver
        Noise, ADC, phase noise, see :class:`.echoes.receiver.Receiver`; ideal by default.
    weather
        Rain, fog and gases, see :class:`.radar.Weather`; None: the run's own.
    cfar
        Detector, see :class:`.detection.Cfar`; None: no detections, but those of an array with the
        default detector.
    spectrogram
        Windows, ranges or object of a spectrogram, see :class:`.maps.SpectrogramOptions`; None: no
        spectrogram.
    """

    amplitude_model: AmplitudeModel | None = setting(default=None, **AMPLITUDE_MODEL)
    receive_antenna_gain_dbi: float = setting(
        "Receive antenna gain", "Set the gain of the receive antenna of a run without link budget",
        0.0, unit="dBi",
    )  # fmt: skip
    range_taper: str = setting(
        "Range taper", f"Choose the window over the band: {_TAPERS}", "hamming", metavar="NAME",
    )  # fmt: skip
    doppler_taper: str = setting(
        "Doppler taper", f"Choose the window over the pulses: {_TAPERS}", "hamming", metavar="NAME",
    )  # fmt: skip
    range_limits_m: tuple[float, float] | None = setting(
        "Range limits", "Set the one-way ranges of the profile. None: those of the run", None,
        unit="m", metavar="A:B",
    )  # fmt: skip
    max_range_rate_mps: float = setting(
        "Max range rate", "Set the limit of a believable range rate between the snapshots",
        MAX_RANGE_RATE_MPS, unit="m/s", minimum=0.0,
    )  # fmt: skip
    nufft_backend: Backend = setting(
        "NUFFT backend",
        "Choose how echoes are summed: by finufft, or term by term (slow) as a check", "finufft",
        choices=choices_from(get_args(Backend)),
    )  # fmt: skip
    tolerance: float = setting(
        "Tolerance", "Set the relative error of the echoes' spectrum", TOLERANCE,
        minimum=1e-13, maximum=1e-2,
    )  # fmt: skip
    slow_time_transform: Method = setting(
        "Slow-time transform", "Choose the transform of moving paths", "auto",
        choices=choices_from(get_args(Method)),
    )  # fmt: skip
    speckle_seed: int | None = setting(
        "Speckle seed", "Set the seed of the random phases of rough scatterers. none: no phases", 0,
        parse=_seed_or_none, metavar="N",
    )  # fmt: skip
    speckle_cell_size_m: float | None = setting(
        "Speckle cell size", "Set the size of a scatterer's cell. None: by the pixels' footprints",
        None, unit="m", above=0.0,
    )  # fmt: skip
    products: bool = setting("Products", "Write the four EXR products", True)
    plots: bool = setting("Plots", "Draw pictures", True)
    animate: bool | None = setting(
        "Animate", "Write an animation of all frames' maps. None: with several frames", None
    )
    animation_format: AnimationFormat = setting(
        "Animation format", "Set the format of the animation; MP4 needs Blender's module bpy",
        "gif", choices=(("gif", "GIF", ""), ("mp4", "MP4", "")),
    )  # fmt: skip
    link_budget: LinkBudget | None = setting(
        "Link budget", "Read the link budget (JSON, see docs/system.md). None: the run's own", None,
        parse=read_system, metavar="FILE",
    )  # fmt: skip
    radar: Radar | None = None
    receiver: Receiver = dataclasses.field(default_factory=Receiver)
    weather: Weather | None = None
    thermal_noise: bool = setting(
        "Thermal noise", "Add the thermal noise of the link budget", False
    )
    mti: int = setting(
        "MTI canceller", "Cancel stationary echoes over 2 or 3 pulses. 0: none", 0,
        choices=(("0", "None", ""), ("2", "Two Pulses", ""), ("3", "Three Pulses", "")),
    )  # fmt: skip
    cfar: Cfar | None = None
    spectrogram: SpectrogramOptions | None = None
    parts: bool = setting(
        "Parts", "List parts of objects, such as the wheels of a car, by themselves", False
    )
    hdf5: bool = setting("HDF5", "Write all results as HDF5", False)
    sigmf: bool = setting("SigMF", "Write the raw I/Q as SigMF", False)
    parquet: bool = setting("Parquet", "Write the targets of an array as Parquet", False)
    ros_bag: bool = setting("ROS 2 bag", "Write the targets of an array as a ROS 2 bag", False)

    def __new__(cls, *_: object, **given: object) -> Self:
        """Refuse unknown names with the nearest known one; dataclasses name none."""
        fields = [item.name for item in dataclasses.fields(cls)]
        for name in given:
            if name not in fields:
                raise SettingNameError(
                    f"{cls.__name__} has no option {name!r}; {_hint(name, fields)}"
                )
        return super().__new__(cls)

    @property
    def receiver_gain(self) -> float:
        """G_r, linear, for runs without a link budget."""
        return float(10 ** (self.receive_antenna_gain_dbi / 10))

    def for_run(self, run: Run) -> ResolvedOptions:
        """Settle what the run decides.

        Parameters
        ----------
        run
            The run that is to be processed.

        Returns
        -------
        ResolvedOptions
            These options with the run's radar and link budget, where none are given.

        Raises
        ------
        ConfigError
            A receiver gain and a link budget, which has one already; thermal noise without a link
            budget; an unknown canceller; a tolerance or range limits that cannot be; files of an
            array without one.
        """
        check_settings(self)
        for name, kind in (("cfar", Cfar), ("spectrogram", SpectrogramOptions)):
            value = getattr(self, name)
            if not isinstance(value, kind | None):
                raise ConfigError(
                    f"{name} of ProcessOptions is {value!r}; expected {kind.__name__}(...) or None."
                )
        link_budget = self.link_budget or run.record.link_budget
        if link_budget is not None and self.receive_antenna_gain_dbi != 0:
            raise ConfigError(
                f"A receiver gain of {self.receive_antenna_gain_dbi:g} dBi is given, and a link "
                "budget, whose receiver antenna has one. Set gain_dbi there, or leave the receiver "
                "gain out."
            )
        radar = self.radar or run.radar
        if (self.parquet or self.ros_bag) and len(radar.channels) < 2:
            wanted = "Parquet" if self.parquet else "A ROS 2 bag"
            raise ConfigError(
                f"{wanted} is asked for, which holds the targets of an array, and the radar has "
                "one element. Give it an array (docs/arrays.md), or leave the file out."
            )
        limits_m = check_window(self.range_limits_m or run.range_limits_m)
        radar.check_size(window_samples(radar, limits_m))
        settled = {
            "amplitude_model": self.amplitude_model
            or (link_budget or LinkBudget()).amplitude_model,
            "link_budget": link_budget,
            "radar": radar,
            "receiver": self._receiver(link_budget),
            "weather": self.weather or run.weather,
            "limits_m": limits_m,
        }
        return ResolvedOptions(**(vars(self) | settled))

    def _receiver(self, link_budget: LinkBudget | None) -> Receiver:
        if not self.thermal_noise:
            return self.receiver
        if link_budget is None:
            raise ConfigError(
                "The noise of the link budget is asked for, and the run has none. Give a noise "
                "figure, or a link budget."
            )
        return dataclasses.replace(
            self.receiver,
            noise_figure_db=link_budget.noise_figure_db,
            antenna_temperature_k=link_budget.antenna_temperature_k,
        )


def _hint(name: str, options: list[str]) -> str:
    """Return where a name belongs that is no option of processing, or which it resembles."""
    parts: dict[str, Any] = {
        "receiver": Receiver, "link_budget": LinkBudget, "weather": Weather, "cfar": Cfar,
        "spectrogram": SpectrogramOptions,
    }  # fmt: skip
    ways: dict[str, str] = {}
    for option, kind in parts.items():
        for field, item in declared(kind).items():
            way = f"{option}=signal.{kind.__name__}({field}=...)"
            for word in (item.flag.lstrip("-").replace("-", "_"), field, f"{option}_{field}"):
                ways.setdefault(word, way)
    of_radar = ["waveform", "burst", "channels", "array"]
    of_radar += [field for kind in (Burst, *WAVEFORM_KINDS.values()) for field in declared(kind)]
    ways |= dict.fromkeys(of_radar, "radar=signal.Radar(...)")
    ways |= {word: f"the argument {word} of the function" for word in ("out", "frames")}
    if name in ways:
        return f"give {ways[name]}."
    near = difflib.get_close_matches(name, options, 2, 0.6)
    near = near or [ways[word] for word in difflib.get_close_matches(name, ways, 2, 0.6)]
    found = " or ".join(dict.fromkeys(near))
    return f"did you mean {found}?" if near else "docs/signal.md lists them."


@documented
@dataclass(frozen=True, kw_only=True)
class ResolvedOptions(ProcessOptions):
    """Options for a run, with nothing left open; made by :meth:`ProcessOptions.for_run`.

    Parameters
    ----------
    amplitude_model, radar, weather
        As in `ProcessOptions`, never None.
    limits_m
        One-way ranges (start, stop) of all frames [m].
    receiver, cfar, spectrogram
        As in `ProcessOptions`.
    """

    amplitude_model: AmplitudeModel
    radar: Radar
    weather: Weather
    limits_m: tuple[float, float]

    @property
    def echo_options(self) -> EchoOptions:
        """Options of the echo synthesis. Only powers in watts get random phases."""
        watts = self.amplitude_model == "radar-equation"
        return EchoOptions(
            amplitude_model=self.amplitude_model,
            receiver_gain=self.receiver_gain,
            nufft_backend=self.nufft_backend,
            tolerance=self.tolerance,
            slow_time_transform=self.slow_time_transform,
            speckle_seed=self.speckle_seed if watts else None,
        )

    @property
    def writers(self) -> tuple[str, ...]:
        """Names of the writers of result files, pictures and summary apart."""
        array = len(self.radar.channels) > 1
        wanted = {
            "points": array, "parquet": self.parquet, "hdf5": self.hdf5, "sigmf": self.sigmf,
            "exr": self.products,
        }  # fmt: skip
        return ("npz", "csv", *(name for name, wish in wanted.items() if wish))

    def open(self, frame: RadarFrame) -> FrameInput:
        """Open a frame with the radar, link budget and range limits of these options.

        Raises
        ------
        FrameFileError, SchemaError
            As :func:`.decoding.open_frame`.
        """
        opened = open_frame(
            frame, radar=self.radar, link_budget=self.link_budget, range_limits_m=self.limits_m
        )
        return opened.by_parts() if self.parts else opened

    def record(self) -> dict[str, Any]:
        """Return the options as plain JSON, without the radar, which has a record of its own."""
        given = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(ProcessOptions)
        }
        return dataclasses.asdict(ProcessOptions(**(given | {"radar": None})))
