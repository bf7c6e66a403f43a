"""A file that gets its name has reached the disk before, whatever happens to the machine afterwards."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from vsacli.base.atomic_files import write_text


@pytest.mark.parametrize("overwrite", [False, True])
def test_content_is_on_the_disk_before_the_file_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool
) -> None:
    target, synced = tmp_path / "r.txt", []

    def sync(descriptor: int) -> None:
        status = os.fstat(descriptor)
        synced.append(("folder" if stat.S_ISDIR(status.st_mode) else status.st_size, target.exists()))

    monkeypatch.setattr(os, "fsync", sync)
    write_text(target, "content", overwrite=overwrite)
    assert synced == [(len("content"), False), ("folder", True)]
