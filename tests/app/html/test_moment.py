"""What is computed of a recording is found by its id, wherever in a key that stands."""

from dataclasses import dataclass, replace

import pytest

from app.engine.requests import FrameRequest
from app.html.moment import ARRAYS, PICTURES, forget_recording, is_about
from etnet.windows import ByCount

REQUEST = FrameRequest("upload-a", "m", "fp32", ByCount(5), 3)


@dataclass(frozen=True)
class Asked:
    """A job."""

    request: FrameRequest
    site: str = "scale1.decoder.0.cross"


KEYS = [
    ("events", "upload-a", ByCount(5), 3),
    ("frame", (*REQUEST.playback, *REQUEST.frame), "gamma"),
    ("thumbnail", *REQUEST.key),
    ("kymograph", Asked(REQUEST), 4),
    ("curve", "upload-a^4000", ByCount(5)),
    ("doctor", "upload-a!us"),
]


@pytest.mark.parametrize("key", KEYS, ids=lambda key: str(key[0]))
def test_a_key_names_its_recording_and_no_other(key):
    assert is_about(key, "upload-a")
    assert not is_about(key, "upload-b")
    assert not is_about(key, "upload")


def test_a_recording_that_goes_takes_its_pictures_and_arrays_along_and_leaves_the_others():
    theirs = ("kymograph", Asked(replace(REQUEST, recording_id="upload-b")), 4)
    for shared in (PICTURES, ARRAYS):
        for key in (*KEYS, theirs):
            shared.keep(key, "made", 4)
    forget_recording("upload-a")
    for shared in (PICTURES, ARRAYS):
        assert theirs in shared
        assert not any(key in shared for key in KEYS)
    forget_recording("upload-b")
