"""Many recordings over many processes: each is done once, by one, and a failure ends nothing else."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from etnet.cli import many
from etnet.cli.main import main
from etnet.cli.many import Job, Remaining, Share, dealt, in_words, is_done, jobs_of, run_many, this_share
from etnet.cli.many_sources import recordings_in
from etnet.errors import EtnetError
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.files import claimed
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from tests.strategies import make_events


def _jobs(folder: Path, sizes: list[int]) -> tuple[Job, ...]:
    return tuple(Job(folder / f"{i}.h5", folder / "out" / str(i), size) for i, size in enumerate(sizes))


def _write(path: Path, num_events: int) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_recording(recording_of_events(make_events(num_events)), path)
    return path


@pytest.mark.parametrize(
    ("environment", "share"),
    [
        ({}, Share()),
        ({"RANK": "2", "WORLD_SIZE": "4"}, Share(2, 4)),
        ({"SLURM_PROCID": "1", "SLURM_NTASKS": "8"}, Share(1, 8)),
        ({"SLURM_ARRAY_TASK_ID": "5", "SLURM_ARRAY_TASK_COUNT": "4", "SLURM_ARRAY_TASK_MIN": "3"}, Share(2, 4)),
        (
            {"SLURM_ARRAY_TASK_ID": "1", "SLURM_ARRAY_TASK_COUNT": "3", "SLURM_PROCID": "0", "SLURM_NTASKS": "1"},
            Share(1, 3),
        ),
        ({"RANK": "0", "WORLD_SIZE": "1", "SLURM_PROCID": "3", "SLURM_NTASKS": "4"}, Share(0, 1)),
    ],
)
def test_a_process_knows_its_part(environment: dict[str, str], share: Share):
    assert this_share(environment) == share


@pytest.mark.parametrize("rank", ["4", "-1", "one"])
def test_a_part_that_is_none_is_refused(rank: str):
    with pytest.raises(EtnetError, match=f"RANK is {rank}"):
        this_share({"RANK": rank, "WORLD_SIZE": "4"})


def test_work_is_dealt_by_size_and_every_job_once(tmp_path):
    jobs = _jobs(tmp_path, [100, 1, 1, 1, 50, 49, 0])
    shares = [dealt(jobs, Share(rank, 2)) for rank in range(2)]
    assert sorted(job.folder.name for share in shares for job in share) == sorted(job.folder.name for job in jobs)
    assert shares[0][0].nbytes == 100
    assert abs(sum(job.nbytes for job in shares[0]) - sum(job.nbytes for job in shares[1])) <= 2
    assert dealt(jobs, Share(0, 2)) == dealt(tuple(reversed(jobs)), Share(0, 2))


def test_folders_are_gone_through_and_the_output_is_left_out(tmp_path):
    first, second = _write(tmp_path / "a" / "one.h5", 50), _write(tmp_path / "a" / "deep" / "one.h5", 50)
    (tmp_path / "a" / "text").mkdir()
    (tmp_path / "a" / "text" / "events.txt").write_text("0.1 1 1 1\n")
    (tmp_path / "a" / "notes.md").write_text("no recording")
    _write(tmp_path / "a" / "out" / "one" / "made.h5", 50)
    found = recordings_in((tmp_path / "a", first), tmp_path / "a" / "out")
    assert set(found) == {first, second, tmp_path / "a" / "text"}
    jobs = jobs_of(found, tmp_path / "out")
    assert len({job.folder for job in jobs}) == 3
    assert all(job.folder.name.startswith(("one-", "text")) for job in jobs)
    (tmp_path / "empty").mkdir()
    with pytest.raises(EtnetError, match="no recording"):
        recordings_in((tmp_path / "empty",), tmp_path / "out")
    with pytest.raises(EtnetError, match="no such file"):
        recordings_in((tmp_path / "nowhere",), tmp_path / "out")


def test_what_is_done_is_not_done_again_and_a_failure_is_named_at_the_end(tmp_path, capsys):
    jobs, worked = _jobs(tmp_path, [3, 2, 1]), []

    def work(path: Path, folder: Path, told) -> int:
        worked.append(path.name)
        if path.name == "1.h5" and len(worked) <= 3:
            raise ValueError("it is broken")
        told(1.0)
        return 7

    assert run_many(jobs, Share(), "settings", work) == 1
    said = capsys.readouterr().err
    assert said.rstrip().endswith(f"{jobs[1].path}: ValueError: it is broken")
    assert "2 of 3 recordings are done, 1 failed:" in said
    assert (jobs[1].folder / many.FAILED).read_text() == "ValueError: it is broken\n"
    assert worked == ["0.h5", "1.h5", "2.h5"]
    assert run_many(jobs, Share(), "settings", work) == 0
    assert worked[3:] == ["1.h5"]
    assert not (jobs[1].folder / many.FAILED).exists()
    assert json.loads((jobs[0].folder / many.DONE).read_text())["frames"] == 7
    assert run_many(jobs, Share(), "other settings", work) == 0
    assert len(worked) == 7


def test_what_is_done_is_done_anew_when_that_is_asked(tmp_path):
    jobs, worked = _jobs(tmp_path, [3, 2]), []

    def work(path: Path, folder: Path, told) -> int:
        worked.append(path.name)
        return 1

    for anew in (False, False, True):
        assert run_many(jobs, Share(), "settings", work, anew=anew) == 0
    assert worked == ["0.h5", "1.h5"] * 2


def test_a_file_that_changed_is_done_again(tmp_path):
    job = _jobs(tmp_path, [5])[0]
    run_many((job,), Share(), "s", lambda *_: 1)
    assert is_done(job, "s")
    assert not is_done(Job(job.path, job.folder, 6), "s")
    assert not is_done(Job(job.path, job.folder, 5, mtime_ns=1), "s")
    for damaged in ("{", "[1]", "[" * 100_000, "1" * 6000, '{"settings": NaN}', b"\xff".decode("latin-1")):
        (job.folder / many.DONE).write_text(damaged)
        assert not is_done(job, "s")


def test_a_name_that_is_no_utf_8_is_done_once(tmp_path):
    path = tmp_path / "a\udcff.raw"
    path.write_bytes(b"x" * 5)
    job = Job(path, tmp_path / "out", 5)
    run_many((job,), Share(), "s", lambda *_: 1)
    assert is_done(job, "s")


def test_two_processes_never_work_on_one_recording(tmp_path, capsys):
    jobs, inner = _jobs(tmp_path, [5]), []

    def work(path: Path, folder: Path, told) -> int:
        inner.append(run_many(jobs, Share(), "s", lambda *_: pytest.fail("two at once")))
        return 1

    assert run_many(jobs, Share(), "s", work) == 0
    assert inner == [0]
    assert "another process is at it" in capsys.readouterr().err


def test_what_another_process_does_is_no_work_of_this_one(tmp_path, monkeypatch, capsys):
    jobs, now = _jobs(tmp_path, [1000, 10, 10]), 0.0
    monkeypatch.setattr(many, "Remaining", lambda total: Remaining(total, lambda: now))

    def work(path: Path, folder: Path, told) -> int:
        nonlocal now
        now += 60
        return 1

    jobs[0].folder.mkdir(parents=True)
    with claimed(jobs[0].folder / many.CLAIM):
        assert run_many(jobs, Share(), "s", work) == 0
    said = capsys.readouterr().err
    assert "[1/3] 0.h5: another process is at it" in said
    assert "[2/3] 1.h5: done; all of this process's in about 60 s" in said


def test_a_file_that_is_written_anew_is_done_again_though_its_size_is_the_same(tmp_path):
    path = _write(tmp_path / "a.h5", 50)
    (first,) = jobs_of([path], tmp_path / "out")
    run_many((first,), Share(), "s", lambda *_: 1)
    assert is_done(jobs_of([path], tmp_path / "out")[0], "s")
    os.utime(path, ns=(1, path.stat().st_mtime_ns + 1))
    assert not is_done(jobs_of([path], tmp_path / "out")[0], "s")


def test_the_time_that_the_rest_takes_holds_at_a_steady_speed():
    now = 100.0
    remaining = Remaining(1000, lambda: now)
    assert remaining.seconds() is None
    now = 110.0
    assert remaining.seconds(0.5, 200) == pytest.approx(90)
    remaining.done = 200
    now = 120.0
    assert remaining.seconds() == pytest.approx(80)
    assert [in_words(s) for s in (0.2, 45, 600, 9000)] == ["1 s", "45 s", "10 min", "2.5 h"]


def test_a_line_a_minute_says_how_far_it_is(tmp_path, capsys):
    now = 0.0
    remaining = Remaining(100, lambda: now)
    telling = many._Telling("[1/1] a.h5", _jobs(tmp_path, [100])[0], remaining)
    telling(0.1)
    assert capsys.readouterr().err == ""
    now = 61.0
    telling(0.5)
    telling(0.6)
    assert capsys.readouterr().err == "[1/1] a.h5: 50%; all of this process's in about 61 s\n"


def _setting(tmp_path: Path, num: int, num_events: int = 400) -> list[str]:
    for i in range(num):
        _write(tmp_path / "in" / f"r{i}.h5", num_events + 10 * i)
    save_weights(build_model("tiny"), tmp_path / "tiny.safetensors")
    out, weights = str(tmp_path / "out"), str(tmp_path / "tiny.safetensors")
    return ["reconstruct", str(tmp_path / "in"), "--out", out, "--model", weights, "--windows", "count=100"]


def test_the_command_makes_a_folder_for_each_recording(tmp_path, capsys):
    line = _setting(tmp_path, 2)
    (tmp_path / "in" / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n and no more")
    assert main(line) == 1
    assert "2 of 3 recordings are done, 1 failed:" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "out" / "r1").iterdir()} >= {
        "frames",
        "stamps.csv",
        "video.mp4",
        "done.json",
    }
    before = (tmp_path / "out" / "r0" / "video.mp4").stat().st_mtime_ns
    assert main(line) == 1
    assert (tmp_path / "out" / "r0" / "video.mp4").stat().st_mtime_ns == before


@pytest.mark.slow
def test_of_four_processes_one_is_killed_and_started_again(tmp_path):
    line = _setting(tmp_path, 8, num_events=8_000)

    def start(rank: int) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "RANK": str(rank), "WORLD_SIZE": "4", "OMP_NUM_THREADS": "1"}
        return subprocess.Popen([sys.executable, "-m", "etnet", *line], env=environment, stderr=subprocess.PIPE)

    processes = [start(rank) for rank in range(4)]
    ends = time.monotonic() + 120
    while not list((tmp_path / "out").glob("*/frames/*.png")) and time.monotonic() < ends:
        time.sleep(0.05)
    processes[3].send_signal(signal.SIGKILL)
    processes[3].communicate(timeout=30)
    assert processes[3].returncode == -signal.SIGKILL
    again = start(3)
    said = [process.communicate(timeout=240)[1].decode() for process in (*processes[:3], again)]
    assert [process.returncode for process in (*processes[:3], again)] == [0, 0, 0, 0]
    done = [json.loads(path.read_text()) for path in (tmp_path / "out").glob("*/done.json")]
    assert sorted(each["recording"] for each in done) == [f"r{i}.h5" for i in range(8)]
    for folder in (tmp_path / "out").iterdir():
        frames = len(list((folder / "frames").glob("*.png")))
        assert frames == len((folder / "stamps.csv").read_text().splitlines()) - 1
        assert frames == json.loads((folder / "done.json").read_text())["frames"]
    assert all("2 of 8 recordings are this process's" in text for text in said)
