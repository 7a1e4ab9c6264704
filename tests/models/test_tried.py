"""Causes and rigs of one's own that are wrong are refused when they are loaded, in one line; right ones are not."""

import re
from pathlib import Path

import pytest

import fes_pin as fp
from fes_pin.models import tried
from fes_pin.models.effects import EFFECTS
from fes_pin.models.rigs import RIGS

DOCUMENT = Path(__file__).parents[2] / "docs" / "own_causes_and_rigs.md"
FILES = dict(re.findall(r"```python\n# (\w+\.py)\n(.*?)```", DOCUMENT.read_text(), re.DOTALL))
CAUSE, RIG = FILES["door_closer.py"], FILES["tail.py"]
LINE = "        return value - self.coefficient * ramp(s.v)\n"
LAGGED = CAUSE.replace(
    '"torque", ("joint",)\n', '"torque", ("joint",)\n    states, memories = ("late",), ("held",)\n'
).replace(
    LINE,
    """\
        return value - self.coefficient * s.own.late - self.coefficient * s.own.held

    def rate(self, s):
        return {"late": (s.v - s.own.late) / 0.1}

    def update(self, s):
        return {"held": s.q}

    def rest(self, s):
        return {"held": s.q}

    @classmethod
    def grids(cls, measured):
        return super().grids(measured)

    def limits(self, measured):
        return {"coefficient": (0.0, 1.0)}

    def smallest(self, measured):
        return {"coefficient": 1e-6}
""",
)
"""The document's cause with states, memories and what depends on data."""


def applying(text):
    return CAUSE.replace("from dataclasses", "import math\nfrom dataclasses").replace(LINE, text)


def changed(old, new, text=LAGGED):
    assert text.count(old) == 1, old
    return text.replace("from dataclasses", "import math\nfrom dataclasses").replace(old, new)


