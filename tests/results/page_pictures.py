"""The pictures of the documentation, drawn by the commands of its pages: `python -m tests.results.page_pictures`.

A page that shows `pictures/NAME` has a command that writes NAME; the pictures go to docs/pictures.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
SHOWN = re.compile(r"\]\(pictures/([\w.-]+)\)")


def shown(page: Path) -> set[str]:
    """Names of the pictures on a page."""
    return set(SHOWN.findall(page.read_text(encoding="utf-8")))


def main() -> None:
    """Type the commands of every page that shows pictures, and keep these."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    from pages import PAGES, run_page

    for page in PAGES:
        if names := shown(page):
            with tempfile.TemporaryDirectory() as folder:
                wrong = run_page(page, Path(folder))
                if wrong:
                    raise SystemExit(f"{page.name}: {wrong[0]}")
                for name in names:
                    shutil.copy(Path(folder, name), PICTURES / name)


if __name__ == "__main__":
    main()
