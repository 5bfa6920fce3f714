"""What all tests share: `--validate`, quiet drawing, and where shared files live."""

import os

import pytest

os.environ["MPLBACKEND"] = "Agg"  # before anything imports matplotlib, here and in subprocesses


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also make the long statistical runs")


def pytest_collection_modifyitems(config, items):
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="a long statistical run; made with --validate")
    for item in items:
        if "validate" in item.keywords:
            item.add_marker(skip)
