# SPDX-License-Identifier: GPL-3.0-or-later
"""Raw I/Q as a SigMF recording: ``.sigmf-data`` and ``.sigmf-meta`` (sigmf.org, 1.2)."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...atomic_files import replaced, write_json
from ..echoes import Echoes, line_times_s
from ..radar import FmcwWaveform, waveform_to_dict
from ..results import FrameResult, frame_file, result_writer

SIGMF_VERSION = "1.2.0"
#: More rows than this are not annotated one by one.
_MOST_ANNOTATIONS = 4096


@result_writer("sigmf", ".sigmf-data", ".sigmf-meta")
def write_sigmf_recording(result: FrameResult, folder: Path) -> list[Path]:
    """Write the raw samples of a result as a SigMF recording."""
    stem = frame_file(folder, result.frame, "")
    return write_sigmf(stem, result.echoes, f"radarsim frame {result.frame}")


def write_sigmf(stem: Path, echoes: Echoes, description: str = "") -> list[Path]:
    """Write the samples of a burst, one pulse after the other, as complex (or real) float32.

    `stem` is the path without suffix. Several channels are interleaved sample by sample, as SigMF's
    ``core:num_channels`` says. Each pulse is an annotation; the pause between pulses is not
    recorded, ``radarsim:prf_hz`` says how long it is.
    """
    data, meta = (stem.with_name(stem.name + s) for s in (".sigmf-data", ".sigmf-meta"))
    waveform = echoes.radar.waveform
    real = isinstance(waveform, FmcwWaveform) and waveform.real_adc
    samples = echoes.samples.real.astype("<f4") if real else echoes.samples.astype("<c8")
    content = np.moveaxis(samples, 0, -1).tobytes()
    with replaced(data) as temporary:
        temporary.write_bytes(content)
    write_json(meta, _metadata(echoes, real, hashlib.sha512(content).hexdigest(), description))
    return [data, meta]


def _metadata(echoes: Echoes, real: bool, digest: str, description: str) -> dict[str, Any]:
    radar = echoes.radar
    channels, rows, count = echoes.samples.shape
    starts_s = line_times_s(radar) if radar.waveform.family == "line" else echoes.slow_time_s
    annotations = [
        {
            "core:sample_start": row * count,
            "core:sample_count": count,
            "core:label": f"pulse {row}",
            "radarsim:slow_time_s": float(starts_s[row]),
        }
        for row in range(min(rows, _MOST_ANNOTATIONS))
    ]
    waveform = waveform_to_dict(radar.waveform)
    waveform.setdefault("kind", radar.waveform.kind)
    waveform.pop("samples", None)
    return {
        "global": {
            "core:datatype": "rf32_le" if real else "cf32_le",
            "core:sample_rate": radar.waveform.sampling_rate_hz,
            "core:version": SIGMF_VERSION,
            "core:num_channels": channels,
            "core:sha512": digest,
            "core:description": description,
            "core:recorder": f"radarsim {__version__}",
            "core:extensions": [{"name": "radarsim", "version": "1.0.0", "optional": True}],
            "radarsim:unit": "sqrt(W)" if echoes.amplitude_model == "radar-equation" else "B r^2",
            "radarsim:sign_convention": "exp(-j 2 pi f0 tau): Doppler = -2 v / wavelength, "
            "receding v > 0",
            "radarsim:waveform": waveform,
            "radarsim:prf_hz": radar.burst.prf_hz,
            "radarsim:pulses": radar.burst.pulses,
            "radarsim:samples_per_row": count,
            "radarsim:first_sample_s": echoes.first_sample_s,
            "radarsim:range_limits_m": list(echoes.range_limits_m),
        },
        "captures": [{"core:sample_start": 0, "core:frequency": radar.waveform.carrier_hz}],
        "annotations": annotations,
    }