EXPECTED = "expected finite numbers, by fes_pin.models.maths.sin and its like in place of math.sin"
CAUSES = {  # text, the words of the row that is named, what is said
    "math_of_an_expression": (
        applying("        return value - self.coefficient * math.sin(s.v)\n"),
        "def apply",
        "apply gives NaN or infinity; " + EXPECTED,
    ),
    "root_of_what_is_below_0": (
        applying("        return value - self.coefficient * s.v**0.5\n"),
        "def apply",
        "apply gives NaN",
    ),
    "a_branch_on_an_expression": (
        applying("        return value - self.coefficient * (s.v if s.v > 0 else 0)\n"),
        "s.v > 0",
        "RuntimeError",
    ),
    "division_by_0": (
        applying("        return value - self.coefficient * s.v / (1 - 1)\n"),
        "def apply",
        "apply gives NaN",
    ),
    "another_null": (CAUSE.replace("null=0.0", "null=0.5"), "def apply", "at the null; expected the same number"),
    "forgotten_return": (applying(LINE.replace("return ", "")), "def apply", "apply returns None; expected numbers"),
    "several": (applying("        return value, s.v\n"), "def apply", "expected numbers"),
    "an_end": (applying("        raise SystemExit(3)\n"), "SystemExit(3)", "SystemExit: 3"),
    "text": (applying('        return "value"\n'), "def apply", "apply returns 'value'; expected numbers"),
    "a_number_that_is_none": (
        applying('        return value + self.coefficient * float("inf")\n'),
        "def apply",
        "apply",
    ),
    "constant": (applying("        return -0.1\n"), "def apply", "apply ignores value"),
    "without_value": (applying(LINE.replace("value - ", "-")), "def apply", "apply ignores value"),
    "never_acts": (applying("        return value\n"), "def apply", "the rig does not depend on coefficient"),
    "acts_on_nothing": (
        applying("        return value + 0.0 * self.coefficient * s.v\n"),
        "def apply",
        "the rig does not depend",
    ),
    "a_state_without_its_size": (
        changed("- self.coefficient * s.own.late - self.coefficient * s.own.held", "- s.own.late"),
        "def apply",
        "at the null; expected the same number",
    ),
    "no_such_signal": (CAUSE.replace("s.v", "s.speed"), "s.speed", "AttributeError"),
    "no_such_input": (CAUSE.replace("s.v", "s.u.efort"), "s.u.efort", "has no attribute 'efort'"),
    "arguments": (CAUSE.replace("(self, value, s)", "(self, value)"), "def apply", "expected apply(self, value, s)"),
    "no_rate": (changed("def rate", "def rates_"), "class", "expected a method rate(self, s) of its states"),
    "no_update": (changed("def update", "def updates"), "class", "expected a method update(self, s) of its memories"),
    "rate_of_math": (changed("(s.v - s.own.late)", "math.tanh(s.v - s.own.late)"), "def rate", "nan}; " + EXPECTED),
    "rate_of_another": (changed('{"late": (', '{"lat": ('), "def rate", "expected a dictionary of late"),
    "rate_of_nothing": (
        changed('return {"late"', '{"late"'),
        "def rate",
        "rate returns None; expected a dictionary of late",
    ),
    "update_of_nothing": (
        changed('return {"held": s.q}\n\n    def rest', "pass\n\n    def rest"),
        "def update",
        "update returns None",
    ),
    "update_of_math": (
        changed('{"held": s.q}\n\n    def rest', '{"held": math.exp(s.q)}\n\n    def rest'),
        "def update",
        "nan}; " + EXPECTED,
    ),
    "rest_of_another": (
        changed('{"held": s.q}\n\n    @', '{"hold": s.q}\n\n    @'),
        "def rest",
        "expected a dictionary of late, held",
    ),
    "rest_of_math": (
        changed('{"held": s.q}\n\n    @', '{"held": math.cos(s.q)}\n\n    @'),
        "def rest",
        "nan}; " + EXPECTED,
    ),
    "grids_of_nothing": (changed("return super().grids", "super().grids"), "@classmethod", "grids returns None"),
    "grids_of_an_instance": (
        changed("    @classmethod\n    def grids(cls", "    def grids(self"),
        "def grids",
        "expected grids(measured) as a class method",
    ),
    "grids_of_no_numbers": (
        changed("return super().grids(measured)", 'return {"coefficient": (math.nan,)}'),
        "@classmethod",
        "finite numbers",
    ),
    "grids_of_another": (
        changed("return super().grids(measured)", 'return {"size": (1.0,)}'),
        "@classmethod",
        "a dictionary of coefficient",
    ),
    "grids_that_fail": (
        changed("super().grids(measured)", 'measured["angle"]'),
        'measured["angle"]',
        "KeyError: 'angle'",
    ),
    "grids_of_a_number": (
        changed("return super().grids(measured)", 'return {"coefficient": 1.0}'),
        "@classmethod",
        "of each",
    ),
    "limits_of_a_number": (changed("(0.0, 1.0)", "1.0"), "def limits", "expected a lower and an upper bound of each"),
    "rate_of_a_number": (
        changed('{"late": (s.v - s.own.late) / 0.1}', "1"),
        "def rate",
        "expected a dictionary of late",
    ),
    "limits_the_wrong_way": (
        changed("(0.0, 1.0)", "(1.0, 0.0)"),
        "def limits",
        "expected a lower and an upper bound of each",
    ),
    "limits_of_no_number": (
        changed("(0.0, 1.0)", "(0.0, math.nan)"),
        "def limits",
        "expected a lower and an upper bound",
    ),
    "smallest_of_nothing": (
        changed("1e-6", "None"),
        "def smallest",
        "smallest returns {'coefficient': None}; expected numbers",
    ),
}
RIGS_OF_ONES_OWN = {
    "math_of_an_expression": (changed("* s.q - self", "* math.sin(s.q) - self", RIG), "def rates", "rates gives NaN"),
    "forgotten_return": (
        changed('return {"q": s.v', '{"q": s.v', RIG),
        "def rates",
        "rates returns None; expected a dictionary of q, v",
    ),
    "a_state_without_a_rate": (
        changed('"q": s.v, "v"', '"q": s.v, "w"', RIG),
        "def rates",
        "expected a dictionary of q, v",
    ),
    "no_such_signal": (
        changed("self.damping_nms * s.v", "self.damping_nms * s.speed", RIG),
        "s.speed",
        "AttributeError",
    ),
    "what_causes_read": (
        changed(", s.bearing_load = self.inertia_kgm2, 1.0", " = self.inertia_kgm2", RIG),
        's.through("friction"',
        "bearing_load",
    ),
    "a_reading_of_nothing": (
        changed('return (s.through("reading"', '(s.through("reading"', RIG),
        "def readings",
        "readings returns None",
    ),
    "no_rates": (changed("def rates", "def rate", RIG), "class", "expected methods rates"),
    "arguments": (changed("def sample(self, s)", "def sample(self)", RIG), "def sample", "expected sample(self, s)"),
    "kinds": (changed('return ("q", "v")', "return kind[3]", RIG), None, "class Tail"),
}


