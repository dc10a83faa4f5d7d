"""What visitors hand over: let in by size, counted as it comes, seen by one, and gone with him."""

import stat
import subprocess
import sys
import tempfile
import time
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from app.catalogue.recordings import Catalogue, CatalogueError
from app.catalogue.uploads import SPARE_DISK, UploadLimits, Uploads
from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import MEGABYTE, UploadError, in_megabytes, title_of
from app.config import UPLOADS, ConfigError, ViewerConfig
from app.html.uploads import handing_html
from etnet.errors import EtnetError
from etnet.events.index_store import BESIDE, index_path, load_index, save_index
from etnet.events.write import write_recording
from etnet.private_folder import PrivateFolder, sweep
from tests.app.stand_ins import recording

LIMITS = UploadLimits(visitor_bytes=1000, total_bytes=1500, visitor_files=3)


class Shelves:
    """Remembers what was taken in and let go."""

    def __init__(self):
        self.here, self.gone = {}, []

    def take_in(self, entry):
        self.here[entry.id] = entry

    def let_go(self, recording_id):
        del self.here[recording_id]
        self.gone.append(recording_id)


@pytest.fixture
def shelves():
    return Shelves()


@pytest.fixture
def uploads(shelves):
    running = Uploads(LIMITS, shelves.take_in, shelves.let_go)
    yield running
    running.close()


def bring(own_files, name="clip.raw", size=100):
    transfer = own_files.begin(name, size)
    transfer.take(b"x" * size)
    return transfer.finish()


def refused(act):
    with pytest.raises(UploadError) as told:
        act()
    assert "\n" not in str(told.value)
    return str(told.value)


def test_a_file_that_says_it_is_too_large_is_refused_before_anything_is_made_for_it(uploads):
    own_files = uploads.desk()
    assert "--data FOLDER" in refused(lambda: own_files.begin("night drive.raw", 1001))
    assert uploads._folder is None
    assert own_files.shown.refused.startswith("night drive.raw: ")
    assert own_files.num_bytes == 0


def test_not_one_byte_beyond_the_declared_size_is_written(uploads):
    own_files = uploads.desk()
    transfer = own_files.begin("liar.raw", 10)
    transfer.take(b"1234567")
    assert "more came than the 10 bytes" in refused(lambda: transfer.take(b"89ab"))
    transfer._file.flush()
    assert transfer.path.read_bytes() == b"1234567"
    transfer.abort("cut off")
    assert not transfer.path.exists()
    assert own_files.num_bytes == 0


def test_a_file_that_ends_early_is_not_opened(uploads, shelves):
    transfer = uploads.desk().begin("half.raw", 10)
    transfer.take(b"12345")
    assert "5 of 10 bytes came" in refused(transfer.finish)
    transfer.abort("")
    assert shelves.here == {}


def test_a_visitor_has_a_quota_of_bytes_and_of_files_and_what_he_removes_is_free_again(uploads, shelves):
    own_files = uploads.desk()
    first = bring(own_files, size=600)
    assert "remove a file first" in refused(lambda: own_files.begin("second.raw", 401))
    bring(own_files, size=200)
    bring(own_files, size=200)
    assert "3 files are here already" in refused(lambda: own_files.begin("fourth.raw", 1))
    path = shelves.here[first].path
    own_files.remove(first)
    assert not path.parent.exists()
    assert shelves.gone == [first]
    bring(own_files, size=600)


def test_all_visitors_together_have_a_cap_and_what_is_on_its_way_counts_in_full(uploads):
    one, other = uploads.desk(), uploads.desk()
    on_its_way = one.begin("large.raw", 1000)
    assert "all visitors together" in refused(lambda: other.begin("large.raw", 501))
    on_its_way.abort("stopped")
    bring(other, size=1000)


def make_of(shelves, entry_id, size, name="made.h5"):
    """As reading a file does: something lies beside it afterwards."""
    made = shelves.here[entry_id].path.parent / name
    made.write_bytes(b"x" * size)
    return made


def test_what_is_made_of_a_file_counts_until_the_file_is_removed(uploads, shelves):
    own_files = uploads.desk()
    arrived = bring(own_files, size=100)
    assert (own_files.unpacked_bytes, own_files.left_unpacked) == (0, 4000)
    make_of(shelves, arrived, 3000)
    make_of(shelves, arrived, 800, f"{BESIDE}/a.index")
    assert (own_files.unpacked_bytes, own_files.left_unpacked) == (3800, 200)
    own_files.check_unpacked("a.raw", 200)
    assert "unpack" in refused(lambda: own_files.check_unpacked("a.raw", 201))
    assert "remove a file first" in refused(lambda: own_files.begin("second.raw", 201))
    bring(own_files, size=200)
    own_files.remove(arrived)
    assert own_files.left_unpacked == 4000


