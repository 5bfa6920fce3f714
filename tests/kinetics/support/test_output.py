"""The door for output, on disks that fail, in folders with traps."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from failing_disk import CALLS, fail_at_each_call

from kinetics.support import output
from kinetics.support.output import append_line, check_target, checked_name, new_folder, write_together, write_whole

OLD, NEW = b"older " * 700, b"newer" * 900


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_what_is_written_is_there(tmp_path):
    assert write_whole(tmp_path / "a", NEW) == tmp_path / "a"
    write_whole(str(tmp_path / "b"), "Übung\n")
    write_whole(tmp_path / "empty", b"")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "a": NEW, "b": "Übung\n".encode(), "empty": b"",
    }  # fmt: skip


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
def test_a_disk_that_fails_at_any_call_leaves_the_older_file(tmp_path, monkeypatch, error):
    file = tmp_path / "rates.toml"
    file.write_bytes(OLD)
    failed = set()
    for failure, disk in fail_at_each_call(monkeypatch, lambda: write_whole(file, NEW), error):
        assert (failure.errno, failure.filename) == (error, str(file))
        assert file.read_bytes() == OLD
        assert names(tmp_path) == [file.name]
        failed.add(disk.calls[-1])
    assert failed == set(CALLS)
    assert file.read_bytes() == NEW


def test_the_same_disk_destroys_a_file_that_is_written_in_place(tmp_path, monkeypatch):
    """The control: so writes whoever opens the target itself."""
    file = tmp_path / "rates.toml"

    def in_place():
        descriptor = output.os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        output.os.write(descriptor, memoryview(NEW))
        output.os.write(descriptor, memoryview(NEW)[1000:])

    seen = []
    for _ in fail_at_each_call(monkeypatch, in_place):
        seen.append(file.exists() and file.read_bytes())
        file.write_bytes(OLD)
    assert b"" in seen
    assert NEW[:1000] in seen


def test_files_that_belong_together_wait_for_each_other(tmp_path, monkeypatch):
    files = [tmp_path / name for name in ("page.csv", "page.svg", "page.html")]
    for file in files:
        file.write_bytes(OLD)
    partly = 0
    for _, disk in fail_at_each_call(monkeypatch, lambda: write_together(dict.fromkeys(files, NEW))):
        replaced = disk.calls.count("replace")
        contents = [file.read_bytes() for file in files]
        if replaced == 0:
            assert contents == [OLD] * 3
        else:  # a disk on which files can be written and synced, but not renamed
            partly += 1
            assert contents == [NEW] * (replaced - 1) + [OLD] * (4 - replaced)
        assert names(tmp_path) == sorted(file.name for file in files)
        for file in files:
            file.write_bytes(OLD)
    assert partly == 3


def test_ctrl_c_leaves_the_older_file(tmp_path, monkeypatch):
    file = tmp_path / "rates.toml"
    file.write_bytes(OLD)

    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_whole(file, NEW)
    assert file.read_bytes() == OLD
    assert names(tmp_path) == [file.name]


def test_a_limit_of_the_system_leaves_the_older_file(tmp_path):
    file = tmp_path / "rates.toml"
    file.write_bytes(OLD)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(OSError, match=r"could not write.*rates\.toml") as failure:
            write_whole(file, NEW)
        write_whole(tmp_path / "small", NEW[:200])  # the control: it is the size
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert failure.value.errno == errno.EFBIG
    assert file.read_bytes() == OLD
    assert names(tmp_path) == ["rates.toml", "small"]


def test_a_link_planted_at_the_temporary_name_is_not_followed(tmp_path, monkeypatch):
    victim, file = tmp_path / "victim", tmp_path / "rates.toml"
    victim.write_bytes(OLD)
    monkeypatch.setattr(output.os, "urandom", lambda n: b"\x07" * n)
    planted = tmp_path / ".wellmixed-0707070707070707.part"
    for plant in (planted.symlink_to, planted.hardlink_to):
        plant(victim)
        with pytest.raises(FileExistsError, match=r"rates\.toml"):
            write_whole(file, NEW)
        assert victim.read_bytes() == OLD
        assert not file.exists()
        planted.write_bytes(NEW)  # the control: whoever opens it without O_EXCL writes through
        assert victim.read_bytes() == NEW
        victim.write_bytes(OLD)
        planted.unlink()


@pytest.mark.parametrize("kind", ["link", "dangling link", "folder", "pipe"])
def test_only_files_are_replaced(tmp_path, kind):
    victim, file = tmp_path / "victim", tmp_path / "table.csv"
    victim.write_bytes(OLD)
    if kind == "link":
        file.symlink_to(victim)
    elif kind == "dangling link":
        file.symlink_to(tmp_path / "nowhere")
    elif kind == "folder":
        file.mkdir()
    else:
        os.mkfifo(file)
    before = file.lstat()
    with pytest.raises(ValueError, match=r"table\.csv is a .*; give the path of a file"):
        write_whole(file, NEW)
    assert os.path.samestat(file.lstat(), before)
    assert victim.read_bytes() == OLD
    assert names(tmp_path) == ["table.csv", "victim"]
    check_target(victim)  # the control


def test_devices_stay_devices():
    with pytest.raises(ValueError, match="/dev/null is a device or a pipe"):
        check_target("/dev/null")


def test_permissions_of_an_older_file_are_kept(tmp_path):
    file = tmp_path / "rates.toml"
    write_whole(file, OLD)
    mask = os.umask(0)
    os.umask(mask)
    assert file.stat().st_mode & 0o777 == 0o666 & ~mask
    file.chmod(0o600)
    write_whole(file, NEW)
    assert file.stat().st_mode & 0o777 == 0o600


def test_a_file_protected_from_writing_is_not_replaced(tmp_path):
    file = tmp_path / "rates.toml"
    file.write_bytes(OLD)
    file.chmod(0o444)
    tmp_path.chmod(0o777)
    code = f"""
