"""One HTML file that shows a recording, opens from disk and asks the network for nothing."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from etnet.bundled import export_page_folder, tokens_file
from etnet.errors import EtnetError
from etnet.export.page_content import Content, PageConfig, gather
from etnet.export.take import IsCancelled, Progress, Take
from etnet.files import in_megabytes, write_atomically
from etnet.nets.base import Reconstructor
from etnet.windows import Policy

__all__ = ["PageConfig", "render_page", "write_page"]

SCRIPTS = ("data.js", "cloud.js", "pictures.js", "timeline.js", "page.js")
"""In this order they make one script; each sees the names of those before it."""
_HOLE = re.compile(r"\{\{(\w+)\}\}")
_IN_SCRIPT = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"})


def write_page(
    take: Take,
    policy: Policy,
    path: Path,
    config: PageConfig,
    other_models: Sequence[Reconstructor] = (),
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> int:
    """Write the page of a take, whole or not at all; returns its bytes.

    `other_models` get a lane each beside the take's own; attention is that of the take's model. Raises EtnetError when
    even the pictures alone do not fit the budget.
    """
    page = render_page(gather(take, policy, config, other_models, progress, is_cancelled)).encode()
    if len(page) > config.budget_bytes:
        raise EtnetError(
            f"{path.name}: comes to {in_megabytes(len(page))}, allowed are {in_megabytes(config.budget_bytes)}; "
            "take a shorter --range or allow more --megabytes"
        )
    write_atomically(path, page)
    return len(page)


def render_page(content: Content) -> str:
    """The page as text. Strings of the recording's are escaped; nothing but the page's own script may run."""
    folder = export_page_folder()
    script = "(() => {\n'use strict';\n" + "\n".join(_read(folder, name) for name in SCRIPTS) + "\n})();"
    style = tokens_file().read_text(encoding="utf-8") + _read(folder, "page.css")
    holes = {
        "policy": html.escape(content_security_policy(script, style)),
        "title": html.escape(str(content.facts["title"])),
        "style": style,
        "facts": json_in_script(content.facts),
        "data": base64.b64encode(content.data).decode("ascii"),
        "script": script,
    }
    return _HOLE.sub(lambda hole: holes[hole[1]], _read(folder, "template.html"))


def content_security_policy(script: str, style: str) -> str:
    """Nothing from anywhere; one script and one style sheet by their hashes; no markup made from strings."""
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {_hash_source(script)}",
            f"style-src {_hash_source(style)}",
            "img-src data: blob:",
            "base-uri 'none'",
            "form-action 'none'",
            "require-trusted-types-for 'script'",
            "trusted-types 'none'",
        )
    )


def json_in_script(facts: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element it stands in."""
    return json.dumps(facts, ensure_ascii=False, separators=(",", ":"), allow_nan=False).translate(_IN_SCRIPT)


def _hash_source(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _read(folder: Path, name: str) -> str:
    return (folder / name).read_text(encoding="utf-8")
