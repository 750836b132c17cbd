# SPDX-License-Identifier: GPL-3.0-or-later
"""Named errors: each message says what was found, what was expected and how to fix it.

The command line prints ``radarsim: Name: message`` and exits with ``exit_code``; operators hand the
message to ``self.report``. Anything else that escapes is a defect of radarsim and shows its
traceback.
"""

#: Characters of a message.
_LONGEST = 4000


class RadarSimError(Exception):
    """Base of every error that radarsim raises on purpose."""

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        # files may hold a megabyte where a word is expected
        cut = len(message) > _LONGEST
        super().__init__(f"{message[: _LONGEST // 2]} [...] {message[-500:]}" if cut else message)


class ConfigError(RadarSimError):
    """Numbers that do not fit together: ring step zero, a chirp longer than its interval..."""

    exit_code = 2


class SceneError(RadarSimError):
    """The Blender scene cannot be measured: no camera, no emitter, an unsupported camera..."""


class OutputError(RadarSimError):
    """The output folder cannot be used: missing, read-only, full, or holding another run."""


class FrameFileError(RadarSimError):
    """An EXR or JSON file of a run is missing, truncated, of a wrong kind, or holds NaN or Inf."""


class SchemaError(RadarSimError):
    """A sidecar is of a newer schema, or does not match its EXR."""


class RenderError(RadarSimError):
    """Cycles did not deliver a frame."""


class MissingDependencyError(RadarSimError):
    """A package or a system library that this step needs is not installed."""


class PathDataError(RadarSimError):
    """A path cannot be summed: its length or its amplitude is NaN or infinite."""


class WorkerError(RadarSimError):
    """Workers failed, or frames failed in them so often that they were set aside."""


class SettingNameError(ConfigError, AttributeError):
    """There is no setting of that name."""
