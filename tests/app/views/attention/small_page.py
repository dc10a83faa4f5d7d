"""A page of the attention workspace over the small network."""

from app.engine.requests import Ready
from app.state.view_state import ViewState
from app.views.attention.html.atlas import atlas_html
from app.views.attention.state import AttentionState
from etnet.nets.attention import AttentionProbe
from tests.app.small_loaded import POLICY, QUERY, SITE

INDEX = 5
CHOSEN = AttentionState(site=SITE)
STATE = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY, workspace="attention")


def ready_of(loaded, request):
    playback, change = loaded.playing(request)
    step = playback.at(request.index, AttentionProbe(), change)
    frame, contract = step.frame[0, 0].numpy(), loaded.contract
    return Ready(request, frame, step.attention, 1.0, True, False, False, contract, request.index)


def atlas_text(page):
    return "".join(atlas_html(page))
