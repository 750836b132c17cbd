# SPDX-License-Identifier: GPL-3.0-or-later
"""What the synthesis chose, what it cost, and how far off the sum can be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ...findings import Finding, finding

Motion = Literal["still", "linear", "smooth", "sampled"]
Transform = Literal["once", "type 3", "pulse by pulse", "interpolated", "direct sum"]

#: Phase left out of the motion within a ramp that is worth a word: sidelobes at -66 dB.
_RAMP_SLACK_RAD = 1e-3


@dataclass
class SynthesisStep:
    """Paths (twice where folded into the window twice) of one kind of motion that went one way.

    motion: "linear" has a constant range rate within the bound, "smooth" a polynomial fitted within
    it, of "sampled" lengths are taken at every pulse. transform: "once" is one 1-D type 1 for all
    pulses, "type 3" 2-D over frequency and pulse, "pulse by pulse" a 1-D type 1 each,
    "interpolated" the same at a few times, from which all pulses follow.
    """

    motion: Motion
    transform: Transform
    paths: int = 0
    transforms: int = 0
    cpu_s: float = 0.0


@dataclass
class SynthesisReport:
    """How a spectrum was formed.

    Attributes
    ----------
    backend
        "finufft", "numpy" or "direct".
    tolerance
        Relative L2 error that was asked for.
    paths
        Rows added.
    pulses, frequencies
        Size of the result.
    steps
        What was chosen for how many paths, and its cost.
    error_estimate
        Relative L2 error to the direct sum, for phases that are random just outside the band, with
        that of fitted motion; cancellation within the band counts. 0 where there is no echo.
    error_bound
        The same for any paths.
    cancellation_db
        Energy of the result over that of paths with random phases; at -60 dB three digits are lost.
    motion_error_rad
        Largest error of phase that fitted motion was allowed.
    outside
        Paths outside the window, counted once a pulse and divided by pulses.
    range_ambiguous_count
        Paths that stand in the window by folding (delay beyond the pulse interval).
    doppler_ambiguous_count
        Moving paths whose phase turns by more than half a cycle from pulse to pulse.
    ramp_residual_phase_rad
        Where frequencies come one after the other: phase of the motion meanwhile beyond the second
        order in time, about [rad].
    wall_s
        Time spent in all [s].
    notes
        What was done in addition to the steps, in whole sentences.
    """

    backend: str
    tolerance: float
    paths: int = 0
    pulses: int = 0
    frequencies: int = 0
    steps: list[SynthesisStep] = field(default_factory=list)
    error_estimate: float = 0.0
    error_bound: float = 0.0
    cancellation_db: float | None = None
    motion_error_rad: float = 0.0
    outside: float = 0.0
    range_ambiguous_count: int = 0
    doppler_ambiguous_count: int = 0
    ramp_residual_phase_rad: float = 0.0
    wall_s: float = 0.0
    notes: list[str] = field(default_factory=list)

    def count(
        self, motion: Motion, transform: Transform, paths: int, transforms: int, cpu_s: float
    ) -> None:
        """Add to the step of this kind."""
        for step in self.steps:
            if (step.motion, step.transform) == (motion, transform):
                break
        else:
            step = SynthesisStep(motion, transform)
            self.steps.append(step)
        step.paths += paths
        step.transforms += transforms
        step.cpu_s += cpu_s

    def accuracy_findings(self) -> list[Finding]:
        """Return where the samples may miss the tolerance or the motion."""
        found = []
        if self.error_estimate > self.tolerance:
            found.append(
                finding(
                    "echoes-cancel",
                    cancellation_db=self.cancellation_db or 0.0,
                    error_estimate=self.error_estimate,
                    tolerance=self.tolerance,
                )
            )
        if self.ramp_residual_phase_rad > _RAMP_SLACK_RAD:
            found.append(finding("uneven-motion-in-sweep", phase_rad=self.ramp_residual_phase_rad))
        return found

    def lines(self) -> list[str]:
        """The report for people, a line each."""
        found = [
            f"{step.paths} paths {step.motion}, {step.transform}: {step.transforms} transforms, "
            f"{step.cpu_s:.3g} s of processor time"
            for step in self.steps
        ]
        found.extend(self.notes)
        found.append(
            f"{self.backend}, relative error {self.error_estimate:.1e} "
            f"(asked {self.tolerance:g}), {self.wall_s:.3g} s"
        )
        return found
