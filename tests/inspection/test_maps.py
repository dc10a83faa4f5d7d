"""Numbers of maps, mass on areas, value-weighted attention, links and rollout, against slow twins."""

import dataclasses
import math
from typing import Literal

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import Cancelled, ModelError
from etnet.inspection.entropy import choose_head, head_entropies, map_numbers, token_middles
from etnet.inspection.links import mean_row, strongest_links
from etnet.inspection.mass import (
    Region,
    mass_on,
    padding_shares,
    received,
    region_shares,
    value_weighted,
)
from etnet.inspection.rollout import rollout
from etnet.inspection.sites import Site, sites_of
from etnet.nets.attention import Attention, AttentionProbe, MultiHeadAttention, Observer
from etnet.nets.intervention import ORIGINAL
from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.presets import build_model
from tests.inspection.small import SENSOR, small_attention

GRID = TokenGrid(SENSOR.height, SENSOR.width)
PADDED = GRID.rows * PATCH, GRID.columns * PATCH


def test_sites_are_taken_apart_and_put_together():
    for name in small_attention().sites:
        assert Site.of(name).name == name
    assert [Site.of(f"scale{s}.decoder.0.cross").reads(coarsest=3) for s in (1, 2, 3)] == [2, 3, 3]
    assert Site.of("scale1.encoder.2.self").reads(coarsest=3) == 1
    with pytest.raises(ModelError, match="no attention site"):
        Site.of("scale1.encoder")


def test_uniform_and_single_maps_have_known_numbers():
    tokens = GRID.num_tokens
    uniform, single = torch.full((tokens,), 1 / tokens), torch.eye(tokens)[7]
    numbers = map_numbers(torch.stack((uniform, single)).reshape(2, 1, tokens), GRID, [7])
    torch.testing.assert_close(numbers.entropy[:, 0], torch.tensor([math.log2(tokens), 0.0]))
    torch.testing.assert_close(numbers.tokens_read[:, 0], torch.tensor([float(tokens), 1.0]))
    assert numbers.peak_token[:, 0].tolist() == [0, 7]
    middles = token_middles(GRID)
    torch.testing.assert_close(numbers.distance[0, 0], (middles - middles[7]).norm(dim=-1).mean())
    assert numbers.distance[1, 0] == 0


def test_middles_lie_in_the_middle_of_the_pixels_of_a_token():
    for token, middle in enumerate(token_middles(GRID).tolist()):
        inside = [(x, y) for y in range(GRID.height) for x in range(GRID.width) if GRID.token_at(x, y) == token]
        row, column = divmod(token, GRID.columns)
        if len(inside) == PATCH**2:
            assert middle == pytest.approx([sum(axis) / len(axis) for axis in zip(*inside, strict=True)])
        assert middle == pytest.approx((column * PATCH - GRID.left + 3.5, row * PATCH - GRID.top + 3.5))


def test_heads_are_chosen_or_put_together():
    rows = small_attention().rows("scale1.encoder.0.self", [3, 4])
    assert torch.equal(choose_head(rows, 2), rows[2])
    assert (choose_head(rows, "min") <= choose_head(rows, "mean")).all()
    assert (choose_head(rows, "mean") <= choose_head(rows, "max")).all()
    with pytest.raises(ModelError, match="head 4 of 4"):
        choose_head(rows, 4)


def test_the_entropy_of_the_mean_map_is_not_the_mean_of_the_heads_entropies():
    one_each = torch.eye(4, 15)[:, None]
    apart = head_entropies(one_each)
    torch.testing.assert_close((apart.of_mean_map, apart.mean_of_heads), (torch.tensor([2.0]), torch.tensor([0.0])))
    rows = small_attention().rows("scale1.encoder.0.self", [3, 4])
    both = head_entropies(rows)
    assert torch.equal(both.of_mean_map, map_numbers(choose_head(rows, "mean")[None], GRID, [3, 4]).entropy[0])
    torch.testing.assert_close(both.mean_of_heads, map_numbers(rows, GRID, [3, 4]).entropy.mean(0))
    assert (both.mean_of_heads <= both.of_mean_map).all()


