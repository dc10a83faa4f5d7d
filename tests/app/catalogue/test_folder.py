"""What is found in a watched folder lies in it, each once, however its links are laid."""

import pytest

from app.catalogue import folder
from app.catalogue.folder import recordings_in


@pytest.fixture(name="watched")
def folder_of_two(tmp_path):
    watched = tmp_path / "watched"
    (watched / "sub").mkdir(parents=True)
    (watched / "a.txt").write_text("0.1 1 1 1\n")
    (watched / "sub" / "b.txt").write_text("0.1 1 1 1\n")
    return watched


def names_in(watched) -> list[str]:
    return [path.relative_to(watched).as_posix() for path in recordings_in(watched)]


def test_links_to_a_folder_above_are_no_folders_more(watched):
    (watched / "sub" / "up").symlink_to("..")
    (watched / "sub" / "up2").symlink_to("..")
    (watched / "sub" / "itself").symlink_to("itself")
    assert names_in(watched) == ["a.txt", "sub/b.txt"]


def test_links_that_lead_out_are_not_followed(watched):
    outside = watched.parent / "outside"
    outside.mkdir()
    (outside / "secret.txt").write_text("0.1 1 1 1\n")
    (outside / "events.txt").write_text("0.1 1 1 1\n")
    (watched / "file.txt").symlink_to(outside / "secret.txt")
    (watched / "folder").symlink_to(outside)
    (watched / "recording").mkdir()
    (watched / "recording" / "events.txt").symlink_to(outside / "events.txt")
    assert names_in(watched) == ["a.txt", "sub/b.txt"]


def test_the_watched_folder_may_be_a_link_and_so_may_a_file_within_it(watched):
    (watched / "also.txt").symlink_to(watched / "sub" / "b.txt")
    (watched.parent / "link").symlink_to(watched)
    assert names_in(watched.parent / "link") == ["a.txt", "also.txt", "sub/b.txt"]


def test_of_very_many_folders_some_are_looked_into(watched, monkeypatch):
    monkeypatch.setattr(folder, "MAX_FOLDERS", 3)
    for number in range(5):
        (watched / f"empty{number}").mkdir()
    assert names_in(watched) == ["a.txt"]
