"""Store of runs: a folder of checksummed files, each written whole or not at all and never read when damaged.

    folder/format               the format of everything here, written once
    folder/KEY.run              a finished run; KEY is the SHA-256 of its full inputs
    folder/KEY.run.damaged      what stood there but did not pass its checks, set aside
    folder/claims/KEY           locked by the process that is computing this run
    folder/quarantine/KEY.json  a run that failed every time, and why

There is no index to damage: a study is the set of runs it names. A run file is a header (magic, format, size), the
SHA-256 of header and payload, and the payload: an npz of the arrays with a `manifest.json`, in which members of up to
a megabyte are compressed. Larger ones are not, so that no file can claim much more than it holds.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import json
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK
from kinetics.runs.event_tables import NOTES, TableRun, event_tables
from kinetics.support.output import write_whole
from kinetics.support.packages import pd
from mechsim.runs.contents import check_contents, is_trial
from mechsim.runs.file_locks import lock, set_aside, sync_folder, write_locked
from mechsim.runs.frames import counts_every
from mechsim.runs.record import COMPLETED, RunRecord, RunSpec

FORMAT = 2
MAGIC = b"wellmixed run\0"
HEADER = struct.Struct(f"<{len(MAGIC)}sHQ")  # magic, format, bytes of payload
START = HEADER.size + hashlib.sha256().digest_size  # of the payload
SMALL = 1 << 20  # bytes, of a member that is compressed
MOST_MEMBERS = 64
# What reading an altered archive may raise, whatever its checksum says: an encrypted or an unknown member, too. numpy
# takes the header of an array for Python.
DAMAGES: tuple[type[Exception], ...] = (
    *(ValueError, TypeError, LookupError, OSError, EOFError, RuntimeError, OverflowError),
    *(zipfile.BadZipFile, zlib.error, struct.error, SyntaxError, tokenize.TokenError),
)

Contents = tuple[dict[str, Any], dict[str, np.ndarray]]


class DamagedRunError(ValueError):
    """A run file that is truncated, altered, foreign or under another run's name."""


@dataclass(frozen=True)
class Claim:
    """The right to compute one run; it ends with `release`, or with the process that holds it."""

    path: Path
    file: BinaryIO

    def release(self) -> None:
        """Let others have it."""
        self.path.unlink(missing_ok=True)
        self.file.close()


