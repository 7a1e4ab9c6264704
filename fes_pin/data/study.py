"""A study: one rig, the model that is believed of it, and the trials measured on it."""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import tomli_w

from fes_pin.data.as_read import AsRead, digest_of, hashing
from fes_pin.data.checks import check_constants, check_same_inputs, checked_label, checked_labels, checked_mapping
from fes_pin.data.direction import with_kinds
from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.files import as_path, hold, what_is_at
from fes_pin.data.numbers import instance
from fes_pin.data.outputs import Outputs
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.recorded.columns import Columns
from fes_pin.data.recorded.view import View, view_of
from fes_pin.data.schema import (
    OF_A_VIEW,
    Rigs,
    RigSchema,
    check_conditions,
    check_known,
    checked_numbers,
    known_rigs,
    schema_of,
)
from fes_pin.data.show import DataFrame, by_columns, frame, table_html
from fes_pin.data.stimulus import with_one_stimulus
from fes_pin.data.study_text import HORIZON, StudyTables, check_files, checked_horizon
from fes_pin.data.table import format_csv
from fes_pin.data.toml import Document, document_of, read_toml
from fes_pin.data.trial import Trial, check_trial, derived_trial
from fes_pin.data.trial_files import Recordings, read_body_trial, read_view, trial_csv, walk_recordings
from fes_pin.data.turns import with_whole_turns
from fes_pin.data.walk_conventions import STANDARD

EDITED = "edited after it was read"
"""What stands in the place of a hash of a file that is no longer what its study holds."""
_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
"""Names of trials that are names of files as they are."""


