"""Archives whose checksums are right and whose contents are not: files of runs, and tables as Parquet."""

import functools
import hashlib
import io
import json
import warnings
import zipfile

import numpy as np

ODD_VALUES = [
    None,
    True,
    -1,
    2**63,
    2**200,
    1e308,
    float("nan"),
    float("inf"),
    "",
    "x",
    "../x",
    "a\0b",
    [],
    {},
    [[]],
    [1e999],
]
ODD_VALUES += [{"a": {}}, ["monomer"], "9" * 5000, [[[[[[[[]]]]]]]], 0.5, [0] * 3000]
ODD_TYPES = ["<f8", ">i4", "<i2", "|b1", "<c16", "<U3", "|S2", "<M8[s]", "|V5", "<f2", "<u8"]
ODD_NAMES = [
    "../x.npy",
    "/etc/x.npy",
    "a/b.npy",
    "x",
    ".npy",
    "x.npy/",
    "\u00e4.npy",
    "c:\\x.npy",
    "manifest.json",
    "times.npy",
]
HEADERS = [
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1e9,), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': " + "(" * 90 + ")" * 90 + ", }",
    "{'descr': [('a', '<f8'), ('a', '<f8')], 'fortran_order': False, 'shape': (1,), }",
    "{'descr': ('<f8', (100000, 100000)), 'fortran_order': False, 'shape': (), }",
    "{'descr': '|V0', 'fortran_order': False, 'shape': (9223372036854775807,), }",
    "{'descr': '<f8', 'fortran_order': 3, 'shape': (2, 0), }",
    "{'descr': '<f8'}",
    "[" * 200,
    "9" * 5000,
    "",
]
COMPRESSIONS = [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]


@functools.cache
def sound_run():
    """Manifest and arrays of a run that might have been."""
    from mechsim.runs.record import RunSpec, book_of
    from mechsim.scene import Scene

    spec = RunSpec(Scene.load("line4"), {"monomer": 6}, 10.0, seed=1, run=0)
    network = book_of("line4")[1].network
    facts = {"end": 10.0, "steps": 7, "species": network.species, "channels": network.channels}
    facts["open_channels"] = [True] * len(network.channels)
    manifest = {"key": spec.key, "title": spec.title, "inputs": spec.inputs, "outcome": "completed", "facts": facts}
    arrays = {
        "initial": np.array([6, 0, 0, 0]),
        "times": np.array([1.0, 2.0, 3.0]),
        "channels": np.array([0, 1, -1]),
        "bonds": np.array([[0, 1], [1, 2], [-1, -1]], np.int16),
        "partners": np.array([-3, -3, -3], np.int16),
    }
    return json.dumps(manifest | {"cost": {"cpu_seconds": 1.0, "wall_seconds": 1.0}, "digest": "0" * 64}), arrays


def run_file(given):
    """The folder of a run: files of a store, of which the first is to be read. given : `fuzzed_inputs.Inputs`"""
    text, arrays = sound_run()
    manifest, arrays = json.loads(text), dict(arrays)
    key = manifest["key"]
    if given.chance(0.4):
        altered(given, manifest)
    members = {"manifest.json": manifest_text(given, manifest)}
    if given.chance(0.25):
        alter_arrays(given, arrays)
    for name, array in arrays.items():
        content = io.BytesIO()
        np.lib.format.write_array(content, array, version=(1, 0) if given.chance(0.98) else (2, 0), allow_pickle=True)
        members[f"{name}.npy"] = content.getvalue()
    if given.chance(0.05):
        members[given.one(["times", "initial", "bonds", "extra"]) + ".npy"] = npy(given.one(HEADERS), b"12345678")
    payload = zipped(given, members)
    return {f"{key}.run": sealed(given, payload), "format": b"wellmixed runs, format 2\n"}


def altered(given, value):
    """Somewhere in a nested value another one, or none."""
    while True:
        places = list(value) if isinstance(value, dict) else range(len(value))
        if not len(places):
            return
        place = given.one(places)
        inner = value[place]
        if isinstance(inner, (dict, list)) and given.chance(0.7):
            value = inner
        elif isinstance(value, dict) and given.chance(0.3):
            del value[place]
            return
        else:
            value[place] = given.one(ODD_VALUES)
            return


def manifest_text(given, manifest):
    """As JSON, or nearly."""
    text = json.dumps(manifest)
    if given.chance(0.03):
        text = given.one(["[" * 100_000, "{" * 3000, '{"a":' * 2000 + "1" + "}" * 2000, "", "3", "null", text + text])
    return text.encode(given.one(["utf-16", "latin-1", "cp037"]) if given.chance(0.02) else "utf-8")


def alter_arrays(given, arrays):
    """One of them of another type or shape, missing, or too many."""
    name = given.one(list(arrays))
    array = arrays[name]
    match int(given.rng.integers(8)):
        case 0:
            del arrays[name]
        case 1:
            arrays[name] = np.zeros(array.shape, given.one(ODD_TYPES))
        case 2:
            arrays[name] = array[:-1]
        case 3:
            arrays[name] = array.reshape(array.size, 1, 1)
        case 4:
            arrays[name] = np.array(given.one([1.5, 7, True]))
        case 5:
            arrays[name] = np.array([{}, None], dtype=object)
        case 6:
            arrays[name] = np.full(array.shape, given.one([99, -7, 2**62, -(2**63)]))
        case 7:
            arrays[name] = np.full(array.shape, given.one([np.nan, np.inf, -1.0, 1e308]))


