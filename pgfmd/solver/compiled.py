"""Compilation of kernels, and a cache for later starts. Problems of the cache never stop a run.

numba stores compiled kernels next to the sources, or in the user's cache folder; NUMBA_CACHE_DIR sets another folder.
These may not be writable (an installation by an administrator, a container, a compute node without home folders), the
disk may be full, and a crash may have left an incomplete file. Then kernels are stored in the user's folder in the
temporary folder, or not stored and compiled at each start.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import llvmlite.binding
import numba
from numba.core import caching
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.dispatcher import Dispatcher
from numba.extending import overload

CURE = "NUMBA_CACHE_DIR names a folder to keep them in"
_COMPILED = ("**/*kernels.py", "hashing.py", "solver/inlined_laws.py", "physics/adhesion/*.py")
"""Sources of kernels in the package."""

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def compiled(**options: Any) -> Callable[[Kernel], Kernel]:
    """A decorator: `numba.njit` with these options, without Python's lock, and with a cache that never raises."""

    def decorate(function: Kernel) -> Kernel:
        kernel: Any = numba.njit(nogil=True, **options)(function)
        # A plain function if NUMBA_DISABLE_JIT is set.
        if isinstance(kernel, Dispatcher):
            kernel = cast("Any", kernel)
            # The attribute that `cache=True` sets, with another class.
            kernel._cache = KernelCache(function)
        return cast("Kernel", kernel)

    return decorate


def inlined(function: Kernel) -> Kernel:
    """A decorator for functions that kernels call; they are inlined."""
    return cast("Kernel", numba.njit(inline="always")(function))


def overloading(function: Callable[..., Any], **options: Any) -> Callable[[Kernel], Kernel]:
    """A decorator, `numba.extending.overload`: what it decorates finds, by the types of the arguments, the code that
    kernels have in place of the function."""

    def decorate(chosen: Kernel) -> Kernel:
        # Not strict: only the names of the arguments have to agree, not their annotations.
        return cast("Kernel", overload(function, strict=False, **options)(chosen))

    return decorate


def hear(listener: Callable[[str], None] | None) -> None:
    """Sends messages about the cache to `listener` from now on, and earlier ones as well. Each message is sent once per
    process. None: no messages."""
    global _listener
    _listener = listener or (lambda text: None)
    for text in _notes.values():
        _listener(text)


def place() -> Path | None:
    """The folder in which kernels of this module's folder are stored; None if there is none."""
    cache = KernelCache(compiled)
    for one in (cache.first, cache.second):
        found = one()
        if found is not None:
            return Path(found.cache_path)
    return None


def is_kept(what: str) -> bool:
    """Whether the kernels for `what` are in the cache, according to `remember`."""
    mark = _mark_of(what)
    return mark is not None and mark.exists()


def remember(what: str) -> None:
    """Records that the kernels for `what` are in the cache now. If this fails, later starts search for them again."""
    mark = _mark_of(what)
    with contextlib.suppress(OSError):
        if mark is not None and any(mark.parent.glob("*.nbi")):
            mark.touch()


def _mark_of(what: str) -> Path | None:
    """A file in the folder of the cache for these sources, this version of numba and this processor; None without a
    cache."""
    folder = place()
    if folder is None:
        return None
    digest = hashlib.sha256("\0".join((numba.__version__, llvmlite.binding.get_host_cpu_name(), _sources())).encode())
    return folder / f"{what}-{digest.hexdigest()[:16]}.kept"


@functools.cache
def _sources() -> str:
    """A digest of the sources of all kernels in the package, and of the code that is compiled into them."""
    package = Path(__file__).parents[1]
    texts = (source.read_bytes() for pattern in _COMPILED for source in sorted(package.glob(pattern)))
    return hashlib.sha256(b"\0".join(texts)).hexdigest()


_notes: dict[str, str] = {}
_listener: Callable[[str], None] | None = None


def _note(matter: str, text: str) -> None:
    if matter not in _notes:
        _notes[matter] = text
        if _listener is not None:
            _listener(text)


