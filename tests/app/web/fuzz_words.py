"""Made-up words of strangers: links, stored views, channel messages, session files. Deterministic by seed."""

import base64
import json
import random
from copy import deepcopy

ODD = (
    None, True, False, -1, 0, 1, 2**70, -(2**70), 1e308, "", "x", "x" * 600, "\ud800", "NaN", [], {}, [[]],
    [1, 2, 3, 4],
    {"kind": "ByCount", "num_events": 0}, {"kind": "ByDuration"}, {"kind": "ByStamps", "stamps": []}, {"kind": []},
    {"value": {}}, [None] * 70, "../../etc/passwd", "inspect", "upload-0", "a!9999999x1", "a^1", "a~film", -0.5,
)  # fmt: skip
RAW = (
    "[" * 5_000, '{"a":' * 3_000, "9" * 5_000, '{"v":' + "1" * 5_000 + "}", "1e999", "NaN", "-Infinity", "\x00", "",
    "null", "true", '"\\ud800"', '{"a":1e400}', "{", "]", '{"views":[]}', '{"views":{"x":{}}}',
)  # fmt: skip


def damaged(value, rng):
    """The same values of JSON with a few of them replaced, taken away or added."""
    changed = json.loads(json.dumps(value))
    for _ in range(rng.randrange(1, 4)):
        place = changed
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = rng.choice(keys)
            inner = place[key]
            if isinstance(inner, dict | list) and inner and rng.random() < 0.7:
                place = inner
                continue
            if isinstance(place, dict) and rng.random() < 0.2:
                del place[key]
            else:
                place[key] = deepcopy(rng.choice(ODD))
            if isinstance(place, dict) and rng.random() < 0.2:
                place[rng.choice(("extra", "kind", "__class__", "view", "views", key))] = deepcopy(rng.choice(ODD))
            break
    return changed


def texts(value, count, seed):
    """`count` texts of JSON like `value`."""
    rng = random.Random(seed)
    for _ in range(count):
        if rng.randrange(20) == 0:
            yield rng.choice(RAW)
            continue
        text = json.dumps(damaged(value, rng))
        if rng.randrange(10) == 0:
            place = rng.randrange(max(len(text), 1))
            text = text[:place] + chr(rng.choice((0, 34, 91, 123, 125, 57, 0x1F600))) + text[place + 1 :]
        yield text


def links(value, count, seed):
    """`count` words of addresses."""
    rng = random.Random(seed)
    for text in texts(value, count, seed):
        word = base64.urlsafe_b64encode(text.encode("utf-8", "surrogatepass")).decode().rstrip("=")
        if rng.randrange(15) == 0:
            word = rng.choice((word[:-1], "é" + word, "=" * 9, word + "\x00", "%" * 50, "x" * 5_000))
        yield word


KINDS = ("pick", "key", "copied", "touch", "hello", "size", "link", "span", "nothing")
KEYS = (
    "pixel", "open:a", "workspace:inspect", "tab:x", "stage:y", "span:0,1", "goto:1", "at:1,2", "cut:0,0,1,1", "help",
    "remove:x", "set:inspect.part:x", "set:.:", "set:timeline.speed:1e9",
)  # fmt: skip


def channel_words(views, count, seed):
    """`count` texts of the page's channel; `views` are names of views."""
    rng = random.Random(seed)
    numbers = ("0", "1", "-1", "0.5", "nan", "inf", "1e400", "9" * 180, "", "x", "\ud800", "٣", "1_0")
    for _ in range(count):
        key = rng.choice((*KEYS, *(f"{view}:{rng.choice(numbers)}:{rng.choice(KEYS)}" for view in views)))
        if rng.random() < 0.3:
            place = rng.randrange(len(key) + 1)
            key = key[:place] + rng.choice((*numbers, ":", ",", ".", "|")) + key[place:]
        yield "|".join([rng.choice(KINDS), key, *(rng.choice(numbers) for _ in range(rng.randrange(5)))])
