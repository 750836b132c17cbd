# SPDX-License-Identifier: GPL-3.0-or-later
"""What the catalogue declares of a code (`Kind`), and the codes of scenes, settings and runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "caution", "error"]


@dataclass(frozen=True)
class Kind:
    """Severity and templates (what happened, why it matters, what to do) of a kind of finding.

    "info": nothing is wrong; "caution": a result may not mean what you expect; "error": the
    results concerned are wrong or empty.
    """

    severity: Severity
    text: str
    cause: str
    remedy: str


SETTINGS = {
    "one-range-cell": Kind(
        "caution",
        "A bandwidth of {bandwidth_hz:frequency} resolves {range_resolution_m:length} (c / 2B), "
        "but ranges end at {farthest_m:length}.",
        "All echoes lie in one range cell.",
        "Raise the bandwidth (a wider sweep, more frequency steps, or shorter chips), and check "
        "its unit: hertz and seconds in radar files, MHz, kHz, us and ns in the panel. If the "
        "ranges are wrong, set Scene > Units > Unit Scale.",
    ),
    "low-time-bandwidth-product": Kind(
        "caution",
        "Bandwidth times pulse width is only {bandwidth_hz:frequency} x {duration_s:.4g} s = "
        "{product:.3g}.",
        "So short a pulse occupies about 1 / T = {own_hz:frequency}, and the matched filter "
        "keeps only the bandwidth.",
        "Set a bandwidth of at least {own_hz:frequency} or a longer pulse. Check the units: "
        "hertz and seconds in radar files, MHz and us in the panel.",
    ),
    "wavelength-exceeds-scene": Kind(
        "caution",
        "A carrier of {carrier_hz:frequency} has a wavelength of {wavelength_m:length}, but ranges "
        "end at {farthest_m:length}.",
        "Rays do not describe waves that are longer than the scene.",
        "Raise the carrier, and check its unit: hertz in radar files, GHz in the panel and in "
        "--carrier-ghz. If the ranges are wrong, set Scene > Units > Unit Scale.",
    ),
    "burst-exceeds-animation": Kind(
        "caution",
        "A burst of {pulses:#pulse} at a PRF of {prf_hz:frequency} lasts {burst_s:.4g} s, the "
        "animation {animation_s:.4g} s.",
        "The maximum unambiguous velocity is only {max_unambiguous_velocity_mps:.3g} m/s.",
        "Raise the PRF or send fewer pulses. The unit of the PRF is hertz everywhere.",
    ),
    "scene-beyond-range-limits": Kind(
        "info",
        "The scene reaches {farthest_m:.6g} m, and the range limits end at {range_stop_m:g} m.",
        "Profile and map do not contain the echoes from beyond.",
        "Raise Range Stop, or set both range limits to 0.",
    ),
    "scene-beyond-rings": Kind(
        "caution",
        "The rings end at {covered_m:.6g} m, the scene at {farthest_m:.6g} m.",
        "Echoes from beyond the last ring are missing.",
        "Add rings, or widen the ring step.",
    ),
    "footprints-too-coarse": Kind(
        "caution",
        "At grazing incidence, one pixel covers {step_m:length} of range on {subjects} at a "
        "range of {range_m:length}: {range_cells:.3g} times the range resolution.",
        "Powers are wrong by 0.3 dB where a pixel covers 0.3 times the range, and by several "
        "decibels where it covers more than the range. With rings, the range profile has gaps.",
        "Raise the resolution, narrow the field of view, or lower Range Stop.",
    ),
    "run-takes-long": Kind(
        "caution",
        "The run takes about {hours:.2g} hours on this computer.",
        "With a Max standard error, it takes longer.",
        "Use fewer frames, a lower resolution, fewer reflections, the quality Draft, Range "
        "limits, or several workers (docs/workers.md).",
    ),
    "objects-below-a-pixel": Kind(
        "caution",
        "{subjects} {they:is|are} smaller than one pixel of the rings: {they:its|their} size is "
        "{size_px:.2g} pixels.",
        "All rays may miss such an object, and then its echo is missing.",
        "Raise the resolution, narrow the field of view, or set Sampling mode to Paths, which "
        "gives small objects finer pixels.",
    ),
    "scene-beyond-unambiguous-range": Kind(
        "caution",
        "The scene reaches {farthest_m:.6g} m, beyond the unambiguous range of "
        "{unambiguous_range_m:.6g} m.",
        "Echoes from beyond appear at wrong, smaller ranges.",
        "Lower the PRF, use smaller frequency steps, or a longer code: here the {limit} sets the "
        "limit.",
    ),
    "scene-beyond-unambiguous-velocity": Kind(
        "caution",
        "{subjects} {they:reaches a range rate|reach range rates} of {fastest_mps:.4g} m/s, "
        "beyond the maximum unambiguous velocity of {max_unambiguous_velocity_mps:.4g} m/s "
        "(wavelength x PRF / 4).",
        "Doppler is ambiguous: echoes appear at a wrong range rate, maybe of the opposite sign.",
        "Set the PRF to at least {prf_hz:frequency}. A pulse or sweep must fit into 1 / PRF, and "
        "the unambiguous range of pulses falls with it.",
    ),
    "scene-beyond-sampled-band": Kind(
        "caution",
        "The scene reaches {farthest_m:.6g} m, beyond the {unambiguous_range_m:.6g} m that the "
        "sampling rate covers.",
        "The anti-alias filter of the ADC removes echoes from beyond.",
        "Raise the sampling rate, or lower the sweep slope.",
    ),
    "ring-step-below-resolution": Kind(
        "info",
        "The ring step of {ring_step_m:.4g} m is below the range resolution of "
        "{range_resolution_m:.4g} m.",
        "The run takes more renders without more detail.",
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
        "Send fewer pulses, or measure only every n-th frame.",
    ),
    "carrier-differs-from-run": Kind(
        "caution",
        "The carrier is {carrier_hz:frequency}, but the run was rendered for "
        "{run_carrier_hz:frequency}.",
        "The materials are those of the carrier of the run.",
        "If the materials depend on frequency, render again.",
    ),
    "range-limits-beyond-unambiguous-range": Kind(
        "caution",
        "The range limits reach {range_limit_m:g} m, beyond the unambiguous range of "
        "{unambiguous_range_m:.6g} m.",
        "Profile and map end at the unambiguous range.",
        "Lower Range Stop, or choose a waveform with a larger unambiguous range.",
    ),
    "range-limits-beyond-sampled-band": Kind(
        "caution",
        "The range limits reach {range_limit_m:g} m, beyond the {unambiguous_range_m:.6g} m that "
        "the sampling rate covers.",
        "The anti-alias filter of the ADC removes echoes from beyond: profile and map end there.",
        "Lower Range Stop, raise the sampling rate, or lower the sweep slope.",
    ),
}

RUNS = {
    "frames-left-to-others": Kind(
        "info",
        "This process left {count:#frame} of the run to {subjects}.",
        "The run is complete when these processes have finished.",
        "Wait before you process the run. If one of them fails, start the same command again.",
    ),
}


SCENE = {
    "no-radar-material": Kind(
        "caution",
        "No Radar Material is assigned to {subjects}.",
        "{they:This object casts|These objects cast} a radar shadow and {they:returns|return} no "
        "echo.",
        "Select {they:it|them} and choose Radar > Scene > Assign to Selected, or Assign by Name.",
    ),
    "optical-material": Kind(
        "caution",
        "The materials of {subjects} are made for light, or missing.",
        "Their echoes follow visible colour and gloss, not the material at the carrier.",
        "Choose Radar > Scene > Assign by Name, review the list, then Apply.",
    ),
    "rendered-at-whole-frames": Kind(
        "caution",
        "Blender may render {subjects} with the shape of a whole frame at times after it.",
        "Range rates from two snapshots are then 0 or too small, and further renders of a burst "
        "show an old position. Causes are simulations that are not baked, cache files without "
        "Vertex Interpolation, and drivers and scripts that read frame_current.",
        "Bake simulations (Physics > Cache > Bake), switch on Vertex Interpolation, use the "
        "variable frame in drivers and scene.frame_current_final in scripts. Or measure by paths "
        "with one render per burst.",
    ),
    "linked-file-missing": Kind(
        "caution",
        "{they:A file that the scene uses is|Files that the scene uses are} missing: {subjects}.",
        "Blender renders without them: missing images are magenta, and objects of a missing "
        "library or cache are empty or do not move.",
        "Choose File > External Data > Find Missing Files, or remove what uses {they:it|them}.",
    ),
    "changed-by-scripts": Kind(
        "info",
        "Scripts may have changed the scene since its file was opened: {subjects}.",
        "radarsim cannot tell whether an earlier run is of the same scene. It measures all "
        "frames, and this run cannot be resumed.",
        "To resume runs, save the changed scene and use radarsim render.",
    ),
    "handlers-not-run": Kind(
        "caution",
        "The window calls functions of add-ons or scripts at each frame: {subjects}. They do not "
        "run in the process that measures.",
        "What they move has no velocity of theirs, and is where it was at frame {frame}.",
        "Bake or keyframe what they move, or measure in a script of this session "
        "(radarsim.measure).",
    ),
    "camera-markers": Kind(
        "info",
        "Markers bind other cameras to frames of the timeline: {subjects}.",
        "The receiver is {receiver!r} at all frames of this run.",
        "To receive with another camera, make it a child of the transmitter's parent and measure "
        "again.",
    ),
    "object-without-surface": Kind(
        "caution",
        "radarsim skipped {subjects}: fog, volumes and grease pencil have no reflecting surface.",
        "{they:This object casts|These objects cast} no shadow and {they:returns|return} no echo.",
        "Convert {they:it to a mesh|them to meshes} to include {they:it|them}.",
    ),
    "hidden-from-receiver": Kind(
        "caution",
        "{subjects} {they:returns|return} no direct echo: Ray Visibility > Camera is off, or "
        "Holdout, Shadow Catcher or Indirect Only is on, for the object or its collection.",
        "The receiver looks through {they:this object|these objects}, or finds a hole. Radar "
        "shadows and paths with several reflections remain.",
        "To measure {they:it|them}, switch Camera on and the other three off (Object > "
        "Visibility; collections: Outliner). To remove {they:it|them}, disable {they:it|them} in "
        "renders.",
    ),
    "rays-pass-through": Kind(
        "caution",
        "Ray Visibility > Shadow, Diffuse or Glossy is off for {subjects}.",
        "Without Shadow, waves of the transmitter pass through the object; without Diffuse or "
        "Glossy, waves from other surfaces do.",
        "Switch all three on in Object > Visibility.",
    ),
    "displaced-by-shader": Kind(
        "info",
        "A shader displaces the surface of {subjects}.",
        "The displacement exists in the render only: ground_truth.json has no nearest range for "
        "{they:this object|these objects}.",
        "For a nearest range, use a Displace modifier or Geometry Nodes.",
    ),
    "subsurface-scattering": Kind(
        "caution",
        "{they:This material scatters light below its surface|These materials scatter light below "
        "their surface}: {subjects}.",
        "{they:Its|Their} echoes are spread over larger ranges.",
        "Set Subsurface to 0 in each material.",
    ),
    "smooth-across-edges": Kind(
        "caution",
        "{subjects} {they:is|are} shaded smooth across sharp edges: up to {fraction:percent} of a "
        "surface has normals that are off by more than {angle_deg:g} degrees.",
        "Reflection and transmission follow these normals.",
        "Choose Object > Shade Auto Smooth, or Shade Flat.",
    ),
    "mesh-open": Kind(
        "error",
        "{they:This object has|These objects have} an interior, but {they:its|their} mesh is "
        "open: {subjects}.",
        "A face is missing or vertices are double, so depths inside are wrong.",
        "Close the mesh (Mesh > Merge > By Distance, then Fill). If nothing has to be seen "
        "through the object, disconnect Volume: it is then opaque.",
    ),
    "mesh-flipped": Kind(
        "error",
        "{they:This object has|These objects have} an interior, but neighbouring faces point in "
        "opposite directions: {subjects}.",
        "Cycles loses count of which object a ray is in, so depths inside are wrong.",
        "Choose Mesh > Normals > Recalculate Outside.",
    ),
    "mesh-inside-out": Kind(
        "error",
        "{they:This object has|These objects have} an interior, but {they:its|their} normals "
        "point inwards: {subjects}.",
        "Depths are counted outside the {they:object|objects}.",
        "Choose Mesh > Normals > Recalculate Outside, or Flip.",
    ),
    "shells-overlap": Kind(
        "caution",
        "Parts of {subjects} reach into one another: {fraction:percent} of the surface lies "
        "inside another part of the mesh.",
        "Cycles counts the interior once there, but each face inside takes its part of the "
        "power: waves through it are too weak and appear too near.",
        "Unite the parts (Boolean modifier, Union with Self Intersection), or make each part an "
        "object.",
    ),
    "interior-not-refracted": Kind(
        "info",
        "Simple Radar Materials do not refract waves inside {subjects}.",
        "Targets behind a wall at a slant appear too far, by up to {too_long_30_m:.2g} m of path "
        "at 30 degrees of incidence and {too_long_60_m:.2g} m at 60 (two ways).",
        "Choose a medium in the panel of the material.",
    ),
    "pane-counts-twice": Kind(
        "caution",
        "{subjects} {they:has|have} a thin sheet on both sides of a pane.",
        "Each face of a thin sheet is a whole pane, so loss and delay count twice.",
        "Delete one of the two sides, or set Thin Sheet to 0 and connect Volume.",
    ),
    "rim-echoes-weak": Kind(
        "info",
        "Waves inside {subjects} come back from its rough rim, but this wall absorbs and delays "
        "at its faces.",
        "Echoes of the rim from inside are up to {power_db:.2g} dB too weak, and as late as those "
        "of the far face.",
        "Move the radar nearer, where the wall has its exact interior, or give the rim a smooth "
        "material.",
    ),
    "inside-a-wall": Kind(
        "caution",
        "An object is within the material of a wall: {subjects}.",
        "These walls absorb and delay half at each face, not by the depth inside.",
        "Move the object out, or make this wall an object of its own, a plain box near the radar.",
    ),
    "antenna-in-medium": Kind(
        "caution",
        "An antenna of the radar is inside {subjects}, in a medium of index {index:.3g}.",
        "Rays leave the object without refraction, but real waves spread more. Echoes from "
        "outside are up to {power_db:.2g} dB too strong and appear in other directions.",
        "Place the radar in air: a radome is a closed shell with a hollow around the antennas. "
        "Or set EIRP and patterns to those measured outside, and disable the object in renders.",
    ),
    "coincident-faces": Kind(
        "error",
        "{they:This pair of objects has|These pairs of objects have} faces that coincide exactly: "
        "{subjects}.",
        "Cycles loses count of which object a ray is in, so depths and shadows are wrong.",
        "Leave a gap or an overlap of at least {least_gap:.1g} Blender units.",
    ),
    "interiors-nested-too-deep": Kind(
        "error",
        "Around {subjects} up to {count:#object} with an interior overlap; Cycles follows at most "
        "{limit}.",
        "The interiors beyond this limit have no effect.",
        "Join some of the objects, or disconnect their Volume, which makes them opaque.",
    ),
    "many-interiors": Kind(
        "caution",
        "{count:,} of {total:,} objects and instances have an interior ({subjects}).",
        "Before the first pixel, Cycles tests each object against each interior, for about "
        "{seconds:.0f} s.",
        "Disconnect Volume of materials behind which nothing matters, or join instances into "
        "fewer meshes.",
    ),
    "absorption-below-float32": Kind(
        "caution",
        "Two-way absorption through {subjects} is more than the {limit_db:.0f} dB that float32 "
        "can hold in this Blender.",
        "A wave that crosses {they:this object|these objects} returns no echo.",
        "If you need those echoes, use thinner objects or a material with less absorption.",
    ),
    "interior-rounded": Kind(
        "caution",
        "Cycles rounds the depths of waves inside {subjects}, because they are far from the "
        "antennas or from the world's origin.",
        "Echoes through them have random errors of {power_db:.2g} dB and {length_wavelengths:.2g} "
        "wavelengths (two ways, standard deviation).",
        "Move the scene near the world origin, and the radar nearer. Plane-parallel walls of one "
        "physical material with nothing inside have no such error.",
    ),
    "opaque-without-volume": Kind(
        "info",
        "Volume is not connected in {subjects}.",
        "{they:This material absorbs|These materials absorb} all waves that enter: nothing "
        "behind returns an echo.",
        "To let waves through, connect Volume to the Material Output, or set Thin Sheet for a "
        "thin pane.",
    ),
    "medium-beyond-band": Kind(
        "caution",
        "The carrier, {carrier_hz:frequency}, is outside the band of the medium {medium} of "
        "{subjects}: {band}.",
        "Beyond Band is {beyond_band}; the nearest edge of the band is {edge_hz:frequency}. Held "
        "and extrapolated values differ by {reflection_db:.2g} dB in reflection and by a factor "
        "{absorption_ratio:.3g} in absorption: error class {error_class}.",
        "Use a medium for this carrier, or measured values (medium Table). To stop such runs, "
        "set Beyond Band to Refuse.",
    ),
    "clutter-not-connected": Kind(
        "caution",
        "The clutter {they:model|models} of {subjects} {they:has|have} no effect.",
        "A clutter model needs the physical Radar Material at the output of the material, "
        "without Thin Sheet. A link at Clutter Row replaces the model.",
        "Choose Use Physical Inputs in the Material tab, or set Clutter to None.",
    ),
    "clutter-beyond-band": Kind(
        "caution",
        "The carrier, {carrier_hz:frequency}, is outside the band of the clutter model {model} of "
        "{subjects}: {low_hz:frequency} to {high_hz:frequency}.",
        "sigma0 is extrapolated (a table holds its nearest rows), with an unknown error.",
        "Use a model or a table for this carrier.",
    ),
    "clutter-too-weak": Kind(
        "caution",
        "The clutter of {subjects} may be missing from a grazing angle of {grazing_deg:.3g} "
        "degrees on, where sigma0 is {sigma0_db:.3g} dB.",
        "Cycles drops surfaces that return less than 1e-5 of the light.",
        "Ignore this if the radar sees the surface at smaller angles, or if other echoes are "
        "stronger. Else use a model with a larger sigma0.",
    ),
    "total-reflection": Kind(
        "caution",
        "In {subjects}, {fraction:percent} of the power that enters from the antennas arrives, "
        "after absorption, at a face beyond the critical angle (index {index:.3g}).",
        "radarsim follows straight rays that leave the object: echoes through these faces are "
        "too strong.",
        "If such echoes matter, use plane-parallel parts, or disconnect Volume.",
    ),
    "wall-corners": Kind(
        "caution",
        "{fraction:percent} of the power that enters {subjects} from the antennas leaves by "
        "corners where walls meet (index {index:.3g}).",
        "Such rays get half of the absorption and delay of the wall that they enter and half of "
        "the wall that they leave, for any path length within the corner.",
        "If such echoes matter, make each wall an object of its own, a plain box near the radar.",
    ),
    "walls-averaged-separately": Kind(
        "info",
        "For {paths}, radarsim averages the transmission of each of {subjects} over both "
        "polarisations before it multiplies them.",
        "Behind two such walls the two-way power is up to {loss_60_db:.2g} dB too low at 60 "
        "degrees of incidence, {loss_30_db:.2g} dB at 30; further walls add to the error.",
        "Set Polarisation to that of your radar. Average has no such error in the sampling mode "
        "Paths with one reflection and Radar Materials alone.",
    ),
    "device-unfit": Kind(
        "caution",
        "radarsim renders on the CPU, because its check of {device} failed: {subjects}.",
        "Powers or ranges from {device} would be wrong.",
        "Update Blender and the driver, run radarsim selfcheck --device {device}, and render "
        "again. Or choose CPU in Render > Device.",
    ),
    "facets-encode-range": Kind(
        "caution",
        "Range encoding is Materials, and rough physical materials return several reflections.",
        "Cycles rounds the three channels separately: lengths from two reflections on are off by "
        "up to 1e-5 of the range encoding length, and some paths are wrongly flagged as mixed.",
        "Choose Radar > Advanced > Range Encoding: Automatic.",
    ),
    "medium-not-connected": Kind(
        "caution",
        "The Radar Material of {subjects} does not feed the Surface of the material output alone.",
        "Its numbers do not follow the carrier.",
        "Connect the Radar Material to Surface directly; only reroutes and your own groups may "
        "be between.",
    ),
    "not-a-layer": Kind(
        "info",
        "{subjects} {they:is|are} neither a layer nor made of walls: less than "
        "{least_fraction:percent} of the surface is one pair of parallel faces, and less than "
        "{least_walls:percent} is walls (six times as wide as thick).",
        "Absorption and delay inside are those of normal incidence at any angle, or those of the "
        "largest walls alone.",
        "For a thick wall, set the object's property {property}: three numbers, the normal of "
        "the wall in the axes of the object.",
    ),
}
