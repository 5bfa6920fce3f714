"""Fields of a frozen record, put into their checked form while it is built."""

from __future__ import annotations


def set_fields(record: object, /, **values: object) -> None:
    """Set fields of a frozen dataclass from its own `__post_init__` or from what makes a copy; never afterwards."""
    for name, value in values.items():
        object.__setattr__(record, name, value)
