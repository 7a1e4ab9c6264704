"""Public measured data that the documentation and the tests refer to: where they come from, where they lie."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.schema import unknown

VARIABLE = "FES_PIN_DATA"


@dataclass(frozen=True)
class Dataset:
    """One public recording.

    There is no download: no checksum of the upstream files is known to this project, and a file that cannot be checked
    is not fetched. Convert the upstream file to a study and name its folder in FES_PIN_DATA.

    Parameters
    ----------
    name
        Of the folder that holds its `study.toml`.
    what
        One line on what was measured.
    repository, commit, file
        Origin on GitHub.
    licence
        SPDX identifier.
    reference
        Publication, if there is one.
    """

    name: str
    what: str
    repository: str
    commit: str
    file: str
    licence: str
    reference: str = ""

    @property
    def origin(self) -> str:
        """Where a person finds the upstream file."""
        return f"https://github.com/{self.repository}/blob/{self.commit}/{self.file}"


DATASETS: Mapping[str, Dataset] = {
    dataset.name: dataset
    for dataset in (
        Dataset(
            name="free_pendulum",
            what="free swings of a real pendulum, angle and rate at 1 kHz",
            repository="dynamicslab/MultiArm-Pendulum",
            commit="e99a7e13fe2adc8fc647321a156b6cb59a48a698",
            file="SinglePendulumDataForParameterEstimation.mat",
            licence="MIT",
            reference="arXiv:2205.06231",
        ),
        Dataset(
            name="biceps_fes",
            what="isometric force of a human biceps under stimulation trains at about 31 Hz",
            repository="Kev1CO/cocofest_archive",
            commit="f50d932e07117a5a8da42cad808052b331c8f578",
            file="cocofest/examples/data/biceps_force.pkl",
            licence="MIT",
        ),
    )
}


WALKING = Dataset(
    name="walking_subject01",
    what="two strides of one adult on a treadmill: joint angles, ground reaction, inverse dynamics",
    repository="opensim-org/opensim-models",
    commit="20a888b9655e73fb84963d6e03eee3752cf6074b",
    file="Pipelines/Gait2354_Simbody",
    licence="CC-BY-3.0",
)
"""Not a study: tables of its own (`fes_pin.body.measured_walk.read_walk`)."""


def fetch(name: str) -> Path:
    """Folder of a public data set, as a study that `read_study` reads.

    Parameters
    ----------
    name
        One of `DATASETS`.

    Returns
    -------
    Path
        `<name>` or `data/<name>` in the folder that the environment variable FES_PIN_DATA names.

    Raises
    ------
    InputError
        Unknown name, FES_PIN_DATA not set, or nothing of that name in it; the message says where the data come from.
    """
    if name not in DATASETS:
        raise InputError(unknown(name, DATASETS), column=name)
    dataset = DATASETS[name]
    hint = f"convert {dataset.origin} ({dataset.licence}) to a study in its folder {name}"
    named = os.environ.get(VARIABLE, "")
    if not named:
        raise InputError(f"expected {VARIABLE} to name a folder of data; {hint}", column=name)
    for folder in (Path(named) / name, Path(named) / "data" / name):
        if (folder / "study.toml").is_file():
            return folder
    raise InputError(f"no {name}/study.toml in the folder that {VARIABLE} names; {hint}", file=named)
