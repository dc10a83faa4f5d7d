"""What the containers of ROS messages have in common: a message, and the topics that are there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from etnet.events.assumptions import Progress

MOST_TOPICS = 4096
"""Topics of a recording that are told apart."""


class Message(NamedTuple):
    """One message as it was recorded."""

    topic: str
    type: str
    content: bytes
    fraction: float
    is_cdr: bool
    """Whether it is serialised as in ROS 2; else as in ROS 1, whose bags can be packed into MCAP as they are."""


class CutOff(ValueError):
    """The container ends within a record, or holds what no recorder writes."""


def plain_type(name: str) -> str:
    """ "dvs_msgs/msg/EventArray" and "dvs_msgs/EventArray" are one type."""
    return name.replace("/msg/", "/")


@dataclass
class Contents:
    """Which messages are wanted, and which topics there are. `tick` is told the fraction read and may raise to stop."""

    wants: Callable[[str], bool]
    tick: Progress
    topics: dict[str, str] = field(default_factory=dict)
    """Type of each topic, the wanted and the others."""
    is_indexed: bool = True
    """Whether the container was closed as it should be."""

    def note(self, topic: str, kind: str) -> bool:
        """Take in a topic; whether its messages are wanted."""
        if len(self.topics) >= MOST_TOPICS and topic not in self.topics:
            raise CutOff(f"more than {MOST_TOPICS} topics")
        self.topics[topic] = plain_type(kind)
        return self.wants(plain_type(kind))
