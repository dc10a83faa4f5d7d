"""Labels tell files apart, and are as short as that allows."""

from itertools import combinations, product
from pathlib import Path

from etnet.cli.labels import labels_of


def test_a_name_without_its_ending_is_enough_where_no_other_file_has_it():
    paths = [Path("runs/12/weights.safetensors"), Path("runs/13/weights.safetensors"), Path("mine.safetensors")]
    assert list(labels_of(paths).values()) == ["12/weights", "13/weights", "mine"]
    assert list(labels_of([Path("a/x/w.h5"), Path("b/x/w.h5"), Path("y/w.h5")]).values()) == ["a/x/w", "b/x/w", "y/w"]
    assert list(labels_of([Path("events.h5"), Path("events.raw")]).values()) == ["events.h5", "events.raw"]
    assert labels_of([]) == {}


def test_no_two_files_have_one_label():
    names = ("events.h5", "events.raw", "events", "events.h5.zip", "a")
    paths = [Path("/", folder, name) for folder, name in product(("", "a", "b", "a/b"), names)]
    for few in combinations(paths, 3):
        labels = labels_of(few)
        assert tuple(labels) == few
        assert len(set(labels.values())) == 3
    assert len(set(labels_of(paths).values())) == len(paths)
