# SPDX-License-Identifier: GPL-3.0-or-later
"""Every code of a finding, declared once: severity, what happened, why it matters, what to do.

Templates name the finding's numbers in braces, with Python's format specifications or those of
records.py (``percent``, ``length``, ``frequency``, ``#noun``); ``{subjects}`` lists the names.
"""

from __future__ import annotations

from .scene_kinds import RUNS, SCENE, SETTINGS, Kind

PATHS = {
    "reflections-truncated": Kind(
        "caution",
        "{fraction:percent} of the received power (standard error {fraction_stderr:percent}, at "
        "most {fraction_upper:percent} with 95 % confidence) has more reflections than radarsim "
        "followed.",
        "The path table lacks this power. The bound assumes that missed rare paths are at most "
        "as strong as the strongest one found.",
        "Raise Max reflections.",
    ),
    "reverse-outside-view": Kind(
        "caution",
        "{fraction:percent} of the received power comes from paths via two scatterers, the second "
        "of which is outside the field of view.",
        "The table lacks the reverse paths, which begin at the second scatterer. The summed "
        "power of a path and its reverse is up to 3 dB too low.",
        "Widen the field of view, or use a panoramic camera.",
    ),
    "transparency-truncated": Kind(
        "caution",
        "{fraction:percent} of the received power lies behind more transparent surfaces than "
        "radarsim followed, or is below Max unfollowed fraction.",
        "The path table lacks this power.",
        "Use fewer transparent layers, or make them opaque.",
    ),
    "clutter-of-several-materials": Kind(
        "caution",
        "{subjects} {they:has|have} several materials, one of them with a clutter model or a "
        "scattered lobe.",
        "With bistatic radars and in second reflections, sigma0 depends only on the angle "
        "towards the receiver, and a Lambert lobe replaces the scattered lobe.",
        "Give the surface with the clutter model or the lobe an object of its own.",
    ),
    "clutter-of-higher-orders": Kind(
        "caution",
        "{fraction:percent} of the received power has more than two reflections, at least one of "
        "them at a surface with a clutter model or a scattered lobe.",
        "In these paths, sigma0 of a clutter model depends only on the angle towards the "
        "receiver, and a Lambert lobe replaces a scattered lobe.",
        "If these paths matter, compare with Max reflections of 2.",
    ),
    "clutter-beyond-angles": Kind(
        "caution",
        "{fraction:percent} of the rays have a grazing angle outside the range of the clutter "
        "model {model} of {subjects}, {low_deg:.3g} to {high_deg:.3g} degrees; all rays have "
        "{least_deg:.3g} to {most_deg:.3g} degrees.",
        "There, sigma0 is extrapolated (a table gives its nearest row), with an unknown error.",
        "Exclude ranges with such angles, or use a table that covers them.",
    ),
    "clutter-on-flat-earth": Kind(
        "caution",
        "The surface of {subjects} is flat and reaches to {furthest_m:length}.",
        "The Earth curves: from {range_m:length} on, its sigma0 differs by more than 0.5 dB, at "
        "most by {error_db:.2g} dB (4/3 of the Earth's radius).",
        "Use shorter ranges, or a mesh that follows the Earth.",
    ),
    "mixed-paths": Kind(
        "caution",
        "{fraction:percent} of the received power is in pixels that hold several paths (subsurface "
        "scattering, volumes).",
        "The range of such a pixel is a mixture of the ranges of its paths.",
        "Replace subsurface scattering and volumes by surfaces.",
    ),
    "unranged-power": Kind(
        "caution",
        "{fraction:percent} of the received power carries no range encoding.",
        "The path table has this power without a length, and no echo contains it.",
        "Give every object a Radar Material, or set Range encoding to World volume.",
    ),
    "phase-unreliable": Kind(
        "caution",
        "Path lengths have a standard deviation of {length_sigma_m:.2g} m, "
        "{length_sigma_wavelengths:.2g} wavelengths.",
        "Phases are not reliable at this carrier; powers and ranges are.",
        "Move the scene near the world origin and make it smaller, or lower the carrier.",
    ),
    "object-without-echo": Kind(
        "caution",
        "Rays met {subjects}, but received no echo from there.",
        "A Point light does not show in mirrors (roughness 0). Black, fully transparent and "
        "shadowed objects return no echo either.",
        "Give smooth surfaces a roughness above 0.",
    ),
    "rough-object-without-echo": Kind(
        "caution",
        "Rays met {subjects}, which {they:is|are} rough, but the echo is missing or more than "
        "120 dB below the strongest.",
        "At grazing incidence, a rough surface returns almost nothing. Objects in a radar shadow "
        "return no echo either.",
        "If you expect an echo from ground or sea, use a clutter model. Else raise the "
        "roughness, or lower Specularity below 1.",
    ),
    "object-missed-by-rays": Kind(
        "caution",
        "No ray met {subjects}, in view but smaller than a pixel.",
        "{they:Its echo is missing, and no error estimate includes it|Their echoes are missing, "
        "and no error estimate includes them}.",
        "Raise the resolution or the replicates, or narrow the field of view.",
    ),
    "small-objects-share-tiles": Kind(
        "info",
        "{small:,} small objects are in view; {tiled:,} of them got tiles of their own.",
        "The rays of the whole frame measure the others, with larger standard errors.",
        "Raise the resolution to measure more of them well.",
    ),
    "glints-left-out": Kind(
        "caution",
        "Specular points on {count:#surface} of {subjects} have no tile of their own: radarsim "
        "follows the {traced} strongest ones, on the surfaces that look largest.",
        "Rays may miss specular points that are smaller than a pixel. The power of {they:this "
        "object|these objects} is then too low, and its standard error does not show it.",
        "Raise the resolution, or narrow the field of view.",
    ),
    "power-uncertain": Kind(
        "caution",
        "The power of {subjects} has a standard error of {stderr_fraction:percent}.",
        "Too few rays met the bright parts of {they:this object. Its|these objects. Their} "
        "level, cross section and SNR can be wrong by tens of decibels.",
        "Raise the resolution or the replicates, or set Max standard error.",
    ),
    "smooth-face-level": Kind(
        "caution",
        "Faces of {subjects} have an RMS height of {height_m:height}, less than an eighth of the "
        "wavelength ({eighth_m:height}). Physical optics gives {expected_dbsm:.1f} dBsm at "
        "normal incidence; the result has {measured_dbsm:.1f} dBsm at {aspect_deg:.2g} degrees "
        "from it.",
        "radarsim takes the level from the RMS slope. The echo of a smooth face lies within "
        "{beam_deg:.2g} degrees and depends on its area and the wavelength.",
        "Use the level of physical optics near normal incidence, or raise the RMS height.",
    ),
    "face-height-unknown": Kind(
        "caution",
        "Faces of {subjects} have an RMS slope and no RMS height, so they may be smooth (RMS "
        "height from {height_m:height} on) or rough (from {eighth_m:height} on). If smooth, "
        "physical optics gives {expected_dbsm:.1f} dBsm at normal incidence; the result has "
        "{measured_dbsm:.1f} dBsm at {aspect_deg:.2g} degrees from it.",
        "radarsim takes the level from the RMS slope. The echo of a smooth face lies within "
        "{beam_deg:.2g} degrees and depends on its area and the wavelength.",
        "Set the RMS Height of the material.",
    ),
    "object-error-above-target": Kind(
        "info",
        "The power of {subjects} has a standard error of {stderr_fraction:percent}, more than "
        "twice the maximum of {target_fraction:percent}.",
        "The maximum standard error applies to all objects together.",
        "Lower the maximum standard error, or raise the replicates.",
    ),
}