def npy(header, data=b""):
    """An npy 1.0 file with a header of our making."""
    text = header.encode().ljust(117)[:60_000] + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def zipped(given, members):
    """An archive of them: nested, doubled, too many, packed otherwise, larger or smaller than it says, or cut."""
    buffer = io.BytesIO()
    names = list(members)
    if given.chance(0.05):
        given.rng.shuffle(names)
    with zipfile.ZipFile(buffer, "w", given.usual(COMPRESSIONS, [zipfile.ZIP_BZIP2])) as archive:
        for name in names:
            write(archive, given.one(ODD_NAMES) if given.chance(0.02) else name, members[name])
        if given.chance(0.05):
            write(archive, given.one([*ODD_NAMES, *names]), given.one([b"", members["manifest.json"], npy(HEADERS[0])]))
        if given.chance(0.03):
            for i in range(given.one([59, 65, 3000])):
                write(archive, f"{i}.npy", b"")
        if given.chance(0.03):
            archive.writestr("bomb.npy", bytes(given.one([1 << 20, (1 << 20) + 1, 1 << 22])), zipfile.ZIP_DEFLATED)
        if given.chance(0.02):
            write(archive, "nested.npy", buffer.getvalue())
        if given.chance(0.02):
            archive.comment = b"PK\x05\x06" * given.one([1, 9, 1000])
    data = bytearray(buffer.getvalue())
    if given.chance(0.1):  # what an entry says of its member: flags, kind of packing, checksum, sizes, places
        entry = data.rfind(b"PK\x01\x02") if given.chance(0.5) else data.find(b"PK\x01\x02")
        place = entry + int(given.rng.integers(4, 46))
        data[place : place + 4] = given.one([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x01\0\0\0", b"\0\0\0\x80"])
    for _ in range(int(given.rng.integers(1, 4)) if given.chance(0.1) else 0):
        place = int(given.rng.integers(len(data)))
        data[place : place + int(given.rng.integers(0, 5))] = given.one([b"", b"\0", b"\xff" * 4, bytes(data[:30])])
    if given.chance(0.03):
        del data[int(given.rng.integers(len(data))) :]
    return bytes(data)


def write(archive, name, content):
    """A member, which may be there already."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        archive.writestr(zipfile.ZipInfo(name), content, archive.compression)


def sealed(given, payload):
    """With a header and a checksum that are right, mostly."""
    from mechsim.runs.store import FORMAT, HEADER, MAGIC

    header = HEADER.pack(MAGIC, FORMAT if given.chance(0.98) else 7, len(payload) + (given.chance(0.01)))
    return header + hashlib.sha256(header + payload).digest() + payload


def table(given):
    """A table of watched events as Parquet, with odd columns, odd values, or damaged."""
    import pyarrow as pa
    from pyarrow import parquet

    n = given.one([2, 3, 50])
    marks = ["start", *["join", "break"] * n]
    marks[n - 1 :] = ["end"]
    columns = {
        "run": pa.array(["a"] * n),
        "time": pa.array(np.sort(given.rng.uniform(0, 9, n))),
        "channel": pa.array(marks),
        "A": pa.array([20] + [None] * (n - 1)),
        "B": pa.array([0] + [None] * (n - 1)),
    }
    if given.chance(0.4):
        columns[given.one(["run", "time", "channel", "A", "B", "", "t\0"])] = odd_column(given, n)
    if given.chance(0.1):
        del columns[given.one(list(columns))]
    if given.chance(0.02):
        n = given.one([0, 10**6, 10**8])  # runs of one value take no room
        columns = (
            {"run": pa.nulls(n), "time": pa.nulls(n)}
            if n > 10**6
            else {"run": pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int8)), pa.array(["a" * 1000]))}
        )
    whole = pa.table(list(columns.values()), names=list(columns))
    if given.chance(0.05):
        whole = whole.append_column(whole.column_names[0], whole.column(0))
    if given.chance(0.05):
        whole = whole.replace_schema_metadata(
            {"pandas": given.one(["", "{", "3", '{"index_columns": ["x"]}', "[" * 9999])}
        )
    out = io.BytesIO()
    parquet.write_table(whole, out, compression=given.one(["none", "snappy", "gzip", "zstd"]))
    data = bytearray(out.getvalue())
    for _ in range(int(given.rng.integers(1, 5)) if given.chance(0.4) else 0):
        # mostly in the footer, where the sizes are
        first = 0 if given.chance(0.4) else max(0, len(data) - 600)
        place = int(given.rng.integers(first, len(data)))
        data[place : place + int(given.rng.integers(0, 5))] = given.one(
            [b"", b"\0", b"\xff" * 4, b"\x15\x80", bytes(data[:9])]
        )
    if given.chance(0.03):
        del data[int(given.rng.integers(len(data))) :]
    return {"input.parquet": bytes(data)}


def odd_column(given, n):
    """A column of a kind that no table of ours has, or with values that are none."""
    import pyarrow as pa

    match int(given.rng.integers(9)):
        case 0:
            return pa.array([[1, 2]] * n)
        case 1:
            return pa.array([{"a": 1}] * n)
        case 2:
            return pa.array([given.one([1e308, float("nan"), -1.0, 5e-324])] * n)
        case 3:
            return pa.array([2**63 - 1] * n)
        case 4:
            return pa.array([b"\xff\xfe"] * n)
        case 5:
            return pa.array([given.one([10**9, -(2**52)])] * n, pa.timestamp(given.one(["s", "ns"])))
        case 6:
            return pa.nulls(n)
        case 7:
            return pa.array([given.one(["", "nan", "1e999", "x" * 100_000, "9" * 400, "\0"])] * n)
        case _:
            return pa.array([True] * n)
