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
    roomy, tight = (_snippet(moment, asked, then, is_roomy) for is_roomy in (True, False))
    return "\n".join(roomy if len(roomy) <= LINES else tight) + "\n"


def _snippet(moment: Described, asked: Asked, then: Described | None, is_roomy: bool) -> tuple[str, ...]:
    lines = _playback(moment, "playback", is_roomy, is_original=asked.what in ("curve", "apart"))
    if then is not None:
        lines += _playback(then, "other", is_roomy, shares=moment)
    lines += answer(asked, moment, then)
    threads = (f"torch.set_num_threads({moment.threads})",) if moment.threads is not None else ()
    return (*_imports("\n".join((*threads, *lines))), *threads, *lines)


def _playback(
    moment: Described, name: str, is_roomy: bool, is_original: bool = False, shares: Described | None = None
) -> tuple[str, ...]:
    """The lines that make the playback `name`; roomy: a line for each thing. A recording is shared with `shares`."""
    lines: list[str] = []
    recording = "recording" if shares is None or _events_of(shares) == _events_of(moment) else "other_recording"
    if shares is None or recording != "recording":
        opened = call("open_recording", moment.recording, **_stated(moment.opened))
        if not moment.cleaning.changes_nothing:
            opened = f"denoise.cleaned({opened}, {code(moment.cleaning)})"
        lines.append(f"{recording} = {opened}")
    plan = f"plan_windows({recording}, {code(moment.policy)})"
    if moment.cold_at:
        plan = f"windows.from_window({plan}, {moment.cold_at})"
    network = _network(moment)
    if is_roomy:
        lines.append(f"{name}_model = {network}" if shares is not None else f"model = {network}")
        network = lines[-1].split(" = ")[0]
    playback = f"Playback({network}, {recording}, {plan})"
    if not moment.is_changed or is_original:
        return (*lines, f"{name} = {playback}")
    if is_roomy or moment.once:
        return (*lines, f"{name} = {playback}", f"{name} = {change_call(moment, name)}")
    return (*lines, f"{name} = {change_call(moment, playback)}")


def _events_of(moment: Described) -> tuple[object, ...]:
    return moment.recording, moment.opened, moment.cleaning


def _network(moment: Described) -> str:
    if moment.model.endswith(".py"):
        return f"own.load_own(Path({code(moment.model)}))"
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
    ("etnet", ("AttentionProbe", "BetweenFrames", "ByActivity", "ByCount", "ByCountOrDuration", "ByDensity",
               "ByDuration", "ByStamps", "EventEdit", "Intervention", "Playback", "load_model", "open_recording",
               "plan_windows", "windows")),
    ("etnet.evaluation", ("lpips",)),
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
