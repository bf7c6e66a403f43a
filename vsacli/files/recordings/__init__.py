"""Recordings of other programs: what a CSV file holds, its health, and what its columns may stand for."""

from vsacli.files.recordings.recording_info import describe_recording, is_trajectory
from vsacli.files.recordings.recording_text import KIND, recording_lines

__all__ = ["KIND", "describe_recording", "is_trajectory", "recording_lines"]
