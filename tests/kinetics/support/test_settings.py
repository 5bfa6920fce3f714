"""Settings: what a file holds and what Python constructs pass the same checks, and all mistakes are told at once."""

import math
import pickle
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from msgspec import Meta, field

from kinetics.support.settings import AtLeastOne, NotNegative, Positive, Settings, described, validated


class Size(Settings):
    edge: Positive = 2.0
    count: AtLeastOne

    def __post_init__(self):
        if self.count == 13:
            raise ValueError("13 brings bad luck; take another count")


class Round(Settings, tag_field="kind", tag="round"):
    radius: NotNegative


class Flat(Settings, tag_field="kind", tag="flat"):
    unless_usual = ("sides",)
    sides: Annotated[int, Meta(ge=3)] = 4
    face: Literal["up", "down"] | None = None


class Whole(Settings, dict=True):
    size: Size
    shapes: tuple[Round | Flat, ...] = ()
    place: tuple[float, float] = (0.0, 0.0)
    named: dict[str, Size] = field(default_factory=dict)
    free: dict[str, Any] = field(default_factory=dict)
    few: Annotated[tuple[int, ...], Meta(min_length=1)] | None = None
    name: Annotated[str, Meta(pattern=r"^[a-z]*\Z", max_length=5)] = ""

    @cached_property
    def twice(self):
        return 2 * self.size.count


GOOD = {"size": {"count": 1}, "shapes": [{"kind": "flat"}, {"kind": "round", "radius": 1}], "place": [1, 2.5]}


def test_numbers_lists_and_tables_come_as_what_was_declared():
    made = validated(Whole, GOOD, "a file")
    assert made == Whole(size=Size(count=1), shapes=(Flat(), Round(radius=1.0)), place=(1.0, 2.5))
    assert [type(number) for number in made.place] == [float, float]
    assert (made.twice, hash(made.size)) == (2, hash(Size(count=1)))
    assert pickle.loads(pickle.dumps(made)) == made


def test_it_is_written_as_it_is_read():
    made = validated(Whole, GOOD | {"free": {"rows": [(1, 2)], "none": None}}, "a file")
    written = made.as_dict()
    assert written["shapes"] == [{"kind": "flat", "face": None}, {"kind": "round", "radius": 1.0}]
    assert written["free"] == {"rows": [[1, 2]], "none": None}
    assert validated(Whole, written, "a file").as_dict() == written
    assert Flat(sides=5).as_dict(none=False) == {"kind": "flat", "sides": 5}
    assert made.as_dict(without=("shapes", "free", "named"), none=False) == {
        "size": {"edge": 2.0, "count": 1}, "place": [1.0, 2.5], "name": "",
    }  # fmt: skip


def test_every_mistake_is_told_at_once_with_its_place():
    wrong = {
        "size": {"edge": math.nan, "cuont": 1},
        "shapes": [{"kind": "oval"}, {"radius": 1}, {"kind": "round", "radius": "1"}, 3],
        "place": [1.0],
        "named": {"a": {"count": 13}},
        "few": [],
        "name": "Upper",
    }
    with pytest.raises(ValueError, match="a file: ") as found:
        validated(Whole, wrong, "a file")
    assert str(found.value).removeprefix("a file: ").split("; ") == [
        "size.edge = nan: should be a finite number",
        "'size.count' is missing",
        "unknown key 'size.cuont'",
        "did you mean 'count'? allowed here: count, edge",
        "shapes.0: unknown kind 'oval'",
        "allowed are round, flat",
        "'shapes.1.kind' is missing",
        "shapes.2.round.radius = '1': should be a number at least 0",
        "shapes.3 = 3: should be a table",
        "place = [1.0]: should be a list of 2, each a number",
        "named.a: 13 brings bad luck",
        "take another count",
        "few = []: should be a list of at least 1, each a whole number",
        "and 1 more",
    ]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"count": True}, "Size: count = True: should be a whole number at least 1"),
        ({"count": 1.0}, "count = 1.0: should be a whole number"),
        ({"count": 1, "edge": "2"}, "edge = '2': should be a number greater than 0"),
        ({"count": 1, "edge": 0}, "edge = 0: should be a number greater than 0"),
        ({"count": 1, "edge": 10**400}, "000: should be a finite number"),
        ({"count": 1, "edge": -math.inf}, "edge = -inf: should be a finite number"),
        ({"count": 1, "edge": np.float64("nan")}, "edge = nan: should be a finite number"),
        ({"count": 1, "size": 2}, "unknown key 'size'; allowed here: count, edge"),
        ({}, "'count' is missing"),
    ],
)
def test_python_is_as_strict_as_a_file(settings, message):
    with pytest.raises(ValueError, match="Size: ") as found:
        Size(**settings)
    assert message in str(found.value)


