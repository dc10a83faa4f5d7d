import gc
import math
import shutil
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest

from app.catalogue.folder import RESTS, recordings_in
from app.catalogue.recording_id import stated_id
from app.catalogue.recordings import (
    Catalogue,
    CatalogueError,
    Entry,
    suited_policy,
)
from app.config import ConfigError, ViewerConfig
from etnet.bundled import samples
from etnet.errors import EtnetError, WeightsError
from etnet.events.assumptions import Assumptions
from etnet.events.opened_as import OpenedAs, View
from etnet.events.stated import Stated
from etnet.export.video import video_writer
from etnet.windows import BetweenFrames
from tests.real_data import real_file


@pytest.fixture
def folder(tmp_path):
    """A data folder with a good file, a broken one, one beside a recording, and things that are no recordings."""
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.sort(rng.random(90)), rng.integers(0, 20, (90, 2)), rng.integers(0, 2, 90)])
    (tmp_path / "inside").mkdir()
    np.savetxt(tmp_path / "inside" / "good.txt", rows, fmt="%.6f %d %d %d")
    (tmp_path / "broken.h5").write_bytes(b"nothing of the kind")
    (tmp_path / "images.txt").write_text("0.1 images/frame_00000.png\n")
    (tmp_path / "notes.pdf").write_bytes(b"%PDF")
    (tmp_path / ".hidden.txt").write_text("x")
    return tmp_path


def entry_of(catalogue, title):
    return next(entry for entry in catalogue.entries() if entry.title == title)


def test_bundled_recordings_come_first_and_each_has_its_own_id():
    entries = Catalogue(ViewerConfig()).entries()
    assert [entry.kind for entry in entries] == ["bundled"] * len(samples()) + ["on demand"]
    assert len({entry.id for entry in entries}) == len(entries)


def test_a_data_folder_is_searched_for_what_can_be_a_recording(folder):
    found = [entry for entry in Catalogue(ViewerConfig(data=folder)).entries() if entry.kind == "data"]
    assert [entry.title for entry in found] == ["broken.h5", "good.txt"]
    assert found[1].subtitle.startswith("inside")


def test_ids_tell_no_path_and_stay_the_same(folder):
    first, second = (Catalogue(ViewerConfig(data=folder)).entries() for _ in range(2))
    assert [entry.id for entry in first] == [entry.id for entry in second]
    for entry in first:
        assert "/" not in entry.id
        assert entry.title not in entry.id or entry.kind in ("on demand", "bundled")
        assert str(folder) not in repr(entry)


@pytest.mark.parametrize("asked", ["", "data-../../etc/passwd", "/etc/passwd"])
def test_what_is_not_listed_cannot_be_opened(asked):
    with pytest.raises(CatalogueError):
        Catalogue(ViewerConfig()).open(asked)


def test_the_file_of_the_command_line_is_first(folder):
    catalogue = Catalogue(ViewerConfig(file=folder / "inside" / "good.txt"))
    assert catalogue.entries()[0].kind == "file"
    assert catalogue.open(catalogue.entries()[0].id).num_events == 90


