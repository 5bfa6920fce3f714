"""Nothing of ours opens a file for writing but the door, `kinetics.support.output`, and the store of runs; and nothing
reads a user's file but `kinetics.support.limits`.

Read from the source, by what calls are named; `tests/test_outputs.py` watches what
commands really open.
"""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("kinetics", "mechsim", "calibration", "notebooks")
SOURCES = [*sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")), ROOT / "wellmixed.py"]

# The one other writer: its temporary files have fixed names and are locked, so that processes which share a folder of
# runs take turns, and take over what a killed one left (tests/mechsim/runs/test_store.py).
STORE = "mechsim/runs/file_locks.py"
DOORS = ("kinetics/support/output.py", STORE)
# ffmpeg is a program of its own, which writes where it is told: into a private temporary folder.
FFMPEG = "mechsim/inspection/pictures/movie.py"

# Calls whose name says that they write; `to_*` and `dump` do only where they are given something to write to.
WRITES = {
    *("write_text", "write_bytes", "touch", "symlink_to", "hardlink_to", "mkstemp", "mktemp", "NamedTemporaryFile"),
    *("copy2", "copyfile", "copytree", "move", "truncate", "FileIO", "FileHandler", "memmap", "open_memmap", "tofile"),
    *("imsave", "write_html", "write_image", "write_table", "write_csv", "writeSBMLToFile", "write_frames", "fdopen"),
}
WRITES_INTO_FIRST = {
    *("to_csv", "to_parquet", "to_json", "to_excel", "to_feather", "to_pickle", "to_hdf", "to_html", "to_latex"),
    *("savefig", "print_figure", "savez", "savez_compressed", "savetxt", "write_array", "mmwrite", "save_npz"),
}
WRITES_INTO_SECOND = {"dump"}  # of json, pickle, tomli_w, joblib
TARGETS = {"path", "path_or_buf", "fname", "file", "fp", "filename", "buf", "excel_writer"}
PATH_MODULES = {"os", "shutil"}  # whose functions with common names write, too
OF_MODULES = {"rename", "renames", "replace", "link", "symlink", "copy", "mkfifo", "mknod", "sendfile"}
OPENS = {"open", "ZipFile", "TarFile", "GzipFile", "BZ2File", "LZMAFile", "open_code"}
FILE_MODULES = {"io", "gzip", "bz2", "lzma", "zipfile", "tarfile", "codecs"}  # whose `open` takes the path first
FLAGS = ("O_WRONLY", "O_RDWR", "O_CREAT", "O_TRUNC", "O_APPEND")
MAY_WRITE = OPENS | OF_MODULES | WRITES_INTO_FIRST | WRITES_INTO_SECOND | WRITES


@functools.cache
def calls_of(source: str) -> tuple[set[str], list[tuple[str, ast.Call]]]:
    """Names in a source that are bound to a buffer, and its calls by the last part of their names."""
    nodes = list(ast.walk(ast.parse(source)))
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    return in_memory(nodes), [(getattr(call.func, "attr", getattr(call.func, "id", "")), call) for call in calls]


def in_memory(nodes: list[ast.AST]) -> set[str]:
    """Names that are bound to a buffer: `x = io.BytesIO()`."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                one = isinstance(target, ast.Name)
                names = [target] if one else getattr(target, "elts", [])
                values = [node.value] if one else getattr(node.value, "elts", [])
                for name, value in zip(names, values, strict=False):
                    made = ast.unparse(value.func) if isinstance(value, ast.Call) else ""
                    if isinstance(name, ast.Name) and made.split(".")[-1] in ("BytesIO", "StringIO"):
                        found.add(name.id)
    return found


def mode_of(call: ast.Call, of_path: bool) -> str:
    """The mode that a call of `open` or one like it gives; "?" where only the run would tell."""
    given = [word.value for word in call.keywords if word.arg == "mode"]
    if of_path and len(call.args) > 1 and not isinstance(call.args[1], ast.Constant):
        return "r"  # `open` of something else: that of a path takes a mode and a size
    given += call.args[0 if of_path else 1 :][:1]
    if not given:
        return "r"
    return str(given[0].value) if isinstance(given[0], ast.Constant) else "?"


def writing(source: str) -> Iterator[str]:
    """Calls of a source that open, make or replace files, as line and text."""
    buffers, calls = calls_of(source)
    for name, call in calls:
        if name not in MAY_WRITE:
            continue
        text = ast.unparse(call)
        is_method = isinstance(call.func, ast.Attribute)
        on = ast.unparse(call.func.value) if isinstance(call.func, ast.Attribute) else ""
        into = [ast.unparse(word.value) for word in call.keywords if word.arg in TARGETS]
        place = call.args[1:2] if name in WRITES_INTO_SECOND else call.args[:1]
        into += [ast.unparse(argument) for argument in place if ast.unparse(argument) != "None"]
        if name in OPENS:
            if on == "os" or any(flag in text for flag in FLAGS):
                writes = any(flag in text for flag in FLAGS) or "O_RDONLY" not in text
                bad = writes and into != ["os.devnull"]
            else:
                of_path = is_method and on.split(".")[0] not in FILE_MODULES
                bad = (
                    bool(set("wax+?") & set(mode_of(call, of_path)))
                    and "os.devnull" not in on
                    and not set(into) & buffers
                )
        elif name in ("replace", "rename") and is_method and on not in PATH_MODULES:
            bad = len(call.args) == 1 and not call.keywords  # of a path: of a text or a date it takes more, or names
        elif name in OF_MODULES:
            bad = on in PATH_MODULES
        elif name in WRITES_INTO_FIRST | WRITES_INTO_SECOND:
            bad = bool(into) and not set(into) <= buffers
        else:
            bad = name in WRITES
        if bad:
            yield f"{call.lineno}: {text}"


def test_files_are_written_by_the_door_alone():
    found = {str(path.relative_to(ROOT)): list(writing(path.read_text(encoding="utf-8"))) for path in SOURCES}
    assert len(found) > 300
    assert {name for name in DOORS if found[name]} == set(DOORS)  # the control: what writes is seen
    (film,) = found.pop(FFMPEG)
    assert "imageio_ffmpeg.write_frames(made" in film
    assert {name: calls for name, calls in found.items() if calls and name not in DOORS} == {}


@pytest.mark.parametrize(
    "source",
    [
        "open(path, 'w')",
        "open(path, mode='ab')",
        "open(path, 'r+b')",
        "open(path, mode)",
        "io.open(path, 'x')",
        "gzip.open(path, 'wt')",
        "path.open('w', encoding='utf-8')",
        "Path(name).open(mode='wb')",
        "os.open(path, os.O_WRONLY | os.O_CREAT)",
        "os.open(path, flags)",
        "path.write_text(text, encoding='utf-8')",
        "path.write_bytes(data)",
        "path.touch()",
        "temporary.replace(path)",
        "temporary.rename(path)",
        "os.replace(temporary, path)",
        "shutil.copy(source, path)",
        "shutil.move(source, path)",
        "frame.to_csv(path, index=False)",
        "frame.to_csv(path_or_buf=path)",
        "frame.to_parquet(path)",
        "figure.savefig(path, dpi=150)",
        "figure.savefig(fname='a.png')",
        "np.savez(path, a=a)",
        "np.savetxt(path, a)",
        "json.dump(data, file)",
        "json.dump(data, fp=file)",
        "pickle.dump(data, file)",
        "zipfile.ZipFile(path, 'w')",
        "tempfile.NamedTemporaryFile()",
        "view.write_html(path)",
        "imageio_ffmpeg.write_frames(path, size)",
        "buffer = other()\nfigure.savefig(buffer)",
    ],
)
def test_other_ways_are_seen(source):
    """Controls that must fail."""
    assert len(list(writing(source))) == 1


@pytest.mark.parametrize(
    "source",
    [
        "open(path)",
        "path.open('rb')",
        "path.open(newline='', encoding='utf-8-sig')",
        "executor.open(store, execute)",
        "text.replace('a', 'b')",
        "replace(spec, run=1)",
        "frame.rename(columns=names)",
        "frame.to_csv(index=False)",
        "frame.to_csv(None)",
        "result.to_json()",
        "json.dumps(data)",
        "buffer = io.BytesIO()\nnp.savez(buffer, a=a)\nfigure.savefig(buffer, format='svg')",
        "figure, picture = Figure(), io.BytesIO()\nfigure.savefig(picture)",
        "payload = io.BytesIO()\nzipfile.ZipFile(payload, 'w')",
        "os.open(folder, os.O_RDONLY)",
        "with Path(os.devnull).open('wb') as nowhere: pass",
        "write_whole(path, text)",
    ],
)
def test_what_writes_no_file_is_allowed(source):
    assert list(writing(source)) == []


# What is read beside the door: the system, our own sources, what our own child processes and stores wrote.
READS_OWN = {
    "kinetics/support/limits.py": "the door",
    "kinetics/support/memory.py": "/proc",
    "kinetics/commands/compile.py": "/proc",
    "kinetics/kernels/compiled.py": "our sources",
    "kinetics/formats/outside.py": "what a program made in a folder of ours",
    "kinetics/predicting/scanning/checkpoints.py": "points of scans, each with its checksum",
    "mechsim/runs/store.py": "runs, with their checksums",
    "mechsim/runs/file_locks.py": "the same, locked",
    "mechsim/inspection/pictures/movie.py": "a film that ffmpeg made in a folder of ours",
    "kinetics/support/output.py": "the door of the writers, which looks at the end of a line",
    "mechsim/world/engines/pybullet_engine.py": "the null device",
    "calibration/observed/tables.py": "Parquet, which pyarrow reads",
}
READ = {
    *("read_text", "read_bytes", "fromfile", "genfromtxt", "memmap", "open_memmap", "readSBML", "readSBMLFromFile"),
    *("read_csv", "ParquetFile", "read_json", "read_parquet", "read_pickle", "read_excel", "open_code"),
}
READ_FROM = {"open", "fdopen", "FileIO", "load", "loadtxt", "fromregex", "mmread", "load_npz"}


def reading(source):
    """Calls of a source that read files, as line and text."""
    buffers, calls = calls_of(source)
    for name, call in calls:
        if name not in READ | READ_FROM:
            continue
        on = ast.unparse(call.func.value) if isinstance(call.func, ast.Attribute) else ""
        is_numpys = on in ("np", "numpy", "tomllib", "json", "pickle") or name not in ("load", "loadtxt")
        is_executors = (
            name == "open" and len(call.args) > 1 and not isinstance(call.args[1], ast.Constant | ast.Attribute)
        )
        if name in READ or (name in READ_FROM and is_numpys and not is_executors):
            given = {ast.unparse(argument) for argument in call.args[:1]}
            if not given & (buffers | {"texts"}):  # `texts`: lines that the door has read
                yield f"{call.lineno}: {ast.unparse(call)}"


def test_files_are_read_by_the_door_alone():
    sources = [path for path in SOURCES if "notebooks" not in path.parts]  # which read results of ours
    found = {str(path.relative_to(ROOT)): list(reading(path.read_text(encoding="utf-8"))) for path in sources}
    assert found["kinetics/support/limits.py"]  # the control: what reads is seen
    assert {name: calls for name, calls in found.items() if calls and name not in READS_OWN} == {}
    assert {name for name in READS_OWN if not found[name]} == set()  # a list without what is gone


@pytest.mark.parametrize(
    "source",
    [
        "path.read_text(encoding='utf-8')",
        "Path(name).read_bytes()",
        "open(path)",
        "path.open('rb')",
        "os.open(path, os.O_RDONLY)",
        "tomllib.load(file)",
        "json.load(file)",
        "np.load(path)",
        "np.loadtxt(path)",
        "pd.read_csv(path)",
        "libsbml.readSBMLFromFile(str(path))",
    ],
)
def test_other_ways_to_read_are_seen(source):
    """Controls that must fail."""
    assert len(list(reading(source))) == 1
