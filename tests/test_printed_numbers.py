"""Terminal, page and JSON file of an answer have the same numbers (`scripts/numbers` asks whole studies)."""

import json
import sys
from pathlib import Path

import pytest
from view.reported import ankle_diagnosis

from fes_pin.view.report import report_html

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from printed_numbers.read import Saved, agrees, page_text, printed_in, terminal_text


@pytest.fixture(scope="module")
def answer():
    return ankle_diagnosis()


def missed(text, saved):
    return [one.words for one in printed_in(text, "", saved) if not one.is_saved]


def test_every_number_of_terminal_and_page_is_saved(answer):
    saved = Saved(json.loads(answer.to_json()))
    texts = terminal_text(str(answer)), page_text(report_html(answer))
    assert all(len([*printed_in(text, "", saved)]) > 8 for text in texts)
    assert [missed(text, saved) for text in texts] == [[], []]


@pytest.mark.parametrize("changed", ["value", "low", "high"])
def test_an_estimate_that_is_saved_otherwise_is_found(answer, changed):
    record = json.loads(answer.to_json())
    one = record["causes"][0]["parameters"]["torque_nm"]
    one[changed] = 1.01 * one[changed] + 1.0
    assert any("torque" in words for words in missed(terminal_text(str(answer)), Saved(record)))


def test_an_error_that_is_saved_otherwise_is_found(answer):
    record = json.loads(answer.to_json())
    for one in record["errors"]:
        one["nominal"] *= 1.1
    assert missed(terminal_text(str(answer)), Saved(record))


@pytest.mark.parametrize(
    ("printed", "saved", "same"),
    [("0.036", 0.03645, True), ("0.036", 0.0366, False), ("2360", 2362.0, True), ("2361", 2362.0, False),
     ("1e-12", 1.2e-12, True), ("2e-12", 1.2e-12, False), ("-0.5", 0.5, False), ("100", 99.9954, True)],
)  # fmt: skip
def test_a_printed_number_is_the_saved_one_rounded(printed, saved, same):
    assert agrees(printed, saved) is same
