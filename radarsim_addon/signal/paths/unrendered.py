# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of a table that no render has made."""

from __future__ import annotations

from collections.abc import Sequence

from ...contract import PathsRecord, ReceiverRecord, TransmitterRecord
from .table import PathRows


def unrendered_record(
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    carrier_hz: float,
    rows: PathRows,
    objects: Sequence[str],
    replicates: int = 1,
) -> PathsRecord:
    """Return a record in which only what the arguments say is known.

    Parameters
    ----------
    receiver, transmitter
        Antennas at the frame's time.
    carrier_hz
        Carrier [Hz].
    rows
        Table of single reflections, (n,).
    objects
        Names of the objects, which rows number from 1.
    replicates
        Replicates of the table.

    Returns
    -------
    PathsRecord
        Of frame 0, without pixels, renders and files.
    """
    return PathsRecord(
        frame=0,
        time_s=0.0,
        metres_per_unit=1.0,
        range_encoding_length_m=0.0,
        extinction_length_m=0.0,
        range_encoding="materials",
        coloured=False,
        amplitude_channel="mean",
        carrier_hz=carrier_hz,
        receiver=receiver,
        transmitter=transmitter,
        width_px=0,
        height_px=0,
        max_reflections=1,
        max_unfollowed_fraction=0.0,
        seed=0,
        tiles=1,
        replicates=replicates,
        finest_refinement_level=0,
        renders=0,
        render_time_s=0.0,
        path_count=rows.size,
        objects=list(objects),
        total_power_w=float(rows["power_w"].sum()),
        truncated_reflections_fraction=0.0,
        truncated_transparency_fraction=0.0,
        mixed_power_fraction=0.0,
        unranged_power_fraction=0.0,
        mixed_bias_bound_m=0.0,
        length_sigma_m=0.0,
        length_sigma_wavelengths=0.0,
        relative_error=0.0,
        stop_reason="",
        table_file="",
        table_sha256="",
    )
