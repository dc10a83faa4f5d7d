"""HTML as a test reads it."""

import re
from base64 import b64decode
from html.parser import HTMLParser

import numpy as np

PICK = 'data-pick="1"'
VOID = {"img", "br", "rect", "path", "hr", "input", "meta", "link"}


class Checker(HTMLParser):
    """Collects tags and attributes; fails on tags that do not close in order."""

    def __init__(self, html):
        super().__init__()
        self.open, self.tags, self.text = [], [], ""
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data + " "

    @property
    def keys(self):
        return [attrs["data-k"] for _, attrs in self.tags if "data-k" in attrs]

    def by_testid(self, name):
        return [attrs for _, attrs in self.tags if attrs.get("data-testid") == name]


def map_values(html):
    """The numbers that each large map of some HTML carries for the pointer."""
    return [np.frombuffer(b64decode(found), "<f4") for found in re.findall('data-etv-values="([^"]+)"', html)]
