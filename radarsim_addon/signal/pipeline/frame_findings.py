# SPDX-License-Identifier: GPL-3.0-or-later
"""What to know before trusting a frame: findings of its render and of every stage of processing."""

from __future__ import annotations

import itertools

from ...findings import NO_ECHO_CODES, Finding, finding
from ..decoding import FrameInput
from ..detection import BudgetReport, FrameStatistics, statistics_findings
from ..echoes import ReceivedSignal
from ..maps import ExpectedPower
from ..radar import Weather, find_suspicious_parameters
from ..scattering import FrameSpeckle

#: Carriers that differ by more than this are worth a word about materials.
_CARRIER_SLACK = 0.01


def findings_of_frame(
    frame_input: FrameInput,
    statistics: FrameStatistics,
    budget: BudgetReport,
    speckle: FrameSpeckle,
    expected: ExpectedPower | None,
    received: ReceivedSignal,
    weather: Weather,
) -> list[Finding]:
    """Find what to know before trusting the frame, from every stage; `weather` as it is shown."""
    scatterers, report = speckle.report(), received.echoes.report
    mode = frame_input.frame.sampling_mode
    rendered = [*frame_input.frame.record.findings]
    rendered += itertools.chain(*(table.record.findings for table in frame_input.tables))
    explained = any(item.code in NO_ECHO_CODES for item in rendered)
    unranged = frame_input.table.record.unranged_power_fraction if frame_input.tables else 0.0
    of_paths = statistics_findings(
        statistics, frame_input.radar, mode, frame_input.range_limits_m, unranged
    )
    found = itertools.chain(
        rendered,
        (item for item in of_paths if item.code != "no-echo" or not explained),
        weather.findings(frame_input.radar.waveform.carrier_hz),
        budget.findings,
        speckle.findings,
        [] if expected is None else expected.findings,
        [] if report is None else report.accuracy_findings(),
        [] if scatterers is None else scatterers.findings,
        _radar_findings(frame_input, statistics.power_w > 0),
        _receiver_findings(received),
    )
    return [item.in_frame(frame_input.frame.number) for item in found]


def _radar_findings(frame_input: FrameInput, echoing: bool) -> list[Finding]:
    radar, stop_m = frame_input.radar, frame_input.range_limits_m[1]
    # A run without an echo ends where it begins: its range limits tell nothing of a scene.
    found = find_suspicious_parameters(radar, stop_m if echoing else None)
    own_hz, now_hz = frame_input.frame.run.radar.waveform.carrier_hz, radar.waveform.carrier_hz
    if abs(now_hz / own_hz - 1) > _CARRIER_SLACK:
        found.append(finding("carrier-differs-from-run", carrier_hz=now_hz, run_carrier_hz=own_hz))
    unambiguous_m = radar.waveform.unambiguous_range_m
    if stop_m > unambiguous_m * (1 + 1e-9):
        numbers = {"range_limit_m": stop_m, "unambiguous_range_m": unambiguous_m}
        if radar.waveform.kind == "fmcw":
            found.append(finding("range-limits-beyond-sampled-band", **numbers))
        else:
            found.append(finding("range-limits-beyond-unambiguous-range", **numbers))
    return found


def _receiver_findings(received: ReceivedSignal) -> list[Finding]:
    if not received.clipped:
        return []
    samples = received.echoes.samples.size
    return [finding("adc-clipped", count=received.clipped, samples=samples)]
