"""What an open recording keeps alive: nothing of who opened it."""

import gc
import weakref

import pytest

from etnet.bundled import samples
from etnet.events.open import open_recording


class Listener:
    def __init__(self):
        self.shares = []

    def __call__(self, share):
        self.shares.append(share)


@pytest.fixture(params=["h5", "npz", "txt"])
def file(request, tmp_path):
    if request.param == "h5":
        return samples()[0]
    from etnet.events.write import write_recording

    if request.param == "npz":
        write_recording(open_recording(samples()[0]), tmp_path / "own.npz")
        return tmp_path / "own.npz"
    (tmp_path / "own.txt").write_text(
        "8 6\n" + "".join(f"{i / 1000:.6f} {i % 8} {i % 6} {i % 2}\n" for i in range(900))
    )
    return tmp_path / "own.txt"


def test_who_was_told_how_far_the_opening_is_is_not_held_by_what_was_opened(file):
    listener = Listener()
    held = weakref.ref(listener)
    recording = open_recording(file, progress=listener)
    assert listener.shares[-1] == 1.0
    del listener
    gc.collect()
    assert held() is None
    assert len(recording.read(0, 10)) == 10