class _Cache(FunctionCache):
    """numba's own cache. It checks for changes in the kernel's own file. But kernels include code from other files, and
    must be compiled again if that changes."""

    def _index_key(self, *about: Any) -> tuple[Any, ...]:
        return (*super()._index_key(*about), _sources())


class KernelCache(NullCache):
    """numba's own cache of a function, with a second one if the first fails. Never raises."""

    def __init__(self, function: Callable[..., Any]):
        self._function = function
        self._opened: dict[type, FunctionCache | None] = {}

    @property
    def cache_path(self) -> str | None:
        """The folder of numba's own cache."""
        first = self.first()
        return None if first is None else first.cache_path

    def first(self) -> FunctionCache | None:
        """numba's own cache; None if it has no place for one."""
        return self._open(_Cache)

    def second(self) -> FunctionCache | None:
        """The cache in the temporary folder, created if it does not exist; None if this fails."""
        return self._open(_TemporaryCache)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel from either cache; None if it has to be compiled."""
        found = self._load(self.first(), sig, target_context)
        folder = temporary_folder()
        if found is None and folder is not None and folder.is_dir():
            found = self._load(self.second(), sig, target_context)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Stores a compiled kernel in the first cache that accepts it."""
        first = self.first()
        problem = self._save(first, sig, data)
        if problem is None:
            return
        where = "numba's folders" if first is None else first.cache_path
        if self._save(self.second(), sig, data) is None:
            target = temporary_folder()
            _note("place", f"note: {where} can't keep compiled kernels ({problem}): they go to {target}; {CURE}")
        else:
            why = f"{where}: {problem}"
            _note("place", f"note: compiled kernels can't be kept ({why}): each start compiles anew; {CURE}")

    def _open(self, kind: type) -> FunctionCache | None:
        if kind not in self._opened:
            try:
                self._opened[kind] = kind(self._function)
            except Exception:  # numba raises RuntimeError where it finds no place; the system whatever it likes
                self._opened[kind] = None
        return self._opened[kind]

    def _load(self, cache: FunctionCache | None, sig: Any, target_context: Any) -> Any:
        if cache is None:
            return None
        try:
            return cache.load_overload(sig, target_context)
        except Exception as problem:  # whatever unpickling makes of half a file
            _note("damage", f"note: damaged kernels in {cache.cache_path} ({_reason(problem)}): compiled anew")
            with contextlib.suppress(Exception):  # the same file will fail again when it is to be written
                cache.flush()
            return None

    def _save(self, cache: FunctionCache | None, sig: Any, data: Any) -> str | None:
        """Why it was not saved; None if it was."""
        if cache is None:
            return "none can be written"
        try:
            cache.save_overload(sig, data)
        except Exception as problem:  # keeping a kernel is never worth a run
            return _reason(problem)
        return None


def _reason(problem: Exception) -> str:
    return getattr(problem, "strerror", None) or str(problem) or type(problem).__name__


def temporary_folder() -> Path | None:
    """The folder in the temporary folder that kernels of this user go to; None if there is no temporary folder."""
    try:
        return Path(tempfile.gettempdir(), f"pgfmd-kernels-{os.getuid()}")
    except OSError:
        return None


# Its name until numba 0.61.
_UserWideLocator: Any = getattr(caching, "UserWideCacheLocator", None) or caching._UserWideCacheLocator


class _TemporaryLocator(_UserWideLocator):
    """Below `temporary_folder`."""

    def __init__(self, function: Callable[..., Any], file: str):
        super().__init__(function, file)
        folder = temporary_folder()
        if folder is None:
            raise OSError("no temporary folder")
        self._cache_path = str(folder / self.get_suitable_cache_subpath(file))

    def ensure_cache_path(self) -> None:
        """Creates the folder. OSError if this fails, or if other users can write to it, because code is loaded from
        it."""
        folder = Path(self._cache_path).parent
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
        if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o022:
            raise PermissionError(f"{folder} is not this user's alone")
        super().ensure_cache_path()


class _TemporaryImpl(CompileResultCacheImpl):
    _locator_classes: ClassVar = [_TemporaryLocator]


class _TemporaryCache(_Cache):
    _impl_class = _TemporaryImpl
