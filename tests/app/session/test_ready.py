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


def test_a_start_loads_nothing_that_only_some_files_or_cameras_need():
    program = (
        "import sys, app.main, app.catalogue.mirror, app.web.server\n"
        "from app.session.ready import get_ready\n"
        "from app.views import VIEWS\n"
        "get_ready(VIEWS)\n"
        "rare = ('av', 'lz4', 'backports.zstd', 'etnet.simulation.video', 'etnet.live.tcp', 'etnet.live.hdf5_writer')\n"
        "print([name for name in rare if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
