"""The table of shapes (results/polycubes): every polycube of up to 6 cubes and samples of 7 and 8, compiled.

    python -m tests.results.polycubes --workers 2

says what it will cost, compiles each shape in a process of its own, and writes each row as it comes; Ctrl-C keeps what
is there, and `--resume` goes on. Once all rows are there it makes the table, the figures and the page of them;
`--page` makes these alone.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from statistics import mean

from kinetics.support.cli.progress import INTERRUPTED, progress_line
from kinetics.support.output import write_whole
from tests.results.polycubes_page import write_page
from tests.results.polycubes_rows import CPU_LIMIT, Row, code, work
from tests.results.polycubes_shapes import polycubes, sampled
from tests.results.studies import ROOT

FOLDER = ROOT / "results" / "polycubes"
SIZES = (1, 2, 3, 4, 5, 6, 7, 8)
ALL_UP_TO, SAMPLE = 6, 100
SEED = 1

Key = tuple[int, int]


def keys(sizes: Iterable[int], seed: int) -> list[Key]:
    """The shapes of the table: all of few cubes, a sample of more."""
    return [
        (size, number)
        for size in sizes
        for number in (range(len(polycubes(size))) if size <= ALL_UP_TO else sampled(size, SAMPLE, seed))
    ]


def stored(folder: Path) -> dict[Key, Row]:
    """The rows that are there."""
    path = folder / "rows.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {row.key: row for row in map(Row.read, lines)}


def store(folder: Path, rows: Iterable[Row]) -> None:
    """Put all rows in the file, in order."""
    write_whole(folder / "rows.jsonl", "".join(row.line() + "\n" for row in sorted(rows, key=lambda row: row.key)))


def cost(wanted: Sequence[Key], known: Iterable[Row], workers: int) -> str:
    """What so many shapes will take, by the rows that are there."""
    times: dict[int, list[float]] = {}
    for row in known:
        times.setdefault(row.cubes, []).append(row.cpu)
    most = f"at most {len(wanted) * CPU_LIMIT / 60:.0f} CPU minutes of compilation"
    if any(size not in times for size, _ in wanted):
        return f"{len(wanted)} shapes, {most}; what they usually take is not known"
    usual = sum(mean(times[size]) for size, _ in wanted) / 60
    return f"{len(wanted)} shapes, about {usual:.0f} CPU minutes by {workers} workers, {most}"


def made_rows(wanted: Sequence[Key], workers: int) -> Iterator[Row]:
    """Rows as they come, each from a process of its own."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["tests.results.polycubes_rows"])
    waiting, at_work = list(reversed(wanted)), dict[Connection, tuple[BaseProcess, Key]]()
    try:
        while waiting or at_work:
            while waiting and len(at_work) < workers:
                key = waiting.pop()
                receiving, sending = processes.Pipe(duplex=False)
                process = processes.Process(target=work, args=(sending, *key), daemon=True)
                process.start()
                sending.close()
                at_work[receiving] = process, key
            for ready in wait(list(at_work)):
                assert isinstance(ready, Connection)
                process, key = at_work.pop(ready)
                yield _received(ready, process, key)
    finally:
        for process, _ in at_work.values():
            process.kill()
            process.join()


def _received(ready: Connection, process: BaseProcess, key: Key) -> Row:
    """A row that a process has sent; one that says so where it was ended before."""
    size, number = key
    try:
        return Row.read(ready.recv())
    except EOFError:
        process.join()
        reason = f"its process was ended (exit code {process.exitcode})"
        return Row(size, number, polycubes(size)[number], "ended", reason, code=code())
    finally:
        ready.close()
        process.join()


def options(arguments: Sequence[str]) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.results.polycubes", description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="Processes side by side.")
    parser.add_argument("--seed", type=int, default=SEED, metavar="N", help="Seed of the samples of 7 and 8 cubes.")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), metavar="N,...", help="Numbers of cubes.")
    parser.add_argument("--resume", action="store_true", help="Keep the rows that this code has made before.")
    parser.add_argument("--page", action="store_true", help="Only make the page of the rows that are there.")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="Where the rows and the page are.")
    asked = parser.parse_args(arguments)
    try:
        asked.sizes = sorted({int(size) for size in asked.sizes.split(",")})
    except ValueError:
        parser.error(f"--sizes {asked.sizes}: expected numbers such as 4,5,6")
    if wrong := [size for size in asked.sizes if size not in SIZES]:
        parser.error(f"--sizes: {wrong[0]} cubes; the table is of {SIZES[0]} to {SIZES[-1]}")
    if asked.workers < 1:
        parser.error(f"--workers is {asked.workers}; at least 1 is needed")
    if not asked.folder.is_dir():
        parser.error(f"--folder {asked.folder}: there is no such folder; make it first")
    return asked


def main(arguments: Sequence[str]) -> int:
    """Make what is missing, and the page; the exit code."""
    asked = options(arguments)
    table = keys(SIZES, asked.seed)
    rows = stored(asked.folder)
    if not asked.page:
        kept = {key for key, row in rows.items() if asked.resume and row.code == code()}
        wanted = [key for key in keys(asked.sizes, asked.seed) if key not in kept]
        sys.stdout.write(cost(wanted, rows.values(), asked.workers) + "\n")
        rows = {key: row for key, row in rows.items() if key in set(table)}
        began, done = time.monotonic(), 0
        try:
            with progress_line() as progress:
                for row in made_rows(wanted, asked.workers):
                    rows[row.key] = row
                    store(asked.folder, rows.values())
                    done += 1
                    left = (time.monotonic() - began) / done * (len(wanted) - done) / 60
                    progress(f"{done} of {len(wanted)} shapes; {left:.0f} minutes left")
        except KeyboardInterrupt:
            sys.stdout.write(f"stopped after {done} of {len(wanted)} shapes; all are kept, --resume goes on\n")
            return INTERRUPTED
    if missing := [key for key in table if key not in rows]:
        sys.stdout.write(f"{len(missing)} of {len(table)} shapes have no row yet, so the page was not made\n")
        return 1
    write_page(asked.folder, [rows[key] for key in table], asked.seed)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
