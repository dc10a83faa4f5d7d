"""A view of one's own: what its file may define, what it may return, and how its errors are shown."""

import asyncio
import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.config import ConfigError, ViewerConfig
from app.engine.jobs import JobResult
from app.main import Viewer
from app.views import VIEWS
from app.views.own.html import error_html, own_html
from app.views.own.jobs import StepJob
from app.views.own.load import OwnViewError, own_views
from app.views.own.values import Html, Plot, Table
from tests.app.small_loaded import loaded_of, request_of, whole
from tests.app.stand_ins import Browser, served


def _file(folder, text, name="mine.py"):
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def test_a_file_with_show_is_a_view_with_its_title_for_experts_only(tmp_path):
    (view,) = own_views([_file(tmp_path, "title = 'Row profile'\ndef show(moment):\n    return 'seen'\n")])
    assert (view.name, view.title) == ("own-row-profile", "Row profile")
    assert not view.is_public
    assert "demo" not in view.settings_in


def _modules():
    return {name for name in sys.modules if name.startswith("own_view_")}


WHOLE_VIEW = """
from __future__ import annotations
from dataclasses import dataclass
from typing import ClassVar, get_type_hints
from app.views.view import View

@dataclass(frozen=True, slots=True)
class Kept:
    view: ClassVar[str] = "mine"
    level: int = 3

get_type_hints(Kept)
VIEW = View("mine", "Mine", "PUZZLE", Kept(), lambda client: None)
"""


def test_a_file_may_be_written_as_our_own_views_are(tmp_path):
    before = _modules()
    (view,) = own_views([_file(tmp_path, WHOLE_VIEW)])
    assert (view.name, view.initial.level) == ("mine", 3)
    (name,) = _modules() - before
    assert sys.modules[name].VIEW is view


def test_two_files_of_one_name_are_two_modules_and_one_that_fails_leaves_none(tmp_path):
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        folder.mkdir()
    before = _modules()
    text = "title = {!r}\ndef show(moment):\n    return title\n"
    own_views([_file(folder, text.format(folder.name)) for folder in folders])
    made = _modules() - before
    assert {sys.modules[name].title for name in made} == {"a", "b"}
    with pytest.raises(OwnViewError):
        own_views([_file(tmp_path, "raise OSError\n", "broken.py")])
    assert _modules() - before == made


def test_a_file_by_a_relative_path_has_its_line_in_errors_too(tmp_path, monkeypatch):
    _file(tmp_path, "def show(moment):\n    return [][3]\n")
    monkeypatch.chdir(tmp_path)
    (view,) = own_views([Path("mine.py")])
    own = view.make_panel(None)._own
    with pytest.raises(IndexError) as raised:
        own.show(None)
    assert "mine.py, line 2: IndexError" in error_html(raised.value, own.path)


def test_lines_of_a_plot_share_their_x():
    drawn = own_html(Plot({"long": [0, 1, 2, 3, 4], "short": [0, 1, 2]}, x=[10, 20, 30, 40, 50]))
    long, short = ([pair.split(",")[0] for pair in points.split()] for points in re.findall('points="([^"]*)"', drawn))
    assert long[:3] == short
    assert long[-1] == "320.0"
    assert own_html(Plot({"long": range(5), "short": range(3)})).count("80.0,90.0") == 2


def test_a_function_is_a_view_too():
    def busy_pixels(moment):
        return moment.events

    (view,) = own_views([busy_pixels])
    assert view.title == "Busy pixels"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "defines neither show"),
        ("def show(moment)\n", "SyntaxError"),
        ("import no_such_module_here\n", "no_such_module_here"),
    ],
)
def test_a_file_that_is_no_view_is_refused_by_name(tmp_path, text, said):
    with pytest.raises(OwnViewError, match=said) as refused:
        own_views([_file(tmp_path, text)])
    assert "mine.py" in str(refused.value)


def test_a_file_that_is_not_there_and_two_of_one_name_are_refused(tmp_path):
    with pytest.raises(OwnViewError, match="no such file"):
        own_views([tmp_path / "none.py"])
    mine = _file(tmp_path, "def show(moment):\n    return None\n")
    with pytest.raises(OwnViewError, match="two views are called own-mine"):
        own_views([mine, mine])


