"""Gates recombine to the cell; memory is measured by cold starts; a query and norms are followed through time."""

import pytest
import torch

from etnet.errors import Cancelled, ModelError
from etnet.inspection.entropy import map_numbers
from etnet.inspection.gates import (
    UNKNOWN,
    MemoryDepth,
    channel_energy,
    gates_at,
    level_norms,
    memory_depth,
    recurrent_levels,
)
from etnet.inspection.mass import Region, mass_on, padding_shares
from etnet.inspection.through_time import Track, attention_through_time, norms_through_time
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from tests.inspection.small import small_playback


@pytest.mark.parametrize("preset", ["tiny", "e2vid"])
@pytest.mark.parametrize("index", [0, 4])
def test_gates_recombine_to_the_cell_and_the_hidden_state(preset: str, index: int):
    playback = small_playback(preset)
    for level in (1, 2, 3):
        gates = gates_at(playback, index, level)
        cell, hidden = gates.kept + gates.entered, gates.out * torch.tanh(gates.cell)
        torch.testing.assert_close(cell, gates.cell, atol=1e-6, rtol=1e-5)
        torch.testing.assert_close(hidden, gates.hidden, atol=1e-6, rtol=1e-5)
        assert torch.equal(gates.cell, playback.state(index).tensors[2 * level - 1][0])
        assert torch.equal(gates.hidden, playback.state(index).tensors[2 * level - 2][0])
        assert bool(gates.cell_before.any()) == (index > 0)


def test_gates_know_what_an_intervention_did():
    playback = small_playback()
    zeroed = playback.branch(3, Intervention(zeroed_levels=frozenset({2})))
    gates = gates_at(zeroed, 3, 2)
    assert not gates.cell_before.any()
    torch.testing.assert_close(gates.entered, gates.cell, atol=1e-6, rtol=1e-5)
    with pytest.raises(ModelError, match="level 2 is frozen at window 3"):
        gates_at(playback.branch(3, Intervention(frozen_levels=frozenset({2}))), 3, 2)


def test_networks_without_conv_lstm_say_so():
    playback = small_playback("firenet")
    assert recurrent_levels(playback.model) == ()
    with pytest.raises(ModelError, match="firenet has no ConvLSTM levels"):
        gates_at(playback, 1, 1)
    with pytest.raises(ModelError, match="firenet has no ConvLSTM levels"):
        next(norms_through_time(playback, [0]))
    with pytest.raises(ModelError, match="firenet has no attention"):
        next(attention_through_time(playback, (3, 3), [0]))
    with pytest.raises(ModelError, match="ConvLSTM levels 1 … 3"):
        gates_at(small_playback(), 1, 4)


def test_norms_and_energies_are_root_and_mean_squares():
    playback = small_playback()
    for index, norms in norms_through_time(playback, range(3, 6)):
        state = playback.state(index)
        assert float(norms.cell[1]) == pytest.approx(float(state.tensors[3].norm()) / state.tensors[3].numel() ** 0.5)
        torch.testing.assert_close(channel_energy(state.tensors[4][0]).mean().sqrt(), level_norms(state).hidden[2])


def test_memory_depth_starts_cold_and_ends_at_the_exact_frame():
    playback, told = small_playback(), []
    memory = memory_depth(playback, 5, (0, 2, 5, 40), progress=lambda *done: told.append(done))
    assert torch.equal(memory.frames[1], playback.approximate(5, 2).frame[0, 0])
    assert not memory.differences[2:].any()
    assert memory.differences[0].any()
    assert memory.needed(1e9).eq(0).all()
    assert set(memory.needed(0.0).unique().tolist()) <= {0, 2, 5}
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_pixel_needs_the_depth_from_which_on_it_stays_close():
    differences = torch.tensor([[0.0, 0.9, 0.0, 0.5], [0.9, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.5]])
    memory = MemoryDepth((0, 1, 4), differences[:, None] + 0.25, torch.full((1, 4), 0.25))
    assert memory.needed(0.1).tolist() == [[4, 1, 0, UNKNOWN]]
    with pytest.raises(ValueError, match="depths"):
        memory_depth(small_playback(), 2, ())


def test_a_track_is_what_single_frames_give():
    playback, query, region = small_playback(), (20, 9), Region(0, 0, 9, 21)
    sites = frozenset({"scale1.encoder.0.self", "scale1.decoder.0.cross"})
    track = Track.of(attention_through_time(playback, query, range(2, 6), sites, region))
    assert track.index.tolist() == [2, 3, 4, 5]
    assert track.t.tolist() == [playback.windows[i].t_stop for i in range(2, 6)]
    attention = playback.at(4, AttentionProbe()).attention
    assert attention is not None
    grid, token = attention.grid, attention.grid.token_at(*query)
    for place, site in enumerate(track.sites):
        rows = attention.rows(site, [token])
        torch.testing.assert_close(track.entropy[2, place], map_numbers(rows, grid, [token]).entropy[:, 0])
        on_grid = rows[:, 0].reshape(-1, grid.rows, grid.columns)
        assert torch.equal(track.along_row[2, place], on_grid[:, token // grid.columns])
        assert torch.equal(track.along_column[2, place], on_grid[:, :, token % grid.columns])
    whole = Track.of(attention_through_time(playback, query, [4], sites))
    other = Track.of(attention_through_time(playback, query, [4], sites, Region(9, 0, 38, 21)))
    torch.testing.assert_close(whole.mass[0], track.mass[2] + other.mass[0])
    rows = attention.rows(track.sites[0], [token])[:, 0]
    torch.testing.assert_close(whole.mass[0, 0], 1 - mass_on(rows, padding_shares(grid)))


def test_a_chosen_head_has_its_own_track_and_a_path_moves_the_query():
    playback, site = small_playback(), frozenset({"scale1.encoder.0.self"})
    path = {2: (20, 9), 3: (30, 9), 4: (5, 2)}
    every = Track.of(attention_through_time(playback, path, range(2, 5), site))
    third = Track.of(attention_through_time(playback, path, range(2, 5), site, head=3))
    mean = Track.of(attention_through_time(playback, path, range(2, 5), site, head="mean"))
    assert every.pixels.tolist() == [list(path[i]) for i in range(2, 5)]
    torch.testing.assert_close(third.entropy, every.entropy[:, :, 3:])
    torch.testing.assert_close(third.along_row, every.along_row[:, :, 3:])
    torch.testing.assert_close(mean.mass[:, :, 0], every.mass.mean(2))
    torch.testing.assert_close(mean.along_column[:, :, 0], every.along_column.mean(2))
    assert (mean.entropy[:, :, 0] >= every.entropy.mean(2)).all()


def test_a_track_nobody_wants_is_given_up():
    playback, asked = small_playback(), []
    track = attention_through_time(playback, (3, 3), range(8), cancelled=lambda: len(asked) > 0)
    next(track)
    asked.append(True)
    with pytest.raises(Cancelled):
        next(track)
    with pytest.raises(ValueError, match="at least one moment"):
        Track.of([])
