"""Which recording, cut into which windows, by which network in which precision."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from app.catalogue.recording_id import listed_id
from app.engine.jobs import JobResult
from app.engine.requests import Precision
from app.html.choices import DEFAULTS, KINDS, PRECISIONS, STEPS, offered, policy_of, words_of
from app.html.controls import button
from app.html.elements import card
from app.html.uploads import handing_html
from app.state import intents as ask
from app.views.compare.state import CompareState
from app.views.page import Choice, Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor, seconds_since_touched, set_options
from app.views.recording.assumptions_panel import Statement
from app.views.recording.html.cut import excerpt_html
from app.views.recording.html.examination import closed_html, doctor_html
from app.views.recording.html.fitness import fitness_button_html, fitness_html
from app.views.recording.html.networks import networks_html
from app.views.recording.html.sensor import binning_html, sensor_words
from app.views.recording.jobs.examination import SLOT
from app.views.recording.jobs.fitness import SLOT as FITNESS_SLOT
from app.views.recording.state import TRIM_SLOT, RecordingState
from etnet.windows import Policy

MOST_NAMED = 5
GONE = "– not in the folder any more"


class RecordingPanel(Panel):
    """What is looked at, and through what."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One card: statistics of the recording, and of its sensor against the training range."""
        self._statistics = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Dropdowns speak titles; intents speak ids."""
        self._recordings: dict[str, str] = {}
        self._models: dict[str, str] = {}
        self._recording = gui.add_dropdown("Recording", ("–",))
        self._handing = Html(gui)
        self._film = Html(gui)
        self._statement = Statement()
        self._statement.build(gui, dispatch)
        self._kind = gui.add_dropdown("Windowing", KINDS)
        self._number = gui.add_number("Size", 0.35, min=0.0001)
        self._model = gui.add_dropdown("Network", ("–",))
        self._precision = gui.add_dropdown("Precision", tuple(PRECISIONS.values()))
        self._facts = Html(gui)
        self._cut = Html(gui)
        arithmetic: dict[str, Precision] = {text: name for name, text in PRECISIONS.items()}
        on_visitor(self._recording, lambda title: _opened(self._recordings.get(title)), dispatch)
        on_visitor(self._kind, lambda kind: ask.ChoosePolicy(policy_of(kind, DEFAULTS.get(kind, 0.0))), dispatch)
        on_visitor(self._number, self._policy_with, dispatch)
        on_visitor(self._model, lambda title: _chosen(self._models.get(title)), dispatch)
        on_visitor(self._precision, lambda text: ask.ChoosePrecision(arithmetic.get(text, "auto")), dispatch)

    def show(self, page: Page) -> None:
        """Draw what is known of the recording."""
        body = _fitness(page) + _doctor(page) + networks_html(page.models, page.state.model_id)
        parts = f'<div class="etv-columns" data-testid="statistics">{body}</div>'
        self._statistics.show(card("recording", "Recording statistics", parts, {"recording": "stage"}))

    def show_settings(self, page: Page) -> None:
        """Let the widgets say what is open, and list what was noticed on opening it."""
        _offer(self._recording, self._recordings, page.recordings, listed_id(page.state.recording_id))
        self._handing.show("" if page.uploads is None else handing_html(page.uploads))
        self._film.show("" if page.video is None else _film())
        self._statement.show(page)
        _offer(self._model, self._models, page.models, page.state.model_id)
        assign(self._precision, PRECISIONS[page.state.precision])
        self._show_policy(page.state.policy)
        self._facts.show(_facts(page, has_log=not _is_examined(page)))
        self._cut.show(_cut(page))

    def _policy_with(self, number: float) -> ask.Intent | None:
        return ask.ChoosePolicy(policy_of(self._kind.value, float(number))) if number > 0 else None

    def _show_policy(self, policy: Policy | None) -> None:
        if policy is None:
            return
        kind, number = words_of(policy)
        assign(self._kind, kind)
        self._number.visible = kind != "camera frames"
        if kind != "camera frames" and seconds_since_touched(self._number) > 0.4:
            self._number.step = STEPS[kind]
            assign(self._number, number)


def _film() -> str:
    """Where a video's own settings are."""
    return f'<div class="et">{button("Sensor of the video …", "tab:video")}</div>'


