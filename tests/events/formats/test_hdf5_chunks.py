"""Packed chunks of HDF5: sound ones are read as they were written, and a damaged one never reaches its unpacker."""

import struct

import h5py
import hdf5plugin
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events.formats.hdf5.chunks import checked
from etnet.events.open import open_recording
from tests.strategies import make_events

CODECS = {
    "blosc zstd": hdf5plugin.Blosc("zstd", 5, 1),
    "blosc lz4, bits": hdf5plugin.Blosc("lz4", 5, 2),
    "blosclz, plain": hdf5plugin.Blosc("blosclz", 0, 0),
    "bitshuffle lz4": hdf5plugin.Bitshuffle(),
    "bitshuffle zstd": hdf5plugin.Bitshuffle(cname="zstd"),
    "bitshuffle": hdf5plugin.Bitshuffle(cname="none"),
    "bzip2": hdf5plugin.BZip2(),
}


def write(path, codec, **columns):
    with h5py.File(path, "w") as file:
        for axis, column in columns.items():
            file.create_dataset(f"events/{axis}", data=column, chunks=(700,), **CODECS[codec])


def some_events(path, codec, num=3000):
    events = make_events(num)
    write(path, codec, x=events.x, y=events.y, t=events.t, p=events.p > 0)
    return events


@pytest.mark.parametrize("codec", CODECS)
def test_what_was_packed_is_read_as_it_was(codec, tmp_path):
    events = some_events(tmp_path / "packed.h5", codec)
    with open_recording(tmp_path / "packed.h5") as recording:
        read = recording.read(0, recording.num_events)
    for axis in "xytp":
        np.testing.assert_array_equal(getattr(read, axis), getattr(events, axis))


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("tables"), np.random.default_rng(0)
    content = rng.integers(0, 50, (37, 23)).astype("u2")
    with h5py.File(folder / "tables.h5", "w") as file:
        for number, codec in enumerate(CODECS):
            file.create_dataset(str(number), data=content, chunks=(8, 5), **CODECS[codec])
        yield content, [checked(file[str(number)], "table", "tables.h5") for number in range(len(CODECS))]


bounds = st.one_of(st.none(), st.integers(-40, 40))
parts = st.one_of(st.builds(slice, bounds, bounds, st.sampled_from([None, 1, 3])), st.integers(0, 22), st.just(...))


@given(selection=st.one_of(parts, st.tuples(parts, st.integers(0, 22)), st.tuples(st.integers(0, 36), parts)))
def test_every_selection_is_the_librarys_own(tables, selection):
    content, stored = tables
    for each in stored:
        np.testing.assert_array_equal(each[selection], content[selection])


def test_the_whole_is_read_as_an_array_too(tables):
    content, stored = tables
    for each in stored:
        np.testing.assert_array_equal(np.asarray(each), content)


LIES = {
    "blosc zstd": [(12, "<I", 196_608_584), (12, "<I", 3), (4, "<I", 4_000_000_000), (8, "<I", 0), (8, "<I", 1 << 31)],
    "bitshuffle lz4": [(0, ">Q", 1 << 40), (8, ">I", 0), (8, ">I", 7), (12, ">I", 1 << 30), (12, ">I", 0)],
    "bitshuffle zstd": [(12, ">I", 0xFFFFFFFF), (0, ">Q", 0)],
}


@pytest.mark.parametrize(("codec", "lie"), [(codec, lie) for codec, lies in LIES.items() for lie in lies])
def test_a_size_that_lies_is_refused_before_it_is_followed(codec, lie, tmp_path):
    some_events(tmp_path / "damaged.h5", codec)
    place, form, value = lie
    after = place + struct.calcsize(form)
    rewrite(tmp_path / "damaged.h5", lambda chunk: chunk[:place] + struct.pack(form, value) + chunk[after:])
    with pytest.raises(RecordingError, match=r"damaged.h5: events/. is damaged in the chunk that begins at .*; copy"):
        read_all(tmp_path / "damaged.h5")


@pytest.mark.parametrize("codec", CODECS)
def test_a_chunk_that_is_cut_short_is_refused(codec, tmp_path):
    some_events(tmp_path / "damaged.h5", codec)
    for length in (200, 11, 1):
        rewrite(tmp_path / "damaged.h5", lambda chunk, length=length: chunk[:length])
        with pytest.raises(RecordingError):
            read_all(tmp_path / "damaged.h5")


def rewrite(path, change):
    """Put another content in the place of the second chunk of the stamps."""
    with h5py.File(path, "r+") as file:
        stored = file["events/t"].id
        stored.write_direct_chunk((700,), change(stored.read_direct_chunk((700,))[1]))


def read_all(path):
    with open_recording(path) as recording:
        recording.read(0, recording.num_events)


@pytest.mark.parametrize("codec", [codec for codec in CODECS if "blosc" not in codec])  # which cannot pack it
def test_text_of_any_length_is_read(codec, tmp_path):
    words = ["seconds", "", "µs"] * 400
    with h5py.File(tmp_path / "text.h5", "w") as file:
        stored = file.create_dataset("unit", data=words, dtype=h5py.string_dtype(), chunks=(700,), **CODECS[codec])
        assert [word.decode() for word in checked(stored, "unit", "text.h5")[:]] == words


def test_chunks_that_were_never_written_are_filled_in(tmp_path):
    with h5py.File(tmp_path / "gaps.h5", "w") as file:
        stored = file.create_dataset("x", (2000,), "u2", chunks=(700,), fillvalue=9, **CODECS["blosc zstd"])
        stored[:700] = 5
        np.testing.assert_array_equal(checked(stored, "x", "gaps.h5")[:], [5] * 700 + [9] * 1300)


def test_a_chunk_that_the_codec_was_not_asked_for_is_read(tmp_path):
    plain = np.arange(700, dtype="u2")
    with h5py.File(tmp_path / "skipped.h5", "w") as file:
        stored = file.create_dataset("x", (700,), "u2", chunks=(700,), **CODECS["blosc zstd"])
        stored.id.write_direct_chunk((0,), plain.tobytes(), filter_mask=1)
    with h5py.File(tmp_path / "skipped.h5") as file:
        stored = file["x"]
        np.testing.assert_array_equal(checked(stored, "x", "skipped.h5")[:], plain)


def test_a_checksum_around_the_codec_is_read_and_any_other_filter_refused(tmp_path):
    content = np.arange(3000, dtype="u4")
    for name, above in (("sum.h5", h5py.h5z.FILTER_FLETCHER32), ("twice.h5", h5py.h5z.FILTER_DEFLATE)):
        with h5py.File(tmp_path / name, "w") as file:
            made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            made.set_chunk((700,))
            made.set_filter(hdf5plugin.BLOSC_ID, 0, CODECS["blosc zstd"].filter_options)
            made.set_filter(above, 0, () if name == "sum.h5" else (4,))
            space = h5py.h5s.create_simple((3000,))
            stored = h5py.Dataset(h5py.h5d.create(file.id, b"t", h5py.h5t.NATIVE_UINT32, space, made))
            stored[:] = content
            if name == "sum.h5":
                np.testing.assert_array_equal(checked(stored, "t", name)[100:2900], content[100:2900])
            else:
                with pytest.raises(RecordingError, match=r"twice.h5: t is packed by .* other filters"):
                    checked(stored, "t", name)
