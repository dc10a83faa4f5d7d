"""Rows and columns of attention maps equal the dense map, and the dense map is what the network used."""

import pytest
import torch

from etnet.errors import ModelError
from etnet.nets.attention import Attention, AttentionProbe, MultiHeadAttention, Observer
from etnet.nets.intervention import ORIGINAL
from etnet.nets.padding import TokenGrid
from etnet.nets.presets import build_model

SITES = {"tiny": 9, "etnet-half": 21}


def _probed(sites: frozenset[str] | None = None, height: int = 21, width: int = 38) -> Attention:
    voxel = torch.randn(1, 5, height, width, generator=torch.Generator().manual_seed(2))
    with torch.inference_mode():
        attention = build_model("tiny")(voxel, probe=AttentionProbe(sites)).attention
    assert attention is not None
    return attention


@pytest.mark.parametrize("preset", SITES)
def test_sites_carry_the_papers_names(preset: str):
    with torch.inference_mode():
        attention = build_model(preset)(torch.zeros(1, 5, 16, 16), probe=AttentionProbe()).attention
    assert attention is not None
    assert len(attention.sites) == SITES[preset]
    assert attention.sites[0] == "scale3.encoder.0.self"
    assert {"scale1.decoder.0.cross", "scale1.decoder.0.self", "scale2.encoder.0.self"} <= set(attention.sites)


def test_rows_equal_the_dense_map_and_sum_to_one():
    attention = _probed()
    everything = range(attention.grid.num_tokens)
    for site in attention.sites:
        q, k = attention.queries[site].double(), attention.keys[site].double()
        dense = torch.softmax(q @ k.transpose(-1, -2) / q.shape[-1] ** 0.5, dim=-1)
        edge = [0, attention.grid.token_at(37, 20), attention.grid.num_tokens - 1]
        torch.testing.assert_close(attention.rows(site, edge).double(), dense[:, edge], atol=1e-6, rtol=0)
        torch.testing.assert_close(attention.rows(site, edge).sum(-1), torch.ones(q.shape[0], 3), atol=1e-6, rtol=0)
        columns = attention.columns(site, edge)
        torch.testing.assert_close(columns, attention.rows(site, everything)[..., edge], atol=1e-6, rtol=0)


def test_the_map_that_is_shown_is_the_map_that_made_the_output():
    layer = MultiHeadAttention(16, 4, "site")
    tokens = torch.randn(1, 10, 16, generator=torch.Generator().manual_seed(0))
    observer = Observer(AttentionProbe(), ORIGINAL)
    with torch.inference_mode():
        out = layer(tokens, tokens, observer)
        attention = observer.attention(TokenGrid(16, 40))
        assert attention is not None
        v = (tokens @ layer.in_proj_weight[32:].T + layer.in_proj_bias[32:]).reshape(10, 4, 4).transpose(0, 1)
        mixed = attention.rows("site", range(10)) @ v
        expected = layer.out_proj(mixed.transpose(0, 1).reshape(1, 10, 16))
    torch.testing.assert_close(out, expected, atol=1e-6, rtol=0)


def test_equals_torchs_own_multi_head_attention():
    ours, theirs = MultiHeadAttention(16, 4, "site"), torch.nn.MultiheadAttention(16, 4, batch_first=True).eval()
    theirs.load_state_dict(ours.state_dict())
    generator = torch.Generator().manual_seed(0)
    query, memory = (torch.randn(2, n, 16, generator=generator) for n in (7, 11))
    with torch.inference_mode():
        for path in ("fused", "plain"):
            ours.path = path
            torch.testing.assert_close(
                ours(query, memory, Observer(None, ORIGINAL)), theirs(query, memory, memory)[0], atol=1e-6, rtol=0
            )


def test_only_probed_sites_are_kept_and_others_are_named():
    attention = _probed(frozenset({"scale2.decoder.0.cross"}))
    assert attention.sites == ("scale2.decoder.0.cross",)
    with pytest.raises(ModelError, match=r"scale1\.encoder\.0\.self.*scale2\.decoder\.0\.cross"):
        attention.rows("scale1.encoder.0.self", [0])
    with pytest.raises(ModelError, match="not probed"):
        attention.columns("nowhere", [0])


def test_attention_weighs_what_it_keeps_alive_and_not_only_what_it_shows():
    model, voxel = build_model("tiny").eval(), torch.zeros(1, 5, 24, 32)
    for values in (False, True):
        _, attention = model.decode(model.encode(voxel)[0], AttentionProbe(values=values))
        held = (attention.queries, attention.keys, attention.values)
        blocks = {t.untyped_storage().data_ptr(): t.untyped_storage() for part in held for t in part.values()}
        assert attention.nbytes == sum(block.nbytes() for block in blocks.values())
        # q and k are views of one product, which holds v as well.
        shown = sum(tensor.nbytes for part in held[:2] for tensor in part.values())
        assert attention.nbytes >= shown * 1.4


def test_probing_takes_a_batch_of_one():
    with pytest.raises(ModelError, match="batch of 1"):
        build_model("tiny")(torch.zeros(2, 5, 16, 16), probe=AttentionProbe())
