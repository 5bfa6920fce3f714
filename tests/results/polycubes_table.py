"""The table of shapes (results/polycubes): every polycube of up to 6 cubes and samples of 7 and 8, compiled.

    python -m tests.results.polycubes_table --workers 2

says what it will cost, compiles each shape in a process of its own, and writes each row as it comes; Ctrl-C keeps what
is there, and `--resume` goes on. Then it makes the table, the pictures and the page of the rows; `--page` makes these
alone.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from statistics import mean

from kinetics.support.cli.failures import INTERRUPTED
from kinetics.support.cli.progress import progress_line
from kinetics.support.output import write_whole
from tests.results.polycubes_page import write_page
from tests.results.polycubes_rows import CPU_LIMIT, Row, code, work
from tests.results.polycubes_shapes import ALL_UP_TO, SEED, SIZES, chosen, polycubes
from tests.results.studies import ROOT

FOLDER = ROOT / "results" / "polycubes"

Key = tuple[int, int]


def stored(folder: Path, seed: int = SEED) -> dict[Key, Row]:
    """The rows that are there, of the table with these samples."""
    path, table = folder / "rows.jsonl", set(chosen(SIZES, seed))
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {row.key: row for row in map(Row.read, lines) if row.key in table}


def store(folder: Path, rows: Iterable[Row]) -> None:
    """Put all rows in the file, in order."""
    write_whole(folder / "rows.jsonl", "".join(row.line() + "\n" for row in sorted(rows, key=lambda row: row.key)))


def cost(wanted: Sequence[Key], known: Iterable[Row], workers: int) -> str:
    """What so many shapes will take, by the rows that are there."""
    times: dict[int, list[float]] = {}
    for row in known:
        times.setdefault(row.cubes, []).append(row.cpu)
    usual = sum(mean(times[size]) for size, _ in wanted if size in times) / 60
    new = sum(size not in times for size, _ in wanted)
    return (
        f"{len(wanted)} shapes by {workers} workers: about {usual:.0f} CPU minutes, as rows there have taken"
        + (f", without {new} of sizes that have none" if new else "")
        + f"; at most {len(wanted) * CPU_LIMIT / 60:.0f} of compilation"
    )


def made_rows(wanted: Sequence[Key], seed: int, workers: int) -> Iterator[Row]:
    """Rows as they come, each from a process of its own."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["tests.results.polycubes_rows"])
    waiting, at_work = list(reversed(wanted)), dict[Connection, tuple[BaseProcess, Row]]()
    try:
        while waiting or at_work:
            while waiting and len(at_work) < workers:
                key = waiting.pop()
                alone = Row(*key, polycubes(key[0])[key[1]], "ended", code=code(key[0]), seed=_seed_of(key, seed))
                receiving, sending = processes.Pipe(duplex=False)
                process = processes.Process(target=work, args=(sending, *key, alone.seed), daemon=True)
                process.start()
                sending.close()
                at_work[receiving] = process, alone
            for ready in wait(list(at_work)):
                assert isinstance(ready, Connection)
                yield _received(ready, *at_work.pop(ready))
    finally:
        for process, _ in at_work.values():
            process.kill()
            process.join()


def _received(ready: Connection, process: BaseProcess, alone: Row) -> Row:
    """A row that a process has sent; one that says so where it was ended before."""
    try:
        return Row.read(ready.recv())
    except EOFError:
        process.join()
        return replace(alone, reason=f"its process was ended (exit code {process.exitcode})")
    finally:
        ready.close()
        process.join()


def _seed_of(key: Key, seed: int) -> int | None:
    return seed if key[0] > ALL_UP_TO else None


def options(arguments: Sequence[str]) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.results.polycubes_table", description=__doc__.splitlines()[0]
    )
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
    rows = stored(asked.folder, asked.seed)
    exit_code = 0 if asked.page else run(asked, rows)
    write_page(asked.folder, [rows[key] for key in sorted(rows)])
    whole = len(chosen(SIZES, asked.seed))
    if missing := whole - len(rows):
        sys.stdout.write(f"{missing} of {whole} shapes have no row yet; the page says so\n")
    return exit_code


def run(asked: argparse.Namespace, rows: dict[Key, Row]) -> int:
    """Make the rows that are asked for, and store each as it comes; the exit code."""
    kept = {key for key, row in rows.items() if asked.resume and row.code == code(row.cubes)}
    wanted = [key for key in chosen(asked.sizes, asked.seed) if key not in kept]
    sys.stdout.write(cost(wanted, rows.values(), asked.workers) + "\n")
    sys.stdout.flush()
    random.Random(asked.seed).shuffle(wanted)  # so that the time left is told for sizes as they are mixed
    wanted.sort(key=rows.__contains__)  # shapes without a row first
    began, done = time.monotonic(), 0
    try:
        with progress_line() as progress:
            for row in made_rows(wanted, asked.seed, asked.workers):
                rows |= stored(asked.folder, asked.seed) | {row.key: row}  # of another command beside this one too
                store(asked.folder, rows.values())
                done += 1
                left = (time.monotonic() - began) / done * (len(wanted) - done) / 60
                progress(f"{done} of {len(wanted)} shapes; {left:.0f} minutes left")
    except KeyboardInterrupt:
        sys.stdout.write(f"stopped after {done} of {len(wanted)} shapes; all are kept, and --resume goes on\n")
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
