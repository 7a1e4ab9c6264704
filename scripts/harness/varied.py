"""The same studies asked in other ways: from other start values, and at other sample rates.

`scripts/accuracy starts` and `scripts/accuracy rates` count in how many studies the answer stays the same.
"""

from __future__ import annotations

import inspect
import json
import math
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache, partial
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np

import fes_pin as fp
from fes_pin.models.rigs import pulse_period
from harness.generator import Item, Truth, shared
from harness.generators import generator_of
from harness.row import STOPPED, read_only, sets_of
from harness.run import TRUTH, code_of, each_of, ended_after, limited, lines_of_store, made
from harness.table import CONFIDENCE_95, interval

STARTS, RATES = "starts", "rates"
KINDS = (STARTS, RATES)
SOURCES = ("large", "free", "driven", "imposed", "practice")
"""Generators whose studies are asked about, in turn; the last are those of others, where they are."""
DRAWS = 20
"""Starts of each study."""
SHARE_OF_STD = 0.3
"""How far a value may move with its start, in its deviations."""
BETWEEN = {"damping": (0.01, 10.0), "damping_nms": (0.01, 10.0)}
OTHERS = (0.5, 2.0)
"""Start values, as multiples of the true ones, or of those stated where the true ones are not known."""
SLOWER = {"half": 2, "third": 3}
"""Every so many samples are kept."""
PLAIN, TWICE = "plain", "twice"


@dataclass(frozen=True)
class Asked:
    """One way in which a study is asked about.

    Attributes
    ----------
    source
        One of `SOURCES`.
    way
        Number of a start, or name of a rate.
    """

    source: str
    item: Item
    way: str

    @property
    def study(self) -> str:
        """Source and key of the study."""
        return f"{self.source} {self.item.key}"

    @property
    def key(self) -> str:
        """What a store knows the answer by."""
        return f"{self.study} {self.way}"


@dataclass(frozen=True)
class Answer:
    """What was answered.

    Attributes
    ----------
    sets
        Each named cause or change with what cannot be told from it.
    values
        Of the extended model, with deviations, by name; of groups those of what changed.
    error
        Of a study without an answer.
    """

    key: str
    code: str
    verdict: str = ""
    sets: tuple[tuple[str, ...], ...] = ()
    values: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cpu_s: float = 0.0
    error: str | None = None

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> Answer:
        """The answer that a line of a store holds."""
        return cls(**{name: read_only(value) for name, value in stored.items()})

    def words(self) -> str:
        """The verdict and the sets in words."""
        return self.error or f"{self.verdict}: {' and '.join('|'.join(s) for s in self.sets) or 'nothing'}"


def planned(kind: str, number: int, seed: int, only: Sequence[str], draws: int = DRAWS) -> list[list[Asked]]:
    """The ways in which so many studies are asked about, by study; the first way is what others are compared with.

    A study that no other rate has the same stimulus of is passed over.
    """
    starts = [f"{n:02d}" for n in range(draws)]
    every = ([Asked(s, item, w) for w in (starts if kind == STARTS else rates_of(s, item))] for s, item in _bases(seed))
    plan = islice((ways for ways in every if len(ways) > 1), number)
    return [ways for ways in plan if not only or ways[0].item.key in only]


def rates_of(source: str, item: Item) -> list[str]:
    """The rates at which the stimulus of a study is what it was: its own, lower ones, and twice by its generator."""
    trials = _study(source, item, 1)[0].trials
    lower = [way for way, every in SLOWER.items() if all(is_held(t, every) for t in trials)]
    twice = "faster" in inspect.signature(_generator(source).make).parameters
    return [PLAIN, *lower, *([TWICE] if twice else [])]


def is_held(trial: fp.Trial, every: int) -> bool:
    """Whether pulses are at samples that are kept, and pulse widths are the same until the next of them.

    The force is no linear function of a pulse width, nor of the time of a pulse: their means are another stimulus.
    """
    pulses = trial.columns.get("stim", np.zeros(len(trial)))
    widths = trial.columns.get("pulse_width_us", np.zeros(len(trial)))
    kept = np.arange(len(trial)) // every * every
    return not np.any(pulses[kept != np.arange(len(trial))]) and bool(np.all(widths == widths[kept]))


def _bases(seed: int) -> Iterator[tuple[str, Item]]:
    """Studies of all sources in turn."""
    there = [s for s in SOURCES if s != "practice" or (shared() / s / "answers").is_dir()]
    plans = {s: _plan(s, seed) for s in there}
    for k in count():
        source = there[k % len(there)]
        yield source, next(plans[source])