MIRRORS = {
    "mirrors-need-reflections": Kind(
        "info",
        "{subjects} {they:mirrors|mirror} waves, and radarsim followed single reflections only.",
        "Paths via {they:this mirror|these mirrors} are missing: ghosts, and the fading of "
        "targets above smooth ground.",
        "Set Max reflections to 3: one at the target, one at a mirror on transmit, and one at a "
        "mirror on receive.",
    ),
    "mirror-both-ways-left-out": Kind(
        "caution",
        "Max reflections is 2: paths that go via {subjects} on transmit and on receive have 3.",
        "Power and fading of targets near {they:this mirror|these mirrors} are incomplete.",
        "Set Max reflections to 3.",
    ),
    "mirrors-left-out": Kind(
        "caution",
        "{count:#planar mirror} of {subjects} got no image of the transmitter, because the "
        "maximum is {most}.",
        "Paths to the transmitter via {count:this mirror|these mirrors} are missing. The mirrors "
        "with the largest solid angle at the transmitter come first.",
        "Raise Mirror images, and give surfaces that are no mirrors a roughness above 0.",
    ),
    "mirror-pairs-left-out": Kind(
        "caution",
        "{count:#pair} of mirrors of {subjects} got no image of the transmitter, because the "
        "maximum of all images is {most}.",
        "Paths to the transmitter via two mirrors in a row are missing. The pairs in which the "
        "transmitter sees most come first.",
        "Raise Mirror images, or lower Max reflections to 2.",
    ),
    "mirror-slightly-rough": Kind(
        "info",
        "{subjects} {they:is a mirror|are mirrors} with an RMS height and no slope: paths via "
        "{they:this mirror|these mirrors} have the coherent part of the amplitude.",
        "The diffuse part of the power is missing unless the material has a scattered lobe. On "
        "the way from the receiver, the second of two mirrors in a row has the reflectance of a "
        "smooth mirror.",
        "If the diffuse part matters, use radarsim.set_scattered_lobe(material, exponent).",
    ),
    "mirror-curved": Kind(
        "caution",
        "{subjects} {they:is|are} smooth and curved, and radarsim computes no reflection to the "
        "transmitter at {fraction:percent} of the area of {they:its|their} mirrors.",
        "Paths from a scatterer via this area to the transmitter are missing. The material is "
        "not a Radar Material or has linked inputs, the mesh is too coarse for the wavelength, "
        "or the radius of curvature is below 1.6 wavelengths.",
        "Assign a Radar Material without linked inputs and subdivide the mesh. Or give "
        "{they:this surface|these surfaces} a roughness above 0, or set Shade Flat for flat "
        "faces.",
    ),
    "mirror-curved-off": Kind(
        "caution",
        "{subjects} {they:is|are} smooth and curved, and Mirror images is 0.",
        "Paths from a scatterer via {they:this mirror|these mirrors} to the transmitter are "
        "missing.",
        "Set Mirror images above 0.",
    ),
    "mirror-curved-orthographic": Kind(
        "caution",
        "The camera is orthographic: radarsim computes no reflection to the transmitter at the "
        "curved {they:mirror|mirrors} {subjects}.",
        "Paths from a scatterer via {they:this mirror|these mirrors} to the transmitter are "
        "missing.",
        "Use a perspective or panoramic camera.",
    ),
    "mirror-curved-target": Kind(
        "caution",
        "{subjects} {they:scatters|scatter} in a narrow lobe, or by a clutter model, and "
        "{they:is|are} near a curved mirror.",
        "Paths from {they:this object|these objects} via the curved mirror to the transmitter "
        "are missing.",
        "If such paths matter, give {they:this object|these objects} a diffuse surface "
        "(Specularity 0).",
    ),
    "mirror-curved-in-a-row": Kind(
        "caution",
        "A wave can reflect at a curved mirror ({subjects}) and then at a second mirror, or at "
        "another part of the same one.",
        "Paths from the transmitter via two such mirrors in a row to a scatterer are missing.",
        "If such paths matter, replace the curved mirror by a few planar faces (Shade Flat). For "
        "mirrors that do not matter, set Mirror Images to Never.",
    ),
    "mirror-focuses": Kind(
        "caution",
        "{subjects} {they:has|have} concave parts that focus waves.",
        "Near a focus, rays do not give the power. Paths from a scatterer via these parts to the "
        "transmitter are missing.",
        "Give concave parts a roughness above 0.",
    ),
    "mirror-rounded": Kind(
        "info",
        "{subjects} {they:is a curved mirror|are curved mirrors} with a coarse mesh. radarsim "
        "fits a round surface to the smooth shading, up to {height_m:height} outside of the mesh.",
        "Paths to the transmitter follow the round surface, rays of the receiver follow the mesh.",
        "Subdivide the mesh if both should agree.",
    ),
    "mirror-without-image": Kind(
        "caution",
        "{subjects} {they:is|are} smooth and planar, so {they:it acts as a mirror|they act as "
        "mirrors}, but radarsim makes no image of the transmitter for {they:it: its|them: their} "
        "material is a BSDF of Blender, or has inputs that nodes set.",
        "Paths from a scatterer via {they:this mirror|these mirrors} to the transmitter are "
        "missing.",
        "Assign a Radar Material whose inputs are numbers, or raise the roughness of a surface "
        "that is not a mirror.",
    ),
    "mirror-first-without-image": Kind(
        "caution",
        "Mirror Images is First for {subjects}, but {they:this object has|these objects have} no "
        "smooth planar face that faces the transmitter.",
        "{they:This object gets|These objects get} no image of the transmitter.",
        "Use a Radar Material with roughness 0 and planar faces, or set Mirror Images to "
        "Automatic.",
    ),
    "mirror-moves": Kind(
        "caution",
        "{subjects} {they:is a mirror that deforms|are mirrors that deform}, or that "
        "{they:shares|share} a plane with other objects and {they:moves|move} during the burst.",
        "During the burst, radarsim does not change the lengths of paths to the transmitter via "
        "{they:this mirror|these mirrors}.",
        "Shorten the burst, or give {they:this surface|these surfaces} a roughness above 0.",
    ),
    "mirror-echo-not-formed": Kind(
        "caution",
        "The receiver sees the transmitter in {subjects}. This echo is missing, because a Point "
        "light does not show in mirrors.",
        "A smooth face at normal incidence can be the strongest echo of a scene: physical optics "
        "gives up to {expected_dbsm:.1f} dBsm for a conductor.",
        "Add this level to the result, or set RMS Slope if the surface is rough.",
    ),
    "mirror-phases-apart": Kind(
        "caution",
        "{subjects} {they:reflects|reflect} horizontal and vertical waves with phases that differ "
        "by up to {apart_deg:.0f} degrees, and Polarisation is Average.",
        "Paths via {they:this mirror|these mirrors} have the phase of the horizontal wave. For a "
        "vertical radar, lobes and nulls lie elsewhere: a level near a null can be wrong by more "
        "than 10 dB.",
        "Set Polarisation to that of your radar.",
    ),
    "mirror-turns-polarisation": Kind(
        "caution",
        "{subjects} {they:is|are} tilted about the line of sight: {they:it turns|they turn} up to "
        "{fraction:percent} of the power that {they:it reflects|they reflect} into the other "
        "polarisation.",
        "A target that keeps every polarisation, such as a sphere, also returns this part, which "
        "the mirror turns again. Relative to the direct path alone, this makes the level of such "
        "a target up to {higher_db:.1f} dB higher, or up to {lower_db:.1f} dB lower.",
        "Add this difference to the uncertainty of lobes and nulls near {they:this mirror|these "
        "mirrors}. If the real antenna is polarised along or across the mirror, turn the whole "
        "scene about the line of sight until the mirror is level or upright.",
    ),
    "mirror-ways-not-in-phase": Kind(
        "caution",
        "The camera is orthographic: radarsim measures paths that return via mirrors separately "
        "from the direct paths.",
        "Their powers are right, but they do not interfere with the direct paths.",
        "Use a perspective or panoramic camera.",
    ),
    "mirror-lobe-narrow": Kind(
        "caution",
        "{subjects} {they:scatters|scatter} another power towards a mirror than towards the "
        "radar: {they:its lobe is|their lobes are} narrower than the angle between the two "
        "directions.",
        "Paths via the mirror do not interfere with the direct paths. Powers are right.",
        "Ignore this if the target is strong in one of the two directions only. Else lower "
        "Specularity to 0 or raise the roughness.",
    ),
    "mirror-way-through": Kind(
        "caution",
        "{fraction:percent} of the received power goes via a mirror and through an object that "
        "lets waves through.",
        "radarsim omits such paths.",
        "Make these objects opaque, or hide them from renders.",
    ),
}

