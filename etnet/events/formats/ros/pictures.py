"""The pictures in a ROS recording: where several cameras are in it, those of the one that the events come from."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache, Scratch
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks
from etnet.events.formats.bounds import MAX_PIXELS
from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.frames import Frames, attached
from etnet.events.formats.ros.containers import Message, plain_type
from etnet.events.formats.ros.image_messages import (
    COMPRESSED_IMAGES,
    Picture,
    UnreadPicture,
    parse_compressed,
    parse_picture,
)
from etnet.events.recording import GroundTruth, Span

_CLOCK_GAP = 60 * 10**6
"""µs between frames and events beyond which their clocks cannot be one."""

_NO_CAMERA = ("render", "depth", "mask", "flow", "event_image", "accumulate", "segment", "debug")
"""Parts of the names of pictures that were computed."""


@dataclass
class _Topic:
    """The pictures of one topic; all are as large as the first."""

    frames: FrameCache
    shape: tuple[int, ...]
    is_bgr: bool = False
    stamps: list[int] = field(default_factory=list)

    def keep(self, picture: Picture) -> bool:
        """Whether it is like the others."""
        if picture.pixels.shape != self.shape:
            return False
        self.is_bgr = picture.is_bgr
        self.frames.append(picture.pixels)
        self.stamps.append(picture.stamp)
        return True


@dataclass
class Pictures:
    """Pictures as they pass. Until the topic of the events is known those of every topic are kept, then of the nearest.

    A topic of which no picture can be read, such as one of depths, is none.
    """

    scratch: Scratch
    event_topic: str = ""
    topics: dict[str, _Topic] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)
    num_left: Counter[str] = field(default_factory=Counter)
    unread: dict[str, Counter[str]] = field(default_factory=dict)
    """Of each topic, how many pictures there are in a form that is not read."""
    wanted: str = ""
    """The one topic whose pictures a person wants."""
    max_pixels: int = MAX_PIXELS

    def take(self, message: Message) -> None:
        """Keep a picture, if its topic may be the one."""
        if message.topic in self.others or (self.wanted and message.topic != self.wanted):
            if message.topic not in self.others:
                self.others.append(message.topic)
            return
        try:
            picture = self._parsed(message)
        except UnreadPicture as slip:
            self.unread.setdefault(message.topic, Counter())[str(slip)] += 1
            return
        except (ValueError, IndexError, struct.error, cv2.error, RecordingError):
            self.num_left[message.topic] += 1
            return
        if message.topic not in self.topics:
            file = f"frames.{len(self.topics) + len(self.others)}"
            self.topics[message.topic] = _Topic(FrameCache(self.scratch, file), picture.pixels.shape)
            self.belong_to(self.event_topic)
        topic = self.topics.get(message.topic)
        if topic is not None and not topic.keep(picture):
            self.num_left[message.topic] += 1

    def _parsed(self, message: Message) -> Picture:
        if plain_type(message.type) in COMPRESSED_IMAGES:
            return parse_compressed(message.content, message.is_cdr, self.max_pixels)
        return parse_picture(message.content, message.is_cdr)

    def belong_to(self, event_topic: str) -> None:
        """Drop the pictures of all topics but the one nearest to that of the events; of equals the first stays."""
        self.event_topic = event_topic
        if not event_topic or len(self.topics) < 2:
            return
        nearest = max(self.topics, key=lambda topic: (_nearness(topic, event_topic), _likeness(topic)))
        for topic in [topic for topic in self.topics if topic != nearest]:
            self.others.append(topic)
            self.topics.pop(topic).frames.drop()

    def ground_truth(self, span: Span, remarks: Remarks) -> GroundTruth | None:
        """The frames, unless they are on another clock than the events; and what there was to choose."""
        name, topic = next(iter(self.topics.items()), ("", None))
        self._say_unread(name, remarks)
        num_left = self.num_left.total() if topic is None else self.num_left[name]
        if num_left:
            remarks.repaired(f"{num_left} pictures that are damaged or of another size than the first were left out")
        if topic is None:
            if self.wanted:
                others = ", ".join(sorted(self.others)) or "none"
                remarks.detected(f"no pictures of topic {self.wanted} could be read; others with pictures: {others}")
            return None
        if self.others:
            others = ", ".join(sorted(self.others))
            remarks.detected(f"pictures of topic {name}; not shown are those of {others} (--topic ,NAME chooses)")
        stamps = from_nanoseconds(np.array(topic.stamps, np.int64))
        if stamps.min() > span.stop + _CLOCK_GAP or stamps.max() < span.start - _CLOCK_GAP:
            remarks.detected(f"{len(stamps)} pictures of {name} are on another clock than the events: not shown")
            return None

        size = Sensor(topic.shape[1], topic.shape[0])
        frames = Frames(stamps, "us", topic.frames.__getitem__, size, topic.is_bgr)
        return attached(frames, span, "us", f"pictures of {name}", remarks)

    def _say_unread(self, shown: str, remarks: Remarks) -> None:
        for topic, kinds in self.unread.items():
            if not shown or topic == shown:
                for kind, count in kinds.items():
                    remarks.detected(f'{count} pictures of {topic} in "{kind}", which is not read')


def _likeness(topic: str) -> tuple[int, bool]:
    """How likely a topic holds a camera's own pictures by its name; of the same ones those that are not compressed."""
    path = topic.removesuffix("/compressed")
    name = path.rsplit("/", 1)[-1].lower()
    if any(word in topic.lower() for word in _NO_CAMERA):
        return 0, path == topic
    return 2 if name == "image_raw" else 1, path == topic


def _nearness(topic: str, event_topic: str) -> int:
    """How many namespaces the two have in common: of /davis/left/events and /davis/left/image_raw two, and the root."""
    pairs = zip(topic.split("/")[:-1], event_topic.split("/")[:-1], strict=False)
    differs = [ours != theirs for ours, theirs in pairs]
    return differs.index(True) if True in differs else len(differs)