def test_what_is_made_of_all_visitors_files_has_a_cap(uploads, shelves):
    desks = [uploads.desk() for _ in range(3)]
    for desk in desks[:2]:
        make_of(shelves, bring(desk), 2900)
    assert [desk.left_unpacked for desk in desks] == [200, 200, 200]
    assert "unpack" in refused(lambda: desks[2].check_unpacked("a.raw", 201))
    desks[0].close()
    assert desks[2].left_unpacked == 3100


def test_what_is_made_of_files_leaves_the_disk_some_room(uploads, monkeypatch):
    own_files = uploads.desk()
    bring(own_files)
    monkeypatch.setattr("app.catalogue.uploads.shutil.disk_usage", lambda path: SimpleNamespace(free=SPARE_DISK + 7))
    assert own_files.left_unpacked == 7


def test_one_file_of_a_visitor_comes_at_a_time(uploads):
    own_files = uploads.desk()
    first = own_files.begin("first.raw", 10)
    assert "another file is on its way" in refused(lambda: own_files.begin("second.raw", 10))
    first.abort("")
    bring(own_files)


def test_a_full_disk_takes_nothing_more(uploads, monkeypatch):
    monkeypatch.setattr("app.catalogue.uploads.shutil.disk_usage", lambda path: SimpleNamespace(free=MEGABYTE))
    assert "do not fit" in refused(lambda: uploads.desk().begin("a.raw", 10))


def test_the_folder_is_private_and_names_in_it_are_our_own(uploads, shelves):
    arrived = bring(uploads.desk(), "../../evil name <b>.txt.gz")
    entry = shelves.here[arrived]
    assert entry.title == "evil name <b>.txt.gz"
    assert entry.path.name.endswith(".txt.gz")
    assert entry.path.name.removesuffix(".txt.gz").isalnum()
    assert stat.S_IMODE(uploads._folder.path.stat().st_mode) == 0o700
    assert stat.S_IMODE(entry.path.stat().st_mode) == 0o600
    assert uploads._folder.path in entry.path.parents


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("C:\\films\\a.raw", "a.raw"),
        ("a\u202eb\x00\n.raw", "ab.raw"),
        ("", "a file without a name"),
        ("/", "a file without a name"),
    ],
)
def test_a_name_is_shown_as_one_plain_line(name, title):
    assert title_of(name) == title
    assert len(title_of("x" * 500 + ".raw")) <= 80
    assert title_of("x" * 500 + ".raw").endswith(".raw")


def test_what_is_too_large_never_reads_as_what_is_allowed():
    assert in_megabytes(256 * MEGABYTE) == "256 MB"
    assert in_megabytes(256 * MEGABYTE + 1) == "256.1 MB"
    assert in_megabytes(10) == "0.1 kB"


def test_nothing_of_a_name_becomes_markup(uploads):
    own_files = uploads.desk()
    bring(own_files, '<img src=x onerror="alert(1)">.raw', 10)
    coming = own_files.begin("<i>coming.raw", 10)
    refused(lambda: own_files.begin("<u>refused.raw", 10))
    html = handing_html(own_files.shown)
    for tag in ("<img", "<i>", "<u>"):
        assert tag not in html
    assert "&lt;img" in html
    assert "&lt;u&gt;refused" in html
    coming.abort("")


def test_everything_goes_with_the_visitor_and_with_the_server(uploads, shelves):
    one, other = uploads.desk(), uploads.desk()
    bring(one)
    half = one.begin("half.raw", 50)
    kept = bring(other)
    gone = next(iter(shelves.gone or [i for i in shelves.here if i != kept]))
    one.close()
    assert shelves.gone == [gone]
    assert not half.path.exists()
    assert "gone" in refused(lambda: half.take(b"1"))
    half.abort("")
    assert "not open any more" in refused(lambda: one.begin("again.raw", 1))
    assert "not open any more" in refused(lambda: uploads.desk_of(one.ticket))
    folder, path = uploads._folder.path, shelves.here[kept].path
    assert path.exists()
    uploads.close()
    assert not folder.exists()
    assert shelves.here == {}
    assert "being stopped" in refused(lambda: uploads.desk().begin("late.raw", 1))


