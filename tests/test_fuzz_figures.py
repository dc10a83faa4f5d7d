"""What was fuzzed is added up by story, and the documentation says what is kept."""

from pathlib import Path

from tests.fuzz_figures import add, figures

SECURITY = Path(__file__).resolve().parents[1] / "docs" / "security.md"


def test_counts_add_up(tmp_path):
    kept = tmp_path / "fuzz.json"
    assert figures(kept) == {}
    add("links", 100, 0, kept)
    add("files", 50, 1, kept)
    add("links", 20, 2, kept)
    assert figures(kept) == {"links": {"tried": 120, "faults": 2}, "files": {"tried": 50, "faults": 1}}


def test_the_documentation_says_what_is_kept():
    rows = [line.split("|") for line in SECURITY.read_text().splitlines() if line.startswith("| `")]
    told = {row[1].strip(" `").split(" ")[-1]: (row[3].strip(), row[4].strip()) for row in rows}
    assert told == {story: (f"{kept['tried']:,}", str(kept["faults"])) for story, kept in figures().items()}
