"""Loops over small arrays as machine code: there a call into numpy takes longer than its work.

Functions are compiled for fixed types: when they are first called, or by `make_ready`, which
whoever has a loop calls before it, so that no tick waits for the compiler. Machine code is kept
under `NUMBA_CACHE_DIR` where that is set, else beside the sources, else in the user's own cache.
Where it is kept already nothing has to be written. They check nothing: whoever calls them owns the
shapes.
"""

from __future__ import annotations

import gc
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import copy
from dis import get_instructions
from functools import cache
from hashlib import sha256
from inspect import isfunction
from pathlib import Path
from tempfile import TemporaryFile
from types import CodeType
from typing import Annotated, Any, ClassVar, TypeVar, get_args, get_origin, get_type_hints, overload

import numba
from llvmlite import binding, ir
from numba import config, types
from numba.core import caching
from numba.core.cgutils import alloca_once
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from wbc.arrays import BoolArray, FloatArray, IntArray

Number, Count, Flag, Nothing = types.float64, types.int64, types.boolean, types.void
Vector = Annotated[FloatArray, types.Array(types.float64, 1, "A", readonly=True)]
"""To read, with any stride."""
Row = Annotated[FloatArray, types.Array(types.float64, 1, "C", readonly=True)]
"""To read, without gaps."""
Dense = Annotated[FloatArray, types.Array(types.float64, 2, "C", readonly=True)]
"""To read, row by row."""
Places = Annotated[IntArray, types.Array(types.int64, 1, "C", readonly=True)]
"""Row numbers to read."""
Table = Annotated[IntArray, types.Array(types.int64, 2, "C", readonly=True)]
"""Whole numbers to read, row by row."""
Flags = Annotated[BoolArray, types.Array(types.boolean, 1, "A", readonly=True)]
"""To read."""
OutFlags = Annotated[BoolArray, types.Array(types.boolean, 1, "A")]
"""To write."""
OutRow = Annotated[FloatArray, types.Array(types.float64, 1, "C")]
"""To write, without gaps."""
OutDense = Annotated[FloatArray, types.Array(types.float64, 2, "C")]
"""To write, row by row."""
OutPlaces = Annotated[IntArray, types.Array(types.int64, 1, "C")]
"""Row numbers to write."""
OutTable = Annotated[IntArray, types.Array(types.int64, 2, "C")]
"""Whole numbers to write, row by row."""

_Function = TypeVar("_Function", bound=Callable[..., Any])

# Bytes of Python's code, those of copied functions included, up to which machine code is copied
# into functions that call it.
_COPIED = 700


def _view(context: Any, array: Any, start: Any, rows: Any, columns: Any) -> Any:
    """Return the entries of an array (n,) from `start` on as a matrix, without owning them.

    A slice counts who holds its memory each time that it is passed on, which takes longer than a
    loop over a small robot. This does not: the caller keeps `array` alive.
    """
    matrix = types.Array(array.dtype, 2, "C")

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        source = target.make_array(array)(target, builder, given[0])
        found = target.make_array(matrix)(target, builder)
        size = target.get_constant(types.intp, array.dtype.bitwidth // 8)
        strides = [builder.mul(given[3], size), size]
        populate_array(found, builder.gep(source.data, [given[1]]), given[2:], strides, size, None)
        return found._getvalue()

    return matrix(array, start, rows, columns), build


view: Any = intrinsic(_view)


def _local(context: Any, size: Any) -> Any:
    """Return an array (n,) of numbers on the stack, with any content; n is written as a number.

    It lives as long as the call that makes it, and must not be returned. One that is made in a
    loop is the same every time.
    """
    found = types.Array(types.float64, 1, "C")

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        number, count = target.get_value_type(types.float64), size.literal_value
        array = target.make_array(found)(target, builder)
        length = target.get_constant(types.intp, count)
        width = target.get_constant(types.intp, 8)
        data = alloca_once(builder, number, size=length)
        populate_array(array, data, [length], [width], width, None)
        return array._getvalue()

    return found(size), build


local: Any = intrinsic(prefer_literal=True)(_local)


def _ask(context: Any, address: Any) -> Any:
    """Call a function of Python, `ctypes.CFUNCTYPE(None)`, by address.

    It answers in arrays that both sides know. It must not raise: what it has to say goes there too.
    """

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [])
        builder.call(builder.inttoptr(given[0], kind.as_pointer()), [])
        return target.get_dummy_value()

    return Nothing(Count), build


