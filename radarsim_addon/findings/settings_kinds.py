# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of findings of settings and runs."""

from __future__ import annotations

from .kinds import Kind

SETTINGS = {
    "one-range-cell": Kind(
        "caution",
        "A bandwidth of {bandwidth_hz:frequency} resolves {range_resolution_m:length} (c / 2B), "
        "but ranges end at {farthest_m:length}.",
        "All echoes lie in one range cell.",
        "Raise the bandwidth: a wider sweep, larger or more frequency steps, or shorter chips. "
        "Check its unit: hertz and seconds in radar files, MHz, kHz, us and ns in the panel. If "
        "the ranges are wrong, set Scene > Units > Unit Scale.",
    ),
    "low-time-bandwidth-product": Kind(
        "caution",
        "Bandwidth times pulse width is {bandwidth_hz:frequency} x {duration_s:.4g} s = "
        "{product:.3g}.",
        "So short a pulse occupies about 1 / T = {own_hz:frequency} for any sweep, and the matched "
        "filter keeps only the bandwidth.",
        "Set a bandwidth of at least {own_hz:frequency} or a longer pulse. Check the units: hertz "
        "and seconds in radar files, MHz and us in the panel.",
    ),
    "wavelength-exceeds-scene": Kind(
        "caution",
        "A carrier of {carrier_hz:frequency} has a wavelength of {wavelength_m:length}, but ranges "
        "end at {farthest_m:length}.",
        "Rays describe no wave that is longer than the scene.",
        "Raise the carrier. Check its unit: hertz in radar files, GHz in the panel and in "
        "--carrier-ghz. If the ranges are wrong, set Scene > Units > Unit Scale.",
    ),
    "burst-exceeds-animation": Kind(
        "caution",
        "A burst of {pulses:#pulse} at a PRF of {prf_hz:frequency} lasts {burst_s:.4g} s, the "
        "animation {animation_s:.4g} s.",
        "The maximum unambiguous velocity is only {max_unambiguous_velocity_mps:.3g} m/s.",
        "Raise the PRF or send fewer pulses. Check the unit of the PRF: hertz everywhere.",
    ),
    "scene-beyond-range-limits": Kind(
        "info",
        "The scene reaches {farthest_m:.6g} m, and the range limits end at {range_stop_m:g} m.",
        "Profile and map leave out the echoes from beyond.",
        "Raise Range Stop, or set both range limits to 0: as far as the scene reaches.",
    ),
    "scene-beyond-rings": Kind(
        "caution",
        "The rings end at {covered_m:.6g} m, the scene at {farthest_m:.6g} m.",
        "Echoes from beyond the last ring are missing.",
        "Add rings, or widen the ring step.",
    ),
    "footprints-too-coarse": Kind(
        "caution",
        "The radar sees {subjects} at grazing incidence: at a range of {range_m:length}, one pixel "
        "covers a range interval of {step_m:length}, {range_cells:.3g} times the range resolution.",
        "radarsim cannot follow the surface between rays that are so far apart. Powers from there "
        "are wrong by 0.3 dB where the range interval of one pixel is 0.3 times the range, and by "
        "several decibels where it is more than the range. With rings, such pixels leave gaps in "
        "the range profile.",
        "Raise the resolution, narrow the field of view, or set a Range stop before this range.",
    ),
    "run-takes-long": Kind(
        "caution",
        "The run takes about {hours:.2g} hours on this computer.",
        "The estimate uses the time per ray of earlier runs, or a typical value before the first "
        "run. With a Max standard error, the run takes longer.",
        "Use fewer frames, a lower resolution, fewer reflections or the quality Draft. Or set "
        "Range limits, or use several workers (docs/workers.md).",
    ),
    "objects-below-a-pixel": Kind(
        "caution",
        "{subjects} {they:is|are} smaller than one pixel of the rings: {they:its|their} size is "
        "{size_px:.2g} pixels.",
        "All rays may miss such an object. Then its echo is missing.",
        "Raise the resolution, narrow the field of view, or set Sampling mode to Paths, which "
        "measures small objects with pixels of their own.",
    ),
    "scene-beyond-unambiguous-range": Kind(
        "caution",
        "The scene reaches {farthest_m:.6g} m, beyond the unambiguous range of "
        "{unambiguous_range_m:.6g} m.",
        "Echoes from beyond appear at wrong, smaller ranges.",
        "Lower the PRF, take smaller frequency steps, or use a longer code: here the {limit} sets "
        "the limit.",
    ),
    "scene-beyond-unambiguous-velocity": Kind(
        "caution",
        "Range rates of {subjects} reach {fastest_mps:.4g} m/s, beyond the maximum unambiguous "
        "velocity of {max_unambiguous_velocity_mps:.4g} m/s (wavelength x PRF / 4).",
        "Doppler folds, as in a radar: echoes appear at a wrong range rate, maybe of the opposite "
        "sign.",
        "Set the PRF to at least {prf_hz:frequency}. A pulse or sweep must fit into 1 / PRF, and "
        "a pulse's unambiguous range falls with it.",
    ),
    "scene-beyond-sampled-band": Kind(
        "caution",
        "The scene reaches {farthest_m:.6g} m, beyond the {unambiguous_range_m:.6g} m that the "
        "sampling rate covers.",
        "The anti-alias filter of the ADC removes echoes from beyond.",
        "Raise the sampling rate, or sweep less bandwidth in the same time.",
    ),
    "ring-step-below-resolution": Kind(
        "info",
        "The ring step of {ring_step_m:.4g} m is below the range resolution of "
        "{range_resolution_m:.4g} m.",
        "The run takes more renders and shows no more detail.",
        "Widen the ring step.",
    ),
    "single-snapshot": Kind(
        "info",
        "The run takes one snapshot of each frame.",
        "All echoes have a range rate of 0 m/s.",
        "Take two snapshots to measure Doppler.",
    ),
    "short-snapshot-interval": Kind(
        "caution",
        "The snapshot interval is {snapshot_interval_s:.4g} s.",
        "Blender stores animation time in float32; an interval of 1 ms costs about 1 % of the "
        "velocity.",
        "Use about 10 ms.",
    ),
    "bursts-overlap": Kind(
        "caution",
        "A burst lasts {burst_s:.4g} s, but the next frame begins after {frame_interval_s:.4g} s.",
        "The bursts of neighbouring frames overlap.",
        "Send fewer pulses, or measure every n-th frame.",
    ),
    "carrier-differs-from-run": Kind(
        "caution",
        "The carrier is {carrier_hz:frequency}, but the run was rendered for "
        "{run_carrier_hz:frequency}.",
        "The materials are those of the carrier that was rendered.",
        "If the materials depend on frequency, render again.",
    ),
    "range-limits-beyond-unambiguous-range": Kind(
        "caution",
        "The range limits reach {range_limit_m:g} m, beyond the unambiguous range of "
        "{unambiguous_range_m:.6g} m.",
        "Profile and map end at the unambiguous range.",
        "Lower the far range limit, or choose a waveform with a larger unambiguous range.",
    ),
    "range-limits-beyond-sampled-band": Kind(
        "caution",
        "The range limits reach {range_limit_m:g} m, beyond the {unambiguous_range_m:.6g} m that "
        "the sampling rate covers.",
        "The anti-alias filter of the ADC removes echoes from beyond: profile and map end there.",
        "Lower the far range limit, raise the sampling rate, or sweep less bandwidth in the same "
        "time.",
    ),
}

RUNS = {
    "frames-left-to-others": Kind(
        "info",
        "This process left {count:#frame} of the run to {subjects}.",
        "The run is complete when the other processes have finished, too.",
        "Wait for them before you process the run. If one of them fails, start the same command "
        "again.",
    ),
}
