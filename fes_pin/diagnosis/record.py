"""A diagnosis on disk: `diagnosis.json` as the contract says, and the next experiment's stimulus."""

from __future__ import annotations

from dataclasses import replace

from fes_pin.data.trial import trial_csv
from fes_pin.diagnosis.recorded import NEXT_FILE
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.stored import stored_tables
from fes_pin.models.store import model_toml

diagnosis_record = Diagnosis.record
"""`diagnosis.json` as a dictionary, without the text and the table that a saved result has as well."""


def by_command(diagnosis: Diagnosis, command: str) -> Diagnosis:
    """The diagnosis with a command line in its provenance."""
    if diagnosis.provenance is None:
        return diagnosis
    return replace(diagnosis, provenance=replace(diagnosis.provenance, command=command))


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, str]:
    """Every file of a diagnosis but the report, by name."""
    files = {
        "diagnosis.json": diagnosis.to_json(),
        "model.toml": model_toml(diagnosis.model, stored_tables(diagnosis.extended, diagnosis.log)),
    }
    if diagnosis.next_experiment and diagnosis.next_experiment.trial is not None:
        files[NEXT_FILE] = trial_csv(diagnosis.next_experiment.trial)
    return files


__all__ = ["NEXT_FILE", "by_command", "diagnosis_files", "diagnosis_record"]