ask: Any = intrinsic(_ask)


@overload
def compiled(function: _Function, /) -> _Function: ...
@overload
def compiled(
    *kinds: Any, counted: bool = ..., inside: bool = ...
) -> Callable[[_Function], _Function]: ...
def compiled(*kinds: Any, counted: bool = True, inside: bool = False) -> Any:
    """Return a decorator of a function that will be machine code for the types of its annotations.

    Sums may be taken in any order, so that they use the processor's vectors; what is not finite
    stays so.

    Args:
        kinds: the function itself, where nothing else is said; or types of its result and of its
            arguments, where its annotations do not say them.
        counted: whether it counts who holds the memory of its arrays, as a function that makes
            arrays must. One that only reads and writes those that it is given need not, and then
            slices cost nothing; its own small arrays come from `local`.
        inside: whether compiled functions alone call it. What reads its arguments from Python is
            not compiled then, which takes a seventh of the time where there are many arrays.
    """

    def decorator(function: Callable[..., Any]) -> Any:
        hints = get_type_hints(function, include_extras=True)
        declared = stated or (hints.pop("return"), *hints.values())
        result, *arguments = map(kind_of, declared)
        return MachineCode(function, result(*arguments), counted, inside)

    alone = len(kinds) == 1 and isfunction(kinds[0])
    stated = () if alone else kinds
    return decorator(kinds[0]) if alone else decorator


inner = compiled(counted=False, inside=True)
"""Decorator of a function that compiled ones alone call, on arrays that they give it."""


def kind_of(declared: Any) -> Any:
    """Return numba's type of what an annotation declares; one of numba's own is itself.

    A NamedTuple is the tuple of its fields, one with `structure` (`wbc.structures`) that structure.
    """
    if isinstance(declared, types.Type):
        return declared
    if get_origin(declared) is Annotated:
        return get_args(declared)[1]
    if get_origin(declared) is tuple:
        return types.Tuple([kind_of(field) for field in get_args(declared)])
    if declared in _PLAIN:
        return _PLAIN[declared]
    if "structure" in vars(declared):
        return declared.structure.kind
    kinds = [kind_of(hint) for hint in get_type_hints(declared, include_extras=True).values()]
    if len(set(kinds)) == 1:
        return types.NamedUniTuple(kinds[0], len(kinds), declared)
    return types.NamedTuple(kinds, declared)


_PLAIN = {float: Number, int: Count, bool: Flag, type(None): Nothing}


def make_ready(room: str) -> None:
    """Load or compile what the loaded modules of a package of the library call.

    Args:
        room: such as "wbc.control".
    """
    for name, module in list(sys.modules.items()):
        for found in list(vars(module).values()) if f"{name}.".startswith(f"{room}.") else ():
            if isinstance(found, MachineCode):
                found.make_ready()


