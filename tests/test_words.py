"""The documentation uses terms that a reader can search for: those of system identification and statistics."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WRITTEN_BY_OTHERS = {"CHANGELOG.md", "accuracy.md"}
"""A record of what was said, and a page that a script writes."""
PAGES = [ROOT / "README.md", *(p for p in sorted((ROOT / "docs").glob("*.md")) if p.name not in WRITTEN_BY_OTHERS)]

WORDS = {
    r"\bforet(ell|ells|old|elling)\b": "predict, one-step prediction",
    r"\bafresh\b|\banew\b": "again; refit; restart",
    r"\bbeside\b": "together with; in a model that also contains; next to (places)",
    r"\b(is|are|was|were) told\b": "is reported; is printed; is distinguished from",
    r"\bwhat is left\b|\bsomething is left\b": "lack of fit; residual; unexplained part",
    r"\bby turns\b": "alternating maximisation (ECM)",
    r"\babreast\b": "in one batch; vectorised (SIMD)",
    r"\bbears? out\b|\bborne out\b": "confirmed on held-out trials",
    r"\bgo(es)? along\b": "is updated together with",
    r"\bearns? (its|their) (place|price)\b": "improves the penalised likelihood",
    r"\bpromises?\b": "score statistic; predicted improvement",
    r"\bhalf way\b": "(say the criterion)",
    r"\bstands? for\b|\bstood for\b": "is mistaken for; replaces; means",
    r"\bnever looked at\b|\bnobody had looked at\b": "unseen seed",
    r"\bthe rest\b": "(name it)",
    r"\bturns out\b|\bcomes out\b": "is estimated as",
    r"\brefused\b": "rejected; not supported by held-out trials",
    r"\bspeaks? for\b": "is supported by; is evidence of",
    r"\bdoubts?\b": "process and measurement noise; uncertainty",
    r"\blasting\b": "correlation time",
    r"\bunder (it|them)\b": "(name the condition)",
}
"""Words that a stranger cannot search for, and what to write in their place; `docs/glossary.md` has the terms."""

KEPT = {"what is refused or odd before any fit": "of a study that is not fitted, not of a cause"}
"""Lines, or parts of these, in which such a word is right, each with the reason."""


def name(path):
    return str(path.relative_to(ROOT))


def prose(text):
    """A page without its code: names of files and of functions stay until these are renamed."""
    fenced = re.sub(r"```.*?```", lambda m: "\n" * m[0].count("\n"), text, flags=re.DOTALL)
    code = r"`(?:[^`\n]|\n(?!\s*\n))*`|\]\([^)]*\)"
    return re.sub(code, lambda m: "``" + "\n" * m[0].count("\n"), fenced)


def uses(text, kept=()):
    """Of each word in a page its line, and what to write in its place; a word may go over the end of a line."""
    for one in kept:
        text = text.replace(one, "")
    text = prose(text)
    found = [(text.count("\n", 0, m.start()) + 1, m[0], term) for m, term in _matches(text)]
    return [f"line {line}: {' '.join(word.split())!r}: write {term}" for line, word, term in sorted(found)]


def _matches(text):
    for pattern, term in WORDS.items():
        for match in re.finditer(pattern.replace(" ", r"\s+"), text, re.IGNORECASE):
            yield match, term


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_uses_the_terms_of_the_field(page):
    assert uses(page.read_text(), KEPT) == []


def test_a_word_is_found_over_the_end_of_a_line_and_not_in_code():
    assert uses("What\nis left\nis Foretold `beside\nanew`.\n```\nanew\n```\n") == [
        "line 1: 'What is left': write lack of fit; residual; unexplained part",
        "line 3: 'Foretold': write predict, one-step prediction",
    ]
    assert uses("beside a wall", ["beside a wall"]) == []


def test_what_is_kept_is_there():
    text = "".join(page.read_text() for page in PAGES)
    assert [one for one in KEPT if one not in text] == []
