import errno
import io
import os
import resource
import threading
import warnings
import zipfile
import zlib
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fake_runs import FakeSpec, record_of, specs_of

from mechsim.runs import store as store_module
from mechsim.runs.record import RunRecord
from mechsim.runs.store import (
    FORMAT,
    HEADER,
    MAGIC,
    START,
    DamagedRunError,
    RunStore,
    decode,
    digest_of,
    encode,
)

SPEC = FakeSpec(seed=5, run=0)


def sealed(payload, version=FORMAT):
    """A file whose header and checksum are right, whatever it holds."""
    header = HEADER.pack(MAGIC, version, len(payload))
    return header + sha256(header + payload).digest() + payload


def archive(members, compression=zipfile.ZIP_STORED):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return buffer.getvalue()


def twice(members, name):
    """With a second member of one name."""
    buffer = io.BytesIO(archive(members))
    with zipfile.ZipFile(buffer, "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr(name, members[name])
    return buffer.getvalue()


def npy(header, data=b""):
    """An npy 1.0 file with a header of our making."""
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def assert_refused(store, data, reason=""):
    path = store.path(SPEC)
    path.write_bytes(data)
    with pytest.warns(RuntimeWarning, match=f"damaged .*{reason}"):
        assert store.read(SPEC) is None
    assert not path.exists()
    assert path.with_name(path.name + ".damaged").read_bytes() == data


def test_a_run_comes_back_as_it_was(tmp_path):
    store, record = RunStore(tmp_path / "a" / "b"), record_of(SPEC)
    assert store.read(SPEC) is None
    store.write(record)
    again = store.read(SPEC)
    assert (again.digest, again.outcome, again.facts, again.cost) == (
        record.digest,
        record.outcome,
        record.facts,
        record.cost,
    )
    assert again.arrays.keys() == record.arrays.keys()
    for name, array in record.arrays.items():
        np.testing.assert_array_equal(again.arrays[name], array, strict=True)
        assert not again.arrays[name].flags.writeable
    assert sorted(p.name for p in store.folder.iterdir()) == [
        *sorted([f"{SPEC.key}.run", "claims", "format", "quarantine"])
    ]


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(0),
        np.zeros((0, 3), np.int64),
        np.array(1.5),
        np.arange(24.0).reshape(2, 3, 4)[:, ::2],
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.array([True, False]),
        np.array([np.nan, np.inf, -0.0, 5e-324]),
        np.arange(3, dtype=">i4"),
    ],
)
def test_every_kind_of_array_survives(array):
    record = record_of(SPEC)
    record = replace(record, arrays=record.arrays | {"x": array})
    _, arrays = decode(encode(record), "x")
    np.testing.assert_array_equal(arrays["x"], array, strict=True)
    assert replace(record, arrays=arrays).digest == record.digest