class RunStore:
    """A folder of runs, created if missing; any number of processes may share it.

    ValueError: the folder is a file, or of another format. OSError: it cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from mechsim import RunSpec, RunStore, Scene, execute
    >>> folder = TemporaryDirectory()
    >>> store, spec = RunStore(folder.name), RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0)
    >>> store.read(spec) is None, store.write(execute(spec)).suffix, store.read(spec).completed
    (True, '.run', True)
    >>> folder.cleanup()
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).absolute()  # workers may have another working directory
        if self.folder.exists() and not self.folder.is_dir():
            raise ValueError(f"{self.folder} is a file; expected a folder of runs: name another")
        missing = [one.parent for one in self.folder.parents if not one.exists()]
        self.folder.mkdir(parents=True, exist_ok=True)
        marker, expected = self.folder / "format", f"wellmixed runs, format {FORMAT}\n".encode()
        if not marker.exists():
            for above in (self.folder.parent, *missing):  # else a power failure takes the folder with all its runs
                with contextlib.suppress(PermissionError):  # one that may be entered and not read
                    sync_folder(above)
            write_locked(marker, expected)
        found = marker.read_bytes()[:80]
        if found != expected:
            raise ValueError(
                f"{self.folder} holds {found.decode(errors='replace').strip()!r}; this version reads and writes "
                f"{expected.decode().strip()!r}: use the version that made it, or name another folder"
            )
        for part in ("claims", "quarantine"):
            (self.folder / part).mkdir(exist_ok=True)

    @classmethod
    def found(cls, folder: str | Path) -> RunStore:
        """Open a folder that already holds runs, without creating anything. ValueError: it holds none."""
        if not (Path(folder) / "format").is_file():
            raise ValueError(f"{folder} holds no runs; expected one that `wellmixed simulate` has filled")
        return cls(folder)

    def path(self, spec: RunSpec) -> Path:
        """The path at which the run is kept."""
        return self.folder / f"{spec.key}.run"

    def write(self, record: RunRecord) -> Path:
        """Keep a run; it is on disk before this returns. OSError: names the file, whose old content stays."""
        path = self.path(record.spec)
        write_locked(path, encode(record))
        return path

    def read(self, spec: RunSpec) -> RunRecord | None:
        """The run, or None where it is missing. A damaged file is set aside with a warning and counts as missing."""
        contents = self._contents(self.path(spec))
        if contents is None:
            return None
        manifest, arrays = contents
        return RunRecord(spec, manifest["outcome"], arrays, manifest["facts"], manifest["cost"])

    def existing(self, specs: Iterable[RunSpec]) -> list[RunRecord]:
        """Those of these runs that are in the store."""
        return [record for spec in specs if (record := self.read(spec)) is not None]

    def digest(self, specs: Iterable[RunSpec]) -> str:
        """SHA-256 over the results of these runs, in order. ValueError: one is missing."""
        records = []
        for spec in specs:
            record = self.read(spec)
            if record is None:
                raise ValueError(f"{spec.title} is not in {self.folder}: run it first")
            records.append(record)
        return digest_of(records)

    def claim(self, spec: RunSpec) -> Claim | None:
        """Take the right to make a run; None while another process (or another call) has it."""
        path = self.folder / "claims" / spec.key
        try:
            return Claim(path, lock(path, fcntl.LOCK_EX | fcntl.LOCK_NB))
        except BlockingIOError:
            return None

    def quarantine(self, spec: RunSpec, reasons: Sequence[str]) -> Path:
        """Record why a run was given up, one reason for each try."""
        note = {"title": spec.title, "key": spec.key, "reasons": list(reasons), "inputs": spec.inputs}
        write_locked(self._note(spec), json.dumps(note, indent=1).encode())
        return self._note(spec)

    def absolve(self, spec: RunSpec) -> None:
        """Delete that record: the run has finished after all. Where that fails, it is left for the next call."""
        with contextlib.suppress(OSError):
            self._note(spec).unlink(missing_ok=True)

    def contents(self) -> Iterator[Contents]:
        """Manifest (key, title, inputs, outcome, facts, cost, digest) and arrays of every run in the store, by key."""
        for path in sorted(self.folder.glob("*.run")):
            contents = self._contents(path)
            if contents is not None and not is_trial(contents[0]["inputs"]):
                yield contents

    def to_frames(self, rules: str | None = None) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
        """Tables of the events and of the runs, as `kinetics.runs.event_tables` describes them, and one of settings.

        rules : only runs of the rule book that their scenes call so

        A run is named by its key. Events and runs are those of completed runs; where a run tells, an event also has its
        two cubes, cube_a and cube_b, and the partner that broke the bond: a species, `wall` or `several`. The third
        table has a row for every run: inputs, outcome, facts and cost, a nested setting as the column `outer.inner`, a
        list as JSON text. ValueError: the runs are of several rule books.
        """
        settings: list[dict[str, Any]] = []
        completed: list[TableRun] = []
        for manifest, arrays in self.contents():
            if rules not in (None, manifest["inputs"]["scene"]["rules"]):
                continue
            settings.append(dict(_columns(manifest)) | {"events": int((arrays["channels"] >= 0).sum())})
            if manifest["outcome"] == COMPLETED:
                completed.append(_table_run(manifest, arrays))
        if rules is not None and not settings:
            raise ValueError(f"{self.folder} holds no run of rule book {rules!r}")
        try:
            events, runs = event_tables(completed)
        except ValueError as error:
            books = sorted({str(row["inputs.scene.rules"]) for row in settings})
            raise ValueError(f"{error}, as in --rules {books[0]}; there are {', '.join(books)}") from error
        table = pd.DataFrame(settings, columns=None if settings else ["key", "title", "outcome", "digest", "events"])
        for name in map(str, table):
            if name.startswith("inputs.composition."):  # a composition names only the species it holds
                table[name] = table[name].fillna(0).astype("int64")
            elif table[name].dtype == object and (  # a Parquet column has one type, and integers of 64 bits
                pd.api.types.infer_dtype(table[name]).startswith(("mixed", "integer"))
            ):
                table[name] = table[name].map(str)
        return events, runs, table

    def export(
        self,
        folder: str | Path,
        formats: Sequence[str] = ("parquet", "csv"),
        rules: str | None = None,
        every: float | None = None,
    ) -> tuple[Path, ...]:
        """Write the tables `events`, `runs` and `settings`, each file whole or not at all; returns their paths.

        every : write a table `counts` too, of looks so many tu apart at the completed runs; see `counts_every`

        ValueError: as of `to_frames` and `counts_every`; nothing is written
        """
        unknown = set(formats) - {"parquet", "csv"}
        if unknown:
            raise ValueError(f"unknown format {', '.join(sorted(unknown))}; expected parquet, csv or both")
        frames = dict(zip(("events", "runs", "settings"), self.to_frames(rules), strict=True))
        if every is not None:
            frames["counts"] = counts_every(every, self.contents(), self.folder, rules)
        Path(folder).mkdir(parents=True, exist_ok=True)
        paths = []
        for name, frame in frames.items():
            for kind in formats:
                paths.append(Path(folder) / f"{name}.{kind}")
                write_whole(
                    paths[-1],
                    frame.to_csv(index=False).encode() if kind == "csv" else frame.to_parquet(index=False),
                )
        return tuple(paths)

    def _note(self, spec: RunSpec) -> Path:
        return self.folder / "quarantine" / f"{spec.key}.json"

    def _contents(self, path: Path) -> Contents | None:
        """The content of the file; None if it is missing, or damaged and now set aside."""
        try:
            file = path.open("rb")
        except FileNotFoundError:
            return None
        with file:
            try:
                contents = decode(file.read(), path)
                if contents[0]["key"] != path.stem:
                    raise DamagedRunError(f"it holds the run {contents[0]['key']}")
            except DamagedRunError as error:
                aside = path.with_name(path.name + ".damaged")
                warnings.warn(f"{path} is damaged ({error}); moved to {aside.name}", RuntimeWarning, stacklevel=3)
                set_aside(path, file, aside)
                return None
        return contents


def digest_of(records: Iterable[RunRecord]) -> str:
    """SHA-256 over the digests of runs, in order."""
    return hashlib.sha256("\n".join(record.digest for record in records).encode()).hexdigest()


def encode(record: RunRecord) -> bytes:
    """A run as the bytes of its file."""
    spec = record.spec
    manifest = {
        "key": spec.key,
        "title": spec.title,
        "inputs": spec.inputs,
        "outcome": record.outcome,
        "facts": record.facts,
        "cost": record.cost,
        "digest": record.digest,
    }
    payload = io.BytesIO()
    with zipfile.ZipFile(payload, "w") as archive:
        _add(archive, "manifest.json", json.dumps(manifest).encode())
        for name, array in record.arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(array), version=(1, 0), allow_pickle=False)
            _add(archive, f"{name}.npy", content.getbuffer())
    data = payload.getvalue()
    header = HEADER.pack(MAGIC, FORMAT, len(data))
    return header + hashlib.sha256(header + data).digest() + data


def decode(data: bytes, source: Path) -> Contents:
    """Manifest and read-only arrays of a run file. DamagedRunError: not one, or altered. ValueError: another format."""
    if len(data) < START:
        raise DamagedRunError(f"it has {len(data)} bytes, less than a header")
    magic, version, size = HEADER.unpack_from(data)
    header, checksum, payload = data[: HEADER.size], data[HEADER.size : START], data[START:]
    if magic != MAGIC:
        raise DamagedRunError("it is not a run file")
    if size != len(payload):
        raise DamagedRunError(f"it has {len(payload)} bytes of payload and should have {size}")
    if hashlib.sha256(header + payload).digest() != checksum:
        raise DamagedRunError("its checksum is wrong")
    if version != FORMAT:  # asked last, since a flipped bit is no other format
        raise ValueError(
            f"{source} is a run of format {version}; this version reads and writes format {FORMAT}: "
            "use the version that made it, or name another folder"
        )
    try:
        with zipfile.ZipFile(io.BytesIO(payload)) as archive:
            members = archive.infolist()
            _check_members(members, len(payload))
            manifest = json.loads(archive.read("manifest.json"))
            arrays = {m.filename.removesuffix(".npy"): _array(archive.read(m)) for m in members[1:]}
        check_contents(manifest, arrays)
    except DAMAGES as error:
        raise DamagedRunError(str(error)) from error
    return manifest, arrays


def _add(archive: zipfile.ZipFile, name: str, content: bytes | memoryview) -> None:
    compression = zipfile.ZIP_DEFLATED if len(content) <= SMALL else zipfile.ZIP_STORED
    archive.writestr(zipfile.ZipInfo(name), bytes(content), compression)


def _check_members(members: Sequence[zipfile.ZipInfo], size: int) -> None:
    """ValueError: they are not what we write, or `size` bytes of payload could unfold into much more memory."""
    kinds = {member.compress_type for member in members}
    stored = sum(member.file_size for member in members if member.compress_type == zipfile.ZIP_STORED)
    packed = [member.file_size for member in members if member.compress_type == zipfile.ZIP_DEFLATED]
    if not kinds <= {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED} or stored > size or max(packed, default=0) > SMALL:
        raise ValueError("its members claim more bytes than it has")
    if len(members) > MOST_MEMBERS:
        raise ValueError(f"it has {len(members)} members; at most {MOST_MEMBERS} are read")
    names = [member.filename for member in members]
    if names[:1] != ["manifest.json"] or len(set(names)) < len(names) or not all(n.endswith(".npy") for n in names[1:]):
        raise ValueError("its members should be a manifest.json, then arrays of different names")


def _array(data: bytes) -> np.ndarray:
    """The array in the bytes of an npy file, without a copy: a header that claims more than there is cannot harm."""
    stream = io.BytesIO(data)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("its arrays should be npy 1.0")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.hasobject:
        raise ValueError("an array of Python objects is not read")
    return np.ndarray(shape, dtype, data, stream.tell(), order="F" if fortran else "C")


def _table_run(manifest: dict[str, Any], arrays: dict[str, np.ndarray]) -> TableRun:
    """A run as it stands in tables."""
    facts, scene = manifest["facts"], manifest["inputs"]["scene"]
    notes: dict[str, Any] = {}
    if "bonds" in arrays:
        who: dict[int, str | None] = {BY_WALL: "wall", BY_SEVERAL: "several", BY_UNKNOWN: None, NO_BREAK: None}
        who |= dict(enumerate(facts["species"]))
        told = np.array([who[partner] for partner in arrays["partners"].tolist()], dtype=object)
        notes = dict(zip(NOTES, (*arrays["bonds"].T, told), strict=True))
    return TableRun(
        manifest["key"],
        facts["species"],
        facts["channels"],
        arrays["initial"],
        arrays["times"],
        arrays["channels"],
        facts["end"],
        facts["open_channels"],
        scene["tank"]["size"],
        scene["numerics"]["step"],
        notes,
    )


def _columns(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Flat columns of nested settings."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _columns(inner, f"{name}.{key}" if name else key)
    else:
        yield name, json.dumps(value) if isinstance(value, list) else value
