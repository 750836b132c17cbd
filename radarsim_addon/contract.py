# SPDX-License-Identifier: GPL-3.0-or-later
"""All that the two halves share: channel names, file names, and the records in the JSON sidecars.

The Blender half writes these records next to the EXR files, the companion module reads them;
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
    frames/frame_0001/paths.npz           one row per path                  (signal.paths.table)
    frames/frame_0001/paths.json          its sidecar                              (PathsRecord)
    frames/frame_0001/motion.json         how bodies move in the burst            (MotionRecord)
    frames/frame_0001/burst_001/          the same of a further render of the burst
    frames/frame_0001/deforming_surfaces.npz                        (signal.motion.motion_file)
    frames/frame_0001/still_bodies.npz                               (signal.motion.motion_file)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from .findings import Finding
from .options import documented, setting


@dataclass(frozen=True)
class FluctuationRecord:
    """Fluctuation of a surface's clutter: arguments of `texture` and `clutter_velocities` in
    physics.clutter.
    """

    texture: str = "none"
    texture_shape: float = 0.0
    texture_length_m: float = 0.0
    motion: str = "none"
    motion_speed_mps: float = 0.0
    motion_fraction: float = 0.0


@dataclass(frozen=True)
class ObjectRecord:
    """True place of one mesh object: the reference for measured ranges."""

    name: str
    #: From the receiver to the evaluated mesh at t; null if a shader displaces the surface.
    nearest_range_m: float | None
    centre_range_m: float  # to the centre of the bounding box
    #: Of the centre range, between the snapshots (receding > 0); null with one snapshot.
    range_rate_mps: float | None
    materials: list[str] = field(default_factory=list)
    collections: list[str] = field(default_factory=list)  # that hold the object, at any depth
    # Those of the first material that has any; null: none has. clutter: name of its model.
    rms_height_m: float | None = None
    correlation_length_m: float | None = None
    fluctuation: FluctuationRecord | None = None
    clutter: str | None = None
    # Centre of the bounding box in the world, its velocity between the snapshots (null with one),
    # and its direction in the receiver's own axes: to the right and up from the line of sight.
    centre_m: list[float] = field(default_factory=list)
    velocity_mps: list[float] | None = None
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    #: Object with which lists count this one, a car for its wheel; empty: it is counted by itself.
    part_of: str = ""


SCHEMA_VERSION = 2
"""Version of every record below. Readers refuse newer ones and name the version they know."""

# -- colour code (Eq. 2-4 of Costa et al.) ---------------------------------------------------------
AMPLITUDE_CHANNEL = "B"
"""Radiance L of the echo, in W per (Blender unit)^2 per steradian."""
RANGE_CHANNEL = "R"
"""L * exp(-l/k), l the length of the path from receiver over the scatterers to transmitter."""
CHECK_CHANNEL = "G"
"""L * exp(-2 l/k). G*B/R^2 is 1 for one path in a pixel, larger where several were mixed."""
CHANNELS = (RANGE_CHANNEL, CHECK_CHANNEL, AMPLITUDE_CHANNEL)

# -- names of files --------------------------------------------------------------------------------
RUN_FILE = "run.json"
GROUND_TRUTH_FILE = "ground_truth.json"
FRAMES_DIR = "frames"
PRODUCTS_DIR = "products"
PATHS_TABLE = "paths.npz"
PATHS_FILE = "paths.json"
TILES_DIR = "tiles"  # measured tiles of a frame that is not whole yet
MOTION_FILE = "motion.json"
DEFORMING_SURFACES_FILE = "deforming_surfaces.npz"
STILL_BODIES_FILE = "still_bodies.npz"


def frame_dir(frame: int) -> str:
    """Return the folder of a radar frame, relative to the run's folder."""
    return f"{FRAMES_DIR}/frame_{frame:04d}"


def burst_dir(frame: int, render: int) -> str:
    """Return the folder of a render of a burst, relative to the run's folder. The first render is
    in the frame's own folder.
    """
    return frame_dir(frame) if render == 0 else f"{frame_dir(frame)}/burst_{render:03d}"


def render_stem(ring: int, snapshot_index: int) -> str:
    """Return the file name, without suffix, of one ring (from 0) in one snapshot (from 0)."""
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
    """Receiver. Camera space is Blender's: x to the right, y up, the boresight along -z."""

    #: What the outer edges (lens shift included) are: "perspective", tangents u, v of rays along
    #: (u, v, -1); "orthographic", metres across the boresight; "equirectangular", radians of
    #: longitude (0 ahead, positive to the right) and latitude. Row 0 of an image is the top one.
    kind: str
    matrix_world: Matrix
    left: float
    right: float
    bottom: float
    top: float
    #: Depth that the near clip surface cuts from each path's first segment. The reader adds it back
    #: along the ray, times sqrt(1+u^2+v^2) for a perspective camera, whose surface is a plane.
    near_clip_m: float

    def __post_init__(self) -> None:
        check_pose(self.matrix_world)


