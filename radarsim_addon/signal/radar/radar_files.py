# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms and radars as plain dictionaries and files: run.json, radar.json, tables of samples.

Numbers that contradict one another are refused where a waveform or radar is made. Numbers that can
be built but suit no such scene, mostly by an error of a unit, are findings: low frequencies, narrow
bands and slow pulses may be meant.
"""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import Complex, read_npy
from ...errors import ConfigError, FrameFileError
from ...findings import Finding, finding
from ...typed_json import from_json, read_json
from .arrays import array_from_dict
from .config import MAX_WAVEFORM_SAMPLES, AnyWaveform, Burst, Radar
from .waveforms import (
    ArbitraryPulse,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    SteppedWaveform,
    Waveform,
)

#: Kind in a file -> class.
WAVEFORM_KINDS: dict[str, Any] = {
    kind.kind: kind
    for kind in (
        Waveform,
        FmcwWaveform,
        PhaseCodedPulse,
        PmcwWaveform,
        SteppedWaveform,
        ArbitraryPulse,
    )
}
#: A radar file holds a few numbers; the samples of an arbitrary waveform are in their own file.
_MAX_RADAR_BYTES = 1 << 20
_MAX_SAMPLE_BYTES = 64 * MAX_WAVEFORM_SAMPLES


def waveform_to_dict(waveform: AnyWaveform) -> dict[str, Any]:
    """Return the fields of a waveform as plain JSON, with its kind.

    Parameters
    ----------
    waveform
        Any waveform.

    Returns
    -------
    dict
        Fields by name, SI. An LFM pulse has no "kind"; samples are two lists, "real" and "imag".
    """
    fields: Any = waveform
    data: dict[str, Any] = {}
    if waveform.kind != Waveform.kind:
        data["kind"] = waveform.kind
    for item in dataclasses.fields(fields):
        value = getattr(waveform, item.name)
        if isinstance(value, np.ndarray):
            value = {"real": value.real.tolist(), "imag": value.imag.tolist()}
        data[item.name] = value
    return data


def waveform_from_dict(data: dict[str, Any], folder: Path | None = None) -> Any:
    """Return a waveform from its fields and "kind" (none: "lfm").

    Parameters
    ----------
    data
        Kind and fields by name, SI. "arbitrary" takes "samples" as {"real": [...],
        "imag": [...]}, or "file", the name of a .npy or .csv file of samples.
    folder
        What the name of such a file is relative to.

    Returns
    -------
    AnyWaveform
        Of the class of its kind.

    Raises
    ------
    ConfigError
        Unknown kind or field, a missing field, or numbers that do not fit.
    FrameFileError
        The file of samples cannot be read.
    """
    if not isinstance(data, dict):
        raise ConfigError(f"Waveform is {data!r:.60}; expected an object with its fields.")
    given = dict(data)
    name = given.pop("kind", Waveform.kind)
    if not isinstance(name, str) or name not in WAVEFORM_KINDS:
        raise ConfigError(
            f"Waveform of kind {name!r:.60}; expected one of {', '.join(sorted(WAVEFORM_KINDS))}."
        )
    kind = WAVEFORM_KINDS[name]
    if kind is ArbitraryPulse:
        given["samples"] = _given_samples(given, folder)
        given.setdefault("source", "")
    return from_json(kind, given, f"Waveform {name!r}")


def _given_samples(given: dict[str, Any], folder: Path | None) -> Complex:
    if "file" in given:
        path = Path(str(given.pop("file")))
        given["source"] = path.name
        return load_samples(path if folder is None else folder / path)
    samples = given.get("samples")
    if isinstance(samples, dict) and set(samples) == {"real", "imag"}:
        try:
            parts = [np.asarray(samples[key], dtype=np.float64) for key in ("real", "imag")]
            return np.asarray(parts[0] + 1j * parts[1], dtype=np.complex128)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"Waveform samples cannot be read: {error}.") from error
    raise ConfigError(
        "Waveform 'arbitrary' needs \"file\", the name of a .npy or .csv file of complex samples, "
        'or "samples" with the lists "real" and "imag".'
    )


def load_samples(path: str | Path) -> Complex:
    """Read complex samples from a file, (n,).

    ``.npy``: a row of complex numbers, never pickled objects. ``.csv``: real and imaginary part in
    two columns; lines that begin with # are comments, one line of headings may lead.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > _MAX_SAMPLE_BYTES:
            raise FrameFileError(
                f"{path} holds {size} bytes; a waveform has at most {MAX_WAVEFORM_SAMPLES} "
                "samples. Give the pulse alone, without the pause behind it."
            )
        if path.suffix.lower() == ".npy":
            samples = read_npy(path)
        elif path.suffix.lower() == ".csv":
            samples = _csv_samples(path)
        else:
            raise FrameFileError(
                f"{path} is of no kind that holds samples; expected .npy (complex) or .csv "
                "(real, imaginary)."
            )
    except (OSError, ValueError, csv.Error) as error:
        raise FrameFileError(
            f"{path} cannot be read as samples ({error}). Expected a .npy file of complex numbers "
            "or a .csv file with real and imaginary part in two columns."
        ) from error
    if samples.dtype.kind not in "fc" or samples.ndim != 1:
        raise FrameFileError(
            f"{path} holds {str(samples.dtype)[:80]} of shape {samples.shape}; expected one row of "
            "complex numbers."
        )
    if not np.isfinite(samples).all():
        place = int(np.flatnonzero(~np.isfinite(samples))[0])
        raise FrameFileError(
            f"{path}: sample {place} is {samples[place]}; expected finite numbers."
        )
    return np.asarray(samples, dtype=np.complex128)