def _opened(recording_id: str | None) -> ask.Intent | None:
    return None if recording_id is None else ask.OpenRecording(recording_id)


def _chosen(model_id: str | None) -> ask.Intent | None:
    return None if model_id is None else ask.ChooseModel(model_id)


def _offer(
    dropdown: viser.GuiDropdownHandle[Any], ids: dict[str, str], choices: tuple[Choice, ...], chosen: str
) -> None:
    titles = offered(choices)
    if chosen and chosen not in titles.values():
        titles = {GONE: chosen, **titles}  # a dropdown would otherwise name another one than the current one
    if titles and titles != ids:
        ids.clear()
        ids.update(titles)
        set_options(dropdown, tuple(titles), next((t for t, i in titles.items() if i == chosen), next(iter(titles))))
    for title, choice_id in ids.items():
        if choice_id == chosen:
            assign(dropdown, title)


def _facts(page: Page, has_log: bool = True) -> str:
    """What is open; its statistics hold the import log, too."""
    writing = _writing(page.growing)
    if page.moment is None:
        said = f'<div class="et-note">{escape(page.trouble)}</div>' if page.trouble else ""
        return f'<div class="et">{said}{writing}</div>' if said or writing else ""
    recording = page.moment.recording
    truth = recording.ground_truth
    told = [
        ("Events", f"{recording.num_events:,}"),
        ("Duration", f"{recording.span.duration / 1e6:.3f} s"),
        ("Sensor", sensor_words(recording)),
        ("Camera frames", f"{len(truth):,}" if truth else "none"),
        ("Format", recording.format),
        ("Windows", f"{len(page.moment.windows):,}"),
    ]
    rows = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in told)
    rows += f"<dt>Binning</dt><dd>{binning_html(page)}</dd>" if page.can_be_binned else ""
    remarks = "".join(f"<li>{escape(str(remark))}</li>" for remark in recording.remarks)
    noticed = f"<h3>Import log</h3><ul>{remarks}</ul>" if remarks and has_log else ""
    return f'<div class="et etv-told" data-testid="facts"><dl>{rows}</dl>{noticed}{writing}</div>'


def _writing(names: tuple[str, ...]) -> str:
    """Why a file that is being recorded is not in the list yet."""
    if not names:
        return ""
    listed = escape(", ".join(names[:MOST_NAMED]) + (" …" if len(names) > MOST_NAMED else ""))
    return f'<div class="et-note" data-testid="growing">Being written, and offered once it rests: {listed}</div>'


def _is_examined(page: Page) -> bool:
    result = _examination(page)
    return page.state.of(RecordingState).examines and result is not None and result.is_whole


def _examination(page: Page) -> JobResult | None:
    """What is known of the current recording, and not of the one before it."""
    result, moment = page.results.get(SLOT), page.moment
    if result is None or moment is None or result.job.request.recording_id != moment.recording_id:
        return None
    return result


def _cut(page: Page) -> str:
    if page.moment is None:
        return ""
    return excerpt_html(page.moment, page.state, page.results.get(TRIM_SLOT))


def _doctor(page: Page) -> str:
    if page.moment is None:
        return ""
    if not page.state.of(RecordingState).examines:
        return closed_html()
    return doctor_html(page.moment, _examination(page))


def _fitness(page: Page) -> str:
    if page.moment is None:
        return ""
    if not page.state.of(RecordingState).fits:
        return fitness_button_html()
    offset, result = page.state.of(CompareState).offset, page.results.get(FITNESS_SLOT)
    opened = page.moment.recording_id, page.moment.cleaning
    if result is not None and (result.job.request.recording_id, result.job.request.cleaning) != opened:
        result = None  # another network measures the same
    return fitness_html(page.moment, result, page.model, offset)
