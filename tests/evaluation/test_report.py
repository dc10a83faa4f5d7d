"""A report has the grey and the affine rows, averages as its protocol says, and names what is missing."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from rich.console import Console

from etnet.evaluation.datasets import sequence_called
from etnet.evaluation.plot import plot_scores
from etnet.evaluation.protocol import ProtocolName
from etnet.evaluation.report import Failure, Report, _short
from etnet.evaluation.scores import ROWS, Columns, Scores


def scores(model: str, recording: str, lpips: list[float], protocol: ProtocolName = "paper") -> Scores:
    stamps, count = 40_000 * np.arange(len(lpips), dtype=np.int64), len(lpips)

    def columns(worse: float) -> Columns:
        return {"mse": np.full(count, 0.02), "lpips": np.array(lpips) + worse, "temporal": np.full(count, np.nan)}

    rows = dict(zip(ROWS, (columns(0.0), columns(-0.01), columns(0.5)), strict=True))
    return Scores(model, recording, protocol, sequence_called(recording), stamps, rows, (f"remark on {recording}",))


ONE, TWO = scores("a", "slider_depth", [0.2, 0.4]), scores("a", "office_zigzag", [0.6] * 6)


def test_every_recording_and_dataset_has_the_grey_the_raw_and_the_affine_row() -> None:
    lines = Report("paper", (ONE, TWO, scores("b", "slider_depth", [0.1, 0.1]))).lines()
    assert [(line.group, line.label) for line in lines][:5] == [
        ("slider_depth", "constant grey"),
        ("slider_depth", "a"),
        ("slider_depth", "a, best affine per frame"),
        ("slider_depth", "b"),
        ("slider_depth", "b, best affine per frame"),
    ]
    assert {line.group for line in lines} == {"slider_depth", "office_zigzag", "IJRR (2 of 7 sequences)"}


@pytest.mark.parametrize(("protocol", "expected"), [("paper", 0.45), ("evreal", 0.525)])
def test_the_datasets_mean_is_the_protocols(protocol, expected: float) -> None:
    entries = (scores("a", "slider_depth", [0.2, 0.4], protocol), scores("a", "office_zigzag", [0.6] * 6, protocol))
    lines = [line for line in Report(protocol, entries).lines() if line.group.startswith("IJRR")]
    line = next(line for line in lines if line.label == "a")
    assert line.values["lpips"].mean == pytest.approx(expected)
    assert line.num_frames == 8


def test_a_missing_sequence_and_a_failed_pair_are_named_in_every_form() -> None:
    report = Report("paper", (ONE,), (Failure("a", "broken.h5", "cannot be read"),))
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(*report.notes(), sep="\n")
    for text in (console.export_text(), report.to_markdown(), json.dumps(report.to_json())):
        flat = " ".join(text.split())
        assert "broken.h5" in flat
        assert "office_zigzag" in flat
        assert "MVSEC: all of it" in flat
        assert "remark on slider_depth" in flat
        assert "No second judge" in flat
    console.file.close()


def test_the_table_fits_80_columns_and_says_when_there_is_no_value() -> None:
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    judged = {row: {**columns, "lpips_vgg": columns["lpips"]} for row, columns in ONE.rows.items()}
    console.print(Report("paper", (replace(ONE, rows=judged), TWO)).to_table())
    text = console.export_text()
    console.file.close()
    assert "…" not in text
    assert "n/a" in text
    assert ".300" in text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.3, ".300"), (-0.25, "-.250"), (0.0, ".000"), (10.5, "10.500"), (20.0, "20.000"), (-30.04, "-30.040")],
)
def test_only_a_leading_zero_is_left_out(value: float, text: str) -> None:
    assert _short(value, "lpips") == text


def test_what_it_writes_twice_is_the_same() -> None:
    report = Report("paper", (ONE, TWO))
    assert report.to_markdown() == report.to_markdown()
    json.dumps(report.to_json(), allow_nan=False)


def test_the_plot_is_svg_with_a_line_a_model() -> None:
    svg = ElementTree.fromstring(plot_scores((ONE, TWO, scores("<b>", "slider_depth", [0.1, np.nan, 0.2]))))
    lines = svg.findall(".//{http://www.w3.org/2000/svg}polyline")
    assert len(lines) == 3
    assert [len(line.attrib["points"].split()) for line in lines] == [2, 2, 6]
