# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of findings of processing: rough surfaces, echoes, maps."""

from __future__ import annotations

from .kinds import Kind

ROUGHNESS = {
    "kirchhoff-short-correlation": Kind(
        "caution",
        "The Kirchhoff model does not apply to {subjects}: k l = {k_l:.3g} is not above 6.",
        "The surface varies within a wavelength; the small perturbation model would apply.",
        "Raise the correlation length or the carrier.",
    ),
    "kirchhoff-curved-facets": Kind(
        "caution",
        "The Kirchhoff model does not apply to {subjects}: l^2 / (h lambda) = {curvature:.3g} is "
        "not above 2.76.",
        "Facets curve within a wavelength.",
        "Raise the correlation length, or lower the RMS height.",
    ),
    "kirchhoff-coherent-part": Kind(
        "caution",
        "The Kirchhoff model is incomplete for {subjects}: 2 k h cos(incidence) = "
        "{phase_rad:.3g} is not above 3.16.",
        "The rough lobe does not include the remaining coherent, mirror-like part.",
        "Raise the RMS height or the carrier.",
    ),
    "kirchhoff-steep-slopes": Kind(
        "caution",
        "The Kirchhoff model does not apply to {subjects}: the RMS slope {slope:.3g} is above 0.4.",
        "Masking and multiple scattering between facets matter; single scattering loses their "
        "power.",
        "Lower the RMS height, or raise the correlation length.",
    ),
}

