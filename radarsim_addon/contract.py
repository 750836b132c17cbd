# SPDX-License-Identifier: GPL-3.0-or-later
"""All that the two halves share: channel names, file names, and the records in the JSON sidecars.

The Blender half writes these records beside the EXR files, the companion module reads them;
neither imports the other, so a folder can be processed elsewhere, years later. Everything in a
record is SI (metres, seconds, hertz, watts) in float64; one Blender unit is ``metres_per_unit``.
Records of a frame are written with record_sha256, the digest of their other fields.
Pure standard library.

Layout of a run's folder::

    run.json                              the plan: radar, rings, snapshots, frames  (RunRecord)
    products/                             what ``radarsim process`` makes of the frames
    frames/frame_0001/ground_truth.json   where the objects truly are        (GroundTruthRecord)
                                          -- sampling mode "rings" --
    frames/frame_0001/ring_000_t0.exr     ring 0 at t: float32 R, G, B
    frames/frame_0001/ring_000_t0.json    its sidecar                             (RenderRecord)
    frames/frame_0001/ring_000_t1.exr     ring 0 in the second snapshot
                                          -- sampling mode "paths" --
    frames/frame_0001/paths.npy           one row per path                  (signal.paths.table)
    frames/frame_0001/paths.json          its sidecar                              (PathsRecord)
    frames/frame_0001/motion.json         how bodies move in the burst            (MotionRecord)
    frames/frame_0001/burst_001/          the same of a further render of the burst
    frames/frame_0001/deforming_surfaces.npz                        (signal.motion.motion_file)
    frames/frame_0001/still_bodies.npz                              (signal.motion.still_bodies)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from .findings import Finding
from .options import documented, setting

# -------------------------------------------------------------------------------------------------
# Records of the objects of a frame, which :mod:`.contract` keeps in the ground truth.
# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FluctuationRecord:
    """How the clutter of a surface fluctuates, see physics.clutter_statistics.

    motion_speed_mps and motion_fraction are what the kind of motion makes of them.
    """

    texture: str = "none"
    texture_shape: float = 0.0
    texture_length_m: float = 0.0
    motion: str = "none"
    motion_speed_mps: float = 0.0
    motion_fraction: float = 0.0


@dataclass(frozen=True)
class ObjectRecord:
    """Where one mesh object truly is: the reference that measured ranges are compared with.

    nearest_range_m is the least distance from the receiver to the object's evaluated mesh at t, and
    null if a shader displaces the surface. centre_range_m is the distance to the centre of its
    bounding box. range_rate_mps is the rate of that distance between the snapshots (receding > 0);
    null with one snapshot. collections are those that hold the object, at any depth. rms_height_m
    and correlation_length_m are those of the first of its materials that has any; null: none has.
    fluctuation and clutter (the name of the clutter model) likewise.
    """

    name: str
    nearest_range_m: float | None
    centre_range_m: float
    range_rate_mps: float | None
    materials: list[str] = field(default_factory=list)
    collections: list[str] = field(default_factory=list)
    rms_height_m: float | None = None
    correlation_length_m: float | None = None
    fluctuation: FluctuationRecord | None = None
    clutter: str | None = None


SCHEMA_VERSION = 2
"""Version of every record below. Readers refuse newer ones and name the version they know."""

# -- colour code (Eq. 2-4 of Costa et al.) ---------------------------------------------------------
AMPLITUDE_CHANNEL = "B"
"""Radiance L of the echo, in W per (Blender unit)^2 per steradian."""
RANGE_CHANNEL = "R"
"""L * exp(-l/k), l the total length of the path from camera over the scatterers to the emitter."""
CHECK_CHANNEL = "G"
"""L * exp(-2 l/k). G*B/R^2 is 1 for one path in a pixel, larger where several were mixed."""
CHANNELS = (RANGE_CHANNEL, CHECK_CHANNEL, AMPLITUDE_CHANNEL)

# -- names of files --------------------------------------------------------------------------------
RUN_FILE = "run.json"
GROUND_TRUTH_FILE = "ground_truth.json"
FRAMES_DIR = "frames"
PRODUCTS_DIR = "products"
PATHS_TABLE = "paths.npy"
PATHS_FILE = "paths.json"
TILES_DIR = "tiles"  # measured tiles of a frame that is not whole yet
MOTION_FILE = "motion.json"
DEFORMING_SURFACES_FILE = "deforming_surfaces.npz"
STILL_BODIES_FILE = "still_bodies.npz"


def frame_dir(frame: int) -> str:
    """Folder of a radar frame, relative to the run's folder."""
    return f"{FRAMES_DIR}/frame_{frame:04d}"