NO_ECHO = {
    "antenna-inside-mesh": Kind(
        "error",
        "The frame contains no echo: one antenna is inside {subjects}, the other is not.",
        "Light does not pass a closed mesh, so all maps are empty.",
        "Move the radar out of the mesh, or hide the mesh from renders.",
    ),
    "nothing-in-view": Kind(
        "error",
        "The frame contains no echo: no ray met a surface of this scene: {subjects}.",
        "{they:It is|All of them are} outside the view, edge-on, smaller than a pixel, or hidden.",
        "Turn the radar or widen its field of view. Check Object > Visibility: Ray Visibility > "
        "Camera on, Holdout and Shadow Catcher off. Check that no object is scaled to 0.",
    ),
    "shaders-reflect-nothing": Kind(
        "error",
        "The frame contains no echo: the materials of {subjects} reflect nothing.",
        "Emission, Background, Holdout and Transparent shaders return no light of the transmitter.",
        "Choose Radar > Scene > Assign to Selected, or use a BSDF.",
    ),
    "surfaces-return-nothing": Kind(
        "error",
        "The frame contains no echo, although rays of the receiver met {subjects}.",
        "A Point light does not show in mirrors (roughness 0). Black, fully transparent and "
        "shadowed surfaces return nothing either.",
        "Give smooth surfaces a roughness above 0. Check that nothing lies between transmitter "
        "and surface.",
    ),
}

