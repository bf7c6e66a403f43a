"""Recordings in foreign CSV files: their content, faults of their signals, and likely meanings of columns."""

from vsacli.files.recordings.recording_info import describe_recording, is_trajectory
from vsacli.files.recordings.recording_text import recording_lines

__all__ = ["describe_recording", "is_trajectory", "recording_lines"]
