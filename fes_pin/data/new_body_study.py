"""A study of walking made of recordings: which holds coordinates, which the ground reaction, which go together."""

from pathlib import Path

from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.motion import MARKERS, STORAGE, named_coordinates, plates_in, read_motion, stated_degrees
from fes_pin.data.new_study import NewStudy, placed
from fes_pin.data.schema import BODY, check_known
from fes_pin.data.study_text import HEADER, toml_table
from fes_pin.data.walk_conventions import WORDS, checked_conventions
from fes_pin.data.wanted import Wanted, labels_of, number_set

WALKS = "a walk is .mot, .sto or CSV as the study format has it: OpenSim makes joint coordinates of markers"
"""What is said of files that hold no walk."""


def new_body_study(wanted: Wanted) -> NewStudy:
    """Propose a study of a walking body: the first coordinates go with the first ground reaction.

    Its files are `.mot`, `.sto` or CSV, named as the study format says; what is set is `mass_kg` and `height_m`,
    conditions of all trials, and conventions of the files.

    Raises
    ------
    InputError
        A file that is neither, files that do not pair, numbers that are missing or none.
    """
    files, folder, settings = wanted.files, wanted.folder, wanted.settings
    pushes = [path for path in files if _is_ground_reaction(path)]
    moves = [path for path in files if path not in pushes]
    if len(moves) != len(pushes) or not moves:
        found = f"{len(moves)} of coordinates and {len(pushes)} of ground reaction"
        raise InputError(f"expected as many files of joint coordinates as of ground reaction, found {found}")
    stated = checked_conventions({k: v for k, v in settings.items() if k in WORDS}, fault_at("--set {}"))
    check_known(settings, (*BODY.constants, *BODY.conditions, *WORDS), fault_at("--set {}"))
    missing = [f"--set {key}=NUMBER ({BODY.constants[key].unit})" for key in BODY.either if key not in settings]
    if missing:
        raise InputError(f"the files do not say everything; please add {', '.join(missing)}")
    contents: dict[str, str | bytes] = {}
    rig = {key: number_set(key, settings[key], BODY.constants[key]) for key in BODY.either}
    text = [*HEADER, *toml_table("study", {"name": wanted.name, "rig": BODY.name}), *toml_table("rig", rig)]
    text += toml_table("conventions", stated)
    given = {key: number_set(key, settings[key], n) for key, n in BODY.conditions.items() if key in settings}
    origins: dict[str, Path] = {}
    for move, push in zip(moves, pushes, strict=True):
        places = [placed(path, folder, contents) for path in (move, push)]
        origins.update(zip(places, (move, push), strict=True))
        named = dict(zip(BODY.recordings, places, strict=True))
        text += toml_table("[trial]", {**named, **labels_of(wanted, move, push), **given})
    contents["study.toml"] = "\n".join(text) + "\n"
    return NewStudy(contents, (), origins)


def _is_ground_reaction(path: Path) -> bool:
    """True for a ground reaction, False for joint coordinates."""
    try:
        table, in_degrees = read_motion(path)
    except InputError as error:
        if path.suffix.lower() in (*STORAGE, *MARKERS):
            raise
        raise InputError(f"{error.message}; {WALKS}", file=path, row=error.row, column=error.column) from None
    try:
        plates_in(table)
    except InputError:
        named_coordinates(table)
        stated_degrees(table, in_degrees)
        return False
    return True