class MachineCode(CPUDispatcher):  # type: ignore[misc]
    """A function that is compiled for one signature, when it is first needed.

    Attributes:
        calls: compiled functions that it calls.
        size: bytes of Python's code, those of functions included that it holds a copy of.
        stamp: text that differs where its machine code would.
    """

    def __init__(
        self, function: Callable[..., Any], signature: Any, counted: bool, inside: bool
    ) -> None:
        """Look where its machine code may be kept.

        Args:
            function: to compile.
            signature: its types.
            counted, inside: see `compiled`.
        """
        options = {"nopython": True, "error_model": "numpy", "fastmath": {"reassoc", "contract"}}
        options |= {"_nrt": counted, "no_cpython_wrapper": inside, "no_cfunc_wrapper": True}
        super().__init__(function, targetoptions=options)
        self._declared, self._inside = signature, inside
        self.calls = _called(function)
        copies = (one.size for one in self.calls if one.copied)
        self.size: int = len(function.__code__.co_code) + sum(copies)
        self.stamp = _stamp(function, (signature, counted, *["inside"] * inside))
        vars(function)["stamp"] = self.stamp
        with suppress(RuntimeError):  # no folder
            self._cache = _Kept(function)

    def __reduce__(self) -> str:
        """Pickle it by its name."""
        return str(self.py_func.__qualname__)

    @property
    def copied(self) -> bool:
        """Whether functions that call it hold a copy of it; else they call it where it is."""
        return self.size <= _COPIED

    def _called_by_name(self) -> Iterator[MachineCode]:
        """Yield what its machine code calls without holding a copy of it."""
        for one in self.calls:
            if one.copied:
                yield from one._called_by_name()
            else:
                yield one

    def make_ready(self) -> None:
        """Load or compile it, if that was not done yet.

        Raises:
            NameError: it calls a function that is defined after it, of which its stamp tells
                nothing.
        """
        if not self._can_compile:
            return
        if isinstance(self._cache, caching.NullCache):
            _warn_of_compiling()
        late = [one.__name__ for one in _called(self.py_func) if one not in self.calls]
        if late:
            raise NameError(f"{self.__name__} calls {', '.join(late)}: define these before it.")
        for called in self._called_by_name():
            called.make_ready()
        collects = gc.isenabled()
        gc.disable()  # to look for garbage among what a compiler holds takes a tenth of its time
        try:
            super().compile(self._declared)
        except OSError:  # a folder that is full, or cannot be read
            _warn_of_compiling()
            self._cache = caching.NullCache()
            super().compile(self._declared)
        finally:
            if collects:
                gc.enable()
        self.disable_compile()
        if not self.copied:
            self._give_name()

    def _give_name(self) -> None:
        """Let others call it by a name instead of linking its machine code into their own.

        Numba copies what a function calls, and all that this calls, into it and optimises it there
        once more: the innermost functions as often as there are ways to them.
        """
        found = self.overloads[self._declared.args]
        place = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
        binding.add_symbol(f"wbc_{self.stamp}", place)
        named = copy(found.fndesc)
        named.mangled_name = f"wbc_{self.stamp}"
        self.targetctx.remove_user_function(found.entry_point)
        self.targetctx.insert_user_function(found.entry_point, named)

    def add_overload(self, found: Any) -> None:
        """Keep the machine code; Python finds it where it can call it."""
        if self._inside:
            self.overloads[tuple(found.signature.args)] = found
        else:
            super().add_overload(found)

    def compile(self, sig: Any) -> Any:
        """Return the machine code; only for the types declared, whatever is asked for."""
        self.make_ready()
        return self.overloads[self._declared.args].entry_point

    def _compile_for_args(self, *args: Any) -> Any:
        """Return the machine code for a first call.

        Raises:
            TypeError: arguments that are not of the types declared, or a function that compiled
                ones alone call.
        """
        if self._inside:
            raise TypeError(f"{self.__name__} is compiled for other compiled functions alone.")
        self.make_ready()
        found = tuple(map(self.typeof_pyval, args))
        if not self.typingctx.resolve_overload(self.py_func, [self._declared], found, {}):
            self._explain_matching_error(*args)
        return self.overloads[self._declared.args].entry_point


