"""Parts of an HTTP request, parsed strictly: what is not exactly a host, an origin or a path is none."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple
from urllib.parse import SplitResult, parse_qsl, urlsplit

from websockets.datastructures import Headers

LONGEST_PATH = 8000
MOST_QUERIES = 32
LONGEST_COOKIES = 8000
_HOST = re.compile(r"(\[[0-9a-f:.]{2,45}\]|[a-z0-9](?:[a-z0-9.-]{0,252}[a-z0-9])?)(?::([0-9]{1,5}))?")
_DEFAULT_PORTS = {"http": 80, "https": 443}


class RequestError(ValueError):
    """A request that no browser sends; it is answered with 400."""


class Host(NamedTuple):
    """A host and its port (`None`: the scheme's own)."""

    name: str
    port: int | None


class Origin(NamedTuple):
    """Where a page comes from, with the port that its scheme implies."""

    scheme: str
    name: str
    port: int | None


def the_only(headers: Headers, name: str) -> str | None:
    """The value of a header that may stand once; `None` where it does not stand.

    Raises:
        RequestError: it stands more often.
    """
    values: Sequence[str] = headers.get_all(name)
    if len(values) > 1:
        raise RequestError(f"{name} stands {len(values)} times")
    return values[0] if values else None


def host_of(text: str) -> Host | None:
    """A Host header, or the part of an address between its scheme and its path; `None` for anything else."""
    found = _HOST.fullmatch(text.lower())
    if found is None or (found[2] is not None and int(found[2]) > 65_535):
        return None
    return Host(found[1], None if found[2] is None else int(found[2]))


def origin_of(text: str) -> Origin | None:
    """A page's origin, from an Origin header or from an address; `None` for "null" and all that is none."""
    scheme, mark, rest = text.partition("://")
    scheme = scheme.lower()
    host = host_of(rest)
    if not mark or scheme not in _DEFAULT_PORTS or host is None:
        return None
    return Origin(scheme, host.name, host.port or _DEFAULT_PORTS[scheme])


def public_origin(address: str) -> Origin | None:
    """The origin that a public URL names; `None` where it is no address of the web, or one below the root."""
    try:
        parts = urlsplit(address)
    except ValueError:
        return None
    if parts.path not in ("", "/") or parts.query or parts.fragment:
        return None
    return origin_of(f"{parts.scheme}://{parts.netloc}")


def url_of(path: str) -> SplitResult:
    """A request's path and query.

    Raises:
        RequestError: it is too long, or no path.
    """
    if len(path) > LONGEST_PATH or not path.startswith("/"):
        raise RequestError("a path that is too long, or none")
    try:
        # A path may begin with two slashes, which would read as a host.
        return urlsplit("http://viewer" + path)
    except ValueError:
        raise RequestError("a path that cannot be read") from None


def query_of(url: SplitResult) -> dict[str, str]:
    """The query's fields; of a field that stands twice the last.

    Raises:
        RequestError: there are too many.
    """
    try:
        return dict(parse_qsl(url.query, max_num_fields=MOST_QUERIES))
    except ValueError:
        raise RequestError("too many fields in the address") from None


def cookies_of(headers: Headers, name: str) -> Iterator[str]:
    """The values of all cookies of this name. Whatever others set on this host, or on one above it, is passed over."""
    for header in headers.get_all("Cookie"):
        for cookie in header[:LONGEST_COOKIES].split(";"):
            given, mark, value = cookie.partition("=")
            if mark and given.strip() == name:
                yield value.strip().removeprefix('"').removesuffix('"')
