# SPDX-License-Identifier: GPL-3.0-or-later
"""How a run is processed, and what comes of a frame."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from ...contract import AmplitudeModel, LinkBudget
from ...errors import ConfigError
from ..decoding import MAX_RANGE_RATE_MPS
from ..echoes import Receiver
from ..radar import Radar
from ..runs import Run
from ..spectrum import TOLERANCE, Backend, Method
from .cfar import Cfar


@dataclass(frozen=True)
class Progress:
    """`done` of `total` steps of the whole run are done; `text` says which was the last."""

    done: int
    total: int
    text: str


@dataclass(frozen=True)
class ProcessOptions:
    """How a run is processed.

    Attributes
    ----------
    amplitude_model
        "radar-equation" or "paper", see :func:`.paths.paths.path_amplitude`; None: the system's, or
        "radar-equation" without one.
    receiver_gain
        G_r, linear, for runs without a system.
    window, doppler_taper
        Windows over the band and over the pulses, see :mod:`.radar.windows`.
    range_limits_m
        One-way ranges (start, stop) [m]; None: what the rings cover.
    max_range_rate_mps
        Limit of a believable |range rate| between the passes [m/s].
    method
        Engine of the non-uniform FFT.
    tolerance
        Relative L2 error of the echoes' spectrum against the direct sum.
    synthesis
        "auto", "type3", "per-pulse" or "direct", see
        :class:`.spectrum.accumulator.SpectrumAccumulator`.
    speckle_seed
        Of the random phases of rough scatterers, "radar-equation" only; None: no such phases, see
        :mod:`.scattering.surface_speckle`.
    speckle_cell_size_m
        Edge of the cells that hold one scatterer each [m]; None: from the pixels' footprints.
    products
        Whether to write the four EXR products.
    plots
        Whether to draw pictures; None: where matplotlib is installed.
    animate
        Whether to write a GIF of all frames' maps; None: where there are pictures and several
        frames.
    system
        Power budget, see :mod:`.radar.link_budget`; None: the run's own.
    radar
        Another waveform and burst than the run's own: nothing of the renders depends on them but
        materials on the carrier.
    receiver
        Noise, ADC, phase noise, see :class:`.echoes.receiver.Receiver`; ideal by default.
    system_noise
        Thermal noise with the noise figure and antenna temperature of the system.
    mti
        Canceller over the pulses: 0 (none), 2 or 3 pulses, see :mod:`.maps.mti`.
    cfar
        Detector, see :class:`.detection.cfar.Cfar`; None: no detections.
    hdf5, sigmf
        Whether to write all results as HDF5, the raw I/Q as SigMF.
    """

    amplitude_model: AmplitudeModel | None = None
    receiver_gain: float = 1.0
    window: str = "hamming"
    doppler_taper: str = "hamming"
    range_limits_m: tuple[float, float] | None = None
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS
    method: Backend = "auto"
    tolerance: float = TOLERANCE
    synthesis: Method = "auto"
    speckle_seed: int | None = 0
    speckle_cell_size_m: float | None = None
    products: bool = True
    plots: bool | None = None
    animate: bool | None = None
    system: LinkBudget | None = None
    radar: Radar | None = None
    receiver: Receiver = dataclasses.field(default_factory=Receiver)
    system_noise: bool = False
    mti: int = 0
    cfar: Cfar | None = None
    hdf5: bool = False
    sigmf: bool = False

    def for_run(self, run: Run) -> ProcessOptions:
        """These options with what the run itself says filled in.

        Raises
        ------
        ConfigError
            A receiver gain beside a system, which has one already; the noise of a system without
            one; an unknown canceller; a tolerance out of range.
        """
        if self.mti not in (0, 2, 3):
            raise ConfigError(f"MTI canceller of {self.mti!r} pulses; expected 0, 2 or 3.")
        if not 1e-13 <= self.tolerance <= 1e-2:
            raise ConfigError(f"Tolerance is {self.tolerance:g}; expected 1e-13 to 1e-2.")
        system = self.system or run.record.link_budget
        if system is not None and self.receiver_gain != 1:
            raise ConfigError(
                f"A receiver gain of {self.receiver_gain:g} is given, and a system, whose receiver "
                "antenna has one. Set gain_dbi there, or leave the receiver gain out."
            )
        amplitude_model = self.amplitude_model or (system or LinkBudget()).amplitude_model
        receiver = self.receiver
        if self.system_noise:
            if system is None:
                raise ConfigError(
                    "The noise of the system is asked for, and the run has none. Give a noise "
                    "figure, or a system."
                )
            receiver = dataclasses.replace(
                receiver,
                noise_figure_db=system.noise_figure_db,
                antenna_temperature_k=system.antenna_temperature_k,
            )
        return dataclasses.replace(
            self,
            amplitude_model=amplitude_model,
            system=system,
            radar=self.radar or run.radar,
            receiver=receiver,
        )

    def record(self) -> dict[str, Any]:
        """As plain JSON, without the radar, which has a record of its own."""
        return dataclasses.asdict(dataclasses.replace(self, radar=None))
