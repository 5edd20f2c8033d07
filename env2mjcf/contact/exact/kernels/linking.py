"""Functions that are optimised and translated once, in the entry that they end in, and at a level of our own.

Numba does both for each function by itself, and again in each of its callers, which was two thirds of the time that
compiling took; and its level, which is for the whole process, costs more than it gains here. This module needs parts of
numba that are private. Where they are not as expected, `INNER` and `OUTER` are empty, and compiling takes longer.
"""

from __future__ import annotations

import ctypes
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target

_LEVEL = 1


def _prepared(library: Any, module: Any) -> None:
    module.data_layout = library._codegen._data_layout
    for function in module.functions:
        if not function.is_declaration:
            passes, builder = library._codegen._function_pass_manager(opt=_LEVEL)
            passes.run(function, builder)


class _Whole(JITCodeLibrary):
    """An entry, with all that it calls."""

    def _optimize_functions(self, ll_module: Any) -> None:
        _prepared(self, ll_module)

    def _optimize_final_module(self) -> None:
        codegen: Any = self._codegen
        passes, builder = codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap")
        passes.run(self._final_module, builder)
        passes, builder = codegen._module_pass_manager(opt=_LEVEL)
        passes.run(self._final_module, builder)


class _Nowhere:
    """A code generator that places no environments: what is not translated has no address."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)


# Where Python calls what is only a part, it says that a closure is not callable.
_REFUSAL = ctypes.cast(ctypes.pythonapi.PyObject_Call, ctypes.c_void_p).value


class _Part(JITCodeLibrary):
    """What other compiled functions call."""

    def _optimize_functions(self, ll_module: Any) -> None:
        _prepared(self, ll_module)

    @property
    def codegen(self) -> Any:
        return _Nowhere(self._codegen)

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> Any:
        return _REFUSAL

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            module = self._final_module.clone()
            for library in self._behind({}):
                if library is not self:
                    part = isinstance(library, _Part)
                    module.link_in(library._final_module if part else library._get_module_for_linking(), preserve=True)
            for function in module.functions:
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module = module
        return self._shared_module

    def _behind(self, seen: dict[Any, None]) -> dict[Any, None]:
        """Return all libraries that this one needs, in order, itself included."""
        if self not in seen:
            seen[self] = None
            for library in self._linking_libraries:
                if isinstance(library, _Part):
                    library._behind(seen)
                else:
                    seen[library] = None
        return seen


def _compiler(library_class: type[JITCodeLibrary], keeps_objects: bool) -> type[Compiler]:
    class Into(Compiler):
        def __init__(
            self, typingctx: Any, targetctx: Any, library: Any, args: Any, return_type: Any, flags: Any, locals: Any
        ) -> None:
            if library is None:
                library = library_class(targetctx.codegen(), library_class.__name__)
                if keeps_objects:
                    library.enable_object_caching()
            super().__init__(typingctx, targetctx, library, args, return_type, flags, locals)

    return Into


def _as_expected() -> bool:
    """Return whether numba's private parts are those that this module was written for."""
    try:
        target: Any = cpu_target
        codegen = target.target_context.codegen()
        library: Any = JITCodeLibrary(codegen, "trial")
        module = codegen._create_empty_module("trial")
        _, _ = codegen._function_pass_manager(opt=_LEVEL)
        passes, builder = codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap")
        passes.run(llvm.parse_assembly(str(module)), builder)
        parts = (library._final_module, library._linking_libraries, library._shared_module, library._finalized)
        return len(parts) == 4
    except Exception:  # Whatever has changed, there is the other way.
        return False


_UNCALLED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_USED = _as_expected()

INNER: dict[str, Any] = {**_UNCALLED, "pipeline_class": _compiler(_Part, keeps_objects=False)} if _USED else {}
"""Options of numba for functions that other compiled functions call; Python cannot call them."""

OUTER: dict[str, Any] = (
    {"no_cfunc_wrapper": True, "pipeline_class": _compiler(_Whole, keeps_objects=True)} if _USED else {}
)
"""Options of numba for entries."""