PROCESSING = {
    "no-echo": Kind(
        "error",
        "The frame contains no echo, so all maps are empty.",
        "The scene has no objects in view, or none returns power to the radar: a Point light does "
        "not show in mirrors, and a transmitter inside a closed mesh illuminates nothing.",
        "Check that objects are in the camera's view and the transmitter is outside closed meshes, "
        "then give smooth surfaces a "
        "roughness above 0. Check Object > Visibility: Ray Visibility > Camera on, Holdout and "
        "Shadow Catcher off. Check that no object is scaled to 0.",
    ),
    "ground-truth-missing": Kind(
        "caution",
        "The folder of the frame has no ground_truth.json, which Blender wrote with the paths.",
        "The file holds the RMS heights, clutter models, fluctuations and collections of the "
        "objects. Without it, every surface has the speckle of a rough one, and sea, land and "
        "fluctuating objects echo like stationary surfaces.",
        "Put the file back, or render the run again: it writes the file. If no object has one of "
        "these properties, the echoes are the same.",
    ),
    "weather-attenuates": Kind(
        "info",
        "The air takes {attenuation_db_per_km:.3g} dB of each kilometre of path, one way.",
        "Rain, fog or gases were asked for. Cross sections are those in clear air.",
        "For clear air, leave the weather options out.",
    ),
    "rain-echo": Kind(
        "info",
        "Rain of {rain_mm_per_h:g} mm/h returns {reflectivity_db:.1f} dB m^2/m^3 within the field "
        "of view.",
        "Beyond the field of view, behind surfaces and by way of them it returns nothing here. "
        "Directions without an echo (sky, mirrors) are open.",
        "For targets alone, leave the option Rain echo out.",
    ),
    "rain-echo-left-out": Kind(
        "caution",
        "Rain of {rain_mm_per_h:g} mm/h attenuates the paths, but its own echo is left out.",
        "Its drops would return {reflectivity_db:.1f} dB m^2/m^3: that much cross section from "
        "each cubic metre of a resolution cell.",
        "Compare the targets' cross sections with reflectivity times volume of the cell, or set "
        "the option Rain echo (with paths, and not for an orthographic camera).",
    ),
    "range-ambiguous-paths": Kind(
        "caution",
        "The frame has {count:#path} beyond the unambiguous range of {unambiguous_range_m:.6g} m, "
        "which the {limit} sets.",
        "Their echoes appear at wrong, smaller ranges, as in a radar.",
        "For a larger unambiguous range lower the PRF, take smaller frequency steps, or use a "
        "longer code.",
    ),
    "paths-beyond-sampled-band": Kind(
        "caution",
        "The frame has {count:#path} beyond the {unambiguous_range_m:.6g} m that the sampling rate "
        "covers.",
        "The anti-alias filter of the ADC removes their echoes.",
        "Raise the sampling rate, or lower the sweep slope.",
    ),
    "doppler-ambiguous-paths": Kind(
        "caution",
        "The frame has {count:#path} faster than the maximum unambiguous velocity of "
        "{max_unambiguous_velocity_mps:.4g} m/s (wavelength x PRF / 4); the fastest has "
        "{fastest_mps:.4g} m/s.",
        "Doppler folds, as in a radar: their echoes appear at a wrong range rate, maybe of the "
        "opposite sign. Lists of targets give the true one as unfolded_velocity_mps.",
        "Raise the PRF to at least {prf_hz:frequency}.",
    ),
    "all-echoes-outside-ranges": Kind(
        "error",
        "All {count:#path} of the frame are outside the recorded ranges, {start_m:length} to "
        "{stop_m:length}: they are at {nearest_m:length} to {farthest_m:length}.",
        "All maps are empty, or contain noise only.",
        "Set the range limits to the ranges of the paths (Range Start and Range Stop in the "
        "window, --range-limits on the command line). If an FMCW radar ends at its sampled band, "
        "raise the sampling rate or lower the sweep slope.",
    ),
    "paths-outside-range-limits": Kind(
        "info",
        "The frame has {count:#path} outside the range limits.",
        "Their echoes are in no result.",
        "Widen the range limits to include them.",
    ),
    "range-encoding-underflow": Kind(
        "caution",
        "The frame has {count:#pixel} with an echo whose range encoding is below what float32 can "
        "hold (red channel).",
        "radarsim skips these pixels.",
        "Render fewer or narrower rings, so that the range encoding covers their ranges.",
    ),
    "paths-without-length": Kind(
        "info",
        "The table of the frame has {count:#path} without a length, with {fraction:percent} of the "
        "received power.",
        "These paths are in no echo. Absorption inside objects made them too weak for the range "
        "encoding in float32, or they come from a material that has no range encoding.",
        "If an object has no Radar Material, assign one, or set Range encoding to World volume. If "
        "all have one, use less absorption or shorter paths inside the objects.",
    ),
    "no-range-encoding": Kind(
        "caution",
        "The frame has {count:#pixel} with more red than blue: light without range encoding.",
        "radarsim skips these pixels.",
        "Give every object a Radar Material and hide all other lights.",
    ),
    "no-range-rate": Kind(
        "caution",
        "The frame has {rejected:#path} whose range changes between the snapshots faster than Max "
        "range rate allows, and {single:#path} with an echo in the first snapshot only.",
        "Edges of moving objects cause this, and runs with one snapshot. radarsim treats these "
        "paths as stationary.",
        "Raise the resolution, or take two snapshots.",
    ),
    "mixed-pixels": Kind(
        "caution",
        "{fraction:percent} of the received power is in pixels that mix several ranges.",
        "The range of such a pixel is a mixture.",
        "Use one sample per pixel, or more pixels.",
    ),
    "transmit-gain-approximated": Kind(
        "caution",
        "{fraction:percent} of the received power is in {count:#path} with an unknown last "
        "scatterer.",
        "radarsim takes the transmit gain where a single reflection would lie.",
        "Measure by paths, or by rings with one reflection.",
    ),
    "orthographic-power": Kind(
        "caution",
        "The receiver is orthographic, so its powers are R^2 times the received watts (R in metres "
        "from receiver to scatterer).",
        "Levels, SNR and detections against thermal noise are not those of a radar. Ranges and "
        "cross sections are right.",
        "For watts and SNR measure with a perspective receiver.",
    ),
    "coherent-part-not-formed": Kind(
        "caution",
        "{fraction:percent} of the received power is a specular echo of smooth surfaces: "
        "{subjects}.",
        "Echoes and maps contain this power as speckle: its phase is random. Its level follows "
        "from the RMS slope; that of a smooth face depends on area, curvature and wavelength.",
        "For faces at normal incidence use the level of physical optics that smooth-face-level "
        "states, or raise the RMS height.",
    ),
    "few-scatterers": Kind(
        "caution",
        "{fraction:percent} of the received power is in range cells with fewer than {enough} "
        "independent scatterers (median {median:.3g}).",
        "Speckle is not exponential there, and a map shows one realisation of few scatterers. The "
        "expected power is not affected.",
        "Raise the resolution or the replicates.",
    ),
    "range-gaps-between-rays": Kind(
        "caution",
        "From {range_m:.3g} m on, a pixel covers more than a range cell.",
        "Beyond this range, echoes, maps and the expected power are interpolated between the rays "
        "of a surface. Objects and shadows smaller than a pixel are missing. Without a speckle "
        "seed, echoes are of single rays, with gaps that are not in the scene.",
        "Raise the resolution or the replicates, or refine for ranges.",
    ),
    "echoes-cancel": Kind(
        "caution",
        "The echoes of the paths cancel to {cancellation_db:.0f} dB, so the numerical error may be "
        "{error_estimate:.1e} of the result.",
        "This is more than the tolerance of {tolerance:g}.",
        "Lower the tolerance.",
    ),
    "uneven-motion-in-sweep": Kind(
        "caution",
        "Range rates change within one frequency sweep.",
        "The synthesis leaves out up to about {phase_rad:.2g} rad of phase.",
        "Shorten the sweep.",
    ),
    "adc-clipped": Kind(
        "caution",
        "The ADC clipped {count:,} values of I and Q in {samples:#sample}.",
        "Clipping distorts strong echoes and spreads their power over the map.",
        "Raise the full scale of the ADC, or let radarsim choose it.",
    ),
    "frame-incomplete": Kind(
        "caution",
        "radarsim skipped the frame because it lacks {missing:#render}.",
        "The frame has no results.",
        "Render the run again; radarsim render resumes where it stopped.",
    ),
}

COVERAGE = {
    "coverage-near-horizon": Kind(
        "info",
        "{hidden:percent} of the diagram is below the horizon, and {grazing:percent} is so close "
        "to it that rays do not describe the field.",
        "Diffraction around the Earth determines the echo there. The diagram is empty below the "
        "horizon. Close to the horizon its values are too high, at the horizon by tens of "
        "decibels.",
        "Use shorter ranges or greater heights, or a program that computes diffraction.",
    ),
    "coverage-lobes-unresolved": Kind(
        "caution",
        "Lobes are narrower than four steps of height or range in {fraction:percent} of the "
        "diagram.",
        "The diagram shows a false pattern there, because its points are too far apart. The value "
        "at each point is right.",
        "Divide the steps of height by {height_times} and those of range by {range_times}, or "
        "leave the near ranges out.",
    ),
    "coverage-ground-ends": Kind(
        "info",
        "The ground {subjects} ends {reach_m:length} from the radar, and the diagram goes to "
        "{range_m:length}.",
        "radarsim assumes that the ground continues to the last range.",
        "Ignore this if the mesh stands for a larger ground.",
    ),
}