def _csv_samples(path: Path) -> Complex:
    values: list[complex] = []
    headings = 0
    with open(path, encoding="utf-8-sig", newline="") as stream:
        for number, row in enumerate(csv.reader(stream), 1):
            if not row or row[0].lstrip().startswith("#"):
                continue
            try:
                real, imaginary = (float(text) for text in row)
            except ValueError:
                if not values and not headings:
                    headings = number
                    continue
                raise ValueError(f"line {number} is {','.join(row)[:60]!r}") from None
            values.append(complex(real, imaginary))
    return np.array(values, dtype=np.complex128)


def burst_from_dict(data: dict[str, Any], waveform: AnyWaveform | None = None) -> Burst:
    """Return a burst from "pulses" and "prf_hz" [Hz]. Without a PRF, pulses of `waveform` follow
    one another without a pause.
    """
    if isinstance(data, dict) and data.get("prf_hz") is None and waveform is not None:
        data = {**data, "prf_hz": 1 / waveform.duration_s}
    return from_json(Burst, data, "Burst")


def load_radar(path: str | Path, burst: Burst | None = None) -> Radar:
    """Read a radar from a JSON file.

    It holds the objects "waveform" ({"kind": ..., ...}), "burst", and, where the radar has several
    antennas, "array": see :func:`.array_from_dict`.

    Parameters
    ----------
    path
        The file.
    burst
        Taken where the file holds none.

    Returns
    -------
    Radar
        Waveform, burst and channels.

    Raises
    ------
    FrameFileError
        No such file, too large, or no JSON.
    ConfigError
        Numbers that do not fit together.
    """
    path = Path(path)
    remedy = (
        'Expected a radar file: {"waveform": {"kind": "fmcw", ...}, "burst": {"pulses": ..., '
        '"prf_hz": ...}}; samples belong into a file of their own.'
    )
    data = read_json(path, _MAX_RADAR_BYTES, remedy, FrameFileError)
    if not {"waveform"} <= set(data) <= {"waveform", "burst", "array"}:
        raise ConfigError(
            f"{path} holds {', '.join(sorted(data)):.60}; expected the objects waveform and burst, "
            "and array where there are several antennas."
        )
    try:
        waveform = waveform_from_dict(data["waveform"], path.parent)
        if "burst" in data:
            burst = burst_from_dict(data["burst"], waveform)
        if burst is None:
            raise ConfigError("It holds no burst; expected pulses and prf_hz.")
        if "array" not in data:
            return Radar(waveform, burst)
        array = array_from_dict(data["array"], waveform.wavelength_m)
        return Radar(waveform, burst, array.channels(burst, waveform.duration_s))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def range_limit(waveform: AnyWaveform) -> str:
    """Return the setting that bounds the unambiguous range, such as "PRF", for messages."""
    limits = {"stepped": "frequency step", "pmcw": "code length", "fmcw": "sampling rate"}
    return limits.get(waveform.kind, "PRF")


def find_suspicious_parameters(
    radar: Radar, reach_m: float | None = None, animation_s: float | None = None
) -> list[Finding]:
    """Find parameters that make a radar useless for its scene.

    `reach_m` is the farthest range of interest [m], `animation_s` the duration of the animation
    [s], where known.
    """
    waveform, found = radar.waveform, []
    if reach_m is not None and 0 < reach_m < waveform.range_resolution_m:
        found.append(
            finding(
                "one-range-cell",
                bandwidth_hz=waveform.bandwidth_hz,
                range_resolution_m=waveform.range_resolution_m,
                farthest_m=reach_m,
            )
        )
    # the pulse's duration T alone takes a band of 1 / T
    elif isinstance(waveform, Waveform) and waveform.bandwidth_hz * waveform.chirp_duration_s < 0.9:
        found.append(
            finding(
                "low-time-bandwidth-product",
                bandwidth_hz=waveform.bandwidth_hz,
                duration_s=waveform.chirp_duration_s,
                product=waveform.bandwidth_hz * waveform.chirp_duration_s,
                own_hz=1 / waveform.chirp_duration_s,
            )
        )
    if reach_m is not None and 0 < reach_m < waveform.wavelength_m:
        found.append(
            finding(
                "wavelength-exceeds-scene",
                carrier_hz=waveform.carrier_hz,
                wavelength_m=waveform.wavelength_m,
                farthest_m=reach_m,
            )
        )
    burst_s = radar.burst.pulses / radar.burst.prf_hz
    # up to 10 s are plausible, however short the animation is
    if animation_s is not None and burst_s > max(animation_s, 10.0):
        found.append(
            finding(
                "burst-exceeds-animation",
                pulses=radar.burst.pulses,
                prf_hz=radar.burst.prf_hz,
                burst_s=burst_s,
                animation_s=animation_s,
                max_unambiguous_velocity_mps=radar.max_unambiguous_velocity_mps,
            )
        )
    return found
