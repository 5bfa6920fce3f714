"""Settings: frozen groups of values that people write, checked all at once, with messages that say what to do."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from itertools import repeat
from pathlib import Path
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

from msgspec import Meta, Struct, StructMeta, ValidationError, convert, field
from msgspec.structs import FieldInfo, asdict, fields

MAX_ERRORS = 10  # reported at once
MAX_TEXT = 600  # characters of one of them

Kind = TypeVar("Kind", bound="Settings")

# What no double, and no text, can hold.
BEYOND = (OverflowError, UnicodeError)

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
AtLeastOne = Annotated[int, Meta(ge=1)]


class _Kind(StructMeta):
    """Metaclass that checks values given in Python as those in a file."""

    def __new__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **config: Any) -> Any:
        return super().__new__(cls, name, bases, namespace, kw_only=True, **config)

    if not TYPE_CHECKING:  # a type checker reads the fields

        def __call__(cls, **values: Any) -> Any:
            return validated(cls, values, cls.__name__)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
class Settings(Struct, metaclass=_Kind, frozen=True, forbid_unknown_fields=True):
    """A frozen group of settings, given by name: unknown keys, and NaN and infinities but in free tables, are refused.

    `__post_init__` checks what depends on several of them. Where a table may be one of several kinds, `tag_field` names
    the key that says which, and `tag` what stands there, both in the line of the class.
    """

    unless_usual: ClassVar[Collection[str]] = ()  # fields that are written only if they are not at their default

    def replace(self, **changes: Any) -> Self:
        """A copy with other values, checked again."""
        return type(self)(**asdict(self) | changes)

    def as_dict(self, without: Collection[str] = (), none: bool = True) -> dict[str, Any]:
        """The values as JSON and TOML have them: tables, lists, texts, numbers.

        without : names left out of this table; none : whether those that are None are there
        """
        config, values = self.__struct_config__, asdict(self)
        for name, usual in _unwritten(type(self)):
            if values[name] == usual:
                del values[name]
        if config.tag is not None:
            values = {str(config.tag_field): config.tag} | values
        return {n: _written(v, none) for n, v in values.items() if n not in without and (none or v is not None)}


@cache
def _unwritten(kind: type[Settings]) -> list[tuple[str, Any]]:
    """The fields that are written only if they are not at their default, and that default."""
    return [(each.name, each.default) for each in fields(kind) if each.name in kind.unless_usual]


def _written(value: Any, none: bool) -> Any:
    if isinstance(value, Settings):
        return value.as_dict(none=none)
    if isinstance(value, Mapping):
        return {key: _written(inner, none) for key, inner in value.items() if none or inner is not None}
    return [_written(inner, none) for inner in value] if isinstance(value, list | tuple) else value


def validated(kind: type[Kind], data: Any, source: str | Path) -> Kind:
    """`data` as a `kind`, or one ValueError that names every wrong key, what came and what is allowed.

    Strict: a number is written as a number, neither as text nor as true or false.
    """
    try:
        data = _plain(data)
        try:
            made = convert(data, kind)
        except (ValidationError, *BEYOND) as error:
            texts = list(_faults(kind, data, "")) or [str(error)]
        else:
            texts = [] if _is_finite(data) else list(_faults(kind, data, ""))
            if not texts:
                return made
    except RecursionError:
        texts = ["tables within tables, too deep"]
    more = f"; and {len(texts) - MAX_ERRORS} more" if len(texts) > MAX_ERRORS else ""
    told = (text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]}..." for text in texts[:MAX_ERRORS])
    raise ValueError(f"{source}: {'; '.join(told)}{more}")


def _plain(value: Any) -> Any:
    """A copy of nested tables and lists with Python's numbers in place of numpy's."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value] if isinstance(value, list) else tuple(map(_plain, value))
    return value.item() if hasattr(value, "dtype") and not value.ndim else value


