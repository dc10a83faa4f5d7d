"""Copy as Python: the lines that give exactly the array that is shown, from a frozen description of the moment."""

from __future__ import annotations

from etnet.errors import ModelError
from etnet.events.opened_as import OpenedAs
from etnet.inspection.answers import answer
from etnet.inspection.asked import Asked
from etnet.inspection.described import Described, change_call
from etnet.inspection.literals import call, code, names_in

LINES = 10
"""As many at most, whatever is asked."""


def as_python(moment: Described, asked: Asked, then: Described | None = None) -> str:
    """At most ten lines that end with `array = …`: what `asked` is answered with at `moment`, to the last digit.

    `then` is the other moment of "map_difference" and the one that "similarity" takes its reference from. Exact under
    the exactness contract: same machine, device, threads and library versions.
    """
    if (then is None) and asked.what == "map_difference":
        raise ModelError("a map difference has two moments; give `then`")
    lines = _playback(moment, "playback", is_original=asked.what == "curve")
    if then is not None:
        lines += _playback(then, "other", shares=moment)
    lines += answer(asked, moment, then)
    threads = [f"torch.set_num_threads({moment.threads})"] if moment.threads is not None else []
    return "\n".join((*_imports("\n".join((*threads, *lines))), *threads, *lines)) + "\n"


def _playback(
    moment: Described, name: str, is_original: bool = False, shares: Described | None = None
) -> tuple[str, ...]:
    recording = "recording" if name == "playback" else "other_recording"
    lines = []
    if shares is not None and (shares.recording, shares.opened, shares.cleaning) == (
        moment.recording, moment.opened, moment.cleaning,
    ):  # fmt: skip
        recording = "recording"
    else:
        opened = call("open_recording", moment.recording, **_stated(moment.opened))
        if not moment.cleaning.changes_nothing:
            opened = f"denoise.cleaned({opened}, {code(moment.cleaning)})"
        lines.append(f"{recording} = {opened}")
    plan = f"plan_windows({recording}, {code(moment.policy)})"
    if moment.cold_at:
        plan = f"windows.from_window({plan}, {moment.cold_at})"
    playback = f"Playback({_network(moment)}, {recording}, {plan})"
    if not moment.is_changed or is_original:
        return (*lines, f"{name} = {playback}")
    if moment.once:
        return (*lines, f"{name} = {playback}", f"{name} = {change_call(moment, name)}")
    return (*lines, f"{name} = {change_call(moment, playback)}")


def _network(moment: Described) -> str:
    if moment.model.endswith(".py"):
        return f"own.load_own(Path({moment.model!r}))"
    given: dict[str, object] = {} if moment.device == "cpu" else {"device": moment.device}
    if moment.precision != "fp32":
        given["precision"] = moment.precision
    return call("load_model", moment.model, **given)


def _stated(opened: OpenedAs) -> dict[str, object]:
    plain = OpenedAs()
    stated: dict[str, object] = {}
    if opened.assumed != plain.assumed:
        stated["assume"] = opened.assumed
    if opened.view != plain.view:
        stated["view"] = opened.view
    return stated


_PACKAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("etnet", ("AttentionProbe", "BetweenFrames", "ByCount", "ByDensity", "ByDuration", "EventEdit", "Intervention",
               "Playback", "load_model", "open_recording", "plan_windows", "windows")),
    ("etnet.events", ("denoise", "opened_as", "assumptions")),
    ("etnet.inspection", ("atlas", "attribution", "basis", "causal_search", "entropy", "features", "follow", "gates",
                          "importance", "input", "links", "mass", "pins", "rollout", "similarity", "sources",
                          "through_time", "twin", "uncertainty")),
    ("etnet.nets", ("own",)),
    ("pathlib", ("Path",)),
)  # fmt: skip
"""What a snippet can import from where, one line for each package."""


def _imports(text: str) -> tuple[str, ...]:
    """The imports of the names that the lines use."""
    used = names_in(text)
    lines = [f"from {package} import {', '.join(name for name in names if name in used)}"
             for package, names in _PACKAGES if used & set(names)]  # fmt: skip
    return (*(("import torch",) if "torch" in used else ()), *lines)
