"""Derived networks in the user's cache: the same as derived anew, whatever lies in the folder, and without one."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from kinetics.assembly import LivelockError, RuleBook, derive
from kinetics.assembly.deriving import cached
from kinetics.assembly.deriving.cached import derive_cached

ROOT = Path(__file__).parents[4]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache for any network, however quickly derived."""
    monkeypatch.setenv(cached.FOLDER, str(tmp_path / "cache"))
    monkeypatch.setattr(cached, "WORTH", 0.0)
    return tmp_path / "cache" / "networks"


@pytest.fixture
def derivations(monkeypatch):
    """The books derived anew since."""
    made = []

    def counted(book, progress=None):
        made.append(book.name)
        return derive(book, progress=progress)

    monkeypatch.setattr(cached, "derive", counted)
    return made


def same(found, expected):
    """Down to the order of species, channels and ways, and the digits of these."""
    ways = [[[*event, [(*each, repr(n)) for each, n in of.items()]] for event, of in d.events.items()] for d in
            (found, expected)]  # fmt: skip
    return (
        list(found.structures.items()) == list(expected.structures.items())
        and ways[0] == ways[1]
        and found.network.fingerprint == expected.network.fingerprint
        and found.rate_classes == expected.rate_classes
        and (found.beyond, found.stopped, found.is_closed) == (None, "", True)
        and found.book.fired == expected.book.fired
    )


@pytest.mark.parametrize("name", ["line4", "line4_pairs", "t5", "t5_all", "jack13"])
def test_a_network_that_is_read_is_the_one_derived(name, folder, derivations):
    expected = derive(RuleBook.load(name))
    for _ in range(3):
        book = RuleBook.load(name)
        found = derive_cached(book)
        assert found.book is book
        assert same(found, expected)
        assert found.species_of(book.monomer()) == expected.species_of(book.monomer())
    assert derivations == [name]
    (file,) = folder.iterdir()
    assert file.name == f"{RuleBook.load(name).fingerprint}.json"


def test_a_book_with_another_rule_is_another_network(folder, derivations):
    derive_cached(RuleBook.load("t5"))
    derive_cached(RuleBook.load("t5_bar"))
    assert derivations == ["t5", "t5_bar"]
    assert len(list(folder.iterdir())) == 2


def test_what_is_derived_quickly_is_not_kept(folder, derivations, monkeypatch):
    monkeypatch.setattr(cached, "WORTH", 10.0)
    derive_cached(RuleBook.load("line4"))
    assert not folder.exists()