@given(st.data())
def test_region_shares_are_pixels_counted(data: st.DataObject):
    x, y = data.draw(st.integers(-5, SENSOR.width)), data.draw(st.integers(-5, SENSOR.height))
    region = Region(x, y, x + data.draw(st.integers(1, 50)), y + data.draw(st.integers(1, 50)))
    count = torch.zeros(PADDED)
    left, top = max(region.x_start + GRID.left, 0), max(region.y_start + GRID.top, 0)
    count[top : max(region.y_stop + GRID.top, 0), left : max(region.x_stop + GRID.left, 0)] = 1
    expected = count.reshape(GRID.rows, PATCH, GRID.columns, PATCH).mean((1, 3)).flatten()
    torch.testing.assert_close(region_shares(GRID, region), expected)


def test_mass_on_the_sensor_and_on_padding_make_one():
    rows = small_attention().rows("scale2.decoder.0.cross", range(15))
    on_sensor = mass_on(rows, region_shares(GRID, Region.whole(GRID)))
    torch.testing.assert_close(on_sensor + mass_on(rows, padding_shares(GRID)), torch.ones(4, 15))
    assert padding_shares(GRID).sum() == pytest.approx((math.prod(PADDED) - SENSOR.num_pixels) / PATCH**2)
    with pytest.raises(ValueError, match="holds no pixel"):
        Region(3, 3, 3, 9)


def test_what_is_received_is_the_mean_of_the_dense_map_and_a_planted_sink_is_found():
    attention = small_attention()
    site = "scale1.encoder.0.self"
    rows = attention.rows(site, range(15))
    found = received(attention, site, factor=1.5, tile=4)
    torch.testing.assert_close(found.times_uniform, rows.mean(1) * 15)
    torch.testing.assert_close(found.share_above, (rows * 15 >= 1.5).float().mean(1))

    keys = attention.keys[site].clone()
    keys[:, 6] = 40 * attention.queries[site].mean(1)
    queries = attention.queries[site].mean(1, keepdim=True).expand_as(keys)
    planted = dataclasses.replace(attention, keys={site: keys}, queries={site: queries})
    assert received(planted, site, tile=4).sinks().nonzero()[:, 1].tolist() == [6] * 4
    with pytest.raises(ModelError, match=r"'nowhere' was not probed"):
        received(planted, "nowhere")


