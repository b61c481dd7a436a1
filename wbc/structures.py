"""Arrays and numbers with names in one structure, handed to machine code as one argument.

Handing an array over to a compiled function takes 0.1 us, as long as a small robot's work on it: a
tick reads some hundred. A structure is handed over as one pointer to where its arrays lie, holds
them for as long as it lives, and cannot change them for others, so that nothing is read stale.
Structures may hold structures. Machine code makes them, too, from arrays that it takes from a
`Heap`.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Mapping
from hashlib import sha256
from itertools import accumulate
from typing import Any, ClassVar, TypeVar, cast, get_type_hints

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, intrinsic, models, register_model, unbox
from numba.np.arrayobj import populate_array

from wbc.compiled import kind_of

_Tuple = TypeVar("_Tuple", bound=tuple[Any, ...])


class _Kind(types.Type):  # type: ignore[misc]
    """The type of structures of some fields."""

    def __init__(self, label: str, fields: tuple[tuple[str, Any], ...]) -> None:
        self.fields = dict(fields)
        sizes = [1 + 2 * kind.ndim if isinstance(kind, types.Array) else 1 for _, kind in fields]
        self.places = dict(zip(self.fields, accumulate([0, *sizes[:-1]]), strict=True))
        digest = sha256(repr(fields).encode()).hexdigest()[:12]
        super().__init__(f"{label}_{digest}")


@register_model(_Kind)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    """A pointer to words: every whole number, of every array its address, lengths and strides."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(64).as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = _Kind

    def generic_resolve(self, kind: Any, name: str) -> Any:
        """Return the kind of a field."""
        return kind.fields.get(name)


@lower_getattr_generic(_Kind)  # type: ignore[untyped-decorator]
def _field(target: Any, builder: Any, kind: Any, words: Any, name: str) -> Any:
    """Return a field: an array that is not owned, a structure, or a number."""
    found, first = kind.fields[name], kind.places[name]

    def word(place: int) -> Any:
        at = target.get_constant(types.int64, first + place)
        return builder.load(builder.gep(words, [at]))

    if isinstance(found, _Kind):
        return builder.inttoptr(word(0), words.type)
    if isinstance(found, types.Float):
        return builder.bitcast(word(0), target.get_value_type(found))
    if isinstance(found, types.Integer | types.Boolean):
        return builder.trunc(word(0), target.get_value_type(found))
    array = target.make_array(found)(target, builder)
    address, *sizes = [word(place) for place in range(1 + 2 * found.ndim)]
    data = builder.inttoptr(address, array.data.type)
    size = target.get_constant(types.intp, np.dtype(str(found.dtype)).itemsize)
    populate_array(array, data, sizes[: found.ndim], sizes[found.ndim :], size, None)
    return array._getvalue()


WORDS = 160
"""Of the largest structure that machine code makes."""


def _kept(context: Any, memory: Any, values: Any) -> Any:
    """Return a NamedTuple as its structure, whose words are written to memory (WORDS,).

    It lives as long as this memory and its arrays do.
    """
    found = values.instance_class.structure.kind

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        whole = ir.IntType(64)
        held = target.make_array(memory)(target, builder, given[0])
        first = builder.bitcast(held.data, whole.as_pointer())
        for number, (name, kind) in enumerate(found.fields.items()):
            value = builder.extract_value(given[1], number)
            if isinstance(kind, types.Array):
                array = target.make_array(values[number])(target, builder, value)
                both = array.shape, array.strides
                sizes = [builder.extract_value(one, k) for one in both for k in range(kind.ndim)]
                words = [builder.ptrtoint(array.data, whole), *sizes]
            elif isinstance(kind, types.Float):
                words = [builder.bitcast(value, whole)]
            else:
                words = [builder.ptrtoint(value, whole) if isinstance(kind, _Kind) else value]
            for k, word in enumerate(words):
                place = target.get_constant(types.int64, found.places[name] + k)
                builder.store(word, builder.gep(first, [place]))
        return first

    return found(memory, values), build


kept: Callable[[Any, _Tuple], _Tuple] = intrinsic(_kept)


@unbox(_Kind)  # type: ignore[untyped-decorator]
def _unboxed(kind: Any, value: Any, context: Any) -> Any:
    """Return the pointer of a structure."""
    address = context.pyapi.object_getattr_string(value, "_address")
    number = context.pyapi.long_as_longlong(address)
    context.pyapi.decref(address)
    return NativeValue(context.builder.inttoptr(number, ir.IntType(64).as_pointer()))


