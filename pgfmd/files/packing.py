"""Packing dataclasses for a checkpoint, and unpacking them: numbers and arrays separately.

All fields of a dataclass are packed; none is listed by hand. Arrays are shares of a whole array, adjacent along the
last axis in the order of the ranks. Metadata of a field can mark exceptions: `replicated=True`, an array that is the
same on every rank; `like="name"`, a list of arrays, each distributed like the field of that name; `unknown=value`, the
value for checkpoints of versions without this field; `stored="name"`, the name in the checkpoint, if it is not that of
the field. Plain NumPy, no MPI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

Numbers = dict[str, Any]
Read = Callable[[str, np.ndarray], None]
"""Fills a share of the array of this name."""


def numbers_of(packed: Any) -> Numbers:
    """All fields that are not arrays, as plain data for JSON without loss of digits; for a list of arrays, its length.

    Raises TypeError for a field that could not be restored exactly, such as a number in single precision.
    """
    return {name: _number(f"{type(packed).__name__}.{name}", value, about) for name, _, value, about in _fields(packed)}


def arrays_of(packed: Any, path: str = "") -> dict[str, np.ndarray]:
    """Shares of all arrays of a dataclass and of nested ones, by name; names are paths such as "past_u/0"."""
    found: dict[str, np.ndarray] = {}
    for name, _, value, about in _fields(packed):
        if is_dataclass(value):
            found |= arrays_of(value, f"{path}{name}/")
        elif isinstance(value, np.ndarray) and not about.get("replicated"):
            found[path + name] = value
        elif _is_list_of_arrays(value, about):
            found |= {f"{path}{name}/{k}": array for k, array in enumerate(value)}
    return found


def unpack(target: Any, numbers: Numbers, read: Read, path: str = "") -> None:
    """Sets the fields of a dataclass to the packed values; existing arrays are filled in place.

    Raises KeyError if a field is missing in `numbers`, and ValueError if the target lacks one: both mean another
    version.
    """
    unknown = set(numbers) - {name for name, *_ in _fields(target)}
    if unknown:
        raise ValueError(f"{type(target).__name__} has no {', '.join(sorted(unknown))}")
    for name, own, value, about in _fields(target):
        if name not in numbers and "unknown" in about:
            setattr(target, own, about["unknown"])
            continue
        packed = numbers[name]
        if is_dataclass(value):
            unpack(value, packed, read, f"{path}{name}/")
        elif about.get("replicated"):
            setattr(target, own, np.array(packed, dtype=float))
        elif isinstance(value, np.ndarray):
            read(path + name, value)
        elif "like" in about:
            missing = range(len(value), packed)
            shares = value[:packed] + [np.empty_like(getattr(target, about["like"])) for _ in missing]
            setattr(target, own, shares)
            for k, share in enumerate(shares):
                read(f"{path}{name}/{k}", share)
        else:
            setattr(target, own, packed)


def _fields(packed: Any) -> Iterator[tuple[str, str, Any, Mapping[str, Any]]]:
    """Of each field the name in a checkpoint, its own name, its value and its metadata."""
    for entry in fields(packed):
        yield entry.metadata.get("stored", entry.name), entry.name, getattr(packed, entry.name), entry.metadata


def _is_list_of_arrays(value: Any, about: Mapping[str, Any]) -> bool:
    return "like" in about or (isinstance(value, list) and bool(value) and isinstance(value[0], np.ndarray))


def _number(where: str, value: Any, about: Mapping[str, Any]) -> Any:
    if is_dataclass(value):
        return numbers_of(value)
    if isinstance(value, np.ndarray):
        return value.tolist() if about.get("replicated") else None
    if _is_list_of_arrays(value, about):
        return len(value)
    if isinstance(value, (list, tuple)):
        return [_number(where, entry, {}) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, float):
        # np.float64 is a float; np.float32 is not, and sums with it may round differently afterwards.
        return float(value)
    if value is None or isinstance(value, str):
        return value
    raise TypeError(f"{where} is a {type(value).__name__}: a checkpoint can't hold it")
