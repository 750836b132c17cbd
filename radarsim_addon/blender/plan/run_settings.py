# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user chooses besides the numbers of a measurement. Does not import bpy."""

from __future__ import annotations

from dataclasses import dataclass

from ...options import documented, setting
from .measurement import LAST_FRAME

_FRAME = {"minimum": -LAST_FRAME, "maximum": LAST_FRAME}


@documented
@dataclass(frozen=True)
class RunSettings:
    """Choices between records, and where a run goes; they are kept with the radar."""

    waveform_kind: str = setting(
        "Waveform",
        "Choose what is transmitted; a finished run can be processed with another one",
        "lfm",
        choices=(
            ("lfm", "LFM Pulse", "Linear chirp, one echo per pulse"),
            ("fmcw", "FMCW", "Linear chirps with de-chirp: the ADC samples the beat"),
            ("stepped", "Stepped Frequency", "One sample at each of many tones"),
            ("pmcw", "PMCW", "m-sequence of phases, sent without a pause"),
            ("barker", "Barker Pulse", "Pulse with a Barker code of phases"),
            ("file", "File", "Waveform and burst from a file (JSON)"),
        ),
    )
    waveform_file: str = setting(
        "Waveform file",
        "Read waveform and burst from a file (JSON, see docs/waveforms.md)",
        "",
        path="FILE",
        flag="--waveform",
    )
    use_link_budget: bool = setting(
        "Use link budget",
        "Use transmit power and antennas as given here. Off: the light's power is the EIRP in all "
        "directions, the receiver is isotropic",
        False,
    )
    sampling_mode: str = setting(
        "Sampling mode",
        "Choose how the scene is measured",
        "paths",
        choices=(
            ("rings", "Rings", "The paper's: shells of range, all paths of a shell in a pixel"),
            ("paths", "Paths", "One path per pixel: exact ranges, standard error reported"),
        ),
    )
    extinction: str = setting(
        "Extinction",
        "Choose the length to which the Radar Material's extinction coefficient kappa is "
        "normalised: power falls as exp(-4 pi kappa d / length) with the depth d",
        "length",
        choices=(
            ("length", "Length", "A length in metres, or one Blender unit"),
            ("wavelength", "Wavelength", "Makes the coefficient the physical one"),
        ),
    )
    frame_mode: str = setting(
        "Frames",
        "Choose the Blender frames that become radar frames",
        "current",
        choices=(
            ("current", "Current", "The current frame alone"),
            ("scene", "Scene Range", "The scene's frame range and step"),
            ("range", "Range", "First, last and step as given here"),
        ),
    )
    frame_start: int = setting("First", "Set the first frame", 1, **_FRAME)
    frame_end: int = setting("Last", "Set the last frame", 1, **_FRAME)
    frame_step: int = setting("Step", "Take every n-th frame", 1, minimum=1, maximum=LAST_FRAME)
    output_folder: str = setting(
        "Output",
        "Set the folder of the run; // is the folder of the .blend file. radarsim makes it where "
        "its parent exists",
        "//radar_run",
        path="DIR",
        flag="--out",
    )
    overwrite: bool = setting(
        "Overwrite",
        "Measure all frames again, in place of any run in the output folder. Off: the run of "
        "another scene is refused, and radarsim render resumes a stopped run of the same file",
        False,
    )
