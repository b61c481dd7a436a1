"""Shape checks and read-only arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypeAlias, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.errors import WbcError

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int_]
BoolArray: TypeAlias = NDArray[np.bool_]


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """Return a read-only copy of `values` as an array of `dtype`."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def is_real(value: Any) -> TypeGuard[float]:
    """Whether a value is a real number that a float can hold; True and False are none."""
    if type(value) is float:
        return True
    if isinstance(value, bool) or not isinstance(value, (float, int, np.floating, np.integer)):
        return False
    try:
        held = float(value)
    except OverflowError:
        return False
    return held == value or np.isfinite(held) or held != held


def reals(values: Any) -> FloatArray:
    """Return a new array (...) of floats of values (...) that are real numbers.

    NumPy alone would read text as numbers, drop imaginary parts, and ignore the mask of an array.

    Raises:
        TypeError: values that are text, truth values, complex, masked, or no numbers.
        ValueError: rows of different lengths.
    """
    given = np.asanyarray(values)
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise TypeError("some of its values are masked")
    for value in given.flat if given.dtype.kind == "O" else ():
        if not is_real(value):
            raise TypeError(f"{value!r:.40} is no real number that a float can hold")
    if given.dtype.kind not in "fiuO":
        raise TypeError(f"values of type {given.dtype} are no real numbers")
    return np.array(given, dtype=np.float64, subok=False)


def checked(
    values: ArrayLike, shape: Sequence[int | None], name: str, error: type[WbcError] = WbcError
) -> FloatArray:
    """Return a read-only float copy of `values` after checking shape and finiteness.

    Args:
        values: what the caller gave.
        shape: expected shape; None leaves an axis free.
        name: what to call the array in the message.
        error: exception class to raise.

    Raises:
        WbcError: (or `error`) for a wrong shape, a value that is no number, NaN or infinity.
    """
    try:
        array = frozen(values)
    except (TypeError, ValueError) as cause:
        raise error(f"{name} must be an array of numbers: {cause}.") from cause
    fits = [want in (None, have) for want, have in zip(shape, array.shape, strict=False)]
    if array.ndim != len(shape) or not all(fits):
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise error(f"{name} has shape {array.shape}, expected {wanted}.")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise error(f"{name} holds {array[where]} at index {where}; every value must be finite.")
    return array


_COMPARE = {">": np.greater, ">=": np.greater_equal, "<": np.less, "<=": np.less_equal}


def must(rule: str) -> Mapping[str, str]:
    """Return what rules a field of a `Ranged` class: `field(metadata=must("> 0 m and < inf"))`."""
    return {"must": rule}


class Ranged:
    """Base of dataclasses whose numbers say what they must be (`must`); None may be anywhere.

    Attributes:
        _told: what messages begin with; it and rules are formatted with the object.
        _raised: class of the error.
    """

    _told: ClassVar[str]
    _raised: ClassVar[type[WbcError]]

    def __post_init__(self) -> None:
        """Raise an error unless every number is where it must be."""
        rules: dict[str, str] = {}
        for base in reversed(type(self).__mro__):  # a class may change a default, but no rule
            for one in vars(base).get("__dataclass_fields__", {}).values():
                rules |= {one.name: one.metadata["must"]} if "must" in one.metadata else {}
        for name, rule in rules.items():
            given, conditions = getattr(self, name), rule.format(self)
            for condition in conditions.split(" and ") if given is not None else ():
                sign, end, *_ = condition.split()
                if not np.all(_COMPARE[sign](given, float(end))):
                    told = self._told.format(self)
                    raise self._raised(f"{told}{name} must be {conditions}, got {given}.")


class Remade:
    """Base of frozen dataclasses that are made anew where they are copied or unpickled.

    Pickled as they are, their arrays would come back writable; the class makes them read-only.
    """

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """Return the class and what it was made of."""
        thing: Any = self
        given = (getattr(thing, part.name) for part in fields(thing) if part.init)
        values = (dict(v) if isinstance(v, MappingProxyType) else v for v in given)
        return type(self), tuple(values)

    def _with(self, **changes: Any) -> Self:
        """Return a copy with some fields changed, of which nothing is checked anew.

        A diagnosis makes some hundred thousand robots, and checks took a tenth of its time.
        """
        other, known = object.__new__(type(self)), vars(self)
        vars(other).update({one.name: known[one.name] for one in fields(cast(Any, self))} | changes)
        return other
