"""The page and the figure of results/nerdss."""


def write_page() -> None:
    """To come."""
