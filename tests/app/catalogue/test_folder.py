"""What is found in a watched folder lies in it, each once, however its links are laid."""

import errno
import os
from pathlib import Path

import pytest

from app.catalogue import folder
from app.catalogue.folder import recordings_in
from app.catalogue.models import offered_models
from app.config import ViewerConfig


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


def deny(monkeypatch, closed, names=("stat", "lstat", "listdir", "scandir")):
    """Nothing below `closed` can be looked at, as where its mode lacks r and x; root, who may run this, always can."""

    def guarded(original, is_listing):
        def call(path=".", *args, **more):
            asked = Path(path) if isinstance(path, str | Path) else Path()
            if closed in asked.parents or (is_listing and asked == closed):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
            return original(path, *args, **more)

        return call

    for name in names:
        monkeypatch.setattr(os, name, guarded(getattr(os, name), name in ("listdir", "scandir")))


def test_a_folder_that_may_not_be_looked_into_holds_nothing_and_hides_nothing_else(watched, monkeypatch):
    closed = watched / "lost+found"
    closed.mkdir()
    (closed / "events.txt").write_text("0.1 1 1 1\n")
    (closed / "own.safetensors").write_bytes(b"")
    deny(monkeypatch, closed)
    with pytest.raises(PermissionError):
        (closed / "events.txt").is_file()
    assert names_in(watched) == ["a.txt", "sub/b.txt"]
    assert not any(model.id.startswith("data-") for model in offered_models(ViewerConfig(data=watched)))


def test_weights_whose_folder_lets_itself_be_listed_and_no_more_are_no_networks(watched, monkeypatch):
    closed = watched / "listed"
    closed.mkdir()
    (closed / "own.safetensors").write_bytes(b"")
    deny(monkeypatch, closed, ("stat", "lstat"))
    assert not any(model.id.startswith("data-") for model in offered_models(ViewerConfig(data=watched)))
    assert names_in(watched) == ["a.txt", "sub/b.txt"]


def test_columns_are_one_recording_and_lists_of_pictures_are_none(watched):
    columns = watched / "columns"
    columns.mkdir()
    for name in ("x", "y", "t", "p"):
        (columns / f"{name}.npy").write_bytes(b"")
    (watched / "sub" / "other.npy").write_bytes(b"")  # not the columns of anything
    for name in ("stamps.csv", "timestamps.txt", "images.txt"):
        (watched / "sub" / name).write_text("1\n")
    assert names_in(watched) == ["a.txt", "columns", "sub/b.txt", "sub/other.npy"]
