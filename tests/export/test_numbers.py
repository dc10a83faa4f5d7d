import csv
import json

import h5py
import numpy as np
import pytest
import torch

from etnet.errors import Cancelled, EtnetError, ModelError
from etnet.evaluation.lpips import load_lpips
from etnet.export.arrays import ArraysChoice, write_arrays
from etnet.export.table import COLUMNS, write_table
from etnet.nets.attention import AttentionProbe
from etnet.reconstruction import window_voxel
from tests.export.recordings_made_up import NUM_WINDOWS, SENSOR, made_up_take

SITE = "scale1.encoder.2.self"
EVERYTHING = ArraysChoice(("frames", "voxels", "camera", "attention", "states"), ((10, 10), (45, 33)), (SITE,))


def read(path) -> dict[str, np.ndarray]:
    if path.suffix == ".npz":
        with np.load(path) as archive:
            return {name: archive[name] for name in archive.files}
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[:]}) if isinstance(item, h5py.Dataset) else None)
        found["facts"] = np.array(file.attrs["facts"])
    return found


@pytest.mark.parametrize("name", ["a.npz", "a.h5"])
def test_arrays_are_those_of_the_network_in_both_containers(tmp_path, name):
    take = made_up_take(1, 4)
    assert write_arrays(take, tmp_path / name, EVERYTHING) == 3
    found = read(tmp_path / name)
    assert found["window"].tolist() == [1, 2, 3]
    assert found["t_stop_us"].tolist() == [80_000, 120_000, 160_000]
    for row, moment in enumerate(take.moments(AttentionProbe())):
        assert np.array_equal(found["frames"][row], moment.frame)
        voxel = window_voxel(take.playback.model, take.recording, moment.window)
        assert np.array_equal(found["voxels"][row], voxel.numpy())
        assert np.array_equal(found["camera"][row], moment.camera)
        for i, tensor in enumerate(moment.step.state):
            assert np.array_equal(found[f"state/{i}"][row], tensor[0].numpy())
        tokens = [moment.step.attention.grid.token_at(x, y) for x, y in EVERYTHING.queries]
        rows = moment.step.attention.rows(SITE, tokens)
        assert torch.equal(torch.from_numpy(found[f"attention/{SITE}"][row]), rows.transpose(0, 1))
    assert json.loads(str(found["facts"]))["sensor"] == [SENSOR.width, SENSOR.height]
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", ["a.npz", "a.h5"])
def test_a_cancelled_export_of_arrays_leaves_nothing(tmp_path, name):
    calls = iter(range(100))
    with pytest.raises(Cancelled):
        write_arrays(made_up_take(), tmp_path / name, ArraysChoice(), is_cancelled=lambda: next(calls) > 3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.npz", "a.h5"])
def test_arrays_that_are_packed_or_read_again_can_be_cancelled_too(tmp_path, name):
    told = []
    with pytest.raises(Cancelled, match="packed"):
        write_arrays(
            made_up_take(),
            tmp_path / name,
            ArraysChoice(),
            lambda done, total: told.append(done == total),
            lambda: bool(told) and told[-1],
        )
    assert len(told) == NUM_WINDOWS
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_exported_is_said_before_or_by_name(tmp_path):
    with pytest.raises(EtnetError, match=r"\.npz or \.h5"):
        write_arrays(made_up_take(), tmp_path / "a.txt", ArraysChoice())
    with pytest.raises(EtnetError, match="query pixel"):
        ArraysChoice(("attention",))
    with pytest.raises(EtnetError, match=r"\(99, 3\)"):
        write_arrays(made_up_take(), tmp_path / "a.npz", ArraysChoice(("attention",), ((99, 3),)))
    with pytest.raises(ModelError, match=r"no\.site"):
        write_arrays(made_up_take(), tmp_path / "a.npz", ArraysChoice(("attention",), ((1, 1),), ("no.site",)))


def test_the_table_agrees_with_the_events_and_the_pictures(tmp_path):
    take = made_up_take()
    assert write_table(take, tmp_path / "t.csv") == NUM_WINDOWS
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    for row, moment in zip(rows, take.moments(), strict=True):
        events = moment.events
        assert int(row["num_events"]) == len(events)
        assert float(row["events_per_second"]) == pytest.approx(len(events) / 0.04, rel=1e-5)
        assert float(row["on_share"]) == pytest.approx((events.p == 1).mean(), rel=1e-5)
        active = len({(x, y) for x, y in zip(events.x.tolist(), events.y.tolist(), strict=True)})
        assert float(row["active_share"]) == pytest.approx(active / SENSOR.num_pixels, rel=1e-5)
        squared = (moment.frame.clip(0, 1).astype(float) - moment.camera) ** 2
        assert float(row["mse"]) == pytest.approx(squared.mean(), rel=1e-5)
        assert int(row["camera_stamp_us"]) == moment.window.t_stop
        pair = (torch.from_numpy(image)[None, None] for image in (moment.frame.clip(0, 1), moment.camera))
        assert float(row["lpips"]) == pytest.approx(float(load_lpips()(*pair)), rel=1e-5)