def burst_dir(frame: int, render: int) -> str:
    """Folder of a render of a burst, relative to the run's; the first: the frame's own."""
    return frame_dir(frame) if render == 0 else f"{frame_dir(frame)}/burst_{render:03d}"


def render_stem(ring: int, snapshot_index: int) -> str:
    """File name, without suffix, of one ring (from 0) in one pass (0 at t, 1 at t + delta t)."""
    return f"ring_{ring:03d}_t{snapshot_index}"


#: Most rings of a run, and most pixels of an image: 16k x 16k.
MAX_RINGS, MAX_PIXELS = 10_000, 1 << 28

# -- records ---------------------------------------------------------------------------------------
Matrix = list[list[float]]
"""4x4, row by row; translation column in metres, rotation part without scale."""


def check_pose(matrix: Matrix) -> None:
    """Raise a ValueError unless a pose is 4 x 4."""
    if list(map(len, matrix)) != [4, 4, 4, 4]:
        raise ValueError("its pose is no matrix of 4 x 4 numbers")


@dataclass(frozen=True)
class ReceiverRecord:
    """Receiver. Camera space is Blender's: x to the right, y up, the boresight along -z.

    kind says what the outer edges left, right, bottom, top (lens shift included) are:
    "perspective", tangents u, v of rays along (u, v, -1); "orthographic", metres across the
    boresight; "equirectangular", radians of longitude (0 ahead, positive to the right) and
    latitude. Row 0 of an image is the top one. near_clip_m is the depth that the near clip surface
    cuts from each path's first segment; the reader adds it back along the ray, times
    sqrt(1+u^2+v^2) for a perspective camera, whose surface is a plane.
    """

    kind: str
    matrix_world: Matrix
    left: float
    right: float
    bottom: float
    top: float
    near_clip_m: float

    def __post_init__(self) -> None:
        check_pose(self.matrix_world)


@dataclass(frozen=True)
class TransmitterRecord:
    """Transmitter: a point lamp. eirp_w is its power; radiant intensity eirp_w / (4 pi) [W/sr]."""

    matrix_world: Matrix
    eirp_w: float

    def __post_init__(self) -> None:
        check_pose(self.matrix_world)


AmplitudeModel = Literal["radar-equation", "paper"]
AMPLITUDE_MODEL: dict[str, Any] = {
    "label": "Amplitude model",
    "help": "Choose how radiance becomes amplitude",
    "choices": (
        ("radar-equation", "Radar Equation", "Amplitude is the root of the received power"),
        ("paper", "Paper", "Blue as amplitude times range squared (Eq. 10, 14)"),
    ),
}
"""Setting of the link budget and of the processing."""


@documented
@dataclass(frozen=True)
class AntennaRecord:
    """Antenna pattern: a kind and its parameters, see :mod:`radarsim_addon.signal.radar.antennas`.

    The antenna looks along the -z of what carries it (the lamp, the camera), its y is up.

    Parameters
    ----------
    parameters
        Numbers of the pattern by name, in the units of their names; docs/settings.md lists them.
    """

    kind: str = setting(
        "Pattern",
        "Choose the gain against direction",
        "isotropic",
        choices=(
            ("isotropic", "Isotropic", "The same gain in all directions"),
            ("cosine", "Cosine", "A power of the cosine of the angle from boresight"),
            ("gaussian", "Gaussian", "By half-power beamwidths in azimuth and elevation"),
            ("aperture", "Aperture", "Uniformly lit rectangle, sinc² in both planes"),
            ("array", "Array", "Grid of elements, steered by phase"),
            ("table", "Table", "CSV file: full pattern or principal cuts"),
        ),
    )
    parameters: dict[str, Any] = field(default_factory=dict)


def _loss(label: str, what: str, **more: Any) -> Any:
    return setting(label, f"Set the {what}", 0.0, unit="dB", minimum=0.0, digits=2, **more)


