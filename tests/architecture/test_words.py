"""One thing has one name: no text of the page, the command line or the docs uses a word that was given up."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WORDS = """
look inside the, take away, takes away, taken away, put everything back, put back, empty memory, invert them
move in time, on show, ten windows on, what the network is given, signed votes, votes, strongest from, all events drawn
as the network needs, whichever is faster, memory warm, warming up, how far back it, from camera frame to camera
taken as this window, what matters here, nothing to take, is what it looks at, handed over, hands on to
attention that goes, channel by channel, rolled into one, how much stays near, which events made, trace back
reads itself, reads ≈, even share, equal share, who reads it, over heads, sharpest first, one scale for all, wiped over
nothing to err, scored by, ms later, camera lags by, second judge, what kind of recording, refractory time
what the file does not say, open it so, put in order, noticed on opening, stamps count, equal stamps, pixels are joined
joined to, a range only, stamps below, session to check, moving picture, in depth (camera, keys and words, it is yours
leave the tour, places it compares, its reading amounts, ctrl+c ends, this one out, this one even, even everywhere
mute head, stamps in order, joins the pixels, join so many, slice of time, slices of time, whoever, anew
"""
_EACH = (words.strip() for words in re.split(r"[,\n]", WORDS.strip()))
GIVEN_UP = re.compile(rf"\b(?:{'|'.join(map(re.escape, _EACH))})\b|[\d}}] M/s", re.IGNORECASE)
FOR_DEVELOPERS = {f"docs/{name}.md" for name in ("design", "training", "simulation", "security", "reproduce")}


def texts_of(file: Path) -> Iterator[tuple[int, str]]:
    """What a person can read of a file: of Python its literals, and the docstrings that the command line shows."""
    text = file.read_text("utf-8")
    if file.suffix != ".py":
        for number, line in enumerate(text.splitlines(), 1):
            yield number, line.partition("// ")[0] if file.suffix == ".js" else line
        return
    nodes = list(ast.walk(ast.parse(text)))
    said = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    if "cli" in file.parts or file.name in ("config.py", "stated.py"):
        fields = [part for node in nodes if isinstance(node, ast.ClassDef) for part in node.body]
        said -= {id(part.value) for part in fields if isinstance(part, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.lineno, re.sub(r"<[^>]*>", "", node.value)


@pytest.mark.parametrize(
    "part",
    [
        "README.md",
        "app/**/*.py",
        "etnet/cli/**/*.py",
        "etnet/events/stated.py",
        "static/**/*.js",
        "static/**/*.html",
        "docs/*.md",
    ],
)
def test_no_text_uses_a_word_that_was_given_up(part):
    files = [file for file in sorted(ROOT.glob(part)) if str(file.relative_to(ROOT)) not in FOR_DEVELOPERS]
    assert files
    found = [
        f"{file.relative_to(ROOT)}:{number}: {met[0]}"
        for file in files
        for number, text in texts_of(file)
        if (met := GIVEN_UP.search(text)) is not None
    ]
    assert found == []
