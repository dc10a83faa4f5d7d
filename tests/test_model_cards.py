"""Cards and pages of training print commands that run as they stand."""

import re
import shlex
from pathlib import Path

import pytest

from etnet.bundled import bundled_folder, models
from etnet.cli.train_options import parse

PAGES = [*(bundled_folder() / "models").glob("*.md"), Path(__file__).resolve().parents[1] / "docs" / "training.md"]


def training_commands(page: Path) -> list[list[str]]:
    """The arguments of every `etnet train` in a page's code blocks, continued lines joined."""
    blocks = re.findall(r"^```\w*\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M)
    lines = [line for block in blocks for line in re.sub(r" *\\\n *", " ", block).splitlines()]
    commands = [line.partition("   ")[0] for line in lines]  # what stands behind is said to the reader
    return [shlex.split(line)[2:] for line in commands if line.startswith("etnet train ") and "…" not in line]


def test_every_bundled_network_has_a_card():
    assert all(path.with_suffix(".md").is_file() for path in models())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_training_commands_of_a_page_are_understood(page: Path):
    for arguments in training_commands(page):
        assert parse(arguments, "etnet train").train.updates > 0


def test_the_default_weights_card_prints_the_runs_that_made_them():
    commands = training_commands(bundled_folder() / "models" / "etnet-half.md")
    assert sum("--stages.0.updates" in command for command in commands) == 5