def test_what_a_killed_server_left_is_swept_up_and_what_a_living_one_holds_is_not():
    code = (
        "import os, sys; from etnet.private_folder import PrivateFolder; f = PrivateFolder('etnet-test-');"
        "print(f.path, flush=True); sys.stdin.read(); os._exit(9)"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
    left = Path(child.stdout.readline().strip())
    mine = PrivateFolder("etnet-test-")
    assert left.is_dir()
    child.communicate("")
    assert left.is_dir()
    sweep("etnet-test-")
    assert not left.exists()
    assert mine.path.is_dir()
    mine.close()
    assert not mine.path.exists()


# ---- with the real catalogue: opened as every other file is, by its visitor alone ----


@pytest.fixture
def catalogue():
    made = Catalogue(ViewerConfig())
    yield made
    made.close()


@pytest.fixture
def opened_uploads(catalogue):
    running = Uploads(UploadLimits.of_megabytes(16), catalogue.take_in, catalogue.let_go)
    yield running
    running.close()


def hand_over(own_files, path, name=None):
    content = path.read_bytes()
    transfer = own_files.begin(name or path.name, len(content))
    transfer.take(content)
    return transfer.finish()


def test_a_recording_is_opened_under_its_visitors_name_and_by_him_alone(catalogue, opened_uploads, tmp_path):
    write_recording(recording(), tmp_path / "mine.h5")
    own_files = opened_uploads.desk()
    arrived = hand_over(own_files, tmp_path / "mine.h5")
    own, others = VisitorCatalogue(catalogue, own_files), VisitorCatalogue(catalogue, opened_uploads.desk())
    assert own.entries()[0].title == "mine.h5"
    assert arrived not in {entry.id for entry in (*others.entries(), *catalogue.entries())}
    assert own.open(arrived).name == "mine"
    assert own.open(arrived).num_events == recording().num_events
    for stranger in (others, VisitorCatalogue(catalogue)):
        with pytest.raises(CatalogueError):
            stranger.open(arrived)
        with pytest.raises(CatalogueError):
            stranger.entry(arrived)
    own_files.close()
    with pytest.raises(CatalogueError):
        own.open(arrived)
    assert own.entries() == catalogue.entries()


def test_an_index_lies_beside_its_file_and_goes_with_it(catalogue, opened_uploads, tmp_path, monkeypatch):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    (tmp_path / "mine.raw").write_bytes(b"x" * 100)
    own_files = opened_uploads.desk()
    path = catalogue.entry(hand_over(own_files, tmp_path / "mine.raw")).path
    save_index(index_path(path, "blocks"), {"before": np.arange(3)})
    assert load_index(index_path(path, "blocks")) is not None
    assert path.parent in index_path(path, "blocks").parents
    assert index_path(tmp_path / "mine.raw", "blocks").parent == tmp_path / "cache" / "indices"
    own_files.close()
    assert not path.parent.exists()


def test_files_that_unpack_to_more_than_a_visitor_may_have_are_refused_one_by_one(tmp_path):
    write_recording(recording(), tmp_path / "a.h5")
    shared = Catalogue(ViewerConfig(public_url="http://show.example", uploads=16))
    files = Uploads(UploadLimits.of_megabytes(16), shared.take_in, shared.let_go)
    try:
        alone = files.desk()
        shared.open(hand_over(alone, tmp_path / "a.h5"))
        unpacked = alone.unpacked_bytes
        assert unpacked > 1000
        alone.close()
        files.limits = replace(files.limits, growth=1.5 * unpacked / files.limits.visitor_bytes)
        own_files = files.desk()
        first, second = (hand_over(own_files, tmp_path / "a.h5", name) for name in ("one.h5", "two.h5"))
        assert shared.open(first).num_events == recording().num_events
        with pytest.raises(EtnetError, match="unpack") as told:
            shared.open(second)
        assert str(told.value).startswith("two.h5")
        assert own_files.unpacked_bytes == unpacked, "nothing of what was refused is left"
        own_files.remove(first)
        assert shared.open(second).num_events == recording().num_events
    finally:
        files.close()
        shared.close()


def test_what_is_no_recording_is_refused_by_the_name_that_its_visitor_knows(catalogue, opened_uploads, tmp_path):
    own_files = opened_uploads.desk()
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("events.txt", b"0" * (64 * MEGABYTE))
    linked = tmp_path / "linked.h5"
    with h5py.File(linked, "w") as file:
        file["events"] = h5py.ExternalLink("/etc/passwd", "/events")
    nonsense = tmp_path / "nonsense.raw"
    nonsense.write_bytes(np.random.default_rng(0).bytes(4000))
    for path in (bomb, linked, nonsense):
        arrived = hand_over(own_files, path)
        ours = catalogue.entry(arrived).path
        began = time.process_time()
        with pytest.raises(EtnetError) as told:
            catalogue.open(arrived)
        assert time.process_time() - began < 20
        assert path.name in str(told.value)
        assert ours.stem not in str(told.value)
        assert tempfile.gettempdir() not in str(told.value)


def test_whoever_can_be_reached_by_others_takes_files_only_when_told_to():
    assert ViewerConfig().upload_megabytes == UPLOADS
    assert ViewerConfig(uploads="off").upload_megabytes is None
    for others in ({"demo": True}, {"public_url": "https://x.y"}, {"host": "0.0.0.0", "token": "s"}):
        assert ViewerConfig(**others).upload_megabytes is None
        assert ViewerConfig(**others, uploads=20).upload_megabytes == 20
    for wrong in (0, -1, 10**6):
        with pytest.raises(ConfigError, match="--uploads"):
            ViewerConfig(uploads=wrong)