def test_a_folder_of_runs_is_found_and_none_is_made(tmp_path):
    RunStore(tmp_path / "runs").write(record_of(SPEC))
    assert RunStore.found(tmp_path / "runs").read(SPEC).digest == record_of(SPEC).digest
    with pytest.raises(ValueError, match="holds no runs"):
        RunStore.found(tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_objects_are_not_written(tmp_path):
    with pytest.raises(ValueError, match="Object arrays"):
        RunStore(tmp_path).write(replace(record_of(SPEC), arrays={"x": np.array([{}])}))
    assert not list(tmp_path.glob("*.run"))


def test_every_flipped_bit_and_every_truncation_is_refused(tmp_path):
    store, rng = RunStore(tmp_path), np.random.default_rng(1)
    whole = encode(record_of(SPEC))
    bits = [*rng.choice(8 * START, 30, replace=False), *rng.choice(8 * len(whole), 30, replace=False)]
    version_bits = 8 * len(MAGIC) + np.arange(16)  # must not pass for another format
    for bit in [*bits, *version_bits]:
        data = bytearray(whole)
        data[bit // 8] ^= 1 << (bit % 8)
        assert_refused(store, bytes(data))
    for length in [0, 1, START - 1, START, len(whole) - 1, *rng.integers(0, len(whole), 15)]:
        assert_refused(store, whole[:length])
    assert_refused(store, whole + b"\0")
    store.path(SPEC).write_bytes(whole)  # the control: nothing wrong, nothing refused
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert store.read(SPEC).digest == record_of(SPEC).digest


def test_files_with_a_good_checksum_and_bad_contents_are_refused(tmp_path):
    store = RunStore(tmp_path)
    with zipfile.ZipFile(io.BytesIO(encode(record_of(SPEC))[START:])) as file:
        good = {name: file.read(name) for name in file.namelist()}
    giant = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", b"12345678")
    objects = npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"12345678")
    lying = bytearray(archive(good))
    entry = lying.rindex(b"PK\x01\x02")
    lying[entry + 20 : entry + 28] = 2 * (1 << 30).to_bytes(4, "little")
    for payload, reason in [
        (b"not a zip", "zip"),
        (archive(good, zipfile.ZIP_LZMA), "more bytes"),
        (archive(good | {"times.npy": bytes((1 << 20) + 1)}, zipfile.ZIP_DEFLATED), "more bytes"),  # a bomb
        (archive(good | {f"{k}.npy": b"" for k in range(65 - len(good))}), "has 65 members; at most 64"),
        (archive(good | {f"{k}.npy": b"" for k in range(64 - len(good))}), "EOF|magic"),
        (b"", "not a zip"),
        (bytes(lying), "more bytes"),
        (archive(good | {"times.npy": giant}), "too small"),
        (archive(good | {"times.npy": objects}), "objects"),
        (archive(good | {"times.npy": b""}), "EOF|magic"),
        (archive(good | {"times.npy": npy("[" * 117)}), "EOF in multi-line"),
        (archive({"times.npy": good["times.npy"]}), "manifest"),
        (archive(good | {"../x": b""}), "members"),
        (archive({"manifest.json": b"", "x": b""} | good), "members"),
        (twice(good, "times.npy"), "different names"),
        (twice(good, "manifest.json"), "different names"),
        (archive({"manifest.json": b"[" * 100_000}), "recursion"),
        (archive({"manifest.json": b"\xff"}), "utf-8"),
        (archive({"manifest.json": b"{}"}), "'key' is missing"),
        (archive({"manifest.json": b"3"}), ""),
    ]:
        assert_refused(store, sealed(payload), reason)
    for compression in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # the controls
        store.path(SPEC).write_bytes(sealed(archive(good, compression)))
        assert store.read(SPEC).digest == record_of(SPEC).digest


def altered_run(arrays=(), **facts):
    """A run file that is sound but for what it says."""
    record = record_of(SPEC)
    kept = {name: array for name, array in (record.arrays | dict(arrays)).items() if array is not None}
    return encode(replace(record, arrays=kept, facts=record.facts | facts))


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (altered_run({"times": None}), "no array times"),
        (altered_run({"times": np.zeros(40, int)}), "times is of type int64"),
        (altered_run({"times": np.zeros(40, ">f8")}), "times is of type >f8"),
        (altered_run(steps=-1), "facts.steps = -1"),
        (altered_run(steps=2**62 + 1), "facts.steps = 4611686018427387905"),
        (altered_run({"times": np.zeros((40, 1))}), r"times is of type float64 and shape \(40, 1\)"),
        (altered_run({"times": np.zeros(39)}), "channels is of type int64"),
        (altered_run({"initial": np.zeros(3, int)}), r"initial is of type int64 and shape \(3,\)"),
        (altered_run({"channels": np.full(40, 2)}), "channels goes from 2 to 2; expected -1 to 1"),
        (altered_run({"channels": np.full(40, -2)}), "channels goes from -2 to -2"),
        (altered_run({"bonds": np.zeros((40, 2), int)}), "bonds without partners"),
        (altered_run({"bonds": np.zeros((40, 3), int), "partners": np.zeros(40, int)}), "bonds is of"),
        (altered_run({"bonds": np.zeros((40, 2), int), "partners": np.full(40, 2)}), "partners goes from 2 to 2"),
        (altered_run({"bonds": np.zeros((40, 2), int), "partners": np.full(40, -5)}), "partners goes from -5 to -5"),
        (altered_run({"centres": np.zeros((2, 3, 3)), "slots": np.zeros((3, 3), int)}), "slots is of"),
        (altered_run(species=[1]), r"facts.species.0 = 1: should be a text"),
        (altered_run(end=-1.0), "facts.end"),
        (altered_run(end=float("inf")), "facts.end = inf"),
        (altered_run(open_channels=[True]), "1 of its 2 channels"),
    ],
)
def test_a_run_that_says_what_cannot_be_is_refused(tmp_path, data, reason):
    assert_refused(RunStore(tmp_path), data, reason)


