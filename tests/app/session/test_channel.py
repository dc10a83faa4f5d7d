"""What a page says beyond its widgets: each message is one intent, and a view hears what its own HTML says."""

import pytest

from app.session.channel import AskHelp, Copied, FollowLink, Hello, RemoveFile, Resized, Touched, parse
from app.state import intents as ask
from app.views import VIEWS
from app.views.attention.state import OpenSite, PinMap, StepSite, Unpin
from app.views.compare.state import AddRun, ChangeRun, RemoveRun, StartCold
from app.views.inspect.state import ResetAll, Switch
from app.views.recording.state import Trim
from app.views.scene.state import ChooseCamera
from etnet.windows import BetweenFrames, ByDuration

SITE = "scale1.encoder.0.self"
SAID = {
    "pick|pixel|0.25000|0.50000|17": ask.QueryFraction(0.25, 0.5),
    "pick|cut:10,20,40,30|0.5|0.5|1": ask.Query(30, 35),
    "pick|at:7,5|0|0|1": ask.Query(7, 5),
    "pick|span:2,6|0.25|0|1": ask.SeekTime(3.0),
    "pick|goto:1.5|0|0|1": ask.SeekTime(1.5),
    "pick|open:b|0|0|1": ask.OpenRecording("b"),
    "pick|remove:upload-1|0|0|1": RemoveFile("upload-1"),
    "pick|workspace:compare|0|0|1": ask.ShowWorkspace("compare"),
    "pick|tab:export|0|0|1": ask.OpenTab("export"),
    "pick|stage:events|0|0|1": ask.StageCard("events"),
    "pick|set:attention.head:3|0|0|1": ask.Set("attention", "head", "3", is_word=True),
    "pick|set:inspect.part:skip 1|0|0|1": ask.Set("inspect", "part", "skip 1", is_word=True),
    f"pick|attention:site:{SITE}|0.1|0.1|18": OpenSite(SITE),
    "pick|attention:pin:a|0.1|0.1|18": PinMap("a"),
    "pick|attention:pin:a:23,9|0.1|0.1|18": PinMap("a", (23, 9)),
    "pick|attention:site:+1|0|0|1": StepSite(1),
    "pick|attention:site:-1|0|0|1": StepSite(-1),
    "pick|attention:unpin:b|0|0|1": Unpin("b"),
    "pick|inspect:switch:head x 3|0|0|1": Switch("head x 3"),
    "pick|inspect:reset|0|0|1": ResetAll(),
    "pick|compare:add|0|0|1": AddRun(),
    "pick|compare:remove:1|0|0|1": RemoveRun(1),
    "pick|compare:cold:2:on|0|0|1": StartCold(2, True),
    "pick|compare:model:2:file-7:x|0|0|1": ChangeRun(2, "model_id", "file-7:x"),
    "pick|compare:model:2:main|0|0|1": ChangeRun(2, "model_id", None),
    "pick|compare:model:0:etnet-half|0|0|1": ask.ChooseModel("etnet-half"),
    "pick|compare:windows:1:milliseconds:20|0|0|1": ChangeRun(1, "policy", ByDuration(20_000)),
    "pick|compare:windows:0:camera frames|0|0|1": ask.ChoosePolicy(BetweenFrames()),
    "pick|compare:precision:1:bf16|0|0|1": ChangeRun(1, "precision", "bf16"),
    "pick|recording:trim|0|0|1": Trim(),
    "pick|scene:camera:side|0|0|1": ChooseCamera("side"),
    "pick|help|0|0|1": AskHelp(),
    "key|comma|1": ask.Move(-1),
    "key|period|1": ask.Move(1),
    "key|question|1": AskHelp(),
    "hello|300|1600|900|1": Hello(44, 1600, 900),
    "size|390|844|1": Resized(390, 844),
    "touch|1": Touched(),
    "copied|1|2": Copied(True),
    "link|abc|1": FollowLink("abc"),
}


@pytest.mark.parametrize(("text", "intent"), SAID.items(), ids=SAID)
def test_what_a_page_says_is_understood(text, intent):
    assert parse(text, VIEWS) == intent


@pytest.mark.parametrize(
    "text",
    [
        "", "pick", "pick|elsewhere|0|0|1", "pick|pixel|x|y|1", "pick|pixel|nan|inf|1", "pick|cut:1,2|0|0|1",
        "pick|cut:a,b,c,d|0|0|1", "pick|at:1|0|0|1", "pick|span:1|0|0|1", "pick|goto:x|0|0|1", "pick|pixel|0|0|9|9",
        "pick|workspace:kitchen|0|0|1", "pick|compare:remove:x|0|0|1", "pick|compare:filter:1:evil|0|0|1",
        "pick|compare:windows:1:milliseconds:nan|0|0|1", "pick|compare:windows:1:milliseconds:-3|0|0|1",
        "pick|compare:precision:0:evil|0|0|1", "pick|compare:cold|0|0|1", "pick|attention:pin:a:evil|0|0|1",
        "pick|scene:camera:under|0|0|1", "key|f13|1", "hello|a|b|c|1", "size|-1|x|1", "|" * 500,
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_nothing(text):
    assert parse(text, VIEWS) is None


def test_a_view_hears_only_its_own_name_and_only_while_it_is_one_of_the_page():
    assert parse("pick|compare:add|0|0|1", [view for view in VIEWS if view.name != "compare"]) is None
