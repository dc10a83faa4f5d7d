"""Triggers that a driver publishes on a topic of their own, as a stamp or a header: `…/trigger`.

The packets of event_camera_msgs hold theirs among the events. A message of no more than a stamp tells neither edge nor
input: each topic is an input, in the order of their names.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np

from etnet.events.formats.base import Remarks
from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.ros.containers import Message, plain_type
from etnet.events.formats.ros.messages import Cursor
from etnet.events.formats.trigger_table import MOST_TRIGGERS, TriggerTable
from etnet.events.recording import Span
from etnet.events.triggers import Triggers

_STAMPS = ("std_msgs/Time", "builtin_interfaces/Time")
_HEADERS = ("sensor_msgs/TimeReference", "std_msgs/Header")
STAMPED = _STAMPS + _HEADERS
_CLOCK_GAP = 60 * 10**6
"""µs between triggers and events beyond which their clocks cannot be one."""


def is_trigger_topic(topic: str) -> bool:
    """By its name: a stamp may tell of anything."""
    return "trigger" in topic.lower()


@dataclass
class TopicTriggers:
    """Stamps (ns) as they pass, by topic."""

    stamps: dict[str, list[int]] = field(default_factory=dict)
    num_damaged: int = 0

    def take(self, message: Message) -> None:
        """Keep the stamp of a message on a topic of triggers."""
        if not is_trigger_topic(message.topic):
            return
        kept = self.stamps.setdefault(message.topic, [])
        try:
            if len(kept) < MOST_TRIGGERS:
                kept.append(_stamp(message))
        except (ValueError, struct.error):
            self.num_damaged += 1

    def triggers(self, span: Span, topics: dict[str, str], remarks: Remarks) -> Triggers | None:
        """All of them, unless they are on another clock than the events; what is not read is said."""
        for topic, kind in sorted(topics.items()):
            if is_trigger_topic(topic) and kind not in STAMPED:
                remarks.detected(f"topic {topic} ({kind}) is not read; triggers are, as {', '.join(STAMPED)}")
        if self.num_damaged:
            remarks.repaired(f"{self.num_damaged} damaged messages of triggers were left out")
        table = TriggerTable()
        for number, (topic, stamps) in enumerate(sorted(self.stamps.items())):
            micros = from_nanoseconds(np.array(stamps, np.int64))
            if len(micros) == 0:
                continue
            if micros.min() > span.stop + _CLOCK_GAP or micros.max() < span.start - _CLOCK_GAP:
                remarks.detected(f"{len(micros)} triggers of {topic} are on another clock than the events: not shown")
                continue
            remarks.detected(f"input {number} are the triggers of topic {topic}")
            table.add(micros, number, 0)
        return table.triggers(remarks)


def _stamp(message: Message) -> int:
    cursor = Cursor(message.content, message.is_cdr)
    if plain_type(message.type) in _STAMPS:
        return cursor.number("I") * 10**9 + cursor.number("I")
    return cursor.header()