@dataclass(frozen=True)
class TransmitterRecord:
    """Transmitter: a Point light; its radiant intensity is eirp_w / (4 pi) [W/sr]."""

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
    """Antenna pattern: a kind and its parameters, see signal.radar.link_budget.

    The antenna looks along the -z of what carries it (the light, the camera), its y is up.

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

    With it the transmitter's EIRP is the light level of the renders alone: it cancels.

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
    """Sidecar of one EXR file: one ring in one snapshot of one radar frame."""

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
    run_fingerprint: str = ""  # of the run that wrote it; empty in older files
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
    """Image of the antennas in planar mirrors, in the order from the antenna to the scatterer."""

    normals: list[list[float]]  # the points x of a mirror have normal . x = offset
    offsets_m: list[float]
    objects: list[str]  # with the mirrors
    #: Numbers in the motion file of the bodies that the mirrors move with; 0, or none in older
    #: files: the mirror is stationary.
    bodies: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class PathsRecord:
    """Sidecar of one radar frame's table of paths (sampling mode "paths").

    Fractions are of total_power_w.
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
    objects: list[str]  # by the numbers in the table's object columns, from 1
    total_power_w: float
    #: In orders above max_reflections, which few rays probe: see its standard error below.
    truncated_reflections_fraction: float
    truncated_transparency_fraction: float  # in path classes that were not rendered
    mixed_power_fraction: float  # in rows whose pixel held several paths even so
    unranged_power_fraction: float  # in rows without a usable range
    mixed_bias_bound_m: float
    length_sigma_m: float
    length_sigma_wavelengths: float
    relative_error: float
    stop_reason: str
    table_file: str
    column_sha256: dict[str, str]  # of the columns of the table
    run_fingerprint: str = ""
    truncated_reflections_stderr: float = 0.0
    truncated_reflections_upper: float | None = None  # bound at 95 % confidence
    error_scope: str = "both"  # of relative_error: "both", "ranges" or "objects"
    small_objects: int = 0  # in view before refinement, with few pixels
    small_objects_tiled: int = 0  # of them, with tiles of their own
    motion_file: str = ""  # empty: no motion is known, all is stationary
    motion_sha256: str = ""
    column_groups: dict[str, ColumnGroupRecord] = field(default_factory=dict)  # of the table
    flags: dict[str, int] = field(default_factory=dict)  # values that its column flags sums up
    #: By the numbers in its columns transmitter_image and receiver_image, from 1.
    images: list[ImageRecord] = field(default_factory=list)
    #: For elements up to so far from their antenna's origin, findings name what they do not see.
    array_reach_m: float = 0.0
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    schema: str = "radarsim/paths"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class GroundTruthRecord:
    """Labels of one radar frame."""

    frame: int
    time_s: float
    objects: list[ObjectRecord]
    run_fingerprint: str = ""
    schema: str = "radarsim/scene"
    schema_version: int = SCHEMA_VERSION


@dataclass(frozen=True)
class RunRecord:
    """Plan of a run. Runs with the same ``fingerprint`` are parts of one run."""

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
    waveform: dict[str, Any]  # its fields, see signal.radar; an LFM pulse carries no "kind"
    burst: dict[str, Any]  # fields of Burst
    blend_file: str
    fingerprint: str
    visibility_updates: int = 1
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)
    #: null: the transmitter's EIRP goes in all directions, the receiver is isotropic.
    link_budget: LinkBudget | None = None
    range_start_m: float = 0.0
    range_stop_m: float = 0.0  # 0: as far as the rings, with paths the scene, reach
    weather: dict[str, Any] = field(default_factory=dict)  # fields of Weather; empty: clear air
    channels: list[dict[str, Any]] = field(default_factory=list)  # Channel; empty: a single one
    scene: str = ""
    schema: str = "radarsim/run"
    schema_version: int = SCHEMA_VERSION


# -- motion.json: how bodies that paths touch move -------------------------------------------------


@dataclass(frozen=True)
class SegmentRecord:
    """A piece of a body's motion; signal.motion's `Segment` explains the numbers."""

    start_s: float
    stop_s: float
    translation: Matrix
    rotation_centre: list[float]
    rotation: Matrix
    initial_orientation: Matrix
    linear: Matrix = field(default_factory=list)


@dataclass(frozen=True)
class BodyRecord:
    """One object or instance: its pose at t, translation in metres, and how it moves from there."""

    object: str
    instance: str  # tells instances of one object apart; empty for the object itself
    pose: Matrix
    deforms: bool
    segments: list[SegmentRecord]  # none: the body is stationary
    # At the body's farthest point: how the samples scatter about the fit, and how wrong a
    # displacement is at most.
    noise_m: float
    displacement_error_bound_m: float
    #: Low and high corner of a turning body's mesh, in its own axes [m at scale 1]; empty: unknown.
    box: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_pose(self.pose)


@dataclass(frozen=True)
class MotionRecord:
    """Motion of all bodies that paths touch, over one burst from time_s on.

    Many stationary bodies are in a file of their own, still_bodies_file, with their numbers; bodies
    then holds the others, in order.
    """

    frame: int
    time_s: float
    duration_s: float
    samples: int
    receiver_kind: str
    antennas: list[BodyRecord]  # receiver and transmitter
    bodies: list[BodyRecord]  # by the numbers in the table's columns body and first_body, from 1
    displacement_error_bound_m: float  # the largest of what moves
    displacement_error_bound_wavelengths: float
    #: Power of moving paths of three and more reflections, whose middle is unknown.
    approximated_motion_fraction: float
    #: Power of paths with a vertex of no known body, which is taken as stationary.
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
