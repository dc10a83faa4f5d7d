"""Made-up frames of viser's protocol: sound ones, damaged ones, and ones that no page sends. Deterministic by seed."""

import random

import msgspec
from viser import _messages

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, -5], "fov": 1.0, "near": 0.01,
    "far": 100.0, "image_height": 900, "image_width": 1600, "look_at": [0, 0, 0], "up_direction": [0, -1, 0],
}  # fmt: skip
CLICK = {
    "type": "SceneNodeClickMessage", "name": "/frame", "instance_index": None, "ray_origin": [0, 0, 0],
    "ray_direction": [0, 0, 1], "screen_pos": [0.5, 0.5], "modifier": None, "owner": "",
}  # fmt: skip
STORED = {"type": "LocalStorageGetItemResponseMessage", "value": None, "error": None, "request_uuid": "r"}
ODD = (
    None, True, -1, 0, 1e308, float("nan"), float("inf"), 2**63, -(2**63), "", "x" * 70_000, "NaN", [], {}, [[]],
    [None] * 9,
    {"value": 1}, b"", b"\xff" * 100, [1e400] * 4, "0", "|||", "link|", "pick|pixel|nan|nan|1", "hello|9|9|9|9",
)  # fmt: skip
TYPES = tuple(sorted({kind.__name__ for kind in _messages.Message.get_subclasses()}))


def sound(uuids):
    """Messages that a page of ours sends."""
    first = uuids[0] if uuids else "none"
    return (
        CAMERA, CLICK, STORED, {"type": "CommandTriggerMessage", "uuid": "c"},
        *({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 1}} for uuid in (*uuids, first)),
    )  # fmt: skip


def frames(count, seed, uuids=()):
    """`count` frames, bytes or text."""
    rng = random.Random(seed)
    bases = sound(uuids)
    for _ in range(count):
        yield _frame(rng, rng.choice(bases), uuids)


def _frame(rng, base, uuids):
    message = dict(base)
    for _ in range(rng.randrange(3)):
        what = rng.randrange(6)
        name = rng.choice(list(message))
        if what == 0:
            message[name] = rng.choice(ODD)
        elif what == 1:
            del message[name]
            if not message:
                message = {"type": "GuiFormDirtyMessage", "uuid": "x" * 1000}
        elif what == 2:
            message["type"] = rng.choice(TYPES)
        elif what == 3:
            message[rng.choice(("extra", "props", "__class__", "excluded_self_client", "uuid"))] = rng.choice(ODD)
        elif what == 4:
            message["uuid"] = rng.choice((*uuids, "unknown"))
            message["updates"] = {rng.choice(("value", "visible", "props", "update_cb")): rng.choice(ODD)}
        else:
            depth = rng.choice((1, 30, 3000))
            value = []
            for _ in range(min(depth, 200)):
                value = [value]
            message[name] = value
    try:
        raw = msgspec.msgpack.encode(message)
    except (OverflowError, ValueError, RecursionError, TypeError):
        raw = b"\xdc\xff\xff"
    fate = rng.randrange(12)
    if fate == 0:
        return raw[: rng.randrange(len(raw) + 1)]
    if fate == 1:
        place = rng.randrange(max(len(raw), 1))
        return raw[:place] + bytes([rng.randrange(256)]) + raw[place + 1 :]
    if fate == 2:
        return rng.choice(("text", "", "{}"))
    if fate == 3:
        return rng.choice((b"", b"\x91" * 100_000, b"\xdf\xff\xff\xff\xff", b"\xa4\xed\xa0\x80x", rng.randbytes(60)))
    return raw
