"""Examples of a page run in a folder of their own, after its commands, with the files that the page shows."""

import pytest
from pages import run_page

collect_ignore = ["conftest.py", "site"]  # no pages


@pytest.fixture(autouse=True)
def folder_of_the_page(request, tmp_path, monkeypatch):
    """The page's commands, typed in a folder of its own, in which its examples then run."""
    if request.path.suffix == ".md":
        wrong = run_page(request.path, tmp_path)
        if wrong:
            pytest.fail("\n".join(wrong), pytrace=False)
        monkeypatch.chdir(tmp_path)
