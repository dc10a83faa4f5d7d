"""One vocabulary of options over all commands, and what is said where there is no terminal."""

import numpy as np
import pytest
import tyro

from etnet.cli.export import Csv, Video, chosen_range
from etnet.cli.main import main, one_vocabulary
from etnet.cli.progress import LineLog, console
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import EtnetError, WindowError
from etnet.events.cleaning import Cleaning
from etnet.export.pace import pace_of
from etnet.stretch import windows_between
from etnet.windows import ByCount, plan_windows


@pytest.fixture
def file(tmp_path):
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.sort(rng.random(900)), rng.integers(0, 34, (900, 2)), rng.integers(0, 2, 900)])
    np.savetxt(tmp_path / "walk.txt", rows, fmt="%.6f %d %d %d", header="34 34", comments="")
    return tmp_path / "walk.txt"


@pytest.mark.parametrize("said", [
    ["--roi", "1,2,3,4"], ["--region", "1", "2", "3", "4"], ["--roi=1,2,3,4"], ["--region", "1,2,3,4"],
])  # fmt: skip
def test_a_region_has_one_meaning_however_it_is_said(said):
    assert tyro.cli(Opening, args=one_vocabulary(said)).region == (1, 2, 3, 4)


def test_the_version_is_told_and_a_slip_gets_the_command_that_was_meant(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("etnet ")
    assert main(["reconstuct"]) == 2
    assert "did you mean reconstruct?" in capsys.readouterr().err


SLIPS = [
    ("reconstruct a.h5 --form 1", "did you mean --from?"), ("reconstruct --liv camera", "did you mean --live?"),
    ("reconstruct --live camera --sepeed 2", "did you mean --speed?"), ("record evk4 a.h5 --rato 1 2", "--rate?"),
    ("inspect a.h5 --timeunit us", "--time-unit?"), ("convert-events a b --overwrit", "--overwrite?"),
    ("cut a b --form=1", "--from?"), ("convert a b --xyz", "etnet convert --help"),
    ("simulate a --vidoe b", "--video?"),
    ("train --confg half", "--config?"), ("train --max_updats 3", "etnet train --help"),
    ("evaluate --protokol paper", "--protocol?"), ("evaluate --no-wole", "--no-whole?"),
    ("export video a.h5 -o b --spped 2", "etnet export video: no option is called --spped; did you mean --speed?"),
    ("export vidio a.h5", "etnet export: no kind of file is called vidio; did you mean video?"),
    ("replay a.json --chck", "--check?"), ("cache --claer", "--clear?"), ("sample --xyz", "etnet sample --help"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "said"), SLIPS)
def test_a_misspelt_option_is_one_line_with_the_one_that_was_meant(line, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    assert ended.value.code == 2
    told = capsys.readouterr()
    assert len(told.err.splitlines()) == 1
    assert said in told.err
    assert not told.out


def test_the_viewer_answers_a_misspelt_option_in_the_same_way(capsys):
    from app.main import main as view

    with pytest.raises(SystemExit) as ended:
        view(["a.h5", "--demoo"])
    assert (ended.value.code, capsys.readouterr().err) == (
        2,
        "etnet-view: no option is called --demoo; did you mean --demo?\n",
    )


def test_an_export_without_a_kind_names_the_kinds_and_help_is_help(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["export", "-o", "b.mp4"])
    assert ended.value.code == 2
    assert "video, gif, frames, arrays, csv, page, session, onnx" in capsys.readouterr().err
    for asked in (["export", "--help"], ["export", "video", "--help"], ["reconstruct", "--help"]):
        with pytest.raises(SystemExit) as ended:
            main(asked)
        assert ended.value.code == 0
        assert "usage: etnet" in capsys.readouterr().out


def test_a_filter_holds_for_whatever_opens_a_recording_and_its_share_is_told(file, capsys):
    with (
        open_with_progress(file, Opening(filter="hot,50ms,2")) as filtered,
        open_with_progress(file, Opening()) as all_,
    ):
        assert filtered.num_events < all_.num_events
        assert filtered.opened_as.cleaning == Cleaning(True, 50_000, 2)
    assert "the filter hot,50ms,2 removes" in capsys.readouterr().err
    assert main(["inspect", str(file), "--filter", "5 minutes"]) == 1
    assert "the filter" in capsys.readouterr().err


def test_seconds_choose_the_windows_that_end_between_them(file):
    with open_with_progress(file, Opening()) as recording:
        windows = plan_windows(recording, ByCount(100))
        start = recording.span.start
        begin, end = ((windows[i].t_stop - start) / 1e6 for i in (1, 4))
        config = Csv(file, file.with_suffix(".csv"), begin=begin, end=end)
        assert chosen_range(config, recording, windows) == (2, 5)
        assert windows_between(windows, None, None) == range(len(windows))
        with pytest.raises(WindowError, match="one of the two"):
            chosen_range(Csv(file, file, range="0:2", begin=0.1), recording, windows)
        with pytest.raises(WindowError, match="no window"):
            chosen_range(Csv(file, file, begin=99.0), recording, windows)


def test_what_is_there_is_not_replaced_unasked(file, capsys):
    target = file.with_suffix(".csv")
    target.write_text("mine")
    assert main(["export", "csv", str(file), "-o", str(target)]) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert target.read_text() == "mine"


def test_a_rate_that_is_given_is_the_files(file):
    with open_with_progress(file, Opening()) as recording:
        windows = plan_windows(recording, ByCount(100))
    assert pace_of(windows, 1.0, frames_per_second=50.0).frames_per_second == 50
    with pytest.raises(EtnetError, match="frames a second"):
        pace_of(windows, 1.0, frames_per_second=500.0)
    assert tyro.cli(Video, args=["a.h5", "-o", "b.mp4", "--fps", "25", "--tone", "robust"]).tone == "robust"


def test_without_a_terminal_a_line_a_minute_says_how_far_it_is(capsys):
    now = [0.0]
    log = LineLog("exporting", lambda: now[0])
    for second in range(0, 181, 10):
        now[0] = float(second)
        log.tell(second, 600)
    said = capsys.readouterr().err.splitlines()
    assert not console.is_terminal
    assert said == [
        "exporting: 60 of 600, 10%, about 9 min left",
        "exporting: 120 of 600, 20%, about 8 min left",
        "exporting: 180 of 600, 30%, about 7 min left",
    ]
