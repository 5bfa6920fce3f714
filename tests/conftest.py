"""Settings of the whole test suite: the `--validate` option, drawing without a display, and the command as fixtures."""

import gc
import os
import signal

import pytest
from command_line import run, run_here
from json_outputs import watch_outputs

# Before numpy and matplotlib are imported, here and in subprocesses: several tests run side by side.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["MPLBACKEND"] = "Agg"
os.environ["WELLMIXED_CACHE"] = "off"  # or tests would read what others left in the user's folder
# Settings of one machine that hide a fault on others: without the first, Python's last flush may fail at exit. And byte
# code is kept, or hundreds of commands compile all modules again.
for name in ("PYTHONUNBUFFERED", "PYTHONDONTWRITEBYTECODE"):
    os.environ.pop(name, None)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell; some tests send it
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_ignore_collect(collection_path):
    """Only tests: what they share holds no examples, and would be imported once more under another name."""
    return True if collection_path.suffix == ".py" and not collection_path.name.startswith("test_") else None


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also make the long statistical runs")
    parser.addoption(
        "--dsmts",
        metavar="FOLDER",
        default=os.environ.get("WELLMIXED_DSMTS"),
        help="cases of the stochastic SBML Test Suite  [default: $WELLMIXED_DSMTS]",
    )
    parser.addoption(
        "--sbml-suite",
        metavar="FOLDER",
        default=os.environ.get("WELLMIXED_SBML_SUITE"),
        help="semantic cases of the SBML Test Suite  [default: $WELLMIXED_SBML_SUITE]",
    )


def pytest_sessionstart(session):
    """Before any command is imported; and before several workers start: each would compile the same kernels."""
    watch_outputs()
    if getattr(session.config.option, "numprocesses", None) and not hasattr(session.config, "workerinput"):
        from warm_kernels import compile_kernels

        compile_kernels()


def pytest_collection_modifyitems(config, items):
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="a long statistical run; made with --validate")
    for item in items:
        if item.get_closest_marker("validate"):  # a keyword may also be the name of a parameter
            item.add_marker(skip)


def pytest_collection_finish():
    """What is imported stays: it need not be looked through for rubbish, nor be copied page by page by a fork."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _figures_are_legible():
    """Every figure that a test saves is looked at: its words may not cover each other, nor be cut off."""
    from legible import illegible
    from matplotlib.figure import Figure

    save = Figure.savefig

    def looked_at(figure, *arguments, **named):
        wrong = illegible(figure, lambda: save(figure, *arguments, **named))
        assert not wrong, "; ".join(wrong[:5])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", looked_at)
        yield


@pytest.fixture(scope="session")
def wellmixed():
    """wellmixed(*arguments, cwd=): the outcome of the installed command, in a process of its own."""
    return run


@pytest.fixture(scope="session")
def wellmixed_here():
    """wellmixed_here(*arguments, cwd=): the same in this process, where the process itself is not the point."""
    return run_here