def test_counts_from_nothing_to_the_largest_are_read():
    for steps in (0, 2**62):
        assert decode(altered_run(steps=steps), "x")[0]["facts"]["steps"] == steps


def test_existing_runs_are_those_in_the_store_in_the_order_asked_for(tmp_path):
    store, specs = RunStore(tmp_path), specs_of(4)
    for spec in specs[::2]:
        store.write(record_of(spec))
    assert [record.spec for record in store.existing(specs[::-1])] == [specs[2], specs[0]]


def test_altered_archives_with_a_good_checksum_are_refused_whatever_reading_them_raises():
    rng, causes = np.random.default_rng(1), set()
    whole = encode(record_of(SPEC))[START:]
    for _ in range(4000):
        payload = bytearray(whole)
        for place in rng.integers(0, len(payload), rng.integers(1, 4)):
            payload[place] = rng.integers(256)
        try:
            decode(sealed(bytes(payload)), "x.run")
        except DamagedRunError as error:
            causes.add(type(error.__cause__))
    # the control: of these, the first three once escaped
    assert causes >= {NotImplementedError, RuntimeError, zlib.error, zipfile.BadZipFile, ValueError}


def test_only_large_arrays_are_kept_uncompressed(tmp_path):
    few, many = np.zeros(1 << 16), np.zeros(1 << 17)  # of 8 bytes, beside their headers
    store = RunStore(tmp_path)
    record = record_of(SPEC)
    record = replace(record, arrays=record.arrays | {"few": few, "many": many})
    assert many.nbytes < len(encode(record)) < many.nbytes + 10_000
    store.write(record)
    for name, array in record.arrays.items():
        np.testing.assert_array_equal(store.read(SPEC).arrays[name], array, strict=True)


def test_a_run_under_another_name_is_refused(tmp_path):
    assert_refused(RunStore(tmp_path), encode(record_of(replace(SPEC, run=1))), "holds the run")


def test_another_format_is_a_mistake_to_report_not_damage(tmp_path):
    store = RunStore(tmp_path / "runs")
    newer = sealed(b"who knows", version=FORMAT + 1)
    store.path(SPEC).write_bytes(newer)
    with pytest.raises(ValueError, match=rf"{SPEC.key}.*format {FORMAT + 1}.*name another folder"):
        store.read(SPEC)
    assert store.path(SPEC).read_bytes() == newer
    for marker in (f"wellmixed runs, format {FORMAT + 1}\n".encode(), b"", b"\xff" * 1000):
        (store.folder / "format").write_bytes(marker)
        with pytest.raises(ValueError, match="name another folder"):
            RunStore(store.folder)
        assert (store.folder / "format").read_bytes() == marker
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ValueError, match="is a file"):
        RunStore(tmp_path / "file")


def test_a_damaged_file_replaced_by_another_process_meanwhile_stays(tmp_path, monkeypatch):
    store = RunStore(tmp_path)
    store.path(SPEC).write_bytes(b"damaged")

    def slow_decode(data, source):
        store.write(record_of(SPEC))
        return decode(data, source)

    monkeypatch.setattr(store_module, "decode", slow_decode)
    with pytest.warns(RuntimeWarning, match="damaged"):
        assert store.read(SPEC) is None
    monkeypatch.undo()
    assert store.read(SPEC).digest == record_of(SPEC).digest


def fail_to_sync(descriptor):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("sync", [fail_to_sync, lambda descriptor: os.ftruncate(descriptor, 100)])
def test_a_failing_disk_names_the_file_and_keeps_the_previous_one(tmp_path, monkeypatch, sync):
    store = RunStore(tmp_path)
    before = store.write(record_of(SPEC)).read_bytes()
    monkeypatch.setattr(os, "fsync", sync)
    with pytest.raises(OSError, match=f"could not write.*{SPEC.key}"):
        store.write(record_of(SPEC, events=50))
    assert store.path(SPEC).read_bytes() == before
    assert not list(tmp_path.glob(".*"))