def _called(function: Callable[..., Any]) -> list[MachineCode]:
    """Return the compiled functions that a function calls, as far as they are defined."""
    known = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    found = {name: one for name, one in known.items() if isinstance(one, MachineCode)}
    if found:  # Attributes have names, too.
        loads = [one for one in get_instructions(function) if one.opname == "LOAD_GLOBAL"]
        found = {one.argval: found[one.argval] for one in loads if one.argval in found}
    return list(found.values())


class _Folder(caching.UserWideCacheLocator):  # type: ignore[misc]
    """A folder in which something is kept of a function already, or where it can be kept."""

    def __init__(self, function: Callable[..., Any], file: str, folder: Path) -> None:
        self._py_file, self._stamp, self._cache_path = file, vars(function)["stamp"], str(folder)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _Folder | None:
        """Return the folder for a function of a file; None where there is none."""
        own = caching.UserWideCacheLocator(function, file).get_cache_path()
        folders = [Path(file).parent / "__pycache__", Path(own)]
        if config.CACHE_DIR:
            folders.insert(0, Path(config.CACHE_DIR))
        holding = [f for f in folders if (f / f"{_base(function)}.nbi").exists()]
        for folder in [*holding, *filter(_can_be_written, folders)]:
            return cls(function, file, folder)
        return None

    def get_source_stamp(self) -> str:
        """Return what stands for the content of the function."""
        return str(self._stamp)


class _Files(caching.CompileResultCacheImpl):  # type: ignore[misc]
    """Named by what is in them, so that several versions of a function may lie side by side."""

    _locator_classes: ClassVar[list[type]] = [_Folder]

    def __init__(self, function: Callable[..., Any]) -> None:
        self._base = _base(function)
        super().__init__(function)

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        return self._base


class _Kept(caching.FunctionCache):  # type: ignore[misc]
    _impl_class = _Files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is kept; None where it cannot be read any more.

        What is kept names the module of its function and those of its types: once these have been
        renamed, it is compiled anew. So is what was cut off while it was written.
        """
        try:
            return super().load_overload(sig, target_context)
        except OSError:
            raise
        except Exception:
            self.flush()
            return None


def _base(function: Callable[..., Any]) -> str:
    return f"{function.__name__.strip('<>')}-{vars(function)['stamp'][:24]}"


@cache
def _can_be_written(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _stamp(function: Callable[..., Any], declared: tuple[Any, ...]) -> str:
    """Return a text that differs where the machine code of a function would.

    That also holds the functions that it calls and the numbers that it reads from its module. Its
    place in the file, its text and comments do not matter.
    """
    versions = numba.__version__, *sys.version_info[:2], _COPIED
    kinds = declared[0].return_type, *declared[0].args
    names = [name for kind in kinds for name in _field_names(kind)]
    parts = [repr((versions, declared)), *names, *_described(function.__code__, function.__doc__)]
    for name in function.__code__.co_names:
        used = function.__globals__.get(name)
        if isinstance(used, int | float | tuple):
            parts.append(f"{name} = {used!r}")
        elif isinstance(used, MachineCode):
            parts.append(used.stamp)
        parts.extend(getattr(used, "_fields", ()))
    return sha256("\n".join(parts).encode()).hexdigest()


def _field_names(kind: Any) -> Iterator[str]:
    """Return the names of fields within a type: code holds their places, the type's name not."""
    if isinstance(kind, types.BaseNamedTuple):
        yield repr(kind.fields)
    for part in getattr(kind, "types", ()):
        yield from _field_names(part)


def _described(code: CodeType, text: str | None) -> Iterator[str]:
    """Return what a function does, without where it stands."""
    yield repr((code.co_code, code.co_names, code.co_varnames, code.co_freevars))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _described(constant, None)
        elif constant != text:
            yield repr(constant)


@cache
def _warn_of_compiling() -> None:
    """Say it once per process."""
    warnings.warn(
        "wbc finds no folder to keep its compiled functions in and compiles them in every "
        "process, for up to a minute; set NUMBA_CACHE_DIR to a folder that can be written.",
        stacklevel=2,
    )