def row_of(words, text):
    (row,) = (k for k, line in enumerate(text.splitlines(), 1) if words in line)
    return row


@pytest.mark.parametrize(("text", "at", "words"), CAUSES.values(), ids=CAUSES)
def test_a_cause_that_is_wrong_is_one_line_with_its_row(text, at, words, tmp_path):
    path = tmp_path / "wrong.py"
    path.write_text(text)
    with pytest.raises(fp.InputError) as caught:
        fp.load_library(path)
    message = str(caught.value)
    row = "" if at == "class" else f", row {row_of(at, text)}"
    assert message.startswith(f"{path}{row}: class DoorCloser: ") and words in message and "\n" not in message


@pytest.mark.parametrize(("text", "at", "words"), RIGS_OF_ONES_OWN.values(), ids=RIGS_OF_ONES_OWN)
def test_a_rig_that_is_wrong_is_one_line(text, at, words, tmp_path):
    path = tmp_path / "wrong.py"
    path.write_text(text)
    with pytest.raises(fp.InputError) as caught:
        fp.load_library(path)
    message = str(caught.value)
    row = "" if at in ("class", None) else f", row {row_of(at, text)}: "
    assert message.startswith(f"{path}{row}") and "class Tail: " in message
    assert words in message and "\n" not in message


def test_the_library_and_the_documents_files_are_not_refused(tmp_path):
    """Every cause and rig that is written here, as somebody's own; this counts false alarms."""
    folder, alarms = Path(fp.__file__).parent / "models", {}
    for one in (*EFFECTS, *RIGS):
        place = "effects" if one in EFFECTS else "rigs"
        text = (folder / place / f"{one.name}.py").read_text()
        text = text.replace("    schema = RigSchema(", f'    like = ("{one.name}",)\n    schema = RigSchema(')
        path = tmp_path / f"{one.name}.py"
        path.write_text(re.sub(rf'^( +name\b.*?)"{one.name}"', rf'\1"own_{one.name}"', text, flags=re.MULTILINE))
        try:
            library = fp.load_library(path)
            assert library.origins() == {str(path): [f"own_{one.name}"]}
        except fp.InputError as error:
            alarms[one.name] = str(error)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    fp.load_library(*(tmp_path / name for name in FILES))
    assert not alarms


READS = {  # a column that only some trials of the rig hold
    "joint": ("torque", "s.u.effort"),
    "muscle": ("force", "s.u.stim"),
}


@pytest.mark.parametrize("rig", READS)
def test_a_cause_may_read_a_column_that_only_some_trials_hold(rig, tmp_path):
    signal, read = READS[rig]
    text = CAUSE.replace('"torque", ("joint",)', f'"{signal}", ("{rig}",)').replace("s.v", read)
    (tmp_path / "wrong.py").write_text(text)
    assert "door_closer" in {one.name for one in fp.load_library(tmp_path / "wrong.py").effects}


def test_a_cause_that_acts_by_a_state_of_its_own_is_not_refused(tmp_path):
    """At its null it is nominal from its rest on, and only there."""
    text = LAGGED.replace("- self.coefficient * s.own.late - self.coefficient * s.own.held", "- s.own.late")
    text = text.replace("(s.v - s.own.late) / 0.1", "(self.coefficient * s.v - s.own.late) / 0.1")
    (tmp_path / "wrong.py").write_text(text)
    assert "door_closer" in {one.name for one in fp.load_library(tmp_path / "wrong.py").effects}


def test_a_class_is_tried_once(tmp_path, monkeypatch):
    runs, run = [], tried._try
    monkeypatch.setattr(tried, "_try", lambda *given: (runs.append(given), run(*given))[1])
    (tmp_path / "wrong.py").write_text(CAUSE)
    (tmp_path / "tail.py").write_text(RIG)
    library = fp.load_library(tmp_path / "tail.py", tmp_path / "wrong.py")
    count = len(runs)
    assert count >= 3  # the rig alone, the rig with all causes, the cause
    assert fp.load_library(library).origins() == library.origins()
    assert len(runs) == count