def test_value_weighted_rows_are_the_norms_of_what_is_handed_over():
    attention = small_attention(values=True)
    for site in ("scale3.encoder.0.self", "scale1.decoder.0.cross"):
        weighted = value_weighted(attention, site, [0, 9])
        rows = attention.rows(site, [0, 9])
        handed = torch.einsum("hqk,hkd,hdo->hqko", rows, attention.values[site], attention.outputs[site])
        torch.testing.assert_close(weighted.by_head, handed.norm(dim=-1), atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(weighted.joint, handed.sum(0).norm(dim=-1), atol=1e-5, rtol=1e-4)


def test_what_is_handed_over_is_what_the_layer_gives():
    layer = MultiHeadAttention(16, 4, "site")
    tokens = torch.randn(1, 15, 16, generator=torch.Generator().manual_seed(0))
    observer = Observer(AttentionProbe(values=True), ORIGINAL)
    with torch.inference_mode():
        out = layer(tokens, tokens, observer)
        attention = observer.attention(GRID)
        assert attention is not None
        rows = attention.rows("site", range(15))
        handed = torch.einsum("hqk,hkd,hdo->qo", rows, attention.values["site"], attention.outputs["site"])
        torch.testing.assert_close(handed + layer.out_proj.bias, out[0], atol=1e-6, rtol=0)


def test_values_are_kept_on_demand_and_never_change_the_frame():
    model, voxel = build_model("tiny"), torch.randn(1, 5, 21, 38, generator=torch.Generator().manual_seed(1))
    with torch.inference_mode():
        plain = model(voxel)
        probed, full = (model(voxel, probe=AttentionProbe(values=values)) for values in (False, True))
    assert torch.equal(plain.frame, probed.frame)
    assert torch.equal(plain.frame, full.frame)
    assert probed.attention is not None
    assert full.attention is not None
    assert not probed.attention.values
    # v lies in one block with q and k: keeping it costs nothing that was not kept anyway.
    assert full.attention.nbytes == probed.attention.nbytes
    assert full.attention.values
    with pytest.raises(ModelError, match=r"AttentionProbe\(values=True\)"):
        value_weighted(probed.attention, "scale1.encoder.0.self", [0])


def test_links_are_the_largest_entries_of_each_scales_mean():
    attention = small_attention()
    links = strongest_links(attention, 8, num_links=4)
    assert [link.scale for link in links] == [3] * 4 + [2] * 4 + [1] * 4
    for scale in (1, 2, 3):
        here = [link for link in links if link.scale == scale]
        sites = [name for name in attention.sites if name.startswith(f"scale{scale}")]
        row = torch.cat([attention.rows(name, [8])[:, 0] for name in sites]).mean(0)
        torch.testing.assert_close(mean_row(attention, scale, 8), row)
        assert [link.token for link in here] == row.argsort(descending=True)[:4].tolist()
        assert here[0].times_uniform == pytest.approx(float(row.max()) * 15)
        assert GRID.token_at(*here[0].pixel) == here[0].token


def _dense_rollout(attention: Attention, discard: float, fusion: str = "mean") -> torch.Tensor:
    """The definition with whole matrices in double: "query scale token", for every query."""

    def dense(name: str) -> torch.Tensor:
        heads = attention.rows(name, range(15)).double()
        a = {"mean": heads.mean(0), "max": heads.amax(0), "min": heads.amin(0)}[fusion]
        a = a / a.sum(-1, keepdim=True)
        if dropped := int(discard * 15):
            smallest = a.argsort(dim=-1)[:, :dropped]
            a = a.scatter(-1, smallest, 0.0)
            a = a / a.sum(-1, keepdim=True)
        return a

    eye = torch.eye(15, dtype=torch.double)
    sites = sites_of(attention)
    encoders = {}
    for scale in (3, 2, 1):
        matrix = eye
        for site in (s for s in sites if s.scale == scale and s.part == "encoder"):
            matrix = (dense(site.name) + eye) / 2 @ matrix
        encoders[scale] = matrix
    streams = []
    for scale in (3, 2, 1):
        entering = torch.zeros(15, 3, 15, dtype=torch.double)
        entering[:, 3 - scale] = encoders[scale]
        streams.append(entering)
        own, memory = eye, torch.zeros_like(eye)
        for site in (s for s in sites if s.scale == scale and s.part == "decoder"):
            if site.kind == "self":
                step = (dense(site.name) + eye) / 2
                own, memory = step @ own, step @ memory
            else:
                own, memory = own / 2, memory / 2 + dense(site.name) / 2
        entering = torch.zeros(15, 3, 15, dtype=torch.double)
        entering[:, 3 - scale] += own @ encoders[scale]
        entering[:, 3 - min(scale + 1, 3)] += memory @ encoders[min(scale + 1, 3)]
        streams.append(entering)
    return torch.stack(streams).mean(0)


@pytest.mark.parametrize(
    ("preset", "discard", "fusion"),
    [("tiny", 0.0, "mean"), ("tiny", 0.5, "max"), ("tiny", 0.0, "min"), ("etnet-half", 0.2, "mean")],
)
def test_rollout_equals_the_dense_product(preset: str, discard: float, fusion: Literal["mean", "max", "min"]):
    attention = small_attention(preset)
    dense = _dense_rollout(attention, discard, fusion)
    for token in (0, 7, 14):
        rolled = rollout(attention, token, discard, tile=4, fusion=fusion)
        torch.testing.assert_close(rolled.weights.double(), dense[token], atol=1e-5, rtol=0)
        assert float(rolled.weights.sum()) == pytest.approx(1, abs=1e-5)
        torch.testing.assert_close(rolled.by_scale.sum(), rolled.total.sum())


def test_rollout_wants_every_site():
    for missing in ("scale1.encoder.0.self", "scale2.decoder.0.cross", "scale3.decoder.0.self"):
        sites = frozenset(small_attention().sites) - {missing}
        with pytest.raises(ModelError, match="every attention site"):
            rollout(small_attention(sites=sites), 0)
    with pytest.raises(ValueError, match="discard"):
        rollout(small_attention(), 0, discard=1.0)
    with pytest.raises(ModelError, match="no attention was probed"):
        rollout(Attention(GRID, {}, {}, {}), 0)


def test_a_rollout_nobody_wants_is_given_up():
    asked = iter([False] * 5 + [True])
    with pytest.raises(Cancelled):
        rollout(small_attention(), 0, tile=4, cancelled=lambda: next(asked))
