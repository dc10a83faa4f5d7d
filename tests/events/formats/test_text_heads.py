"""Event text as people and programs write it: names, comments, sizes, separators, words for numbers, and bad rows."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

EVENTS = make_events(300)
SIZE = Assumptions(width=20, height=12)
ON = EVENTS.p > 0


def rows(form: str, on="1", off="0") -> str:
    columns = zip(EVENTS.t.tolist(), EVENTS.x.tolist(), EVENTS.y.tolist(), ON.tolist(), strict=True)
    return "".join(
        form.format(i=i, t=t, s=f"{t / 1e6:.6f}", c=f"{t / 1e6:.6f}".replace(".", ","), x=x, y=y, p=on if p else off)
        + "\n"
        for i, (t, x, y, p) in enumerate(columns)
    )


def holds_events(path, content: str | bytes, assume=SIZE):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with open_recording(path, assume=assume) as recording:
        found = all_events(recording)
        for axis in "xytp":
            np.testing.assert_array_equal(getattr(found, axis), getattr(EVENTS, axis))
        return recording.sensor, "\n".join(map(str, recording.remarks))


HEADS = {
    "pandas": ",x,y,t,p\n" + rows("{i},{x},{y},{t},{p}"),
    "pandas with words": ",x,y,t,p\n" + rows("{i},{x},{y},{t},{p}", "True", "False"),
    "ON and OFF": "x,y,t_us,polarity\n" + rows("{x},{y},{t},{p}", "ON", "OFF"),
    "units in brackets": "timestamp [us];x;y;polarity\n" + rows("{t};{x};{y};{p}"),
    "seconds in brackets": "Time (s),X,Y,Polarity\n" + rows("{s},{x},{y},{p}"),
    "bracket after a blank": "timestamp [us] x y polarity\n" + rows("{t} {x} {y} {p}"),
    "quoted": '"t","x","y","p"\n' + rows('"{t}","{x}","{y}","{p}"'),
    "comments before": "# made by me\n# in May\nt,x,y,p\n" + rows("{t},{x},{y},{p}"),
    "comments after": "t,x,y,p\n# made by me\n" + rows("{t},{x},{y},{p}"),
    "names in a comment": "#!events.txt\n# created today\n# timestamp x y polarity\n" + rows("{t} {x} {y} {p}"),
    "long comments": "".join(f"# line {i} of a long head\n" for i in range(2000))
    + "t x y p\n"
    + rows("{t} {x} {y} {p}"),
    "long comments, no names": "".join(f"# line {i} of a head\n" for i in range(2000)) + rows("{s} {x} {y} {p}"),
    "Metavision": "%geometry:20,12\n" + rows("{x},{y},{p},{t}"),
    "comma and blank": "t, x, y, p\n" + rows("{t}, {x}, {y}, {p}"),
    "CRLF": ("t,x,y,p\n" + rows("{t},{x},{y},{p}")).replace("\n", "\r\n"),
    "decimal comma": "t;x;y;p\n" + rows("{c};{x};{y};{p}"),
    "decimal comma, no names": rows("{c};{x};{y};{p}"),
    "floats of pandas": "t,x,y,p\n" + rows("{t}.0,{x}.0,{y}.0,{p}.0"),
    "further words": "t,x,y,p,lens\n" + rows("{t},{x},{y},{p},wide"),
    "signs": "t x y p\n" + rows("{t} {x} {y} {p}", "+1", "-1"),
    "empty end": "t,x,y,p\n" + rows("{t},{x},{y},{p}") + ",,,\n\n",
}


@pytest.mark.parametrize("head", HEADS)
def test_heads_of_every_kind_are_understood(head, tmp_path):
    holds_events(tmp_path / "a.csv", HEADS[head])


def test_a_geometry_in_a_comment_is_the_sensor_and_bounded(tmp_path):
    sensor, _ = holds_events(tmp_path / "a.csv", HEADS["Metavision"], Assumptions())
    assert str(sensor) == "20×12"
    (tmp_path / "a.csv").write_text("%geometry:60000,60000\n" + rows("{x},{y},{p},{t}"))
    with pytest.raises(RecordingError, match="--max-pixels"):
        open_recording(tmp_path / "a.csv")


def test_a_packed_csv_opens(tmp_path):
    _, said = holds_events(tmp_path / "a.csv.gz", gzip.compress(HEADS["pandas"].encode()))
    assert "unpacked from gzip" in said


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("t,x,y,p\n" + rows("{t},{x},{y},{p}").encode().decode(), None),
        ("t,x,y,p\n1,2,3,1\n2,oops,3,1\n", 'line 3 reads "2,oops,3,1"'),
        ("t;x;y;p\n1;2;3;1\n2;3;1\n", 'line 3 reads "2;3;1"'),
        ("1 2 3 1 7\n2 2 3 0 7\n", "rows of 5 numbers and no line that names them"),
        ("t,x,y,p,q\n1,2,3,1\n", "names 5 columns"),
    ],
)
def test_what_is_wrong_is_quoted_as_it_stands(content, match, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(content)
    if match is None:
        open_recording(path).close()
        return
    with pytest.raises(RecordingError) as refusal:
        open_recording(path)
    assert match in str(refusal.value)


@pytest.mark.parametrize("mark", ["utf-16", "utf-16-be"])
def test_utf_16_is_called_by_its_name(mark, tmp_path):
    content = HEADS["pandas"].encode(mark)
    (tmp_path / "a.csv").write_bytes(content if mark == "utf-16" else b"\xfe\xff" + content)
    with pytest.raises(RecordingError, match=r"UTF-16.*UTF-8"):
        open_recording(tmp_path / "a.csv")


def test_stamps_that_are_whole_micros_printed_as_floats_are_micros(tmp_path):
    t = np.linspace(1000, 100_950, 2000).round().astype(int)
    path = tmp_path / "a.csv"
    path.write_text("t,x,y,p\n" + "".join(f"{float(a)},{i % 200}.0,{i % 150}.0,{i % 2}.0\n" for i, a in enumerate(t)))
    with open_recording(path) as recording:
        np.testing.assert_array_equal(all_events(recording).t, t)
        assert any("time unit us: in s" in remark.text for remark in recording.remarks)
