"""The file of a scan: torn and altered lines are left out, and their points made anew."""

import pytest

from kinetics.predicting.scanning.answering import ScanRequest
from kinetics.predicting.scanning.checkpoints import Checkpoints
from kinetics.support.answer import CONFIDENCE, Answer

ASKED = ScanRequest(("E[A] @ 1",), 10, None, 20, 0)
ANSWER = Answer(0.1 + 0.2, 0.25, float("inf"), CONFIDENCE, "ssa", 0.01, "20 runs")


def keep(folder, *keys):
    kept = Checkpoints(folder, ASKED)
    for key in keys:
        kept.add(key, [ANSWER])
    return kept.path


def test_what_was_kept_comes_back_to_the_last_bit(tmp_path):
    keep(tmp_path / "new", "one", "two")
    kept = Checkpoints(tmp_path / "new", ASKED)
    assert kept.get("one") == kept.get("two") == (ANSWER,)
    assert kept.get("three") is None
    assert Checkpoints(tmp_path / "new", ScanRequest(("E[A] @ 1",), 10, None, 20, 1)).get("one") is None


@pytest.mark.parametrize("length", [1, 40, -1])
def test_a_torn_line_is_left_out_and_the_next_begins_anew(tmp_path, length):
    path = keep(tmp_path, "one", "two")
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1].rstrip(b"\n")[:length])
    kept = Checkpoints(tmp_path, ASKED)
    assert kept.get("one") == (ANSWER,)
    assert kept.get("two") is None
    keep(tmp_path, "three")
    kept = Checkpoints(tmp_path, ASKED)
    assert kept.get("one") == kept.get("three") == (ANSWER,)


@pytest.mark.parametrize("old_new", [(b"0.25", b"0.26"), (b'"ssa"', b'"fsp"'), (b"{", b"["), (b"low", b"lw")])
def test_an_altered_line_is_left_out(tmp_path, old_new):
    path = keep(tmp_path, "one")
    path.write_bytes(path.read_bytes().replace(*old_new, 1))
    assert Checkpoints(tmp_path, ASKED).get("one") is None


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"null\n[]\n7\n{}\n", b"[" * 100_000, b'{"check": 1}\n'])
def test_a_foreign_file_holds_nothing(tmp_path, content):
    path = keep(tmp_path, "one")
    path.write_bytes(content)
    assert Checkpoints(tmp_path, ASKED).found == {}


def test_no_folder_keeps_nothing(tmp_path):
    kept = Checkpoints(None, ASKED)
    kept.add("one", [ANSWER])
    assert kept.get("one") is None
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="is a file; expected a folder for the points of scans"):
        Checkpoints(tmp_path / "file", ASKED)
