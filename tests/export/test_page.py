import base64
import dataclasses
import hashlib
import html
import json
import re

import cv2
import numpy as np
import pytest

from etnet.errors import Cancelled, EtnetError
from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.export.page import PageConfig, json_in_script, render_page, write_page
from etnet.export.page_attention import chosen_sites, query_pixels
from etnet.export.page_content import event_shift, gather, pack_events, thinned
from etnet.export.take import Take
from etnet.playback.playback import Playback
from etnet.windows import BetweenFrames, ByCount, ByDuration, plan_windows
from tests.export.recordings_made_up import NUM_WINDOWS, made_up_model, made_up_recording, made_up_take

HOSTILE = "</script><script>alert('&\"\u2028')</script><!-- {{data}} {{policy}}"
CONFIG = PageConfig("a page", query_grid=(3, 2))


def element(page: str, name: str) -> str:
    found = re.search(rf'<script type="[^"]+" id="{name}">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return found[1]


def test_what_goes_in_comes_out_of_the_page_again():
    content = gather(made_up_take(), BetweenFrames(), CONFIG)
    page = render_page(content)
    assert json.loads(element(page, "page-facts")) == json.loads(json.dumps(content.facts))
    assert base64.b64decode(element(page, "page-data")) == content.data
    assert sum(sum(lengths) for _, lengths in content.facts["streams"]) == len(content.data)


def test_a_hostile_name_stays_text():
    recording = dataclasses.replace(made_up_recording(HOSTILE), format=HOSTILE)
    page = render_page(gather(made_up_take(recording=recording), BetweenFrames(), PageConfig(HOSTILE)))
    assert page.count("<script") == 3
    assert page.count("</script>") == 3
    assert html.escape(HOSTILE) in page
    assert json.loads(element(page, "page-facts"))["title"] == HOSTILE
    assert not set("<>&\u2028") & set(json_in_script({"title": HOSTILE}))


def test_the_policy_allows_this_script_and_style_alone_and_no_address():
    page = render_page(gather(made_up_take(0, 1), BetweenFrames(), CONFIG))
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', page)
    assert policy is not None
    rules = dict(rule.split(" ", 1) for rule in html.unescape(policy[1]).split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data: blob:"
    for rule, tag in (("script-src", "script"), ("style-src", "style")):
        text = re.search(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        assert text is not None
        digest = base64.b64encode(hashlib.sha256(text[1].encode()).digest()).decode()
        assert rules[rule] == f"'sha256-{digest}'"
    own = page.replace(element(page, "page-data"), "")
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import|\bfetch\(|XMLHttpRequest|innerHTML|eval\(", own)


def test_events_are_packed_so_that_they_can_be_read_again():
    rng = np.random.default_rng(1)
    sensor = Sensor(2048, 1536)
    x, y = rng.integers(0, 2048, 99).astype(np.uint16), rng.integers(0, 1536, 99).astype(np.uint16)
    t, p = np.sort(rng.integers(0, 1_000, 99)), rng.choice(np.array([-1, 1], np.int8), 99)
    words = pack_events(Events(x, y, t, p, sensor), 0, 1_000)
    assert np.array_equal(words >> 21, x)
    assert np.array_equal(words >> 10 & 2047, y)
    assert np.abs((words >> 1 & 511) / 512 * 1_000 - t).max() < 2
    assert np.array_equal(words & 1, p > 0)
    assert [event_shift(Sensor(side, 4)) for side in (2048, 2049, 4096, 65_536)] == [0, 1, 1, 5]


def test_thinning_keeps_some_of_every_part_in_order():
    events = made_up_recording().read(0, 1500)
    few = thinned(events, 300)
    assert len(few) == 300
    places = np.searchsorted(events.t, few.t)
    assert (np.diff(places) >= 0).all()
    assert np.histogram(places, 10, (0, 1500))[0].min() >= 25
    assert len(thinned(events, 5000)) == 1500


def test_attention_sheets_hold_a_map_for_each_site_and_query():
    content = gather(made_up_take(), BetweenFrames(), CONFIG)
    about = content.facts["attention"]
    assert [site["name"] for site in about["sites"]] == [
        f"scale{scale}.{part}" for scale in (3, 2, 1) for part in ("encoder.2.self", "decoder.1.cross")
    ]
    streams = dict(content.facts["streams"])
    start = sum(sum(n) for name, n in content.facts["streams"][: list(streams).index("attention")])
    sheet = np.frombuffer(content.data[start : start + streams["attention"][0]], np.uint8)
    size = (6 * about["rows"], 6 * about["columns"])
    assert cv2.imdecode(sheet, cv2.IMREAD_UNCHANGED).shape == (*size, 4)
    assert len(about["read"]) == len(streams["attention"]) == NUM_WINDOWS
    assert all(1 <= read <= about["rows"] * about["columns"] for row in about["read"] for read in row)


def test_query_pixels_lie_in_the_middles_of_equal_parts():
    assert query_pixels(Sensor(240, 180), (2, 2)) == ((60, 45), (180, 45), (60, 135), (180, 135))
    assert len(query_pixels(Sensor(3, 2), (6, 4))) == 6


def test_sites_are_the_last_of_each_kind_and_scale():
    sites = ["scale2.encoder.0.self", "scale2.encoder.1.self", "scale1.decoder.0.self", "scale1.decoder.0.cross"]
    assert chosen_sites(sites) == ("scale2.encoder.1.self", "scale1.decoder.0.cross")


def test_a_recording_without_a_camera_makes_a_page_too(tmp_path):
    recording = recording_of_events(made_up_recording().read(0, 900), "no camera")
    take = Take.of(Playback(made_up_model(), recording, plan_windows(recording, ByCount(300))))
    content = gather(take, ByCount(300), CONFIG)
    assert not content.facts["hasCamera"]
    assert content.facts["ssim"] == [None] * 3
    assert "NaN" not in render_page(content)


def test_each_model_gets_a_lane():
    other = made_up_model()
    other.card = {"title": "the other"}
    told: list[tuple[int, int]] = []
    content = gather(
        made_up_take(), BetweenFrames(), CONFIG, (other,), progress=lambda done, total: told.append((done, total))
    )
    assert content.facts["lanes"] == ["tiny", "the other"]
    assert told == [(i + 1, 2 * NUM_WINDOWS) for i in range(2 * NUM_WINDOWS)]


def test_a_page_keeps_to_its_budget_by_thinning_events_and_maps(tmp_path):
    recording = made_up_recording(sensor=Sensor(240, 180), num_windows=24)
    take = made_up_take(recording=recording)
    size = write_page(take, BetweenFrames(), tmp_path / "p.html", PageConfig("p", budget_bytes=2_000_000))
    assert size == (tmp_path / "p.html").stat().st_size <= 2_000_000
    with pytest.raises(EtnetError, match="--range"):
        write_page(take, BetweenFrames(), tmp_path / "q.html", PageConfig("q", budget_bytes=1_000_000))
    assert [path.name for path in tmp_path.iterdir()] == ["p.html"]


@pytest.mark.parametrize(("num_windows", "told_at_most"), [(600, 0), (11_000, 0), (48, 30)])
def test_what_does_not_fit_a_page_is_said_as_soon_as_that_is_known(num_windows, told_at_most):
    """All windows were rendered and kept before; where their numbers alone fill the page it was a ZeroDivisionError."""
    sensor = Sensor(240, 180) if num_windows == 48 else Sensor(16, 16)
    recording = made_up_recording(sensor=sensor, num_windows=min(num_windows, 24))
    windows = plan_windows(recording, ByDuration(max(1, recording.span.duration // num_windows)))
    take, told = Take.of(Playback(made_up_model(), recording, windows)), []
    config = PageConfig("p", budget_bytes=1_000_000)
    with pytest.raises(EtnetError, match=r"windows do not fit in 1 MB.* --range"):
        gather(take, BetweenFrames(), config, progress=lambda done, _: told.append(done))
    assert len(told) <= told_at_most < len(take)


def test_a_cancelled_page_leaves_no_file(tmp_path):
    with pytest.raises(Cancelled):
        write_page(made_up_take(), BetweenFrames(), tmp_path / "p.html", CONFIG, is_cancelled=lambda: True)
    assert list(tmp_path.iterdir()) == []