def test_each_kind_of_value_is_drawn_as_what_it_is():
    assert "<img" in own_html(np.zeros((4, 6)))
    assert "<img" in own_html(np.zeros((4, 6, 3), np.uint8))
    assert "<td>ON</td><td>0.5</td>" in own_html({"ON": 0.5})
    assert own_html(Plot({"a": [0, 1, 2], "b": [2, 1, np.nan]}, x_label="x")).count("<polyline") == 2
    assert "<th>name</th>" in own_html(Table(("name",), [("<b>",)]))
    assert "&lt;b&gt;" in own_html("<b>")
    assert "<b>mine</b>" in own_html(Html("<b>mine</b>"))
    assert "Nothing to show" in own_html(None)


def test_what_cannot_be_drawn_says_what_can():
    with pytest.raises(TypeError, match="wanted an image"):
        own_html(object())
    with pytest.raises(TypeError, match="1 or 3 channels"):
        own_html(np.zeros((2, 2, 5)))


def test_an_error_names_the_users_file_and_line_and_shows_it(tmp_path):
    path = _file(tmp_path, "def show(moment):\n    return [][3]\n")
    (view,) = own_views([path])
    panel = view.make_panel(None)
    try:
        panel._own.show(None)
    except IndexError as error:
        shown = error_html(error, str(path))
    assert "mine.py, line 2: IndexError" in shown
    assert "return [][3]" in shown


@pytest.mark.parametrize("more", [{"demo": True}, {"public_url": "https://show.example"}, {"host": "0.0.0.0"}], ids=str)
def test_where_others_come_in_no_code_of_ones_own_runs(tmp_path, more):
    ran = tmp_path / "ran"
    mine = _file(tmp_path, f"open({str(ran)!r}, 'w')\ndef show(moment):\n    return None\n")
    with pytest.raises(ConfigError, match="--view runs your own code"):
        ViewerConfig(views=(mine,), **more)
    with pytest.raises(OwnViewError, match="run your code"):
        Viewer(ViewerConfig(port=0, cache="off", **more), views=[mine])
    assert not ran.exists()


def test_a_file_that_asks_for_a_probe_gets_the_whole_step_of_its_window(tmp_path):
    plain, probing = own_views([
        _file(tmp_path, "def show(moment):\n    return None\n", "plain.py"),
        _file(tmp_path, "probe = True\ndef show(moment):\n    return None\n", "probing.py"),
    ])  # fmt: skip
    asked = request_of(3, wants_attention=True)
    assert plain.jobs(None, asked) == {}
    ((slot, job),) = probing.jobs(None, asked).items()
    assert (slot, job) == ("own-probing.step", StepJob(request_of(3)))
    loaded = loaded_of()
    step, fast = whole(job, loaded), loaded.playback.at(3)
    assert np.array_equal(step.frame, fast.frame)
    assert step.attention.sites
    assert step.state.tensors


def test_its_code_is_given_the_step_when_it_has_come(tmp_path):
    text = """
probe = True
def show(moment):
    return f"step {moment.step}, state {moment.state}, window {moment.window.index}"
"""
    (view,) = own_views([_file(tmp_path, text)])

    class Made:
        state, attention = "carried on", None

        def __str__(self):
            return "made"

    async def story(viewer):
        async with Browser.open(viewer.port, tab=93) as browser:
            await browser.until_shown("Reconstruction of window 0")
            await browser.use(browser.widget("channel"), f"pick|tab:own-mine|0.5|0.5|{time.monotonic_ns()}")
            await browser.until_shown("step None, state None, window 0")
            asked = lambda: [job for _, slot, job in viewer.engine.jobs if slot == "own-mine.step" and job]  # noqa: E731
            await browser.until(asked)
            viewer.engine.tell("own-mine.step", JobResult(asked()[-1], Made(), 1.0, is_whole=True))
            await browser.until_shown("step made, state carried on, window 0")

    with served(views=(*VIEWS, view)) as viewer:
        asyncio.run(story(viewer))