MOTION = {
    "surface-not-followed": Kind(
        "caution",
        "The vertices of {subjects} are not the same points of the surface during the burst.",
        "radarsim moves these points with the matrix of {they:this object|these objects} only. "
        "They get up to {apart_m:.2g} m away from the evaluated surface: range rates may be "
        "wrong by up to about {speed_mps:.2g} m/s.",
        "Apply modifiers that make vertices (Decimate, Remesh, Boolean, Build), or move them "
        "above those that deform. Convert metaballs to a mesh. Replace an animated Bevel Start "
        "or End by keyframes of the object.",
    ),
    "surface-changes": Kind(
        "info",
        "The vertices of {subjects} are not the same points of the surface during the burst.",
        "radarsim moves these points with the matrix of {they:this object|these objects} only. "
        "They stay within {apart_m:.2g} m of the evaluated surface.",
        "If the surface moves along itself, apply modifiers that make vertices (Decimate, "
        "Remesh, Boolean), or move them above those that deform.",
    ),
    "displacement-changes": Kind(
        "caution",
        "The shader displacement of {subjects} may change during the burst.",
        "radarsim moves the points of {they:this surface|these surfaces} without this change, so "
        "phases and range rates lack it.",
        "Use a Displace modifier, or Geometry Nodes with Set Position.",
    ),
    "motion-sampling-slow": Kind(
        "caution",
        "radarsim stopped after {samples:#motion sample}, because more would take too long in "
        "this scene.",
        "Displacements are known to {displacement_error_bound_m:.2g} m.",
        "Simplify the animated meshes, or shorten the burst.",
    ),
    "motion-unresolved": Kind(
        "caution",
        "With {samples:#motion sample} per burst, the fit misses the motion of {subjects} by up "
        "to {miss_m:.2g} m.",
        "{they:This object turns or vibrates|These objects turn or vibrate} too fast: the "
        "Doppler is wrong.",
        "Shorten the burst, or raise Max motion samples.",
    ),
    "motion-jumps": Kind(
        "caution",
        "{subjects} {they:jumps|jump} by up to {size_m:.3g} m during the burst, first at frame "
        "{frame:.6g}.",
        "radarsim fits the motion before and after the jump. Range rates are those at the time "
        "of the render.",
        "Set the F-curve's Cycles modifier to Repeat with Offset, and check drivers and scripts "
        "for a modulo. Or choose frames whose burst has no jump.",
    ),
    "driver-disabled": Kind(
        "caution",
        "Blender does not evaluate {count:#driver} of {subjects}.",
        "Objects with these drivers do not move. The Python expressions are wrong, or the file "
        "was opened without its scripts.",
        "If you trust the file, open it with Auto Run Python Scripts (blender -b "
        "--enable-autoexec FILE -P scripts/render_radar.py), or bake the animation.",
    ),
    "motion-between-frames": Kind(
        "info",
        "Blender stores the simulated motion of {subjects} at whole frames only.",
        "radarsim takes a smooth cubic through these poses, because Blender's straight lines "
        "would give steps of Doppler.",
        "For Blender's straight lines, set Motion to Linear simulations.",
    ),
    "moves-at-whole-frames": Kind(
        "caution",
        "A script, or a driver that reads frame_current, moves {subjects} at whole frames only.",
        "In Blender, {they:this object is|these objects are} stationary between whole frames. "
        "radarsim takes a smooth cubic through the poses at whole frames, unless Motion is "
        "Linear simulations.",
        "Use the variable frame in drivers and scene.frame_current_final in scripts, or bake the "
        "animation.",
    ),
    "points-deform-within": Kind(
        "caution",
        "Geometry Nodes deform point clouds or hair curves within {subjects}.",
        "radarsim moves the echoes of these points with the object only: phase and Doppler lack "
        "their own motion.",
        "Make a hair curves or point cloud object of its own with these nodes, or turn the "
        "points into faces (Curve to Mesh; Instance on Points, then Realize Instances).",
    ),
    "cache-between-frames": Kind(
        "caution",
        "The cache file that moves {subjects} has frames between those of the scene.",
        "radarsim takes a smooth cubic through whole frames of the scene: range rates are wrong "
        "by up to about {speed_mps:.2g} m/s.",
        "Set the scene to the frame rate of the cache.",
    ),
    "motion-in-steps": Kind(
        "caution",
        "{subjects} {they:moves|move} in steps, by Constant interpolation or a Stepped modifier.",
        "Between two steps, {they:it is stationary and has|they are stationary and have} no "
        "Doppler.",
        "Set the interpolation of {they:its|their} keyframes to Linear or Bezier in the Graph "
        "Editor.",
    ),
    "instances-appear-or-vanish": Kind(
        "caution",
        "Instances of {subjects} exist during a part of the burst only.",
        "radarsim treats them as present during the whole burst.",
        "Shorten the burst, or keep the number of instances constant.",
    ),
    "motion-approximated": Kind(
        "caution",
        "{fraction:percent} of the received power moves in paths of three or more reflections.",
        "radarsim assumes a straight line between their first and last scatterers.",
        "Lower Max reflections to exclude such paths.",
    ),
    "displacement-error": Kind(
        "caution",
        "Displacements during the burst have an error of up to {displacement_error_bound_m:.2g} m, "
        "{wavelengths:.2g} wavelengths.",
        "Blender stores positions in float32, so phases from pulse to pulse are not reliable.",
        "Move the scene near the world origin, or raise Max motion samples.",
    ),
}