def test_a_full_disk_names_the_file_and_keeps_the_previous_one(tmp_path):
    store = RunStore(tmp_path / "runs")
    before = store.write(record_of(SPEC)).read_bytes()
    table = store.export(tmp_path / "tables")[0].read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(OSError, match=SPEC.key) as run_failure:
            store.write(record_of(SPEC, events=50))
        with pytest.raises(OSError, match=r"events\.parquet"):
            store.export(tmp_path / "tables")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert run_failure.value.errno == errno.EFBIG
    assert store.path(SPEC).read_bytes() == before
    assert (tmp_path / "tables" / "events.parquet").read_bytes() == table
    assert not list(store.folder.glob(".*"))


def test_a_new_folder_is_on_disk_before_its_runs(tmp_path, monkeypatch):
    """Else a power failure takes the name of the folder, and with it all runs."""
    synced, real = [], store_module.sync_folder

    def sync(folder):
        synced.append((folder, (tmp_path / "a" / "runs" / "format").exists()))
        real(folder)

    monkeypatch.setattr(store_module, "sync_folder", sync)
    RunStore(tmp_path / "a" / "runs")
    assert {(tmp_path, False), (tmp_path / "a", False)} <= set(synced)
    synced.clear()
    RunStore(tmp_path / "a" / "runs")
    assert not synced  # the control: there is nothing new


def test_what_a_killed_writer_left_is_taken_over(tmp_path):
    store = RunStore(tmp_path)
    (tmp_path / f".{SPEC.key}.run.tmp").write_bytes(b"x" * 100_000)
    store.write(record_of(SPEC))
    assert store.read(SPEC).digest == record_of(SPEC).digest
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("plant", [Path.symlink_to, Path.hardlink_to])
def test_a_link_planted_at_the_temporary_name_is_not_written_through(tmp_path, plant):
    store, victim = RunStore(tmp_path / "runs"), tmp_path / "victim"
    victim.write_bytes(b"mine")
    planted = store.folder / f".{SPEC.key}.run.tmp"
    plant(planted, victim)
    with pytest.raises(OSError, match=f"(symbolic links|another name).*could not write.*{SPEC.key}.run"):
        store.write(record_of(SPEC))
    claimed = store.folder / "claims" / SPEC.key
    plant(claimed, victim)
    with pytest.raises(OSError, match=r"symbolic links|another name"):
        store.claim(SPEC)
    assert victim.read_bytes() == b"mine"
    with planted.open("wb") as file:  # the control: so it would have been
        file.write(b"yours")
    assert victim.read_bytes() == b"yours"
    planted.unlink()
    assert store.write(record_of(SPEC)).is_file()


