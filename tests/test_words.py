"""Documentation and code use terms that a reader can search for: those of system identification and statistics."""

import io
import re
import tokenize
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "fes_pin"
STORIES = sorted((ROOT / "analysis").rglob("*.py"))
"""Scripts that draw the pictures of the manual."""
ROOMS = sorted({path.relative_to(PACKAGE).parts[0] for path in PACKAGE.rglob("*.py")})
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
OTHERS = [ROOT / "CONTRIBUTING.md", ROOT / "docs" / "api" / "index.md"]
"""Pages whose sentences are counted too."""

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

KEPT = {
    "Fit.doubt is": "an old name, which says that it ends",
    '"beside"': "an old name, which is still read",
    "the rest angle": "of a joint at rest",
}
"""Lines, or parts of these, in which such a word is right, each with the reason."""

KEPT_NAMES = {
    "doubt": "the option --doubt of `body observe`; Fit.doubt, an old name which says that it ends",
    "lasts_s": "Endurance.lasts_s, how long a muscle can go on; an old name of StateSpaceNoise.correlation_s",
    "REFUSED": "Status.REFUSED of a controller: the caller's error, no cause",
    "told": "Apart.told of a comparison, and its key in JSON",
}
"""Names of the code that hold such a word, each with the reason."""
NAMED = {**WORDS, r"\btold\b": "reported; evaluated", r"\blasts s\b": "correlation time"}
"""Words that no other name of the code may hold."""


TEXT = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", None)}  # of Python 3.12 and later


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


@cache
def tokens(path):
    return list(tokenize.generate_tokens(io.StringIO(path.read_text()).readline))


def files_of(room):
    return sorted((PACKAGE / room).rglob("*.py")) if (PACKAGE / room).is_dir() else [PACKAGE / room]


def said_in(token):
    """The words of a string or a comment; of an f-string without its code."""
    is_f = token.type == tokenize.STRING and "f" in token.string[: token.string.index(token.string[-1])].lower()
    return re.sub(r"\{[^{}\n]*\}", "{}", token.string) if is_f else token.string


def uses_in_code(path, kept=()):
    """As `uses`, of the strings and comments of a file."""
    said = [t for t in tokens(path) if t.type in TEXT]
    return [f"{name(path)}:{t.start[0]}, {one}" for t in said for one in uses(said_in(t), kept)]


def names_with_such_words(path):
    """Names of a file that hold such a word, with what to write in its place."""
    names = {t.string: t.start[0] for t in tokens(path) if t.type == tokenize.NAME}
    apart = {n: re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", n) for n in names}
    found = ((n, term) for n, words in apart.items() for p, term in NAMED.items() if re.search(p, words, re.IGNORECASE))
    return [(f"{name(path)}:{names[n]}", n, term) for n, term in found]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_uses_the_terms_of_the_field(page):
    assert uses(page.read_text(), KEPT) == []


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_comments_and_messages_use_the_terms_of_the_field(room):
    assert [one for path in files_of(room) for one in uses_in_code(path, KEPT)] == []


@pytest.mark.parametrize("story", STORIES, ids=name)
def test_stories_and_their_pictures_use_the_terms_of_the_field(story):
    """What a picture says is a string of its script."""
    assert uses_in_code(story, KEPT) == []


@pytest.mark.parametrize("room", ROOMS)
def test_names_of_the_code_are_terms_of_the_field(room):
    found = [one for path in files_of(room) for one in names_with_such_words(path)]
    assert [one for one in found if one[1] not in KEPT_NAMES] == []


def test_a_word_is_found_over_the_end_of_a_line_and_not_in_code():
    assert uses("What\nis left\nis Foretold `beside\nanew`.\n```\nanew\n```\n") == [
        "line 1: 'What is left': write lack of fit; residual; unexplained part",
        "line 3: 'Foretold': write predict, one-step prediction",
    ]
    assert uses("beside a wall", ["beside a wall"]) == []


def test_a_word_is_found_in_code(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    path = tmp_path / "one.py"
    path.write_text(
        '"""A cause\n\nbeside a `beside`."""\nforetoldTrial = f"{anew} anew {x}"  # by turns\nis_told = 1\n'
    )
    assert uses_in_code(path) == [
        "one.py:1, line 3: 'beside': write together with; in a model that also contains; next to (places)",
        "one.py:4, line 1: 'anew': write again; refit; restart",
        "one.py:4, line 1: 'by turns': write alternating maximisation (ECM)",
    ]
    assert [n for _, n, _ in names_with_such_words(path)] == ["foretoldTrial", "is_told", "is_told"]


def test_what_is_kept_is_there():
    files = [path for room in ROOMS for path in files_of(room)]
    text = "".join(path.read_text() for path in (*PAGES, *files))
    assert [one for one in KEPT if one not in text] == []
    names = {n for path in files for _, n, _ in names_with_such_words(path)}
    assert sorted(set(KEPT_NAMES) - names) == []


LONGEST_SENTENCE = 40
"""Words."""
ENDS = re.compile(r"(?<=[.!?])[\"*)]*\s+(?=[\"*(\[]*[A-Zx0-9])(?<!e\.g\. )(?<!eq\. )(?<!al\. )")
"""Where a sentence ends: not after an abbreviation."""


def without_fences(text):
    """A page without its fenced code and its comments; every line stays in its place."""
    fenced = re.compile(r"^( *)(`{3,}|:{3,}).*?^\1\2 *$|<!--.*?-->", re.DOTALL | re.MULTILINE)
    return fenced.sub(lambda m: "\n" * m[0].count("\n"), text)


def paragraphs(text):
    """Paragraphs and items of lists, each with its first line; no headings, tables, or code."""
    begun, found = False, []
    for number, line in enumerate(without_fences(text).split("\n"), 1):
        shown = line.strip()
        if not shown or shown.startswith(("|", "#")) or (line.startswith("    ") and not begun):
            begun = False
            continue
        item = re.match(r"(?:[-*] |\d+\. )", shown)
        if item or not begun:
            found.append((number, []))
        found[-1][1].append(shown[item.end() :] if item else shown)
        begun = True
    return [(number, " ".join(lines)) for number, lines in found]


def sentences(text):
    """Sentences of a page with the lines that their paragraphs begin in; code in a sentence counts as one word."""
    for number, words in paragraphs(text):
        for one in ENDS.split(re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "x", words))):
            yield number, one


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=name)
def test_no_sentence_is_long(page):
    counted = [(number, len(one.split()), one) for number, one in sentences(page.read_text())]
    assert [f"line {n}: {count} words: {one}" for n, count, one in counted if count > LONGEST_SENTENCE] == []


@pytest.mark.parametrize("page", [p for p in PAGES if p.stem != "architecture"], ids=name)
def test_no_sentence_names_a_file_of_the_package(page):
    """A table of docs/architecture.md has these names."""
    files = re.compile(r"`(?:fes_pin|infer|diagnosis|tests|analysis)/[\w/.]+`")
    assert [(number, found) for number, text in paragraphs(page.read_text()) for found in files.findall(text)] == []


def test_sentences_are_counted_without_code_and_tables():
    page = (
        "# A b\n\nOne two\n`three\nfour` five. Five\nsix: Seven.\n\n    code here\n\n| a | b |\n\n- item (e.g. This)\n"
        "- [x](y.md). Z\n\n```\nz\n```\n"
    )
    assert [(n, len(one.split())) for n, one in sentences(page)] == [(3, 4), (3, 3), (12, 3), (13, 1), (13, 1)]