def test_a_broken_file_is_an_error_with_a_name(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    with pytest.raises(EtnetError, match=r"broken\.h5"):
        catalogue.open(entry_of(catalogue, "broken.h5").id)


def test_what_is_stated_holds_for_the_files_that_are_named_and_for_no_other(folder):
    rows = np.array([[0.2, 3, 4, 1], [0.1, 5, 6, 0], [0.3, 7, 8, 1]])
    np.savetxt(folder / "back.txt", rows, fmt="%.6f %d %d %d")
    taken = Catalogue(ViewerConfig(data=folder))
    with pytest.raises(EtnetError, match="--sort"):
        taken.open(entry_of(taken, "back.txt").id)
    stated = Catalogue(ViewerConfig(data=folder, stated=Stated(assume="width=64,height=32", sort=True)))
    recording = stated.open(entry_of(stated, "back.txt").id)
    assert recording.read(0, 3).t.tolist() == [100_000, 200_000, 300_000]
    assert recording.sensor.width == 64
    assert stated.open(f"bundled-{samples()[0].stem}").sensor.width == 240


def test_viewers_that_open_a_file_in_another_way_know_it_by_another_id(folder):
    """What is drawn is shared by all viewers of a process: under one id one would show the other's events."""
    ways = [{}, {"roi": "1,2,16,12"}, {"roi": "2,2,16,12"}, {"downsample": 2}, {"stated": Stated(sort=True)}]
    ids = [entry_of(Catalogue(ViewerConfig(data=folder, **way)), "good.txt").id for way in ways]
    assert len(set(ids)) == len(ways)
    assert entry_of(Catalogue(ViewerConfig(data=folder)), "good.txt").id == ids[0]


def test_two_visitors_share_one_opened_recording(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    entry, opened = entry_of(catalogue, "good.txt"), []
    threads = [threading.Thread(target=lambda: opened.append(catalogue.open(entry.id))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(opened) == 8
    assert len({id(recording) for recording in opened}) == 1


def test_a_recording_nobody_uses_any_more_is_closed(folder, monkeypatch):
    monkeypatch.setattr("app.catalogue.recordings.KEPT_OPEN", 1)
    shutil.copy(folder / "inside" / "good.txt", folder / "other.txt")
    catalogue = Catalogue(ViewerConfig(data=folder))
    in_use = catalogue.open(entry_of(catalogue, "good.txt").id)
    unused = weakref.ref(catalogue.open(entry_of(catalogue, "other.txt").id))
    catalogue.open(entry_of(catalogue, "good.txt").id)
    gc.collect()
    assert unused() is None
    assert len(in_use.read(0, 90)) == 90


def titles(catalogue):
    return [entry.title for entry in catalogue.entries() if entry.kind == "data"]


def test_a_new_file_is_offered_once_it_rests(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    rows = (folder / "inside" / "good.txt").read_bytes()
    (folder / "new.txt").write_bytes(rows[:400])
    catalogue.look(10.0)
    assert titles(catalogue) == ["broken.h5", "good.txt"]
    assert catalogue.growing() == ("new.txt",)
    (folder / "new.txt").write_bytes(rows)
    catalogue.look(10.0 + RESTS)
    assert catalogue.growing() == ("new.txt",)  # it was larger than at the last look
    catalogue.look(10.0 + 2 * RESTS)
    assert titles(catalogue) == ["broken.h5", "new.txt", "good.txt"]
    assert catalogue.growing() == ()
    assert catalogue.open(entry_of(catalogue, "new.txt").id).num_events == 90


def test_a_file_by_the_name_of_a_former_one_is_another_recording(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    former = entry_of(catalogue, "good.txt").id
    assert catalogue.open(former).num_events == 90
    lines = (folder / "inside" / "good.txt").read_text().splitlines(keepends=True)
    (folder / "inside" / "good.txt").write_text("".join(lines[:40]))
    catalogue.look(0.0)
    assert titles(catalogue) == ["broken.h5"]
    with pytest.raises(CatalogueError):
        catalogue.open(former)
    catalogue.look(RESTS)
    assert entry_of(catalogue, "good.txt").id != former
    assert catalogue.open(entry_of(catalogue, "good.txt").id).num_events == 40
    assert not {former} & (catalogue._open.keys() | catalogue._opening.keys())


def test_of_a_recording_that_was_let_go_no_word_stays(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    catalogue.take_in(Entry("upload-1", "my walk.txt", "upload", "", folder / "inside" / "good.txt"))
    catalogue.open("upload-1")
    assert catalogue.facts.of("upload-1") != ""
    catalogue.let_go("upload-1")
    assert catalogue.facts.of("upload-1") == ""


def test_a_file_that_is_gone_is_not_offered_and_what_stays_keeps_its_id(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    kept = entry_of(catalogue, "good.txt").id
    (folder / "broken.h5").unlink()
    catalogue.look(0.0)
    assert titles(catalogue) == ["good.txt"]
    assert entry_of(catalogue, "good.txt").id == kept


def test_whoever_asks_for_the_list_sets_off_a_look_that_he_does_not_wait_for(folder, monkeypatch):
    monkeypatch.setattr("app.catalogue.folder.RESTS", 0.0)
    monkeypatch.setattr("app.catalogue.recordings.LOOK_EVERY", 0.0)
    monkeypatch.setattr("app.catalogue.recordings._PATIENCE", 0)
    catalogue = Catalogue(ViewerConfig(data=folder))
    shutil.copy(folder / "inside" / "good.txt", folder / "new.txt")
    ends = time.monotonic() + 10
    while "new.txt" not in titles(catalogue):
        assert time.monotonic() < ends
        time.sleep(0.01)


def test_without_a_folder_nothing_is_looked_at(monkeypatch):
    folders = []  # a look that another test set off may still be under way, into its own folder
    monkeypatch.setattr("app.catalogue.recordings.recordings_in", lambda folder: folders.append(folder) or [])
    catalogue = Catalogue(ViewerConfig())
    catalogue.look(0.0)
    assert catalogue._next_look == math.inf
    assert None not in folders


def test_a_recording_in_a_folder_rests_when_all_of_its_files_do(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "events.txt").write_text("2 2\n")
    before = recordings_in(tmp_path)
    assert list(before) == [tmp_path / "run"]
    with (tmp_path / "run" / "events.txt").open("a") as file:
        file.write("0.1 1 1 1\n")
    assert recordings_in(tmp_path) != before


def test_a_recording_on_demand_is_fetched_when_it_is_opened_and_tells_its_terms(folder, monkeypatch):
    asked = []

    def fetch(sample, progress=None):
        asked.append(sample.name)
        return folder / "inside" / "good.txt"

    monkeypatch.setattr("app.catalogue.recordings.fetch", fetch)
    catalogue = Catalogue(ViewerConfig())
    entry = next(entry for entry in catalogue.entries() if entry.kind == "on demand")
    assert "non-commercial" in entry.terms
    assert asked == []
    assert catalogue.open(entry.id).num_events == 90
    assert catalogue.open(entry.id).num_events == 90
    assert asked == ["slider_depth"]


def test_models_have_a_card_and_the_wanted_one_is_first():
    models = Catalogue(ViewerConfig()).models()
    assert models[0].id == "etnet-half"
    assert models[0].is_linear_light
    low, high = models[0].trained_band
    assert 0 < low < high


def test_a_model_that_is_not_there_is_said_before_anything_is_served(folder):
    with pytest.raises(WeightsError, match="no such weights file"):
        Catalogue(ViewerConfig(model="nonsense"))
    with pytest.raises(WeightsError, match="not a weights file"):
        Catalogue(ViewerConfig(model=str(folder / "broken.h5")))
    with pytest.raises(CatalogueError):
        Catalogue(ViewerConfig()).model("nonsense")


def test_neither_catalogue_nor_present_nor_engine_load_torch():
    code = (
        "import sys, app.catalogue.recordings, app.config, app.engine.engine, app.html;"
        "c = app.catalogue.recordings.Catalogue(app.config.ViewerConfig()); c.models(); c.open(c.entries()[0].id);"
        "e = app.engine.engine.Engine(c, 1 << 20); e.stop();"
        "assert 'torch' not in sys.modules and 'viser' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_windows_suit_the_recording():
    catalogue = Catalogue(ViewerConfig())
    assert suited_policy(catalogue.open(catalogue.entries()[0].id)) == BetweenFrames()


@pytest.mark.real
def test_a_region_is_applied_on_opening():
    path = real_file("aedat4/dvxplorer_lite_face_headphones_1.5s.aedat4")
    catalogue = Catalogue(ViewerConfig(file=path, roi="10,20,100,80"))
    assert str(catalogue.open(catalogue.entries()[0].id).sensor) == "100×80"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"roi": "1,2,3"}, "--roi"),
        ({"host": "0.0.0.0", "token": ""}, "--token"),
        ({"token": ""}, "--token"),
        ({"public_url": "show.example"}, "--public-url"),
        ({"public_url": "http://["}, "--public-url"),
        ({"port": 70_000}, "--port"),
        ({"budget": 1}, "--budget"),
        ({"threads": 0}, "--threads"),
        ({"stated": Stated(assume="640x480")}, "--assume"),
    ],
)
def test_options_that_do_not_go_together_are_one_line(options, said):
    with pytest.raises(EtnetError, match=said):
        ViewerConfig(**options)


def test_another_host_is_allowed_with_a_token():
    assert ViewerConfig(host="0.0.0.0", token="secret").token == "secret"


def test_a_folder_that_is_not_there_is_said(tmp_path):
    with pytest.raises(ConfigError, match="no such folder"):
        ViewerConfig(data=tmp_path / "nowhere")


def test_the_command_line_is_the_configuration(tmp_path):
    import tyro

    config = tyro.cli(
        ViewerConfig,
        args=[
            "some.h5",
            "--data",
            str(tmp_path),
            "--roi",
            "1,2,30,40",
            "--downsample",
            "2",
            "--sort",
            "--time-unit",
            "ms",
        ],
    )
    assert config.stated == Stated(sort=True, time_unit="ms")
    assert config.file.name == "some.h5"
    assert config.region == (1, 2, 30, 40)
    assert config.downsample == 2
    assert config.budget_bytes == 1024 << 20


def test_a_part_of_a_video_is_opened_as_an_event_sensor_sees_it_and_nothing_stays_on_the_disk(tmp_path):
    video = tmp_path / "clip.mp4"
    with video_writer(video, 64, 48, 50.0) as append:
        for i in range(8):
            append(np.roll(np.tile(np.arange(0, 256, 4, dtype=np.uint8), (48, 1)), 2 * i, 1))
    catalogue, told = Catalogue(ViewerConfig(data=tmp_path, roi="0,0,64,48")), []
    entry = next(entry for entry in catalogue.entries() if entry.title == "clip.mp4")
    recording = catalogue.open(entry.id, told.append)
    assert recording.num_events > 500
    assert len(recording.ground_truth) == 8
    assert any("simulated from a video" in remark.text for remark in recording.remarks)
    assert told == sorted(told)
    assert told[-1] == 1.0
    made = recording.path
    catalogue.close()
    assert not made.parent.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mp4"]


def test_weights_are_known_by_the_mark_that_the_library_writes():
    from app.catalogue.models import WEIGHTS_FORMAT
    from etnet.nets.weights import FORMAT

    assert WEIGHTS_FORMAT == FORMAT


def test_a_recording_says_how_it_was_opened_by_whoever_asked_for_it(folder):
    config = ViewerConfig(file=folder / "inside" / "good.txt", roi="1,2,16,12", downsample=2, stated=Stated(sort=True))
    catalogue = Catalogue(config)
    named = catalogue.open(entry_of(catalogue, "good.txt").id)
    assert named.opened_as == OpenedAs(Assumptions(sort=True), View((1, 2, 16, 12), 2))
    said = Assumptions(polarity="inverted")
    stated = catalogue.open(stated_id(entry_of(catalogue, "good.txt").id, said))
    assert stated.opened_as == OpenedAs(said, View((1, 2, 16, 12), 2))


def test_a_visitors_file_is_named_as_he_names_it(folder):
    catalogue = Catalogue(ViewerConfig())
    catalogue.take_in(Entry("upload-1", "my walk.txt", "upload", "", folder / "inside" / "good.txt"))
    assert catalogue.open("upload-1").path.name == "my walk.txt"


def test_the_list_is_looked_at_after_the_first_page_and_not_once_it_is_closed(folder):
    catalogue = Catalogue(ViewerConfig(data=folder))
    opened = catalogue.entries()[0]
    catalogue.look_at_files(after=0.0)
    assert "×" in catalogue.facts.of(opened.id)
    other = Catalogue(ViewerConfig(data=folder))
    looking = threading.Thread(target=other.look_at_files, args=(60.0,))
    looking.start()
    other.close()
    looking.join(10)
    assert not looking.is_alive()
    assert other.facts.of(opened.id) == ""