@dataclass(frozen=True, eq=False, repr=False)
class Study(ReadOnly):
    """One rig and its trials.

    Parameters
    ----------
    name
        Of the study.
    rig
        Its name: "ankle", "muscle", "joint", "body", or one of anybody's own.
    constants
        Numbers of `[rig]` and `[rig.passive]`, by key: known, never fitted.
    start
        Numbers of `[start]`, by key: start values of what the nominal model fits.
    trials
        Measured trials, in the order of the study.
    folder
        That the study was read from, absolute; `Path()` of one that was made in memory.
    files
        Other files of the study by key: `urdf`, `segments`. They are read when the study is built, and held.
    described
        What studies of the rig must and may hold, if it is not one that is written here or installed.
    horizon_s
        How far ahead errors over a horizon look, s; None leaves it to the diagnosis.
    as_read
        The study.toml that it was read from; None of a study that was made in memory. Not compared.

    Raises
    ------
    InputError
        What `read_study` refuses in a file: an unknown rig, a constant or start value that is missing, unknown or not
        the number that it must be, a joint without URDF, no trials, two of one name, a trial that is not one of this
        rig (see `check_trial`).
    """

    name: str
    rig: str
    constants: Mapping[str, float]
    start: Mapping[str, float]
    trials: tuple[Trial, ...]
    folder: Path = Path()
    files: Mapping[str, Path] = field(default_factory=dict)
    described: RigSchema | None = None
    horizon_s: float | None = None
    as_read: AsRead | None = None

    def __post_init__(self) -> None:
        checked_label(self.name, fault_at(), "name", "a name")
        for key, kind in (("described", RigSchema), ("as_read", AsRead)):
            if getattr(self, key) is not None:
                instance(getattr(self, key), kind, key)
        schema = self._schema()
        given = {n: checked_mapping(getattr(self, n), fault_at("Study.{}"), n) for n in ("constants", "start", "files")}
        given["start"] |= schema.left_out(given["files"], {*given["start"], *given["constants"]})
        twice = set(schema.start) & set(given["constants"])
        if odd := sorted(twice & set(given["start"])):
            raise fault_at("start.{}")(odd[0], "is also among the constants; expected it in one of them")
        known = {"constants": {**schema.known_constants, **schema.passive}}
        known["start"] = {key: number for key, number in schema.start.items() if key not in twice}
        numbers = {n: checked_numbers(given[n], keys, fault_at(f"{n}.{{}}")) for n, keys in known.items()}

        def of_rig(key: str, message: str) -> InputError:
            return fault_at("files.{}" if key in schema.files else "constants.{}")(key, message)

        check_constants(schema, numbers["constants"], given["files"], of_rig)
        check_known(given["files"], schema.files, fault_at("files.{}"))
        files = {key: hold(path) for key, path in given["files"].items()}
        if any(files[key] is not path for key, path in given["files"].items()):
            check_files(schema, files)
        trials = tuple(self.trials) if isinstance(self.trials, Iterable) else (self.trials,)
        if all(isinstance(t, Trial) for t in trials):
            trials = with_one_stimulus(
                with_kinds(with_whole_turns(trials, files), schema), numbers["constants"], schema.inputs
            )
        self._check_trials(trials, schema)
        if schema.inputs_required:  # else a trial without an input is one that nothing drives
            check_same_inputs([(t.kind, t.columns) for t in trials], schema, numbers["constants"], _fault_of(trials))
        checked_horizon(self.horizon_s, fault_at("Study.{}"))
        vars(self).update(numbers, files=files, folder=as_path(self.folder, "folder"), trials=trials, described=schema)
        self._freeze()

    def _schema(self) -> RigSchema:
        if self.described is not None and self.described.name in ("", self.rig):
            return self.described
        return schema_of(self.rig, partial(InputError, column="rig"))

    def _check_trials(self, trials: tuple[Trial, ...], schema: RigSchema) -> None:
        if not trials:
            raise InputError("expected at least one trial, found none", column="trials")
        if odd := [one for one in trials if not isinstance(one, Trial)]:
            raise InputError(f"expected trials, found a {type(odd[0]).__name__}", column="trials")
        for trial in trials:
            try:
                check_trial(trial, schema, threshold_us=-math.inf)  # `check` judges the widths of all together
            except InputError as error:
                raise InputError(error.message, file=error.file or self.folder, column=error.column) from None
        if twice := [name for name, count in Counter(t.name for t in trials).items() if count > 1]:
            raise InputError(f"two trials are named {twice[0]!r}; expected a name for each", column="trials")

    @classmethod
    def from_frames(cls, frames: Mapping[str, Any], about: Any = None, *, rig: str, **fields: Any) -> Study:
        """A study of frames of pandas, or of mappings of arrays.

        Parameters
        ----------
        frames
            By the trial's name; see `Trial.from_frame`.
        about
            By the trial's name a mapping of its `kind` (without it as the data show: `data.direction`), `role`, `group`
            and conditions, as a `[[trial]]` table gives them; or a frame with a row for each trial, as `to_frame` gives
            it, of which what is missing, and what is none of these, is passed over.
        rig, fields
            As `Study` takes them: name, constants, start, files ...

        Returns
        -------
        Study

        Raises
        ------
        InputError
            Something is said about a trial that is not there, or twice; two columns have one name; or as `Trial` and
            `Study`.
        """
        fields = {"constants": {}, **fields}
        schema = fields.get("described") or schema_of(rig, partial(InputError, column="rig"))
        rows = about or {} if about is None or isinstance(about, Mapping) else _rows(about, schema)
        if odd := [name for name in rows if name not in frames]:
            raise InputError(f"expected names of frames, found {odd[0]!r}", column="about")
        trials = []
        for name, one in frames.items():
            row = dict(rows.get(name, {}))
            labels = {"kind": "", **{n: row.pop(n) for n in ("kind", "role", "group") if n in row}}
            trials.append(Trial.from_frame(one, name=name, conditions=row, **labels))
        return cls(rig=rig, trials=tuple(trials), **fields)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Study) or self is other:
            return self is other
        same = ("name", "rig", "constants", "start", "trials", "horizon_s")
        return all(getattr(self, one) == getattr(other, one) for one in same) and self._contents() == other._contents()

    def __hash__(self) -> int:
        return hash((self.name, self.rig, self.trials))

    def _contents(self) -> dict[str, bytes]:
        return {key: path.read_bytes() for key, path in self.files.items()}

    def digest(self) -> bytes:
        """A short hash of what its study.toml says."""
        said = (self.name, self.rig, sorted(self.constants.items()), sorted(self.start.items()), self.horizon_s)
        each = [(t.name, t.kind, sorted(t.conditions.items()), t.role, t.group, t.low_pass_hz) for t in self.trials]
        return digest_of((said, each))

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file as it was when it was read, by its path in the study; `EDITED` of what was changed then.

        Empty for a study that was made in memory, but for files that were read for it.
        """
        parts: tuple[Study | Trial, ...] = (self, *self.trials)
        out = {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in self.files.values()}
        for one in parts:
            if one.as_read is not None:
                edited = one.as_read.digest != one.digest()
                out |= dict.fromkeys(one.as_read.sha256, EDITED) if edited else one.as_read.sha256
        return {path.removeprefix(f"{self.folder}/"): sha for path, sha in out.items()}

    @property
    def schema(self) -> RigSchema:
        """What studies of this rig must and may hold."""
        return self._schema()

    @property
    def urdf(self) -> Path | None:
        """The rig's URDF, if the study has one."""
        return self.files.get("urdf")

    @property
    def document(self) -> Path | None:
        """Its study.toml, if it was read from one."""
        return Path(next(iter(self.as_read.sha256))) if self.as_read is not None else None

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[Trial]:
        return iter(self.trials)

    def __getitem__(self, which: str | int) -> Trial:
        """One trial by its name or its place.

        Raises
        ------
        KeyError, IndexError
            If there is none.
        """
        return self.trial(which) if isinstance(which, str) else self.trials[which]

    def __contains__(self, which: object) -> bool:
        return which in self.trials or any(trial.name == which for trial in self.trials)

    def to_fit(self) -> tuple[Trial, ...]:
        """The trials whose role is not "held_out".

        Raises
        ------
        InputError
            If there is none.
        """
        if not (found := tuple(t for t in self.trials if t.role != "held_out")):
            raise InputError("expected at least one trial to fit; all have role = held_out", file=self.folder)
        return found

    def trial(self, name: str) -> Trial:
        """One trial by its name.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        for trial in self.trials:
            if trial.name == name:
                return trial
        raise KeyError(f"study {self.name} has no trial {name!r}; it has {', '.join(t.name for t in self.trials)}")

    def __repr__(self) -> str:
        kinds = Counter(trial.kind for trial in self.trials)
        counts = " and ".join(f"{count} {kind}" for kind, count in kinds.items())
        seconds = sum(trial.duration for trial in self.trials)
        return f"Study {self.name} ({self.rig}): {counts} trials, {seconds:.4g} s"

    def _repr_html_(self) -> str:
        head = ("trial", "kind", "role", "samples", "duration", "columns")
        rows = [
            (t.name, t.kind, t.role or "-", str(len(t)), f"{t.duration:.4g} s", ", ".join(t.columns))
            for t in self.trials
        ]
        return table_html(repr(self), head, rows)

    def to_frame(self) -> DataFrame:
        """One row a trial, with its conditions, as a frame of pandas; see `data.show.frame`."""
        conditions = dict.fromkeys(n for t in self.trials for n in t.conditions)
        head = ("trial", "kind", "role", "group", "samples", "duration_s", *conditions)
        known = ((t.name, t.kind, t.role, t.group, len(t), t.duration) for t in self.trials)
        given = ((t.conditions.get(n, math.nan) for n in conditions) for t in self.trials)
        rows = [(*one, *more) for one, more in zip(known, given, strict=True)]
        return frame(by_columns(head, rows), index="trial")


def _rows(table: Any, schema: RigSchema) -> dict[str, dict[str, Any]]:
    """What a frame says about trials, by their name."""
    columns = checked_mapping(table, fault_at("about.{}"), "about")
    known = table[[n for n in columns if n in ("kind", "role", "group", *schema.conditions)]]
    rows = checked_mapping(known.T, fault_at("about.{}"), "about")
    return {str(name): dict(row.dropna()) for name, row in rows.items()}


def _fault_of(trials: Sequence[Trial]) -> Callable[[int | None, str, str], InputError]:
    """Makes the error of a trial's place, or of the rig's constants."""

    def error(place: int | None, key: str, message: str) -> InputError:
        return fault_at("constants.{}")(key, message) if place is None else trials[place].error(message, "columns")

    return error


def read_study(path: str | Path, *, rigs: Rigs | None = None) -> Study:
    """Read a study with all its trials.

    Parameters
    ----------
    path
        Its folder, or the `study.toml` in it.
    rigs
        What studies of other rigs than those written here or installed must and may hold; see `Catalogue.schemas`.

    Raises
    ------
    InputError
        For anything that is not as the study format says: with file, row, and column or dotted key.
    """
    with hashing() as sha256:
        document = _document(path)
    study = _Reader(document, known_rigs(rigs)).study()
    vars(study)["as_read"] = AsRead(sha256, study.digest())
    return study


def study_of_text(text: str, folder: Path, elsewhere: Mapping[str, Path], rigs: Rigs) -> Study:
    """The study that a folder will hold whose study.toml has this text, as `read_study`.

    Parameters
    ----------
    elsewhere
        Where files lie that are not in the folder yet, by their paths there.
    """
    return _Reader(document_of(text, folder / "study.toml", elsewhere), known_rigs(rigs)).study()


def read_columns(path: str | Path, *, rigs: Rigs | None = None) -> Columns | None:
    """How a study's recordings are written, to read another one like them; None if they are as the format has it.

    Raises
    ------
    InputError
        As `read_study`, of everything but the trials.
    """
    tables = StudyTables(_document(path), known_rigs(rigs))
    return tables.columns_table(tables.rig_table()[1])


def _document(path: str | Path) -> Document:
    """The `study.toml` of a folder, or the file itself."""
    path = as_path(path)
    found = what_is_at(path)
    if found == "nothing":
        raise InputError("no such study; expected a folder with study.toml", file=path)
    return read_toml(path / "study.toml" if found == "a folder" else path)


class _Reader(StudyTables):
    """One reading of a study.toml with its trials."""

    walks: Mapping[str, Any]
    """What a body's trials are read by: stated conventions and its mass."""

    def study(self) -> Study:
        constants, files = self.rig_table()
        start = self.start_table(constants, files)
        written, tables = self.recordings_tables(files), self._trial_tables()
        self.walks = {"conventions": self.conventions_table(), "mass_kg": constants.get("mass_kg")}
        views = [self._view(f"trial[{i}]", table, written) for i, table in enumerate(tables)]
        names = self._trial_names(tables, views)
        each = enumerate(zip(tables, views, names, strict=True))
        read = [self._trials(f"trial[{i}]", table, view, name) for i, (table, view, name) in each]
        self._places = [i for i, some in enumerate(read) for _ in some]
        every = [one for some in read for one in some]
        trials = with_one_stimulus(
            with_kinds(with_whole_turns(every, files), self.schema), constants, self.schema.inputs
        )
        check_same_inputs([(t.kind, t.columns) for t in trials], self.schema, constants, self._fault_of)
        horizon = checked_horizon(self.document.table("study").get(HORIZON), self.document.under("study"))
        folder = self.folder.absolute()
        return Study(self.name, self.rig, constants, start, trials, folder, files, self.schema, horizon)

    def _trial_tables(self) -> list[dict[str, Any]]:
        tables = self.document.data.get("trial", [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise self.error("trial", "expected tables [[trial]]")
        if not tables:
            raise self.error("trial", "missing; expected at least one table [[trial]]")
        return tables

    def _view(
        self, where: str, table: Mapping[str, Any], written: Mapping[str, Columns | None]
    ) -> tuple[Recordings, View]:
        """The files of a trial by their sources, and which part of them it is."""
        named, error = self.schema.recordings, self.document.under(where)
        stated = [key for key in ("file", "sources") if key in table]
        if len(named) > 1 or stated != ["sources"]:
            if len(named) == 1 and len(stated) > 1:
                raise error("sources", "expected file or sources, found both")
            for key in named:
                if key not in table:
                    raise error(key, "missing; expected the path of a file inside the study")
            paths = {key: self.document.path_of(f"{where}.{key}", table[key]) for key in named}
            return {key: (path, written.get("")) for key, path in paths.items()}, view_of(table, (), error)
        sources = table["sources"]
        if not isinstance(sources, dict) or not sources:
            raise error("sources", 'expected a table like { motor = "a.csv", force = "b.csv" }')
        check_known(sources, [n for n in written if n], lambda key, message: error(f"sources.{key}", message))
        files = {n: self.document.path_of(f"{where}.sources.{n}", f) for n, f in sources.items()}
        return {n: (path, written[n]) for n, path in files.items()}, view_of(table, tuple(sources), error)

    def _trial_names(self, tables: Sequence[Mapping[str, Any]], views: Sequence[tuple[Recordings, View]]) -> list[str]:
        """What trials call themselves, else the stems of their files, or their paths where stems are the same."""
        self._check_apart(tables, views)
        paths: list[PurePosixPath] = []
        for table, (recordings, _) in zip(tables, views, strict=True):
            main = next(iter(recordings))
            paths.append(PurePosixPath((table[main] if main in table else table["sources"][main]).replace("\\", "/")))
        stems = Counter(path.stem for path in dict.fromkeys(paths))
        names = [path.stem if stems[path.stem] == 1 else str(path.with_suffix("")) for path in paths]
        names = [f"{name}-{view.sheet}" if view.sheet else name for name, (_, view) in zip(names, views, strict=True)]
        count = Counter(names)
        twice = [f"{n}-{names[:k].count(n) + 1}" if count[n] > 1 else n for k, n in enumerate(names)]
        return [table.get("name", name) for table, name in zip(tables, twice, strict=True)]

    def _check_apart(self, tables: Sequence[Mapping[str, Any]], views: Sequence[tuple[Recordings, View]]) -> None:
        """Raise an error where two trials are the same rows of the same readings; inputs may be those of both."""
        shared = ("time_s", *self.schema.inputs)
        seen: dict[Path, list[tuple[str, View, set[str]]]] = {}
        for index, (table, (recordings, whole)) in enumerate(zip(tables, views, strict=True)):
            main, (path, own) = next(iter(recordings.items()))
            once, view = set[str](), whole
            if own is not None:
                view = replace(whole, sheet=whole.sheet or own.form.sheet)
                once = {s.name for c, s in own.sources.items() if c not in shared}
            key = f"trial[{index}].{main if main in table else f'sources.{main}'}"
            for other, earlier, others in seen.get(path.resolve(), []):
                if view.overlaps(earlier) and (once & others or not (once and others)):
                    raise self.error(key, f"the same file as {other}; expected from and to that tell them apart")
            seen.setdefault(path.resolve(), []).append((key, view, once))

    def _trials(self, where: str, table: Mapping[str, Any], seen: tuple[Recordings, View], name: str) -> list[Trial]:
        """The trials of one `[[trial]]`: one, or the parts that its view is split into."""
        recordings, view = seen
        error = self.document.under(where)
        kind, labels = self.schema.kind_of(table.get("kind"), error), checked_labels(name, table, error)
        of_all = (*self.schema.recordings, *OF_A_VIEW, "kind", *labels)
        rest = {key: value for key, value in table.items() if key not in of_all}
        labels["conditions"] = check_conditions(self.schema, kind, rest, error)
        if len(self.schema.recordings) > 1:
            (coordinates, _), (reaction, _) = recordings.values()
            if odd := [key for key in OF_A_VIEW if key in table and key not in ("from", "to")]:
                raise error(odd[0], f"expected no {odd[0]} of a rig {self.rig}: from and to alone")
            return [read_body_trial(coordinates, reaction, view, **self.walks, **labels)]
        trials = read_view(recordings, view, self.schema, {**labels, "kind": kind})
        return trials if "kind" in table else [derived_trial(t, kind="") for t in trials]

    def _fault_of(self, place: int | None, key: str, message: str) -> InputError:
        return self.error(f"rig.{key}" if place is None else f"trial[{self._places[place]}].{key}", message)


def write_study(study: Study, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write a study as a folder that `read_study` reads: all of its files, or none.

    A body's recordings are written at their own rates where its trials are as they were read, else on the times of its
    trials.

    Parameters
    ----------
    study
        To write; the files it names are copied.
    folder
        Made if it is missing. Files of the same names that this function wrote are replaced, others stay.
    overwrite
        Replace files of the same names that this function did not write, or that were changed since.

    Raises
    ------
    InputError
        If the folder cannot be written, a file in it was read or is one of others and would be replaced, or what would
        be written could not be read: samples that were not measured, an input that some trials lack.
    """
    schema = instance(study, Study, "study").schema
    check_same_inputs([(t.kind, t.columns) for t in study.trials], schema, study.constants, _fault_of(study.trials))
    contents: dict[str, str | bytes] = {}
    rig: dict[str, Any] = {}
    for key, value in study.constants.items():
        (rig.setdefault("passive", {}) if key in schema.passive else rig)[key] = float(value)
    for key, path in study.files.items():
        rig[key] = f"{key}{path.suffix}"
        contents[rig[key]] = path.read_bytes()
    tables = []
    for place, trial in enumerate(study.trials):
        file = trial.name if _PLAIN.fullmatch(trial.name) else f"trial~{place + 1}"  # which is no plain name
        named = _trial_files(schema, trial, file)
        contents |= named
        labels: dict[str, Any] = {n: getattr(trial, n) for n in ("role", "group", "low_pass_hz")}
        labels |= {"remarks": list(trial.remarks), "name": trial.name if file != trial.name else None}
        known = {"kind": trial.kind, **trial.conditions, **{n: v for n, v in labels.items() if v}}
        tables.append({**dict(zip(schema.recordings, named, strict=True)), **known})
    head = {"name": study.name, "rig": study.rig, **({HORIZON: study.horizon_s} if study.horizon_s else {})}
    document = {"study": head, "rig": rig, "start": dict(study.start)}
    if len(schema.recordings) > 1:
        document["conventions"] = STANDARD
    contents["study.toml"] = tomli_w.dumps({**document, "trial": tables})
    Outputs("fp.write_study", overwrite).write(as_path(folder, "folder"), contents)


def _trial_files(schema: RigSchema, trial: Trial, file: str) -> dict[str, str | bytes]:
    alone = replace(trial, as_read=None)  # which checks it by itself, as it will be read
    if len(schema.recordings) == 1:
        return {f"trials/{file}.csv": trial_csv(alone)}
    texts = [format_csv({"time_s": time, **columns}) for time, columns in walk_recordings(trial)]
    return {f"{key}/{file}.csv": text for key, text in zip(schema.recordings, texts, strict=True)}
