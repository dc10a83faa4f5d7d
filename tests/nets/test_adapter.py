"""Somebody's own network keeps the contracts of ours, and the example in the documentation runs."""

import re
from pathlib import Path

import pytest
import torch
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.adapter import Adapter
from etnet.nets.base import Reconstructor
from etnet.nets.intervention import Intervention
from tests.evaluation.recordings import made_up, write_event_utils


def counts(voxel: Tensor, memory: tuple[Tensor, ...] | None) -> tuple[Tensor, tuple[Tensor, ...]]:
    total = voxel.sum(dim=1, keepdim=True) + (0 if memory is None else memory[0])
    return torch.sigmoid(total), (total,)


def test_a_state_gives_its_own_frame_with_no_replay() -> None:
    model, state = Adapter(counts, "counts"), None
    assert isinstance(model, Reconstructor)
    generator = torch.Generator().manual_seed(0)
    for _ in range(3):
        voxel = torch.randn(1, 5, 9, 12, generator=generator)
        step = model(voxel, state)
        pyramid, state = model.encode(voxel, state)
        assert torch.equal(model.decode(pyramid)[0], step.frame)
        assert torch.equal(model.decode(model.pyramid(voxel, state))[0], step.frame)


def test_a_frame_of_the_wrong_shape_and_an_intervention_are_refused() -> None:
    voxel = torch.zeros(1, 5, 9, 12)
    with pytest.raises(ModelError, match=r"\(1, 1, 9, 12\)"):
        Adapter(lambda grid, _: (grid, ()), "wrong")(voxel)
    with pytest.raises(ModelError, match="whole steps"):
        Adapter(counts, "counts")(voxel, intervention=Intervention(without_context=True))


def test_the_example_of_the_documentation_runs(tmp_path: Path, capsys) -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "own_network.md").read_text()
    found = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert found is not None
    exec(found[1], {"path": write_event_utils(made_up(num_frames=5), tmp_path / "recording.h5")})
    assert capsys.readouterr().out.startswith("4 frames, LPIPS ")