class NamedArrays:
    """Arrays, and structures of arrays, by name; none can be replaced by another one."""

    _numba_type_: ClassVar[Any]
    _fields: ClassVar[Mapping[str, Any]]

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Describe the arrays."""
        words: list[int] = []
        for name, kind in self._fields.items():
            value = values[name]
            self.__dict__[name] = value
            if isinstance(kind, types.Array):
                words += _described(name, kind, value)
            else:
                words.append(value._address if isinstance(kind, _Kind) else int(value))
        self.__dict__["_words"] = np.array(words, dtype=np.int64)
        self.__dict__["_address"] = self._words.ctypes.data

    def exchange(self, name: str, array: Any) -> None:
        """Put another array in the place of one, while machine code waits for an answer."""
        words, place = _described(name, self._fields[name], array), self._numba_type_.places[name]
        self.__dict__[name] = array
        self._words[place : place + len(words)] = words

    def __setattr__(self, name: str, value: Any) -> None:
        """Raise AttributeError: machine code would go on with the array that it knows."""
        raise AttributeError(f"'{name}' of a structure stays the same array; write into it.")

    def __getattr__(self, name: str) -> Any:
        """Raise AttributeError: there is no such field."""
        raise AttributeError(f"a structure of {', '.join(self._fields)} has no '{name}'.")


def _described(name: str, kind: Any, array: Any) -> list[int]:
    """Return address, lengths and strides of an array after checking that it is of its kind."""
    layout = "C" if array.flags.c_contiguous else "A"
    fits = array.ndim == kind.ndim and array.dtype == np.dtype(str(kind.dtype))
    if not fits or kind.layout not in (layout, "A") or (kind.mutable and not array.flags.writeable):
        raise TypeError(f"'{name}' of {array.ndim} dimensions of {array.dtype} is no {kind}")
    return [array.__array_interface__["data"][0], *array.shape, *array.strides]


class Structure:
    """A kind of structure: what its fields are called, and what is in them.

    Attributes:
        kind: its type, as that of an argument of a compiled function or of a field.
    """

    def __init__(self, label: str, *arrays: tuple[Any, ...], **fields: Any) -> None:
        """Name the fields.

        Args:
            label: of the kind.
            arrays: a kind, as in `wbc.compiled`, and the names of the arrays of it, or of numbers
                that stay the same (`int`, `bool`). Behind them may stand their shape, numbers or
                names of sizes: such arrays are made where they are not given.
            fields: name -> kind of array, structure or number.
        """
        self._shapes: dict[str, tuple[Any, ...]] = {}
        for kind, names, *shape in arrays:
            fields |= dict.fromkeys(names.split(), kind)
            self._shapes |= dict.fromkeys(names.split() if shape else (), tuple(shape))
        kinds = {name: kind_of(field) for name, field in fields.items()}
        self.kind = _Kind(label, tuple(kinds.items()))
        self._made = type(label, (NamedArrays,), {"_numba_type_": self.kind, "_fields": kinds})

    def of(self, sizes: Mapping[str, int] | None = None, /, **values: Any) -> Any:
        """Return a structure that holds these arrays; they are read and written where they lie.

        Args:
            sizes: those of the arrays that are made here, of zeros.
            values: the other arrays.

        Raises:
            KeyError: an array or a size is missing.
            TypeError: an array of another kind.
        """
        for name in self._shapes.keys() - values.keys():
            shape = [(sizes or {})[n] if isinstance(n, str) else n for n in self._shapes[name]]
            values[name] = np.zeros(shape, np.dtype(str(self.kind.fields[name].dtype)))
        return self._made(values)


def structured(names: type[_Tuple]) -> type[_Tuple]:
    """Let a NamedTuple be a structure for compiled functions, of the types of its annotations."""
    fields = get_type_hints(names, include_extras=True)
    cast(Any, names).structure = Structure(names.__name__, **fields)
    return names


def stored(values: _Tuple) -> _Tuple:
    """Return arrays with names as what compiled functions take, see `structured`."""
    named: Any = values
    return cast(_Tuple, named.structure.of(**named._asdict()))


def numbered(names: str) -> Any:
    """Return numbers by name, counted from zero, which compiled functions read as such."""
    kind: Any = namedtuple
    return kind("Numbered", names)(*range(len(names.split())))