@documented
@dataclass(frozen=True)
class LinkBudget:
    """Power budget of the radar; see docs/system.md.

    With it the emitter's EIRP is the light level of the renders alone: it cancels.

    Parameters
    ----------
    transmitter, receiver
        Antennas.
    schema, schema_version
        Kind and version of the file.
    """

    transmit_power_w: float = setting(
        "Transmit power", "Set the peak power at the transmitter's output", 1.0, unit="W",
        above=0.0, initial=1000.0,
    )  # fmt: skip
    transmitter: AntennaRecord = field(default_factory=AntennaRecord)
    receiver: AntennaRecord = field(default_factory=AntennaRecord)
    transmit_loss_db: float = _loss("Transmit loss", "loss between transmitter and antenna")
    receive_loss_db: float = _loss("Receive loss", "loss between antenna and receiver")
    other_loss_db: float = _loss("Other losses", "losses that remain: atmosphere, processing")
    noise_figure_db: float = _loss(
        "Noise figure", "noise figure of the receiver, at 290 K", initial=3.0
    )
    antenna_temperature_k: float = setting(
        "Antenna temperature", "Set the noise temperature of the antenna", 290.0, unit="K",
        minimum=0.0, digits=1,
    )  # fmt: skip
    amplitude_model: AmplitudeModel = setting(default="radar-equation", **AMPLITUDE_MODEL)
    schema: str = "radarsim/system"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class RenderRecord:
    """Sidecar of one EXR file: one ring in one pass of one radar frame.

    run_fingerprint is the fingerprint of the run that wrote it; empty in older files.
    """

    sampling_mode: str  # "rings"
    frame: int
    snapshot_index: int
    time_s: float
    ring: int
    ring_min_m: float
    ring_max_m: float
    width_px: int
    height_px: int
    metres_per_unit: float
    range_encoding_length_m: float
    extinction_length_m: float
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    samples: int
    seed: int
    max_reflections: int
    exr_file: str
    exr_sha256: str
    run_fingerprint: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    schema: str = "radarsim/render"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class ColumnRecord:
    """A column of the path table: numpy dtype of an element, its unit, and the shape of a row's."""

    name: str
    dtype: str
    unit: str
    meaning: str
    shape: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class ColumnGroupRecord:
    """Columns of the path table that are read together; a new meaning is a new version."""

    version: int
    columns: list[ColumnRecord]


@dataclass(frozen=True)
class ImageRecord:
    """Image of the antennas in planar mirrors, in the order from the antenna to the scatterer.

    The points x of a mirror have normal . x = offset [m]. objects are those with the mirrors.
    bodies are the numbers in the motion file of the bodies that the mirrors move with; 0, or none
    in older files: the mirror is stationary.
    """

    normals: list[list[float]]
    offsets_m: list[float]
    objects: list[str]
    bodies: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class PathsRecord:
    """Sidecar of one radar frame's table of paths (acquisition "paths").

    objects names the numbers in the table's object columns, from 1. Fractions are of total_power_w:
    truncated_reflections in orders above max_reflections (probed by few rays: see its standard
    error, and its upper bound at 95 % confidence), truncated_transparency in gates that were not
    rendered, mixed_power in rows whose pixel held several paths even so, unranged_power in rows
    without a usable range. relative_error is over error_scope: "both", "ranges" or "objects".
    small_objects are in view before refinement and have few pixels; small_objects_tiled of them
    got tiles of their own. column_groups describes the table, flags gives the values that its
    column flags sums up. images names the numbers of its columns transmitter_image and
    receiver_image, from 1. run_fingerprint is as in RenderRecord.
    """

    frame: int
    time_s: float
    metres_per_unit: float
    range_encoding_length_m: float
    extinction_length_m: float
    range_encoding: str  # "materials" or "world"
    coloured: bool
    amplitude_channel: str
    carrier_hz: float
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    width_px: int
    height_px: int
    max_reflections: int
    max_unfollowed_fraction: float
    seed: int
    tiles: int
    replicates: int
    finest_refinement_level: int
    renders: int
    render_time_s: float
    path_count: int
    objects: list[str]
    total_power_w: float
    truncated_reflections_fraction: float
    truncated_transparency_fraction: float
    mixed_power_fraction: float
    unranged_power_fraction: float
    mixed_bias_bound_m: float
    length_sigma_m: float
    length_sigma_wavelengths: float
    relative_error: float
    stop_reason: str
    table_file: str
    table_sha256: str
    run_fingerprint: str = ""
    truncated_reflections_stderr: float = 0.0
    truncated_reflections_upper: float | None = None
    error_scope: str = "both"
    small_objects: int = 0
    small_objects_tiled: int = 0
    motion_file: str = ""  # empty: no motion is known, all is stationary
    motion_sha256: str = ""
    column_groups: dict[str, ColumnGroupRecord] = field(default_factory=dict)
    flags: dict[str, int] = field(default_factory=dict)
    images: list[ImageRecord] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    schema: str = "radarsim/paths"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class GroundTruthRecord:
    """Labels of one radar frame; run_fingerprint is as in RenderRecord."""

    frame: int
    time_s: float
    objects: list[ObjectRecord]
    run_fingerprint: str = ""
    schema: str = "radarsim/scene"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class RunRecord:
    """Plan of a run. Runs with the same ``fingerprint`` are parts of one run.

    waveform and burst hold the fields of the waveform, see signal.waveform_files, and of Burst. An
    LFM pulse carries no "kind". link_budget null: the emitter's EIRP goes in all directions, the
    receiver is isotropic. range_stop_m 0: as far as the rings, with paths the scene, reach.
    weather holds the fields of Weather; empty: clear air.
    """

    sampling_mode: str
    frames: list[int]
    frame_times_s: list[float]
    rings: int
    ring_step_m: float
    snapshots: int
    snapshot_interval_s: float
    width_px: int
    height_px: int
    samples: int
    seed: int
    max_reflections: int
    metres_per_unit: float
    range_encoding_length_m: float
    extinction_length_m: float
    waveform: dict[str, Any]
    burst: dict[str, Any]
    blend_file: str
    fingerprint: str
    visibility_updates: int = 1
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)
    link_budget: LinkBudget | None = None
    range_start_m: float = 0.0
    range_stop_m: float = 0.0
    weather: dict[str, Any] = field(default_factory=dict)
    scene: str = ""
    schema: str = "radarsim/run"
    schema_version: int = SCHEMA_VERSION


