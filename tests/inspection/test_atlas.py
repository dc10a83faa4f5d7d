"""The atlas of heads: each effect is one decode under that mask, and the work can be left and taken up again."""

import pytest
import torch

from etnet.errors import Cancelled, ModelError
from etnet.inspection.atlas import head_atlas, head_maps, head_table, masking, strongest_heads
from etnet.inspection.entropy import map_numbers
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import ORIGINAL, Intervention
from tests.inspection.small import small_attention, small_playback

INDEX, PIXEL = 5, (20, 9)


def test_an_atlas_effect_is_the_decode_under_that_mask():
    playback = small_playback()
    *_, atlas = head_atlas(playback, INDEX)
    original = playback.at(INDEX).frame[0, 0]
    assert atlas.is_whole
    assert torch.equal(atlas.frame, original)
    for (site, head), difference in zip(atlas.heads, atlas.differences, strict=True):
        masked = playback.at(INDEX, intervention=Intervention(masked_heads=frozenset({(site, head)}))).frame[0, 0]
        assert torch.equal(difference, masked - original)
    uniform = playback.at(INDEX, intervention=Intervention(uniform_attention=True)).frame[0, 0]
    assert torch.equal(atlas.uniform, uniform - original)
    assert atlas.on_image.shape == atlas.on_pixel(*PIXEL).shape == (9, 4)
    assert float(atlas.on_image[4, 2]) == pytest.approx(float(atlas.differences[4 * 4 + 2].abs().mean()))
    assert float(atlas.on_pixel(*PIXEL)[8, 3]) == float(atlas.differences[-1][PIXEL[1], PIXEL[0]])


def test_an_atlas_is_left_and_taken_up_again_and_measures_no_head_twice():
    playback = small_playback()
    atlases = head_atlas(playback, INDEX)
    assert next(atlases).progress == (0, 36)
    for _ in range(7):
        part = next(atlases)
    assert int(part.measured.sum()) == 7
    assert part.on_image.isnan().sum() == 29
    rest = list(head_atlas(playback, INDEX, part))
    assert [atlas.progress[0] for atlas in rest] == list(range(7, 37))
    *_, whole = head_atlas(small_playback(), INDEX)
    assert torch.equal(torch.stack(rest[-1].differences), torch.stack(whole.differences))
    assert [atlas.progress for atlas in head_atlas(playback, INDEX, whole)] == [(36, 36)]
    with pytest.raises(ModelError, match="start without it"):
        next(head_atlas(playback, INDEX + 1, part))
    asked = iter([False] * 4 + [True] * 9)
    with pytest.raises(Cancelled, match="this atlas is no longer wanted"):
        list(head_atlas(playback, INDEX, cancelled=lambda: next(asked)))


def test_an_atlas_of_a_changed_network_masks_beside_the_change():
    change = Intervention(removed_skips=frozenset({0}))
    branch = small_playback().branch(3, change)
    atlases = head_atlas(branch, INDEX)
    atlas = [next(atlases) for _ in range(3)][-1]
    site, head = atlas.heads[1]
    both = branch.at(INDEX, intervention=masking(change, site, head)).frame[0, 0]
    assert torch.equal(atlas.differences[1], both - branch.at(INDEX).frame[0, 0])
    assert masking(ORIGINAL, site, head) == Intervention(masked_heads=frozenset({(site, head)}))


def test_an_atlas_leaves_no_frames_in_the_playback_and_does_not_move_its_generator_into_inference():
    playback = small_playback()
    atlases = head_atlas(playback, INDEX)
    next(atlases)
    assert not torch.is_inference_mode_enabled()
    next(atlases)
    assert playback.cached().frames == ()


def test_thumbnails_and_tables_are_the_maps_own():
    attention = small_attention()
    maps = head_maps(attention, 7)
    table = head_table(attention, 7)
    frame = head_table(attention)
    for place, site in enumerate(attention.sites):
        rows = attention.rows(site, range(15))
        assert torch.equal(maps[place].flatten(1), attention.rows(site, [7])[:, 0])
        numbers = map_numbers(rows, attention.grid, range(15))
        torch.testing.assert_close(table.entropy[place], numbers.entropy[:, 7])
        torch.testing.assert_close(table.distance[place], numbers.distance[:, 7])
        torch.testing.assert_close(frame.entropy[place], numbers.entropy.mean(1))
        torch.testing.assert_close(frame.distance[place], numbers.distance.mean(1))


def test_heads_are_sorted_by_the_size_of_their_effect():
    effect = torch.tensor([[0.1, -0.5], [torch.nan, 0.5], [0.0, 0.2]])
    found = strongest_heads(effect, ("a", "b", "c"))
    assert [(site, head) for site, head, _ in found] == [("a", 1), ("b", 1), ("c", 1), ("a", 0), ("c", 0)]
    assert found[0][2] == -0.5


@pytest.mark.parametrize("path", ["fused", "plain"])
def test_frames_and_rows_are_bit_equal_with_and_without_observing(path: str):
    playback = small_playback()
    for module in playback.model.modules():  # pyright: ignore[reportAttributeAccessIssue]
        if hasattr(module, "path"):
            module.path = path
    plain = small_playback()
    for module in plain.model.modules():  # pyright: ignore[reportAttributeAccessIssue]
        if hasattr(module, "path"):
            module.path = path
    one = AttentionProbe(frozenset({"scale1.encoder.0.self"}))
    observed = playback.at(INDEX, AttentionProbe(values=True))
    narrow = playback.at(INDEX, one).attention
    assert torch.equal(plain.at(INDEX).frame, observed.frame)
    assert observed.attention is not None
    assert narrow is not None
    site, tokens = "scale1.encoder.0.self", [0, 7, 14]
    assert torch.equal(observed.attention.rows(site, tokens), narrow.rows(site, tokens))
    list(head_atlas(playback, INDEX))
    again = playback.at(INDEX, one)
    assert again.attention is not None
    assert torch.equal(again.attention.rows(site, tokens), narrow.rows(site, tokens))
    assert torch.equal(again.frame, observed.frame)
