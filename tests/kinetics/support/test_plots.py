"""Figures as files: whole or not at all, and with names as they are."""

import numpy as np
import pytest
from failing_disk import FailingDisk
from matplotlib.figure import Figure

from kinetics.support import output, plots

NAMES = ("$A", "B$", "{_")


def counts(ax):
    plots.steps(ax, [0.0, 1.0], np.ones((2, len(NAMES))), NAMES)
    ax.set_title("from $} to $")
    ax.set_yticks(range(3), NAMES)
    ax.set_xscale("log")


@pytest.mark.parametrize("kind", ["png", "pdf", "svg", "SVG"])
def test_a_failing_disk_leaves_the_older_figure(tmp_path, monkeypatch, kind):
    file = tmp_path / f"counts.{kind}"
    file.write_bytes(b"older")
    monkeypatch.setattr(output, "os", FailingDisk(at=3))
    with pytest.raises(OSError, match=f"could not write.*{file.name}"):
        plots.save(str(file), counts, dpi=40)
    assert file.read_bytes() == b"older"
    monkeypatch.undo()
    plots.save(str(file), counts, dpi=40)
    new = file.read_bytes()
    assert new.startswith({"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind.lower()])
    plots.save(str(file), counts, dpi=40)
    assert file.read_bytes() == new


def test_a_dollar_in_a_name_begins_no_formula():
    figure = Figure()
    counts(figure.add_subplot())
    with pytest.raises(ValueError, match="from"):  # the control: Matplotlib's own reading
        figure.draw_without_rendering()
    plots.words_as_they_are(figure)
    figure.draw_without_rendering()
    (ax,) = figure.axes
    assert {text.get_parse_math() for text in (*ax.get_yticklabels(), *ax.get_legend().get_texts())} == {False}
    powers = ax.get_xticklabels()
    assert any("10^" in text.get_text() for text in powers)
    assert {text.get_parse_math() for text in powers} == {True}