def test_numbers_of_numpy_are_numbers():
    made = Whole(size=Size(count=np.int64(3), edge=np.float32(0.5)), place=(np.float64(1), np.int32(2)))
    assert made == Whole(size=Size(count=3, edge=0.5), place=(1.0, 2.0))
    assert type(made.size.edge) is float


def test_what_is_replaced_is_checked_again():
    size = Size(count=2)
    assert size.replace(edge=1) == Size(count=2, edge=1.0)
    for changes, message in (({"edge": -1}, "edge = -1"), ({"count": 13}, "bad luck"), ({"cuont": 1}, "did you mean")):
        with pytest.raises(ValueError, match=message):
            size.replace(**changes)
    with pytest.raises(AttributeError):
        size.count = 3


def test_free_tables_hold_anything_even_nan():
    assert math.isnan(Whole(size=Size(count=1), free={"x": math.nan}).free["x"])


def test_tables_within_tables_without_end_are_refused():
    deep: dict = {}
    for _ in range(100_000):
        deep = {"x": deep}
    with pytest.raises(ValueError, match="too deep"):
        validated(Whole, {"size": {"count": 1}, "free": deep}, "a file")


SCALARS = some.none() | some.booleans() | some.integers() | some.floats() | some.sampled_from(["", "a", "flat"])
KEYS = some.sampled_from(["size", "kind", "count", "edge", "radius"])
VALUES = some.recursive(
    SCALARS, lambda inner: some.lists(inner, max_size=3) | some.dictionaries(KEYS, inner, max_size=3), max_leaves=8
)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(some.fixed_dictionaries({}, optional=dict.fromkeys(Whole.__struct_fields__, VALUES)))
def test_anything_is_taken_whole_or_refused_with_a_reason(data):
    """Never by another error than ours."""
    data.setdefault("size", {"count": 1})
    reason = ""
    try:
        made = validated(Whole, data, "a file")
    except ValueError as error:
        reason = str(error)
    assert reason.startswith("a file: ") or made.place == validated(Whole, made.as_dict(), "a file").place


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"size": {"count": 1}, "name": "abc\n"}, "name = 'abc\\n': should be a text of at most 5 and that matches"),
        ({"size": {"count": 1}, "name": "\ud800"}, "name = '\\ud800': should be a text"),
        ({"size": {"count": -(10**5000)}}, "size.count = a number of thousands of digits: should be"),
        ({"size": {"count": 1}, "shapes": [{"kind": 10**5000}]}, "unknown kind a number of thousands of digits"),
        ({"size": {"count": 1}, "shapes": [{"kind": "z" * 5000}]}, "allowed are round, flat"),
        ({"size": {"count": 1}, "named": {"k" * 5000: {"count": 0}}}, "named.kkk"),
    ],
)
def test_what_is_long_or_odd_is_told_shortly_and_with_its_place(settings, message):
    with pytest.raises(ValueError, match="Whole: ") as found:
        Whole(**settings)
    assert message in str(found.value)
    assert len(str(found.value)) < 700


def test_the_kind_of_a_table_by_itself_is_checked_too():
    with pytest.raises(ValueError, match="Flat: unknown kind 'round'; allowed are flat"):
        Flat(kind="round", sides="a")


def test_kinds_in_words():
    assert described(bool) == "true or false"
    assert described(int | str) == "a whole number or a text"
    assert described(Literal["a", "b", "c"]) == "'a', 'b' or 'c'"
    assert described(tuple[tuple[float, ...], ...]) == "a list, each a list, each a number"
    assert described(dict[str, float]) == described(Size) == "a table"