# -------------------------------------------------------------------------------------------------
# Record in ``motion.json``: how bodies that paths touch move; see :mod:`.contract`.
# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SegmentRecord:
    """A piece of a body's motion; see signal.motionmodel.Segment for what the numbers are."""

    start_s: float
    stop_s: float
    translation: Matrix
    rotation_centre: list[float]
    rotation: Matrix
    initial_orientation: Matrix
    linear: Matrix = field(default_factory=list)


@dataclass(frozen=True)
class BodyRecord:
    """One object or instance: its pose at t, translation in metres, and how it moves from there.

    instance tells instances of one object apart; it is empty for the object itself. Without
    pieces the body is stationary. noise_m is what the samples scatter about the fit,
    displacement_error_bound_m bounds the error of a displacement, both at the body's farthest
    point. box holds the low and the high corner of a turning body's mesh, in its own axes [m at
    scale 1]; empty where it is not known.
    """

    object: str
    instance: str
    pose: Matrix
    deforms: bool
    segments: list[SegmentRecord]
    noise_m: float
    displacement_error_bound_m: float
    box: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_pose(self.pose)


@dataclass(frozen=True)
class MotionRecord:
    """Motion of all bodies that paths touch, over one burst from time_s on.

    Numbers in the table's columns body and first_body count bodies from 1. antennas are receiver
    and emitter. displacement_error_bound_m is the largest bound of what moves.
    approximated_motion_fraction is the power of moving paths of three and more reflections, whose
    middle is unknown; unknown_motion_fraction that of paths with a vertex that is not known to
    belong to any body, which is taken as stationary. Many stationary bodies are in a file of their
    own, still_bodies_file, with their numbers; bodies then holds the others, in order.
    """

    frame: int
    time_s: float
    duration_s: float
    samples: int
    receiver_kind: str
    antennas: list[BodyRecord]
    bodies: list[BodyRecord]
    displacement_error_bound_m: float
    displacement_error_bound_wavelengths: float
    approximated_motion_fraction: float
    unknown_motion_fraction: float
    deforming_surfaces_file: str
    deforming_surfaces_sha256: str
    epoch_offset_s: float = 0.0  # when the table was rendered, after time_s; poses are of then
    still_bodies_file: str = ""
    still_bodies_sha256: str = ""
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    schema: str = "radarsim/motion"
    schema_version: int = SCHEMA_VERSION
