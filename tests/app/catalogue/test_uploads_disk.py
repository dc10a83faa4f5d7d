"""What the disk does under a visitor's files is one sentence on their page, and holds up nothing that comes after."""

import errno
import shutil
from types import SimpleNamespace

import pytest

from app.catalogue.uploads import SPARE_DISK, UploadLimits, Uploads
from tests.app.catalogue.test_visitor_uploads import bring, refused, shelves, uploads  # noqa: F401


def fill_up(transfer):
    """From now on the transfer writes to a disk that is full."""
    transfer._file.close()
    transfer._file = open("/dev/full", "wb")  # noqa: SIM115


@pytest.mark.parametrize("size", [100, 100_000])
def test_a_disk_that_fills_up_before_the_last_byte_leaves_nothing_of_the_file(shelves, size):  # noqa: F811
    roomy = Uploads(UploadLimits(10**6, 10**6), shelves.take_in, shelves.let_go)
    own_files = roomy.desk()
    transfer = own_files.begin("a.raw", size)
    fill_up(transfer)

    def send():
        transfer.take(b"x" * size)
        transfer.finish()

    said = refused(send)
    assert said.startswith("a.raw: cannot be stored here (No space left")
    transfer.abort(said)
    shown = own_files.shown
    assert (shown.coming, shown.files, shown.refused) == (None, (), said)
    assert (own_files.num_bytes, shelves.here, transfer.path.exists()) == (0, {}, False)
    bring(own_files)
    roomy.close()


def test_a_transfer_that_is_stopped_on_a_full_disk_is_over(uploads):  # noqa: F811
    own_files = uploads.desk()
    transfer = own_files.begin("a.raw", 100)
    fill_up(transfer)
    transfer.take(b"x" * 50)
    transfer.abort("stopped")
    assert (own_files.shown.coming, own_files.shown.refused, own_files.num_bytes) == (None, "stopped", 0)
    bring(own_files)


def test_the_disk_is_not_promised_twice(shelves, monkeypatch):  # noqa: F811
    roomy = Uploads(UploadLimits(10**6, 10**6), shelves.take_in, shelves.let_go)
    free = SPARE_DISK + 1000
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=free))
    transfer = roomy.desk().begin("a.raw", 600)
    assert "do not fit" in refused(lambda: roomy.desk().begin("b.raw", 500))
    transfer.take(b"x" * 600)
    free -= 600
    refused(lambda: roomy.desk().begin("b.raw", 500))
    bring(roomy.desk(), size=400)
    transfer.abort("stopped")
    free += 600
    bring(roomy.desk(), size=600)
    roomy.close()


def test_what_the_system_says_of_the_folder_is_one_sentence_on_the_page(uploads, monkeypatch):  # noqa: F811
    own_files = uploads.desk()

    def fails(*given):
        raise OSError(errno.ENOSPC, "No space left on device", "/tmp/etnet-uploads-x")

    with monkeypatch.context() as patched:
        patched.setattr("app.catalogue.visitor_uploads.os.open", fails)
        said = refused(lambda: own_files.begin("a.raw", 10))
    assert said == own_files.shown.refused == "a.raw: cannot be stored here (No space left on device); try again later"
    assert (own_files.num_bytes, own_files.shown.coming) == (0, None)
    bring(own_files)


def test_files_are_taken_after_the_system_has_removed_the_idle_folder(uploads):  # noqa: F811
    one, other = uploads.desk(), uploads.desk()
    bring(one)
    shutil.rmtree(uploads._folder.path)
    assert one.left_unpacked > 0
    bring(other)
    bring(one)
    folder = uploads._folder.path
    assert folder.is_dir()
    uploads.close()
    assert not folder.exists()
