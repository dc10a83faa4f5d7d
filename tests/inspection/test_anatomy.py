"""A network says what it can show; somebody's own network is inspected as far as it goes."""

import pytest
import torch

from etnet.errors import ModelError
from etnet.inspection.anatomy import anatomy_of, cannot_show
from etnet.inspection.attribution import attribute, occlude
from etnet.inspection.sites import Site
from etnet.inspection.through_time import attention_through_time, norms_through_time
from etnet.nets.abilities import Abilities
from etnet.nets.adapter import Adapter
from etnet.nets.base import Reconstructor
from etnet.nets.integrator import IntegratorConfig
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from tests.inspection.small import small_attention, small_playback

PIXEL = (20, 9)


def _integrate(voxel: torch.Tensor, memory: tuple[torch.Tensor, ...] | None) -> tuple[torch.Tensor, tuple]:
    (brightness,) = memory or (torch.zeros_like(voxel[:, :1]),)
    brightness = 0.95 * brightness + 0.1 * voxel.sum(dim=1, keepdim=True)
    return torch.sigmoid(brightness), (brightness,)


def own_playback(model: Reconstructor) -> Playback:
    small = small_playback()
    return Playback(model, small.recording, small.windows)


def test_a_network_lists_the_sites_that_its_attention_has_in_the_same_order():
    for preset in ("tiny", "etnet-half"):
        parts = anatomy_of(build_model(preset))
        assert parts.sites == small_attention(preset).sites
        assert parts.num_heads == len(small_attention(preset).rows(parts.sites[0], [0]))
    assert anatomy_of(build_model("etnet-half")).skips == (1, 0)


def test_what_a_network_cannot_show_is_one_sentence():
    etnet, e2vid, firenet = (build_model(name) for name in ("tiny", "e2vid", "firenet"))
    own = Adapter(_integrate, name="mine")
    assert cannot_show(etnet, "attention") is None
    for model, inspector, reason in (
        (e2vid, "atlas", "e2vid has no attention"),
        (firenet, "attention", "firenet has no attention"),
        (firenet, "gates", "firenet has no ConvLSTM levels"),
        (firenet, "ablation", "firenet has neither scales nor skips"),
        (own, "rollout", "mine has no attention"),
        (own, "hidden", "mine does not say which"),
        (own, "intervention", "mine names no part"),
    ):
        assert str(cannot_show(model, inspector)).startswith(reason)
    assert cannot_show(firenet, "hidden") is None
    foreign = build_model(IntegratorConfig())
    assert anatomy_of(foreign).levels == ()
    foreign.abilities = Abilities(levels=2)
    assert anatomy_of(foreign).levels == (1, 2)
    assert "hidden" in str(cannot_show(foreign, "hidden"))
    assert "passes no gradient back" in str(cannot_show(foreign, "gradient"))
    assert cannot_show(own, "gradient") is None  # only the attempt tells
    assert str(cannot_show(own, "levels")).startswith("mine has no recurrent levels that can be told apart")
    assert cannot_show(firenet, "levels") is None
    for model in (firenet, own):
        with pytest.raises(ModelError, match="has no attention"):
            next(attention_through_time(own_playback(model), PIXEL, [0]))
        with pytest.raises(ModelError, match="has no ConvLSTM"):
            next(norms_through_time(own_playback(model), [0]))


def test_a_pixel_of_an_own_network_is_traced_to_its_events():
    playback = own_playback(Adapter(_integrate, name="mine"))
    found = attribute(playback, 5, PIXEL, num_back=2)
    assert found.value == float(playback.at(5).frame[0, 0, PIXEL[1], PIXEL[0]])
    slope = found.value * (1 - found.value) * 0.1
    for age, window in enumerate(reversed(found.windows)):
        here = (window.events.x == PIXEL[0]) & (window.events.y == PIXEL[1])
        assert window.weights[here] == pytest.approx(0.95**age * slope * window.events.p[here], rel=1e-4)
        assert not window.weights[~here].any()


def test_an_own_network_that_gives_no_gradient_says_so_and_can_be_occluded():
    @torch.no_grad()
    def step(voxel: torch.Tensor, memory: tuple[torch.Tensor, ...] | None):
        return _integrate(voxel, memory)

    playback = own_playback(Adapter(step, name="mine"))
    with pytest.raises(ModelError, match=r"mine: no gradient comes back .* use occlude"):
        attribute(playback, 5, PIXEL)
    hidden = occlude(playback, 5, PIXEL, patch=8)
    assert torch.equal(hidden.change, occlude(own_playback(Adapter(_integrate, name="mine")), 5, PIXEL, patch=8).change)


def test_titles_say_direction_and_scales():
    cross = Site.of("scale1.decoder.0.cross")
    assert cross.in_words(3) == "1/4 keys that this 1/2 query attends to"
    assert cross.in_words(3, "attended by") == "1/2 queries that attend to this 1/4 key"
    assert Site.of("scale3.decoder.0.cross").in_words(3) == "1/8 keys that this 1/8 query attends to"
    assert Site.of("scale0.encoder.0.self").in_words(3).startswith("full-size keys")