ROUGHNESS = {
    "kirchhoff-short-correlation": Kind(
        "caution",
        "The Kirchhoff model does not apply to {subjects}: k l = {k_l:.3g} is not above 6.",
        "The surface varies within a wavelength.",
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
        "The rough lobe lacks the remaining coherent, mirror-like part.",
        "Raise the RMS height or the carrier.",
    ),
    "kirchhoff-steep-slopes": Kind(
        "caution",
        "The Kirchhoff model does not apply to {subjects}: the RMS slope {slope:.3g} is above 0.4.",
        "Power that facets send to one another is lost.",
        "Lower the RMS height, or raise the correlation length.",
    ),
}

PROCESSING = {
    "no-echo": Kind(
        "error",
        "The frame contains no echo, so all maps are empty.",
        "No object is in view, or none returns power: a Point light does not show in mirrors and "
        "does not leave closed meshes.",
        "Check that the transmitter is outside closed meshes and smooth surfaces have a "
        "roughness above 0. Check Object > Visibility: Ray Visibility > Camera on, Holdout and "
        "Shadow Catcher off. Check that no object is scaled to 0.",
    ),
    "ground-truth-missing": Kind(
        "caution",
        "The folder of the frame has no ground_truth.json.",
        "Without its RMS heights, clutter models and fluctuations, every surface has the speckle "
        "of a rough one, and nothing fluctuates.",
        "Put the file back, or render the run again. Without such properties, the echoes are the "
        "same.",
    ),
    "weather-attenuates": Kind(
        "info",
        "The air attenuates by {attenuation_db_per_km:.3g} dB per kilometre of path, one way.",
        "Cross sections are those in clear air.",
        "For clear air, leave the weather options out.",
    ),
    "rain-echo": Kind(
        "info",
        "Rain of {rain_mm_per_h:g} mm/h returns {reflectivity_db:.1f} dB m^2/m^3 within the field "
        "of view.",
        "Rain returns nothing beyond the field of view, behind surfaces and via reflections.",
        "For targets alone, do not set Rain echo.",
    ),
    "rain-echo-left-out": Kind(
        "caution",
        "Rain of {rain_mm_per_h:g} mm/h attenuates the paths, but its own echo is left out.",
        "Its drops would return {reflectivity_db:.1f} dB m^2/m^3.",
        "Compare the cross sections of targets with reflectivity times volume of the cell, or "
        "set Rain echo (with paths, not for an orthographic camera).",
    ),
    "range-ambiguous-paths": Kind(
        "caution",
        "The frame has {count:#path} beyond the unambiguous range of {unambiguous_range_m:.6g} m, "
        "which the {limit} sets.",
        "Their echoes appear at wrong, smaller ranges, as in a radar.",
        "To raise the unambiguous range, lower the PRF, use smaller frequency steps, or a longer "
        "code.",
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
        "Doppler is ambiguous: echoes appear at a wrong range rate, maybe of the opposite sign. "
        "Lists of targets give the true one as unfolded_velocity_mps.",
        "Raise the PRF to at least {prf_hz:frequency}.",
    ),
    "all-echoes-outside-ranges": Kind(
        "error",
        "All {count:#path} of the frame are outside the recorded ranges, {start_m:length} to "
        "{stop_m:length}: they are at {nearest_m:length} to {farthest_m:length}.",
        "All maps are empty, or contain noise only.",
        "Set Range Start and Range Stop (--range-limits) to the ranges of the paths. If an FMCW "
        "radar ends at its sampled band, raise the sampling rate or lower the sweep slope.",
    ),
    "paths-outside-range-limits": Kind(
        "info",
        "The frame has {count:#path} outside the range limits.",
        "No result contains their echoes.",
        "Widen the range limits to include them.",
    ),
    "range-encoding-underflow": Kind(
        "caution",
        "The frame has {count:#pixel} whose range encoding is too small for float32 (red channel).",
        "radarsim skips these pixels.",
        "Render fewer or narrower rings, so that the range encoding covers their ranges.",
    ),
    "paths-without-length": Kind(
        "info",
        "The table of the frame has {count:#path} without a length, with {fraction:percent} of the "
        "received power.",
        "No echo contains these paths. Absorption made them too weak for the range encoding, or "
        "their material has none.",
        "Assign a Radar Material to all objects, or set Range encoding to World volume. If all "
        "have one, use less absorption or shorter paths inside the objects.",
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
        "radarsim treats these paths as stationary, for example edges of moving objects.",
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
        "radarsim takes the transmit gain of a single reflection at the same range.",
        "Measure by paths, or by rings with one reflection.",
    ),
    "orthographic-power": Kind(
        "caution",
        "The receiver is orthographic, so its powers are R^2 times the received watts (R in metres "
        "from receiver to scatterer).",
        "Levels, SNR and detections against thermal noise are not those of a radar. Ranges and "
        "cross sections are right.",
        "For watts and SNR, use a perspective receiver.",
    ),
    "coherent-part-not-formed": Kind(
        "caution",
        "{fraction:percent} of the received power is a specular echo of smooth surfaces: "
        "{subjects}.",
        "Echoes and maps contain this power as speckle, with a level from the RMS slope. The "
        "level of a smooth face depends on area, curvature and wavelength.",
        "At normal incidence, use the level of physical optics that smooth-face-level states, or "
        "raise the RMS height.",
    ),
    "few-scatterers": Kind(
        "caution",
        "{fraction:percent} of the received power is in range cells with fewer than {enough} "
        "independent scatterers (median {median:.3g}).",
        "Speckle is not exponential there. The expected power is not affected.",
        "Raise the resolution or the replicates.",
    ),
    "range-gaps-between-rays": Kind(
        "caution",
        "From {range_m:.3g} m on, a pixel covers more than a range cell.",
        "Beyond, radarsim interpolates between the rays on a surface: objects and shadows "
        "smaller than a pixel are missing. Without a speckle seed, echoes have gaps.",
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
        "The synthesis neglects up to about {phase_rad:.2g} rad of phase.",
        "Shorten the sweep.",
    ),
    "adc-clipped": Kind(
        "caution",
        "The ADC clipped {count:,} values of I and Q in {samples:#sample}.",
        "Clipping distorts strong echoes and spreads their power over the map.",
        "Raise the full scale of the ADC, or leave it to radarsim.",
    ),
    "phase-noise-within-steps": Kind(
        "caution",
        "The phase noise within one frequency step is {phase_rad:.2g} rad RMS.",
        "radarsim averages the phase over a step, not the wave: echoes from far away are up to "
        "{loss_db:.2g} dB too strong.",
        "Shorten the frequency step, or check the levels of the phase noise table.",
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
        "{hidden:percent} of the diagram is below the horizon, and {grazing:percent} is too "
        "close to it for rays.",
        "Below the horizon the diagram is empty. Close to it values are too high, by tens of "
        "decibels at the horizon.",
        "Use shorter ranges or greater heights, or a program that computes diffraction.",
    ),
    "coverage-lobes-unresolved": Kind(
        "caution",
        "Lobes are narrower than four steps of height or range in {fraction:percent} of the "
        "diagram.",
        "The points are too far apart, so the pattern is false. The value at each point is right.",
        "Divide the steps of height by {height_times} and those of range by {range_times}, or "
        "exclude the near ranges.",
    ),
    "coverage-ground-ends": Kind(
        "info",
        "The ground {subjects} ends {reach_m:length} from the radar, and the diagram goes to "
        "{range_m:length}.",
        "radarsim assumes that the ground continues to the last range.",
        "Ignore this if the mesh stands for a larger ground.",
    ),
}


#: Codes by topic, in the order of the reference page.
TOPICS: dict[str, dict[str, Kind]] = {
    "Scene and materials": SCENE,
    "Rough surfaces": ROUGHNESS,
    "Settings": SETTINGS,
    "Path measurement": PATHS,
    "Mirrors": MIRRORS,
    "Motion": MOTION,
    "No echo": NO_ECHO,
    "Processing": PROCESSING,
    "Coverage diagrams": COVERAGE,
    "Runs": RUNS,
}
#: Codes that say why a frame has no echo.
NO_ECHO_CODES = frozenset(NO_ECHO) | {"no-echo"}
CATALOGUE: dict[str, Kind] = {
    code: kind for topic in TOPICS.values() for code, kind in topic.items()
}
"""All kinds of findings by their code."""