def spoiled(whole):
    """Contents that are not the file: cut at many places, altered, foreign, of other sources or another book."""
    yield from (whole[:length] for length in range(0, len(whole), max(1, len(whole) // 40)))
    for place in range(3, len(whole), max(1, len(whole) // 40)):
        yield whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
    head, body = whole.rstrip(b"\n").split(b"\n")
    yield from (b"\n", b"{}\n{}\n", b"[]\n[]\n", b"null\nnull\n", b"\xff\xfe\n\x00\n", b"[" * 10**5 + b"\n" + b"1\n")
    yield b"\x80\x04\x95\x05\x00\x00\x00\x00\x00\x00\x00\x8c\x01a\x94.\n{}\n"  # a pickle
    yield whole + whole
    for name, other in (("sources", "0" * 64), ("book", "0" * 64), ("sha256", "0" * 64)):
        yield json.dumps(json.loads(head) | {name: other}).encode() + b"\n" + body + b"\n"


def test_damaged_and_foreign_files_are_ignored_and_made_anew(folder, derivations):
    expected = derive(RuleBook.load("line4"))
    derive_cached(RuleBook.load("line4"))
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    tried = list(spoiled(whole))
    assert len(tried) > 80
    for content in tried:
        file.write_bytes(content)
        derivations.clear()
        assert same(derive_cached(RuleBook.load("line4")), expected)
        assert derivations == ["line4"], content[:80]
        assert file.read_bytes() == whole


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content["events"][0].__setitem__(0, [0, 99]),
        lambda content: content["events"][0].__setitem__(0, [0, -1]),
        lambda content: content["events"][0].__setitem__(0, [0, 0.0]),
        lambda content: content["events"][0].__setitem__(2, [[0, float("nan")]]),
        lambda content: content["events"][0].__setitem__(2, [[0, -4.0]]),
        lambda content: content["events"][0].__setitem__(2, [[77, 4.0]]),
        lambda content: content["events"].append(content["events"][0]),
        lambda content: content["structures"].append(content["structures"][0]),
        lambda content: content["structures"][1].__setitem__(3, ["nothing", "nothing"]),
        lambda content: content["structures"][1].__setitem__(1, [[0, 0, 0], [0, 0, 0]]),
        lambda content: content["structures"][1].__setitem__(2, [0, 24]),
        lambda content: content.pop("classes"),
        lambda content: content.__setitem__("structures", 3),
    ],
)
def test_a_content_that_the_book_cannot_have_is_ignored_though_its_checksum_holds(
    change, folder, derivations, monkeypatch
):
    derive_cached(RuleBook.load("line4"))
    (file,) = folder.iterdir()
    content = json.loads(file.read_bytes().split(b"\n")[1])
    change(content)
    with monkeypatch.context() as patch:
        patch.setattr(cached, "_content", lambda _: content)
        cached._keep(file, derive(RuleBook.load("line4")))
    derivations.clear()
    assert same(derive_cached(RuleBook.load("line4")), derive(RuleBook.load("line4")))
    assert derivations == ["line4"]


def test_the_sources_that_derive_are_part_of_a_file(folder, derivations, monkeypatch):
    derive_cached(RuleBook.load("line4"))
    monkeypatch.setattr(cached, "sources_hash", lambda: "f" * 64)
    derive_cached(RuleBook.load("line4"))
    derive_cached(RuleBook.load("line4"))
    assert derivations == ["line4", "line4"]
    monkeypatch.setattr(cached, "sources_hash", lambda: None)  # no sources: nothing is kept, nothing read
    derive_cached(RuleBook.load("line4"))
    assert len(derivations) == 3


def planted(kind, path, tmp_path):
    path.parent.mkdir(parents=True)
    if kind == "link":
        path.symlink_to(tmp_path / "elsewhere")
    elif kind == "folder":
        path.mkdir()
    elif kind == "pipe":  # which would wait for a writer
        os.mkfifo(path)


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")
@pytest.mark.parametrize("kind", ["link", "folder", "pipe"])
def test_what_is_no_file_is_neither_read_nor_written_through(kind, folder, derivations, tmp_path):
    path = folder / f"{RuleBook.load('line4').fingerprint}.json"
    planted(kind, path, tmp_path)
    before = path.lstat().st_mode
    for _ in range(2):
        derive_cached(RuleBook.load("line4"))
    assert derivations == ["line4", "line4"]
    assert path.lstat().st_mode == before
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners of POSIX")
def test_a_file_of_another_user_is_not_read(folder, derivations, monkeypatch):
    derive_cached(RuleBook.load("line4"))
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    derive_cached(RuleBook.load("line4"))
    assert derivations == ["line4", "line4"]


@pytest.mark.parametrize("number", [13, 28, 30])
@pytest.mark.parametrize("step", ["open", "write", "fsync", "replace", "mkdir"])
def test_a_disk_that_fails_costs_nothing_but_time(step, number, folder, derivations, monkeypatch):
    """Read-only, full, or write-protected, at any step."""

    def fail(*_args, **_named):
        raise OSError(number, os.strerror(number))

    if step == "mkdir":
        monkeypatch.setattr(Path, "mkdir", fail)
    else:
        true = getattr(os, step)

        def sometimes(*args, **named):
            if step != "open" or named or len(args) > 2:  # only files that are made anew
                fail()
            return true(*args, **named)

        monkeypatch.setattr(os, step, sometimes)
    for _ in range(2):
        assert len(derive_cached(RuleBook.load("line4")).structures) == 4
    assert derivations == ["line4", "line4"]
    assert not folder.exists() or not list(folder.iterdir())


def test_a_folder_may_be_removed_and_be_no_folder(folder, derivations):
    derive_cached(RuleBook.load("line4"))
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    derive_cached(RuleBook.load("line4"))
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    folder.write_text("in the way")
    derive_cached(RuleBook.load("line4"))
    assert derivations == ["line4"] * 3
    assert folder.read_text() == "in the way"


def test_old_files_make_room(folder, monkeypatch):
    monkeypatch.setattr(cached, "KEPT", 2)
    for age, name in enumerate(["line4", "t5", "t5_bar"]):
        derive_cached(RuleBook.load(name))
        newest = folder / f"{RuleBook.load(name).fingerprint}.json"
        os.utime(newest, (1e9 + age, 1e9 + age))
    left = {RuleBook.load(name).fingerprint for name in ("t5", "t5_bar")}
    assert {file.stem for file in folder.iterdir()} == left


def test_where_the_folder_is(monkeypatch, tmp_path):
    monkeypatch.setenv(cached.FOLDER, "off")
    assert cached.cache_folder() is None
    monkeypatch.setenv(cached.FOLDER, str(tmp_path))
    assert cached.cache_folder() == tmp_path / "networks"
    monkeypatch.delenv(cached.FOLDER)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/path")
    assert cached.cache_folder() == tmp_path / ".cache" / "wellmixed" / "networks"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    assert cached.cache_folder() == tmp_path / "own" / "wellmixed" / "networks"

    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    assert cached.cache_folder() is None
    assert len(derive_cached(RuleBook.load("line4")).structures) == 4


def test_turned_off_nothing_is_written(folder, derivations, monkeypatch):
    monkeypatch.setenv(cached.FOLDER, "off")
    derive_cached(RuleBook.load("line4"))
    derive_cached(RuleBook.load("line4"))
    assert derivations == ["line4", "line4"]
    assert not folder.exists()


@pytest.mark.usefixtures("folder")
def test_errors_are_those_of_deriving(monkeypatch):
    def refuses(_book, progress=None):
        raise LivelockError("round and round")

    monkeypatch.setattr(cached, "derive", refuses)
    with pytest.raises(LivelockError, match="round and round"):
        derive_cached(RuleBook.load("line4"))


def test_processes_that_write_at_once_leave_a_whole_file(folder, derivations):
    """Four, each over the others' files, which they remove now and then."""
    code = (
        "from kinetics.assembly import RuleBook\nfrom kinetics.assembly.deriving import cached\n"
        "cached.WORTH, expected = 0.0, None\n"
        "for k in range(25):\n"
        "    found = cached.derive_cached(RuleBook.load('t5')).network.fingerprint\n"
        "    assert expected in (None, found)\n    expected = found\n"
        "    if k % 5 == 0: cached.cache_folder().joinpath(RuleBook.load('t5').fingerprint + '.json').unlink(True)\n"
        "print(expected)"
    )
    running = [
        subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(4)
    ]
    ended = [process.communicate() for process in running]
    assert [process.returncode for process in running] == [0] * 4, ended
    (found,) = {out for out, _ in ended}
    assert found.decode().strip() == derive(RuleBook.load("t5")).network.fingerprint
    derive_cached(RuleBook.load("t5"))
    derivations.clear()
    derive_cached(RuleBook.load("t5"))
    assert derivations == []
    assert [file.suffix for file in folder.iterdir()] == [".json"]
