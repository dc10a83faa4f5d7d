"""Tokens as vectors: they are the network's own, their colours are fixed for a recording, likeness is numpy's."""

import csv
import io

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import Cancelled, ModelError
from etnet.inspection.basis import fit_basis, fit_basis_to_recording, sampled_maps, sampled_windows
from etnet.inspection.features import Feature, FeatureMap, feature_map
from etnet.inspection.similarity import cosine_similarity
from etnet.inspection.threshold import holding, row_csv, strongest
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.padding import TokenGrid
from tests.inspection.small import SENSOR, small_playback

INDEX, PIXEL, SITE = 5, (20, 9), "scale1.decoder.0.cross"
GRID = TokenGrid(SENSOR.height, SENSOR.width)


def test_queries_keys_and_values_are_the_probes_own():
    playback = small_playback()
    attention = playback.at(INDEX, AttentionProbe(values=True)).attention
    assert attention is not None
    for kind, kept in (("query", attention.queries), ("key", attention.keys), ("value", attention.values)):
        whole = feature_map(playback, INDEX, Feature(kind, SITE)).values
        assert torch.equal(whole.reshape(15, 4, 8).permute(1, 0, 2), kept[SITE])
        assert torch.equal(feature_map(playback, INDEX, Feature(kind, SITE, head=2)).values, whole[..., 16:24])


def test_the_tokens_of_the_last_layers_average_to_the_context():
    playback = small_playback()
    sites = [f"scale{scale}.{place}" for scale in (1, 2, 3) for place in ("encoder.0.self", "decoder.0.cross")]
    streams = [feature_map(playback, INDEX, Feature("tokens", site)).values for site in sites]
    context = feature_map(playback, INDEX, Feature("context")).values
    norm = playback.model.tpa.norm  # pyright: ignore[reportAttributeAccessIssue]
    with torch.inference_mode():
        torch.testing.assert_close(norm(torch.stack(streams).mean(0)), context, atol=1e-5, rtol=1e-5)
    without = playback.branch(INDEX, Intervention(without_context=True))
    assert not feature_map(without, INDEX, Feature("context")).values.any()
    assert torch.equal(feature_map(without, INDEX, Feature("tokens", sites[0])).values, streams[0])


