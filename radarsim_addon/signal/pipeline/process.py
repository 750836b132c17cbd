# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder to its products, frame by frame.

    for event in process_run("out/paper"):
        print(event)

yields a :class:`Progress` after each step and a :class:`FrameResult` after each frame. Memory is
bounded by one frame, however many there are, as long as the caller lets go of the results.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...atomic_files import make_folder, remove_abandoned, remove_file
from ...contract import PRODUCTS_DIR
from ...errors import FrameFileError, OutputError, RadarSimError
from ...findings import Finding, finding
from ..maps import power_unit
from ..pictures import (
    ANTENNA_PICTURE,
    MapFile,
    animate_maps,
    common_scale,
    map_file,
    plot_antennas,
    save_figure,
)
from ..pictures import figure as figures
from ..radar import make_system
from ..results import FrameResult, remove_stale, write_result
from ..runs import RadarFrame, Run, open_run
from .frame import frame_steps
from .options import ProcessOptions, ResolvedOptions

#: The moving picture of all frames' maps, in the folder of the products.
ANIMATION_FILE = "range_doppler.gif"
#: Steps of a frame after its rings: echoes and map, products, pictures.
_STEPS_AFTER_RINGS = 3


@dataclass(frozen=True)
class Progress:
    """A step of processing.

    Attributes
    ----------
    done, total
        Steps that are done, and all steps of the whole run.
    text
        What the step did.
    finding
        Why a frame was skipped.
    file
        What was written for all frames together.
    """

    done: int
    total: int
    text: str
    finding: Finding | None = None
    file: Path | None = None


def process_run(
    path: str | Path,
    options: ProcessOptions | None = None,
    *,
    out: str | Path | None = None,
    frames: Sequence[int] | None = None,
    allow_incomplete: bool = False,
) -> Iterator[Progress | FrameResult]:
    """Process a run frame by frame.

    Parameters
    ----------
    path
        Folder that holds ``run.json``.
    options
        How; the defaults where None.
    out
        Folder for the products, made where missing; default ``products`` in the run's folder.
    frames
        Frames to process; all where None.
    allow_incomplete
        Skip frames whose renders are not all there, instead of raising.

    Yields
    ------
    Progress or FrameResult
        Progress after each step, a result after each frame. Files of a frame, in `out`:
        ``frame_0001_amplitude_t0.exr`` and the other three products;
        ``_profile.npz`` (range_m, expected_power, coherent_power); ``_map.npz`` (doppler_hz,
        velocity_mps, range_m, power [channel, Doppler, range]); ``_summary.json``; where asked for
        ``_detections.csv`` and ``.json``, ``.h5``, ``.sigmf-data`` and ``.sigmf-meta``; pictures
        ``_rings.png``, ``_echo.png``, ``_range_profile.png``, ``_range_doppler.png``. With a
        system ``antennas.png``, once; with several frames ``range_doppler.gif`` in the end.

    Raises
    ------
    RadarSimError
        One of its named kinds, see :mod:`radarsim_addon.errors`.
    """
    run = open_run(path)
    settled = (options or ProcessOptions()).for_run(run)
    chosen = [run.frame(n) for n in frames] if frames is not None else list(run.frames())
    with open_products(run, settled, out, allow_incomplete) as products:
        yield from _process_frames(products, chosen)


@dataclass(frozen=True)
class Products:
    """The folder that a run's products go to, and how they are made; see `open_products`."""

    run: Run
    options: ResolvedOptions
    folder: Path
    allow_incomplete: bool = False

    @property
    def draws(self) -> bool:
        """Whether pictures are drawn."""
        plots = self.options.plots
        return figures.has_matplotlib() if plots is None else plots

    def draw_antennas(self) -> None:
        """Draw what all frames share."""
        budget = self.options.link_budget
        if self.draws and budget is not None:
            system = make_system(budget, self.options.radar.waveform.wavelength_m)
            save_figure(plot_antennas(system), self.folder / ANTENNA_PICTURE)

    def process(self, frame: RadarFrame) -> Iterator[str | FrameResult]:
        """Open, process and write a frame; yield what was done, the result in the end."""
        options, folder = self.options, self.folder
        result = yield from frame_steps(options.open(frame), options)
        files = write_result(result, folder, options.writers)
        yield f"frame {frame.number}: products"
        if self.draws:
            files += write_result(result, folder, ["png"])
        yield f"frame {frame.number}: pictures"
        remove_stale(folder, frame.number, files)
        yield replace(result, files=tuple(files))

    def skipped(self, frame: RadarFrame) -> Finding | None:
        """Why a frame is left out; FrameFileError: it is incomplete and must not be."""
        gaps = frame.missing()
        if gaps and not self.allow_incomplete:
            raise FrameFileError(
                f"{frame.path} lacks {len(gaps)} of {frame.planned} renders; the first: "
                f"{gaps[0].reason}. Render the run again: it resumes where it stopped. Or process "
                "only what is complete with --allow-incomplete."
            )
        skipped = finding("frame-incomplete", missing=len(gaps)).in_frame(frame.number)
        return skipped if gaps else None

    def animate(self, maps: Sequence[MapFile]) -> Path | None:
        """Draw the maps of all frames with common colours, if asked for; return the file."""
        if not maps:
            raise FrameFileError(
                f"{self.run.path} has no complete frame to process. Render the run again: it "
                "resumes where it stopped."
            )
        options, path = self.options, self.folder / ANIMATION_FILE
        if options.animate or (options.animate is None and self.draws and len(maps) > 1):
            unit = power_unit(options.amplitude_model)
            return animate_maps(maps, path, common_scale(maps, unit))
        remove_file(path)
        return None


def products_folder(run: Run, out: str | Path | None) -> Path:
    """Where products go: `out`, else a folder in that of the run."""
    return Path(out) if out is not None else run.path / PRODUCTS_DIR


@contextlib.contextmanager
def open_products(
    run: Run, options: ResolvedOptions, out: str | Path | None, allow_incomplete: bool
) -> Iterator[Products]:
    """Make the folder for a run's products; what is refused leaves none behind."""
    folder = products_folder(run, out)
    fresh = not folder.exists()
    make_folder(folder, within=run.path if out is None else None)
    remove_abandoned(folder)
    try:
        try:
            yield Products(run, options, folder, allow_incomplete)
        finally:  # workers may have been killed
            remove_abandoned(folder)
    except RadarSimError:
        # What cannot be read or written is no error of its own where all is gone.
        for place, kind in ((run.path, FrameFileError), (folder, OutputError)):
            if not place.is_dir():
                raise kind(
                    f"The folder {place} has vanished during the processing: it was removed or "
                    "renamed, or its drive is gone. Put it back, or process again."
                ) from None
        if fresh:
            with contextlib.suppress(OSError):  # it holds products: it stays
                folder.rmdir()
        raise


def _process_frames(
    products: Products, chosen: Sequence[RadarFrame]
) -> Iterator[Progress | FrameResult]:
    products.draw_antennas()
    steps = products.run.record.rings + _STEPS_AFTER_RINGS
    total, finished = steps * len(chosen), 0
    maps: list[MapFile] = []
    for frame in chosen:
        skipped = products.skipped(frame)
        if skipped is not None:
            finished += steps
            yield Progress(finished, total, f"frame {frame.number} skipped", skipped)
            continue
        for event in products.process(frame):
            if isinstance(event, FrameResult):
                maps.append(map_file(event, products.folder))
                yield event
            else:
                finished += 1
                yield Progress(finished, total, event)
    path = products.animate(maps)
    if path is not None:
        yield Progress(total, total, f"animation: {path}", file=path)