import os
os.chdir({str(tmp_path)!r})
if os.getuid() == 0:
    os.setgid(65534); os.setuid(65534)  # nothing is protected from root
from kinetics.support.output import new_folder, write_whole
write_whole("own", b"")
write_whole("rates.toml", b"new")
"""
    root = str(Path(output.__file__).parents[2])
    before = f"import sys; sys.path.insert(0, {root!r}); import kinetics.support.output\n"
    done = subprocess.run([sys.executable, "-c", before + code], capture_output=True, text=True, check=False)
    assert "PermissionError: rates.toml is write-protected" in done.stderr
    assert file.read_bytes() == OLD
    assert names(tmp_path) == ["own", "rates.toml"]


@pytest.mark.parametrize("name", ["line4", "T5_2", "a.b-c", "4x", "x" * 80])
def test_names_that_may_become_files(name):
    assert checked_name(name, "study") == name


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../../x",
        "a/b",
        "/etc/passwd",
        ".hidden",
        "-rf",
        "a\\b",
        "a b",
        "a\0b",
        "a\n",
        "ä",
        "x" * 81,
        "$x",
    ],
)
def test_names_that_may_not(name):
    with pytest.raises(ValueError, match=r"study .*: it names files"):
        checked_name(name, "study")


def test_a_new_folder_is_there_whole_or_not_at_all(tmp_path):
    with new_folder(tmp_path / "made") as within:
        write_whole(within / "a", "x")
        assert not (tmp_path / "made").exists()
    assert (tmp_path / "made" / "a").read_text(encoding="utf-8") == "x"

    def interrupted():
        with new_folder(tmp_path / "other") as within:
            write_whole(within / "a", "x")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir()] == ["made"]
    for taken, said in (("made", "already exists"), ("no/where", "does not exist")):
        with pytest.raises(ValueError, match=said), new_folder(tmp_path / taken):
            pass
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    with pytest.raises(ValueError, match="already exists"), new_folder(tmp_path / "link"):
        pass


def test_a_folder_that_cannot_be_made_is_named_as_it_was_asked_for(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", refused)
    said = "no folder can be made here, Permission denied: .*made'$"
    with pytest.raises(PermissionError, match=said), new_folder(tmp_path / "made"):
        pass


def test_lines_are_added_and_a_torn_one_is_left_alone(tmp_path):
    path = tmp_path / "lines"
    append_line(path, "one")
    append_line(path, "zwei \u00e4")
    assert path.read_text(encoding="utf-8") == "one\nzwei \u00e4\n"
    path.write_bytes(path.read_bytes()[:-2])  # the last write was cut short
    append_line(path, "three")
    assert path.read_bytes().splitlines()[0::2] == [b"one", b"three"]


def test_lines_are_added_to_files_alone(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "there")
    with pytest.raises(ValueError, match="is a symbolic link"):
        append_line(tmp_path / "link", "one")
    assert not (tmp_path / "there").exists()
    with pytest.raises(OSError, match="could not write"):
        append_line(tmp_path / "none" / "file", "one")


def test_a_full_disk_keeps_the_lines_before(tmp_path, monkeypatch):
    path, real = tmp_path / "lines", os.write
    append_line(path, "one")
    left = [2]

    def write(file, data):
        if not left:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(file, bytes(data)[: left.pop()])

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(OSError, match="could not write"):
        append_line(path, "another")
    monkeypatch.undo()
    append_line(path, "three")
    assert path.read_bytes().splitlines() == [b"one", b"an", b"three"]
