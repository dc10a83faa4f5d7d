"""What a visit says of a file that has come and cannot be shown: in the names that its visitor knows."""

from types import SimpleNamespace

import pytest

from app.catalogue.recordings import Catalogue
from app.catalogue.uploads import UploadLimits, Uploads
from app.catalogue.visitor import VisitorCatalogue
from app.config import ViewerConfig
from app.session.booth import Booth
from app.session.visit import Visit
from app.state.view_state import ViewState
from app.views import VIEWS
from etnet.errors import RecordingError
from etnet.export.session_file import read_session


@pytest.fixture
def desk():
    catalogue = Catalogue(ViewerConfig())
    uploads = Uploads(UploadLimits.of_megabytes(1), catalogue.take_in, catalogue.let_go)
    own = uploads.desk()
    yield own, VisitorCatalogue(catalogue, own)
    uploads.close()
    catalogue.close()


def said_of(desk, name, content, follow):
    """What is said of a file that is handed over, and where it lies."""
    own, catalogue = desk
    transfer = own.begin(name, len(content))
    transfer.take(content)
    arrived, said = transfer.finish(), []
    client = SimpleNamespace(add_notification=lambda title, body, **how: said.append(body))
    state = ViewState()
    visit = Visit(client, catalogue, state, VIEWS, Booth(), lambda recording_id: follow(catalogue.entry(recording_id)))
    assert visit.handed(arrived, state) == (state, ())
    (body,) = said
    return body, catalogue.entry(arrived).path


def test_what_is_no_session_is_told_by_the_name_that_its_visitor_gave_it(desk):
    body, path = said_of(desk, "notes.json", b"{}", lambda entry: read_session(entry.path))
    assert body.startswith("notes.json: is not a session file")
    assert path.stem not in body


def test_no_folder_of_this_machine_is_told_where_a_session_leads_nowhere(desk, tmp_path):
    def follow(entry):
        raise RecordingError(f"{tmp_path}/samples/slider_depth: there is no such file or folder")

    body, _ = said_of(desk, "s.json", b"{}", follow)
    assert body == "slider_depth: there is no such file or folder"
