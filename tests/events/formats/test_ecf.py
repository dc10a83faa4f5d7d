"""ECF chunks decode to what was encoded: against an encoder written from the layout, in all three modes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from etnet.events.formats.prophesee.ecf import DamagedChunk, decode_chunk


def runs(values):
    """(value, how many in a row)."""
    found = []
    for value in values:
        if found and found[-1][0] == value:
            found[-1][1] += 1
        else:
            found.append([value, 1])
    return found


def encoded_times(t) -> bytes:
    out, now = bytearray(int(t[0]).to_bytes(8, "little")), int(t[0])
    for value, count in runs(t):
        step = int(value) - now
        if step >= 15:
            while step:
                out.append(0xF0 | (step & 15))
                step >>= 4
        now = int(value)
        out.append((step << 4) | min(count, 15))
        if count >= 15:
            out += count.to_bytes(2, "little")
    return bytes(out)


def encoded_runs(values, size: int, num_bits: int) -> bytes:
    out, maximum = bytearray(), (1 << num_bits) - 1
    for value, count in runs(values):
        out += ((int(value) << num_bits) | min(count, maximum)).to_bytes(size, "little")
        if count >= maximum:
            out += count.to_bytes(2, "little")
    return bytes(out)


def encoded_packed(values, num_bits: int) -> bytes:
    """Big-endian bits in words: four values in three words of num_bits · 4 / 3 bits."""
    width = num_bits * 4 // 3
    values = list(map(int, values)) + [0] * (-len(values) % 4)
    out = bytearray()
    a_bits, part = num_bits, num_bits // 3
    for a, b, c, d in zip(*[iter(values)] * 4, strict=True):
        low, middle = (1 << part) - 1, (1 << 2 * part) - 1
        words = (
            (a << (width - a_bits)) | (b & low),
            ((b >> part) << 2 * part) | (c & middle),
            ((c >> 2 * part) << (width - part)) | d,
        )
        for word in words:
            out += word.to_bytes(width // 8, "little")
    return bytes(out)


def encoded_neighbours(x) -> bytes:
    out, i = bytearray(), 0
    while i < len(x):
        base, mask = int(x[i]), 0
        i += 1
        for j in range(5):
            if i < len(x) and int(x[i]) == base + j + 1:
                mask |= 1 << (4 - j)
                i += 1
        out += ((base << 5) | mask).to_bytes(2, "little")
    return bytes(out)


def encode(x, y, t, p, mode: int) -> bytes:
    content = (len(t) << 2 | mode).to_bytes(4, "little") + encoded_times(t)
    if mode == 2:
        return content + encoded_packed((y << 12) | (x << 1) | p, 24)
    content += encoded_runs(y, 2, 5)
    if mode == 1:
        return content + encoded_packed((x << 1) | p, 12)
    return content + encoded_neighbours(x) + encoded_runs(p, 1, 7)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 700),
    mode=st.sampled_from([0, 1, 2]),
    step=st.sampled_from([0, 1, 20, 100_000]),
    rows=st.sampled_from([1, 3, 720]),
)
def test_a_chunk_decodes_to_what_was_encoded(seed, count, mode, step, rows):
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.integers(0, 4, count)) % 1280
    y = np.repeat(rng.integers(0, rows, count), rng.integers(1, 90, count))[:count]
    t = 1_600_000_000_000 + np.cumsum(rng.integers(0, step + 1, count) * (rng.random(count) < 0.3))
    p = (np.cumsum(rng.random(count) < 0.05) % 2).astype(np.int64)
    chunk = decode_chunk(encode(x, y, t, p, mode))
    for found, expected in zip(chunk, (x, y, t, p), strict=True):
        np.testing.assert_array_equal(found, expected)


@example(content=bytes(8) + b"\x0f\x01", num_events=1, mode=0)  # a long count of which one byte is there
@given(content=st.binary(max_size=200), num_events=st.integers(0, 70_000), mode=st.integers(0, 3))
def test_any_bytes_are_decoded_or_called_damaged(content, num_events, mode):
    try:
        chunk = decode_chunk((num_events << 2 | mode).to_bytes(4, "little") + content)
    except DamagedChunk:
        return
    assert len(chunk.t) == num_events


@pytest.mark.parametrize("each", [1, 20, 100])
def test_a_cut_chunk_is_called_damaged(each):
    t = np.repeat(np.arange(100 // each), each)
    whole = encode(t, t, t, t % 2, 0)
    for length in range(len(whole)):
        with pytest.raises(DamagedChunk):
            decode_chunk(whole[:length])
