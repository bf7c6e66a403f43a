"""What whoever computes rows of a study is told of it."""

from __future__ import annotations

import os
from typing import NamedTuple, Self

from vsacli.base.errors import InputError
from vsacli.studies.sweeps.study import Study, load_study


class Job(NamedTuple):
    """A study as another process reads it again, on this machine or on another one.

    Attributes:
        path: of the study file.
        engine: that computes.
        computed_by: versions of all that rows depend on, and their names.
        fingerprint: of the study.
    """

    path: str
    engine: str
    computed_by: tuple[tuple[str, str], ...]
    fingerprint: str

    @classmethod
    def of(cls, study: Study) -> Self:
        """That of a study, whose path does not depend on the working folder."""
        path = os.path.abspath(study.source.path)
        return cls(path, study.engine, tuple(study.computed_by.items()), study.fingerprint)

    def study(self) -> Study:
        """The study, read here.

        Raises:
            InputError: it cannot be read here, what computes here is not what computes there, or a file has
                another content here.
        """
        study = load_study(self.path, self.engine)
        differing = [
            f"{name} is {here or 'missing'} instead of {there or 'none'}"
            for (name, there), here in zip(self.computed_by, study.computed_by.values(), strict=True)
            if here != there
        ]
        if differing:
            raise InputError.one(f"other rows would be computed here: {', '.join(differing)}")
        if study.fingerprint != self.fingerprint:
            raise InputError.one(
                "a file of the study is another one here, or was changed meanwhile; run it again", self.path
            )
        return study
