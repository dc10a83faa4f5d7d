"""What draws a page is imported before the first page asks for it; torch is not."""

import subprocess
import sys

PROGRAM = """
import sys
from app.session.ready import get_ready
from app.views import VIEWS
get_ready(VIEWS)
before = set(sys.modules)
assert "torch" not in before
import app.session.session
for view in VIEWS:
    view.make_panel(None) if view.name in ("events", "voxels") else None
print(sorted(name for name in set(sys.modules) - before if name.startswith("app.")))
"""


def test_a_page_finds_everything_imported():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
