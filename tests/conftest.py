"""What all tests share: `--validate`, drawing without a display, the command as a user has it."""

import os
import signal

import pytest
from command_line import run

os.environ["MPLBACKEND"] = "Agg"  # before anything imports matplotlib, here and in subprocesses
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background; tests send it
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also make the long statistical runs")
    parser.addoption(
        "--dsmts",
        metavar="FOLDER",
        default=os.environ.get("WELLMIXED_DSMTS"),
        help="cases of the stochastic SBML Test Suite  [default: $WELLMIXED_DSMTS]",
    )


def pytest_collection_modifyitems(config, items):
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="a long statistical run; made with --validate")
    for item in items:
        if "validate" in item.keywords:
            item.add_marker(skip)


@pytest.fixture(scope="session")
def wellmixed():
    """wellmixed(*arguments, cwd=): what the installed command does with them."""
    return run