def _plan(source: str, seed: int) -> Iterator[Item]:
    """Studies of a source; those of others begin again at their end."""
    if source != "practice":
        yield from _generator(source).plan(seed)
    items = list(_generator(source).plan(0))
    for k in count(seed):
        yield items[k % len(items)]


def _generator(source: str) -> Any:
    return generator_of(str(shared() / source) if source == "practice" else source)


def run(
    kind: str,
    plan: Sequence[Sequence[Asked]],
    store: Path | None,
    workers: int,
    limit: float | None = None,
    stored: bool = False,
) -> dict[str, Answer]:
    """Answers by key; those that the store has of this code are not made again.

    Parameters
    ----------
    kind
        One of `KINDS`.
    store
        File of one line an answer; nothing is stored without.
    limit
        Seconds that the search of an answer may take.
    stored
        Make none: those of the store, of any code.
    """
    known = [Answer.of(line) for line in lines_of_store(store)]
    done = {one.key: one for one in known if stored or one.code == code_of("", limit)}
    todo = [] if stored else [one for ways in plan for one in ways if one.key not in done]
    for answer in each_of(partial(answered, kind, limit=limit), todo, workers):
        done[answer.key] = answer
        if store:
            store.parent.mkdir(parents=True, exist_ok=True)
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(answer)) + "\n")
    return done


def answered(kind: str, asked: Asked, limit: float | None = None) -> Answer:
    """Make a study, ask about it in one way, and keep what is compared."""
    twice = asked.way == TWICE
    study, truth = _study(asked.source, asked.item, 2 if twice else 1)
    if kind == STARTS:
        study = started(study, truth, np.random.default_rng([asked.item.seed, 91, int(asked.way)]))
    elif asked.way in SLOWER:
        study = replace(study, trials=tuple(decimated(t, SLOWER[asked.way]) for t in study.trials))
    code, began = code_of("", limit), time.process_time()
    try:
        with ended_after(limit):
            record = json.loads(_generator(asked.source).ask(study, **limited(limit)).to_json())
    except Exception as error:
        return Answer(asked.key, code, error=f"{type(error).__name__}: {error}")
    cpu_s = round(time.process_time() - began, 2)
    return Answer(asked.key, code, record["verdict"], sets_of(record), values_of(record, study), cpu_s)


@lru_cache(maxsize=2)
def _study(source: str, item: Item, faster: int) -> tuple[fp.Study, Truth]:
    """The study as its files have it, and what is true of it."""
    with tempfile.TemporaryDirectory(prefix="accuracy") as folder:
        more = {"faster": faster} if faster > 1 else {}
        made(_generator(source), item, Path(folder) / "study", **more)
        truth = Truth(**json.loads((Path(folder) / "study" / TRUTH).read_text(encoding="utf-8")))
        return fp.read_study(Path(folder) / "study"), truth


def started(study: fp.Study, truth: Truth, rng: np.random.Generator) -> fp.Study:
    """The study with start values that are drawn about the true ones, or about those stated."""
    start = {}
    for name, stated in study.start.items():
        low, high = BETWEEN.get(name, OTHERS)
        true = truth.parameters.get(name, stated)
        start[name] = float(f"{true * math.exp(rng.uniform(math.log(low), math.log(high))):.4g}")
    return replace(study, start=start)


def decimated(trial: fp.Trial, every: int) -> fp.Trial:
    """Every so many samples of a trial.

    An effort that moves a joint is the mean of the samples it was held for: its impulse stays. Stimuli are held
    (`is_held`).
    """
    columns, kept = {}, np.arange(0, len(trial), every)
    for name, values in trial.columns.items():
        columns[name] = values[kept]
        if name == "effort" and trial.kind == "motion":
            columns[name] = np.add.reduceat(values, kept) / np.diff(np.append(kept, len(trial)))
    return replace(trial, columns=columns, time=trial.time[::every])


def values_of(record: Mapping[str, Any], study: fp.Study) -> dict[str, tuple[float, float]]:
    """Values that an answer gives, with finite deviations, by name.

    The strength of a muscle is of the study's usual time between pulses: it is given for one second between them.
    """
    pulsed = [t for t in study.trials if "stim" in t.columns]
    unit = pulse_period(pulsed) if pulsed else 1.0
    places = [record.get("extended", {}).get("parameters", {}), *(c["parameters"] for c in record.get("changes", ()))]
    found = {name: one for place in places for name, one in _leaves(place, "")}
    scale = {name: unit if name.split()[0] == "gain" else 1.0 for name in found}
    return {n: (v * scale[n], s * scale[n]) for n, (v, s) in found.items()}