def test_writers_of_the_same_runs_take_turns(tmp_path):
    specs = specs_of(10)

    def write_all():
        store = RunStore(tmp_path)
        for spec in specs:
            store.write(record_of(spec))

    threads = [threading.Thread(target=write_all) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert RunStore(tmp_path).digest(specs) == digest_of(map(record_of, specs))
    assert not list(tmp_path.glob(".*"))


def test_a_claim_is_for_one_at_a_time(tmp_path):
    one, other = RunStore(tmp_path), RunStore(tmp_path)
    claim = one.claim(SPEC)
    assert other.claim(SPEC) is None
    assert one.claim(SPEC) is None
    other.claim(replace(SPEC, run=1)).release()
    claim.release()
    other.claim(SPEC).release()
    assert not list((tmp_path / "claims").iterdir())


def test_the_digest_is_over_what_happened_in_order(tmp_path):
    store, specs = RunStore(tmp_path), specs_of(3)
    for spec in specs[::-1]:
        store.write(replace(record_of(spec), cost={"cpu_seconds": spec.run}))
    assert store.digest(specs) == digest_of(map(record_of, specs)) != store.digest(specs[::-1])
    with pytest.raises(ValueError, match="run 9 is not in"):
        store.digest([*specs, replace(SPEC, run=9)])


class MixedSpec(FakeSpec):
    """Another composition, and a setting that is now a number and now a word."""

    @property
    def inputs(self):
        return super().inputs | {"composition": {"dimer": 30}, "behaviour": 7, "nested": {"deep": {"er": None}}}


def test_tables_and_their_files(tmp_path):
    store = RunStore(tmp_path / "runs")
    specs = [*specs_of(2), MixedSpec(seed=5, run=2)]
    for spec in specs:
        store.write(record_of(spec))
    store.path(specs[0]).with_name("0" * 64 + ".run").write_bytes(b"damaged")
    with pytest.warns(RuntimeWarning, match="damaged"):
        events, runs, settings = store.to_frames()
    keys = [spec.key for spec in specs]
    settings = settings.set_index("key").loc[keys]
    assert list(settings["inputs.run"]) == [0, 1, 2]
    assert list(settings["inputs.composition.monomer"]) == [60, 60, 0]
    assert list(settings["inputs.composition.dimer"]) == [0, 0, 30]
    assert list(settings["inputs.sizes"]) == ["[2, 2, 3]"] * 3
    assert list(settings["digest"]) == [record_of(spec).digest for spec in specs]
    assert list(runs) == ["run", "start", "end", "tank", "resolution", "closed", "monomer", "dimer"]
    for column, expected in {
        "start": 0.0,
        "end": 10.0,
        "tank": "2.0 2.0 3.0",
        "resolution": 0.25,
        "monomer": 60,
    }.items():
        assert list(runs.set_index("run").loc[keys][column]) == [expected] * 3
    for spec in specs:
        record, mine = record_of(spec), events[events["run"] == spec.key]
        np.testing.assert_array_equal(mine["time"], record.arrays["times"])
        names = np.array(["1+1->2", "2->1+1", "restart"])
        assert list(mine["channel"]) == list(names[record.arrays["channels"]])
        assert settings.loc[spec.key, "events"] == (mine["channel"] != "restart").sum()
    paths = store.export(tmp_path / "tables")
    assert [path.name for path in paths] == [
        f"{name}.{kind}" for name in ("events", "runs", "settings") for kind in ("parquet", "csv")
    ]
    pd.testing.assert_frame_equal(pd.read_parquet(paths[0]), events)
    pd.testing.assert_frame_equal(pd.read_csv(paths[1]), events)
    pd.testing.assert_frame_equal(pd.read_parquet(paths[2]), runs)
    assert set(pd.read_parquet(paths[4])["key"]) == set(keys)
    with pytest.raises(ValueError, match="unknown format xlsx"):
        store.export(tmp_path, ["xlsx"])


def test_a_seed_beyond_the_whole_numbers_of_a_column_is_text(tmp_path):
    store = RunStore(tmp_path / "runs")
    for seed in (5, 2**70):
        store.write(record_of(FakeSpec(seed=seed, run=0)))
    path = store.export(tmp_path / "tables", ["parquet"])[2]
    assert set(pd.read_parquet(path)["inputs.seed"]) == {"5", "1180591620717411303424"}


def test_tables_of_no_runs(tmp_path):
    events, runs, settings = RunStore(tmp_path).to_frames()
    assert len(runs) == len(events) == len(settings) == 0
    assert {"key", "outcome"} <= set(settings)
    RunStore(tmp_path).export(tmp_path / "tables")
    assert list(pd.read_parquet(tmp_path / "tables" / "events.parquet")) == ["run", "time", "channel"]


def test_a_run_without_events_and_one_that_was_stopped(tmp_path):
    """What the guard stopped has its settings told, and is no run to take rates from."""
    store, (stopped, quiet) = RunStore(tmp_path), specs_of(2)
    store.write(RunRecord(stopped, "stopped: NaN", record_of(stopped).arrays, record_of(stopped).facts))
    store.write(RunRecord(quiet, "completed", record_of(quiet, events=0).arrays, record_of(quiet).facts))
    events, runs, settings = store.to_frames()
    assert (len(events), list(runs["run"])) == (0, [quiet.key])
    assert dict(zip(settings["key"], settings["outcome"], strict=True)) == {
        stopped.key: "stopped: NaN",
        quiet.key: "completed",
    }


class OtherBook(FakeSpec):
    """Of a scene with another rule book, and therefore other channels."""

    @property
    def inputs(self):
        return super().inputs | {"scene": super().inputs["scene"] | {"rules": "triples"}}


def test_tables_are_of_one_rule_book(tmp_path):
    store, pair, triple = RunStore(tmp_path), FakeSpec(seed=5, run=0), OtherBook(seed=5, run=1)
    store.write(record_of(pair))
    record = record_of(triple)
    store.write(replace(record, facts=record.facts | {"channels": ["join", "break"]}))
    with pytest.raises(ValueError, match=r"runs of two networks.*as in --rules pairs; there are pairs, triples"):
        store.to_frames()
    for rules, spec in (("pairs", pair), ("triples", triple)):
        assert list(store.to_frames(rules)[1]["run"]) == [spec.key]
    with pytest.raises(ValueError, match="holds no run of rule book 'fours'"):
        store.to_frames("fours")