def _is_finite(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_finite, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


def _faults(kind: Any, value: Any, place: str) -> Iterator[str]:
    """Messages for all faults of a value that should be a `kind`.

    place : keys and positions that lead there, with a dot between two
    """
    options = _options(kind)
    tables = [option for option in options if isinstance(option, _Kind)]
    if tables and isinstance(value, dict):
        yield from _faults_of_table(tables, value, place)
        return
    faults = [
        fault for inner, item, where in _inside(options, value) for fault in _faults(inner, item, _at(place, where))
    ]
    yield from faults
    if not faults and not _is_kind(kind, value):
        asked = _or(options)
        if isinstance(value, int | float) and not abs(value) <= sys.float_info.max and float in map(_bare, options):
            asked = "a finite number"
        yield f"{place or 'the file'} = {_shown(value)}: should be {asked}"


def _inside(options: Sequence[Any], value: Any) -> Iterator[tuple[Any, Any, str]]:
    """Kind, value and place of each item of a list or a free table."""
    for option in map(_bare, options):
        inner = get_args(option)
        if get_origin(option) is dict and isinstance(value, dict):
            yield from ((inner[1], item, str(key)) for key, item in value.items())
        elif get_origin(option) is tuple and isinstance(value, list | tuple):
            each = repeat(inner[0]) if inner[-1] is Ellipsis else inner
            yield from ((kind, item, str(i)) for i, (kind, item) in enumerate(zip(each, value, strict=False)))


def _faults_of_table(kinds: Sequence[Any], value: dict[str, Any], place: str) -> Iterator[str]:
    """Faults of a table that should be one of these kinds."""
    tag_field = kinds[0].__struct_config__.tag_field
    by_tag = {kind.__struct_config__.tag: kind for kind in kinds}
    kind = kinds[0]
    if len(kinds) > 1 or tag_field in value:
        if tag_field not in value:
            yield f"'{_at(place, tag_field)}' is missing"
            return
        tag = value[tag_field]
        if not isinstance(tag, str) or tag not in by_tag:
            where = f"{place}: " if place else ""
            yield f"{where}unknown {tag_field} {_shown(tag)}; allowed are {', '.join(by_tag)}"
            return
        kind, place = by_tag[tag], _at(place, tag)
    known: dict[str, FieldInfo] = {each.name: each for each in fields(kind)}
    faults = [fault for n, each in known.items() if n in value for fault in _faults(each.type, value[n], _at(place, n))]
    faults += [f"'{_at(place, n)}' is missing" for n, each in known.items() if each.required and n not in value]
    if kind.__struct_config__.forbid_unknown_fields:
        allowed = sorted({*known, *([tag_field] if tag_field else [])})
        for name in (str(name)[:80] for name in value if name not in allowed):
            close = get_close_matches(name, allowed, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            faults.append(f"unknown key '{_at(place, name)}'; {hint}allowed here: {', '.join(allowed)}")
    yield from faults
    if not faults:
        try:
            convert(value, kind)
        except ValidationError as error:  # by a check of our own, which says it all
            yield f"{place}: {error.__cause__ or error}" if place else str(error.__cause__ or error)


def _or(options: Sequence[Any]) -> str:
    return " or ".join(dict.fromkeys(described(option) for option in options if option is not type(None)))


def _shown(value: Any) -> str:
    """The beginning of a value; Python refuses to write down the largest whole numbers."""
    try:
        return repr(value)[:80]
    except ValueError:
        return "a number of thousands of digits"


def _at(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name


def _options(kind: Any) -> list[Any]:
    """The kinds that a value may be one of."""
    if get_origin(kind) in {Union, UnionType}:
        return [option for inner in get_args(kind) for option in _options(inner)]
    return [kind]


def _bare(kind: Any) -> Any:
    """A kind without its bounds."""
    return kind.__origin__ if get_origin(kind) is Annotated else kind


def _is_kind(kind: Any, value: Any) -> bool:
    try:
        convert(value, kind)
    except (ValidationError, *BEYOND):
        return False
    return _bare(kind) is Any or not isinstance(value, float) or math.isfinite(value)


NAMES = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", Any: "anything"}
BOUNDS = {"gt": "greater than", "ge": "at least", "lt": "less than", "le": "at most"}


def described(kind: Any) -> str:
    """The allowed values of a `kind`, as text.

    >>> from kinetics.support.settings import NotNegative, described
    >>> described(NotNegative), described(tuple[float, float])
    ('a number at least 0', 'a list of 2, each a number')
    """
    bare, origin = _bare(kind), get_origin(_bare(kind))
    inner = get_args(bare)
    if origin in {Union, UnionType}:
        return _or(_options(bare))
    if origin is Literal:
        return " or ".join(filter(None, [", ".join(map(repr, inner[:-1])), repr(inner[-1])]))
    bounds = [each for each in getattr(kind, "__metadata__", ()) if isinstance(each, Meta)]
    words = [
        f"{text} {getattr(each, name):g}"
        for each in bounds
        for name, text in BOUNDS.items()
        if getattr(each, name) is not None
    ]
    words += [f"of at least {each.min_length}" for each in bounds if each.min_length is not None]
    words += [f"of at most {each.max_length}" for each in bounds if each.max_length is not None]
    words += [f"that matches {each.pattern}" for each in bounds if each.pattern is not None]
    if origin is tuple:
        count = "" if inner[-1] is Ellipsis else f" of {len(inner)}"
        return " ".join([f"a list{count}", *words]) + f", each {described(inner[0])}"
    name = "a table" if origin is dict or isinstance(bare, _Kind) else NAMES[bare]
    return f"{name} {' and '.join(words)}".rstrip()