def _leaves(tree: Mapping[str, Any], name: str) -> Iterator[tuple[str, tuple[float, float]]]:
    if "value" in tree:
        if tree.get("std") and tree["value"] is not None and math.isfinite(tree["std"]):
            yield name, (float(tree["value"]), float(tree["std"]))
        return
    for key, one in tree.items():
        if isinstance(one, Mapping):
            yield from _leaves(one, f"{name} {key}".strip())


def is_same(one: Answer, other: Answer) -> bool:
    """Whether there are two answers, of the same verdict, and each set is named by a cause of one of the other's."""
    if one.error or other.error or (one.verdict, len(one.sets)) != (other.verdict, len(other.sets)):
        return False
    left = list(other.sets)
    for names in one.sets:
        if (match := next((s for s in left if s[0] in names and names[0] in s), None)) is None:
            return False
        left.remove(match)
    return True


def moved(one: Answer, other: Answer, kind: str) -> list[str]:
    """Values that differ: by start beyond a share of the deviation, by rate beyond 95 % of either's.

    Returns
    -------
    list of str
        A few words each, of values that both answers have.
    """
    out = []
    for name in one.values.keys() & other.values.keys():
        (x, std), (y, wide) = one.values[name], other.values[name]
        if abs(x - y) > (SHARE_OF_STD * std if kind == STARTS else CONFIDENCE_95 * max(std, wide)):
            out.append(f"{name} {x:.4g} -> {y:.4g} (std {std:.2g})")
    return sorted(out)


def shown(kind: str, plan: Sequence[Sequence[Asked]], answers: Mapping[str, Answer]) -> str:
    """Counts of studies whose answer stays the same, and every study of which it does not."""
    whole = [ways for ways in plan if all(one.key in answers for one in ways)]
    if not whole:
        return "no study has all of its answers"
    ways = list(dict.fromkeys(one.way for one_study in whole for one in one_study[1:]))
    groups = [("from all starts", ways)] if kind == STARTS else [(f"at {way} of the rate", [way]) for way in ways]
    groups = [(words.replace("twice of", "twice"), some) for words, some in groups]
    groups = groups if kind == STARTS else [*groups, ("at every rate", ways)]
    lines = [f"{len(whole)} studies, {sum(len(one) for one in whole)} answers"]
    for words, some in groups:
        pairs = [[(answers[w[0].key], answers[o.key]) for o in w[1:] if o.way in some] for w in whole]
        pairs = [pair for pair in pairs if pair]
        same = [p for p in pairs if all(is_same(a, b) for a, b in p)]
        alike = [p for p in same if all({*map(frozenset, a.sets)} == {*map(frozenset, b.sets)} for a, b in p)]
        values = [p for p in same if not any(moved(a, b, kind) for a, b in p)]
        near = f"within {SHARE_OF_STD:g} deviations" if kind == STARTS else "within their intervals"
        lines += [
            f"{words} the verdict is the same: {interval(len(same), len(pairs))}",
            f"  with the same equivalents: {len(alike)}; with values {near}: {len(values)}",
        ]
    every = [answers[one.key] for ways in whole for one in ways]
    lines.append(f"answers that ended in an error: {sum(one.error is not None for one in every)}")
    lines.append(f"answers that were stopped: {sum(one.verdict == STOPPED for one in every)}")
    return "\n".join([*lines, *(line for one in whole for line in _different(kind, one, answers))])


def _different(kind: str, ways: Sequence[Asked], answers: Mapping[str, Answer]) -> list[str]:
    """What differs between the answers to one study, a line each, below the study; none where they are the same."""
    first, groups = answers[ways[0].key], dict[str, list[str]]()
    for one in ways[1:]:
        other = answers[one.key]
        said = "" if is_same(first, other) else other.words()
        said = said or "; ".join(moved(first, other, kind)[:4])
        if said:
            groups.setdefault(said, []).append(one.way)
    hidden = " and ".join(ways[0].item.hidden) or "nothing"
    head = f"  {ways[0].study} (hidden: {hidden}): {ways[0].way} {first.words()}"
    return [head, *(f"    {', '.join(some)}: {said}" for said, some in groups.items())] if groups else []