@pytest.mark.parametrize(("preset", "cell"), [("tiny", 4), ("e2vid", 4), ("firenet", 1)])
def test_hidden_states_are_the_state_laid_out_over_the_sensor(preset: str, cell: int):
    playback = small_playback(preset)
    found = feature_map(playback, INDEX, Feature("hidden", level=2))
    tensors = playback.state(INDEX).tensors
    hidden = tensors[1 if preset == "firenet" else 2][0]
    assert found.cell == cell
    assert torch.equal(found.values, hidden.permute(1, 2, 0))
    row, column = found.place_of(*PIXEL)
    top, left = (0, 0) if preset == "firenet" else (GRID.top, GRID.left)
    assert (row, column) == ((PIXEL[1] + top) // cell, (PIXEL[0] + left) // cell)
    assert torch.equal(found.at(*PIXEL), hidden[:, row, column])
    with pytest.raises(ValueError, match="outside the sensor"):
        found.at(38, 0)


def test_looking_at_tokens_leaves_no_hook_and_no_change_behind():
    playback, plain = small_playback(), small_playback()
    feature_map(playback, INDEX, Feature("tokens", SITE))
    assert not any(module._forward_hooks for module in playback.model.modules())  # pyright: ignore
    assert torch.equal(playback.at(INDEX).frame, plain.at(INDEX).frame)


def test_features_that_are_not_there_are_refused():
    playback = small_playback()
    for wrong in (
        lambda: Feature("tokens"),
        lambda: Feature("context", SITE),
        lambda: Feature("hidden"),
        lambda: Feature("tokens", SITE, head=1),
        lambda: feature_map(playback, 1, Feature("key", SITE, head=4)),
        lambda: feature_map(playback, 1, Feature("key", "scale1.encoder.7.self")),
        lambda: feature_map(playback, 1, Feature("hidden", level=4)),
        lambda: feature_map(small_playback("firenet"), 1, Feature("cell", level=1)),
        lambda: feature_map(small_playback("e2vid"), 1, Feature("context")),
    ):
        with pytest.raises(ModelError):
            wrong()


def test_an_ablated_site_has_tokens_and_says_that_it_has_no_queries():
    ablated = small_playback().branch(0, Intervention(removed_sites=frozenset({SITE})))
    for kind in ("query", "key", "value"):
        with pytest.raises(ModelError, match=rf"{SITE} is ablated here and has no {kind}"):
            feature_map(ablated, INDEX, Feature(kind, SITE))
    assert feature_map(ablated, INDEX, Feature("tokens", SITE)).values.any()


@pytest.mark.parametrize("feature", [Feature("tokens", SITE), Feature("context"), Feature("hidden", level=1)])
def test_the_basis_of_a_recording_is_fixed_whatever_was_looked_at_before(feature: Feature):
    fresh = fit_basis(sampled_maps(small_playback(), feature, 4, 2))
    used = small_playback()
    for index in (7, 2):
        used.at(index)
    branch = used.branch(0, Intervention(zeroed_levels=frozenset({1})))
    again = fit_basis_to_recording(branch, feature, 4, 2)
    for name in ("mean", "directions", "low", "high", "explained"):
        np.testing.assert_array_equal(getattr(fresh, name), getattr(again, name))
    with pytest.raises(Cancelled, match="this basis"):
        next(sampled_maps(used, feature, cancelled=lambda: True))
    seen = feature_map(used, 6, feature)
    np.testing.assert_array_equal(fresh.colours(seen), again.colours(seen))
    assert 0 <= fresh.colours(seen).min() <= fresh.colours(seen).max() <= 1


def test_the_basis_is_that_of_a_singular_value_decomposition_with_fixed_signs():
    rng = np.random.default_rng(0)
    stack = rng.normal(size=(4, 3, 5, 6)) * np.array([1, 5, 0.2, 3, 0.5, 0.1]) + 7
    maps = [_map(values) for values in stack]
    basis = fit_basis(maps)
    vectors = stack.reshape(-1, 6).astype(np.float32).astype(float)
    _, lengths, directions = np.linalg.svd(vectors - vectors.mean(0), full_matrices=False)
    np.testing.assert_allclose(np.abs(basis.directions), np.abs(directions[:3]), atol=1e-6)
    np.testing.assert_allclose(basis.explained, lengths[:3] ** 2 / (lengths**2).sum(), rtol=1e-6)
    assert (basis.directions[np.arange(3), np.abs(basis.directions).argmax(1)] > 0).all()
    np.testing.assert_array_equal(fit_basis(maps[::-1]).directions.round(9), basis.directions.round(9))
    with pytest.raises(ValueError, match="maps of one feature"):
        fit_basis([])


def test_a_basis_centred_by_place_does_not_show_what_every_window_holds_there():
    rng = np.random.default_rng(1)
    position, moving = 100 * rng.normal(size=(3, 5, 6)), rng.normal(size=(4, 3, 5, 6))
    basis = fit_basis([_map(position + change) for change in moving], "place")
    alone = fit_basis([_map(change - moving.mean(0)) for change in moving])
    np.testing.assert_allclose(basis.directions, alone.directions, atol=1e-3)


def test_fewer_than_three_channels_and_constant_maps_have_colours():
    basis = fit_basis([_map(np.ones((3, 5, 2)))])
    assert np.isfinite(basis.colours(_map(np.ones((3, 5, 2))))).all()
    assert sampled_windows(3, 8) == (0, 1, 2)
    assert sampled_windows(100, 4) == (12, 37, 62, 87)
    assert sampled_windows(140, 4, since=40) == (52, 77, 102, 127)
    with pytest.raises(ValueError, match="of a plan of 0"):
        sampled_windows(40, 4, since=40)


def test_likeness_is_numpys_cosine_within_and_between_windows():
    playback = small_playback()
    here, there = (feature_map(playback, index, Feature("tokens", SITE)) for index in (5, 2))
    for reference in (here.at(*PIXEL), there.at(*PIXEL)):
        v, r = here.values.numpy().astype(float), reference.numpy().astype(float)
        expected = (v @ r) / (np.linalg.norm(v, axis=-1) * np.linalg.norm(r))
        np.testing.assert_allclose(cosine_similarity(here, reference), expected, atol=1e-6)
    assert float(cosine_similarity(here, here.at(*PIXEL))[here.place_of(*PIXEL)]) == 1
    mean = here.values.mean((0, 1))
    centred = _map((here.values - mean).numpy())
    torch.testing.assert_close(
        cosine_similarity(here, here.at(*PIXEL), mean), cosine_similarity(centred, centred.at(*PIXEL))
    )
    assert not cosine_similarity(here, torch.zeros(32)).any()
    with pytest.raises(ValueError, match="same feature"):
        cosine_similarity(here, torch.zeros(31))


@given(st.lists(st.sampled_from([0.0, 0.1, 0.2, 0.5, 3.0]), min_size=1, max_size=12), st.floats(0.01, 1))
def test_the_tokens_that_hold_a_mass_are_the_fewest_that_do(weights: list[float], mass: float):
    row = torch.tensor(weights)
    held = holding(row, mass)
    total = float(row.double().sum())
    count = int(held.sum())
    assert torch.equal(held, strongest(row, count))
    assert float(row.double()[held].sum()) >= mass * total - 1e-9
    if count > 1:
        assert float(row.double()[strongest(row, count - 1)].sum()) < mass * total


def test_thresholds_are_made_row_by_row_and_equals_go_to_the_earlier_token():
    rows = torch.tensor([[[0.5, 0.2, 0.3]], [[0.2, 0.4, 0.4]]])
    assert holding(rows, 0.7).tolist() == [[[True, False, True]], [[False, True, True]]]
    assert strongest(rows, 1).tolist() == [[[True, False, False]], [[False, True, False]]]
    with pytest.raises(ValueError, match="mass is 0"):
        holding(rows, 0)
    with pytest.raises(ValueError, match="at least 1 token"):
        strongest(rows, 0)


def test_a_row_as_text_gives_every_digit_back():
    attention = small_playback().at(INDEX, AttentionProbe()).attention
    assert attention is not None
    row = attention.rows(SITE, [7])[1, 0]
    table = list(csv.DictReader(io.StringIO(row_csv(row, GRID))))
    assert torch.equal(torch.tensor([float(line["weight"]) for line in table]), row)
    assert [(int(line["row"]), int(line["column"])) for line in table] == [divmod(i, 5) for i in range(15)]
    assert (int(table[7]["x"]), int(table[7]["y"])) == GRID.pixel_of(7)
    assert float(table[7]["times_uniform"]) == pytest.approx(float(row[7]) * 15, rel=1e-4)


def _map(values: np.ndarray) -> FeatureMap:
    return FeatureMap(Feature("context"), 0, torch.from_numpy(values.astype(np.float32)), 8, GRID)
