from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from etnet.nets.presets import build_model
from etnet.training import optimiser
from etnet.training.config import OptimiserConfig
from etnet.training.optimiser import Muon, build_optimiser, orthogonalised


@given(rows=st.integers(1, 40), columns=st.integers(1, 60), seed=st.integers(0, 2**20))
def test_a_step_is_as_large_in_every_direction(rows: int, columns: int, seed: int):
    generator = torch.Generator().manual_seed(seed)
    # Well conditioned, as five iterations raise a singular value by at most 3.4⁵.
    left = torch.linalg.qr(torch.randn(rows, rows, generator=generator)).Q
    right = torch.linalg.qr(torch.randn(columns, columns, generator=generator)).Q
    few = min(rows, columns)
    matrix = left[:, :few] * torch.logspace(0, -1, few) @ right[:few]
    values = torch.linalg.svdvals(orthogonalised(matrix[None])[0])
    assert values.min() > 0.5
    assert values.max() < 1.3


def test_orthogonalising_keeps_the_directions():
    matrix = torch.randn(1, 12, 30, generator=torch.Generator().manual_seed(1))
    u, _, vh = torch.linalg.svd(matrix[0], full_matrices=False)
    along = torch.diagonal(u.T @ orthogonalised(matrix)[0] @ vh.T)
    assert along.min() > 0.4
    across = u.T @ orthogonalised(matrix)[0] @ vh.T - torch.diag(along)
    assert across.abs().max() < 1e-3


@given(rows=st.integers(1, 24), wider=st.integers(2, 12), seed=st.integers(0, 2**20))
def test_iterating_on_the_gram_matrix_is_the_same_polynomial(rows: int, wider: int, seed: int):
    generator = torch.Generator().manual_seed(seed)
    x = torch.randn(3, rows, rows * wider, generator=generator)
    x = x / torch.linalg.matrix_norm(x, keepdim=True)
    torch.testing.assert_close(optimiser._by_gram(x), optimiser._by_matrix(x), atol=2e-5, rtol=0)


def test_parameters_without_a_gradient_stay_and_join_later():
    first, second = nn.Parameter(torch.ones(3)), nn.Parameter(torch.ones(3))
    muon = Muon([{"params": [first, second], "blocks": 0}], weight_decay=0.0)
    first.grad = torch.ones(3)
    muon.step()
    assert torch.equal(second, torch.ones(3))
    second.grad = torch.ones(3)
    muon.step()
    assert muon.state[first]["count"] == 2
    assert muon.state[second]["count"] == 1
    torch.testing.assert_close(second.detach(), torch.full((3,), 1 - 1e-3))


def test_the_size_of_gradients_does_not_matter():
    moved = []
    for size in (1.0, 1e-3):
        weight = nn.Parameter(torch.zeros(6, 9))
        weight.grad = size * torch.randn(6, 9, generator=torch.Generator().manual_seed(0))
        Muon([{"params": [weight], "blocks": 3}], weight_decay=0.0).step()
        moved.append(weight.detach())
    assert torch.allclose(moved[0], moved[1], atol=1e-6)
    assert moved[0].square().mean().sqrt() == pytest.approx(0.2e-3, rel=0.5)


def test_what_is_no_matrix_moves_as_under_adamw():
    start = torch.randn(7, generator=torch.Generator().manual_seed(2))
    ours, theirs = nn.Parameter(start.clone()), nn.Parameter(start.clone())
    muon = Muon([{"params": [ours], "blocks": 0}], weight_decay=0.1)
    adamw = torch.optim.AdamW([theirs], lr=1e-3, weight_decay=0.1)
    for seed in range(5):
        gradient = torch.randn(7, generator=torch.Generator().manual_seed(seed))
        ours.grad, theirs.grad = gradient.clone(), gradient.clone()
        muon.step()
        adamw.step()
    assert torch.allclose(ours, theirs, atol=1e-6)


def test_every_parameter_is_in_one_group():
    model, reader = build_model("tiny"), nn.Linear(3, 2)
    muon = build_optimiser(model, reader.parameters(), OptimiserConfig(kind="muon"))
    grouped = [parameter for group in muon.param_groups for parameter in group["params"]]
    assert len(grouped) == len(set(grouped))
    assert set(grouped) == {*model.parameters(), *reader.parameters()}
    ends = {*model.head.parameters(), *model.tail.parameters()}
    assert all(group["blocks"] == 0 for group in muon.param_groups if ends & set(group["params"]))
    assert all((group["rate_share"] < 1) == (group["blocks"] == 0) for group in muon.param_groups)


def test_moments_survive_a_checkpoint(tmp_path: Path):
    def one_step(muon: Muon, weight: nn.Parameter, seed: int) -> None:
        weight.grad = torch.randn(4, 5, generator=torch.Generator().manual_seed(seed))
        muon.step()

    whole = nn.Parameter(torch.zeros(4, 5))
    first = Muon([{"params": [whole], "blocks": 1}], weight_decay=0.0)
    one_step(first, whole, 0)
    torch.save(first.state_dict(), tmp_path / "state.pt")
    parted = nn.Parameter(whole.detach().clone())
    second = Muon([{"params": [parted], "blocks": 1}], weight_decay=0.0)
    second.load_state_dict(torch.load(tmp_path / "state.pt", weights_only=True))
    one_step(first, whole, 1)
    one_step(second, parted, 1)
    assert torch.equal(whole, parted)
