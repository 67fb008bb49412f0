"""What rtsim does otherwise than numba's compiler, so that a flight compiles in seconds: all of it inside numba.

* A kernel that other kernels call is *lowered* only: translated for LLVM and handed to its callers as it is. LLVM
  optimises and generates code for whole entry functions, once, instead of again at every level of the calls.
* Passes that our kernels have no use for are left out.
* A number given as a literal makes no specialisation of its own.

``rtsim.kernels.compiled`` falls back to plain numba where one of the names used here is missing; results are the same
bit for bit, only later. Measured: docs/performance.md; why: docs/decisions/0013-compiled-frame.md.
"""

from __future__ import annotations

import contextlib
import hashlib
import pickle
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import compiler, compiler_machinery, sigutils, typed_passes, untyped_passes
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from rtsim.kernels import progress, store

_SOURCES = Path(__file__).resolve().parents[2]


class LoweredLibrary(JITCodeLibrary):
    """Code that was lowered and no more."""

    def add_llvm_module(self, ll_module: Any) -> None:
        """Take a module as it is; whoever links it optimises.

        Args:
            ll_module: The module.
        """
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """Close the library; nothing is generated."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True


class WholeLibrary(JITCodeLibrary):
    """Code of an entry function with all that it calls, optimised together."""

    def finalize(self) -> None:
        """Link everything that is called, directly or not, optimise it once and generate the machine code."""
        ordered: list[Any] = []
        seen: set[Any] = set()

        def visit(library: Any) -> None:
            if library in seen:
                return
            seen.add(library)
            if isinstance(library, LoweredLibrary):
                for called in library._linking_libraries:
                    visit(called)
            ordered.append(library)

        for library in self._linking_libraries:
            visit(library)
        # Callers before what they call: LLVM links a function only where something already asks for it.
        self._linking_libraries = ordered[::-1]
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Vectorise straight code as well as loops; numba leaves that out."""
        for options in ({"cost": "cheap", "slp_vectorize": False}, {"slp_vectorize": True}):
            manager, builder = self._codegen._module_pass_manager(**options)
            manager.run(self._final_module, builder)


@compiler_machinery.register_pass(mutates_CFG=False, analysis_only=True)
class _LowerInto(compiler_machinery.AnalysisPass):
    """Chooses the library that a kernel is lowered into."""

    _name = "rtsim_library"

    def __init__(self) -> None:
        compiler_machinery.AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        kind = LoweredLibrary if state.flags.no_compile else WholeLibrary
        state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
        if kind is WholeLibrary:
            state.library.enable_object_caching()
        return False


class KernelCompiler(compiler.CompilerBase):
    """numba's passes less those that our kernels have no use for."""

    def define_pipelines(self) -> list[Any]:
        """Give the passes in order."""
        if isinstance(self, LoweredCompiler):
            flags = self.state.flags
            flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        manager = compiler_machinery.PassManager("kernel")
        for one in (
            untyped_passes.TranslateByteCode,
            untyped_passes.FixupArgs,
            untyped_passes.IRProcessing,
            untyped_passes.RewriteSemanticConstants,
            untyped_passes.GenericRewrites,
            untyped_passes.ReconstructSSA,
            typed_passes.NopythonTypeInference,
            typed_passes.PreLowerStripPhis,
            typed_passes.IRLegalization,
            _LowerInto,
            typed_passes.NativeLowering,
            typed_passes.NoPythonBackend,
        ):
            manager.add_pass(one, one.__name__)
        manager.finalize()
        return [manager]


class LoweredCompiler(KernelCompiler):
    """The same, stopping before machine code."""


class _KernelCache(NullCache):
    """Keeps machine code with the other pieces of ``rtsim.kernels.store``, one file for a kernel and its types."""

    def __init__(self, function: Any) -> None:
        """Say what the files are called by.

        Args:
            function: The kernel.
        """
        code, cells = function.__code__, function.__closure__ or ()
        made_from = [code.co_code, dumps(tuple(cell.cell_contents for cell in cells))]
        if not Path(code.co_filename).is_relative_to(_SOURCES):  # ours are part of the folder's name
            with contextlib.suppress(OSError):
                stat = Path(code.co_filename).stat()
                made_from.append(repr((code.co_filename, code.co_firstlineno, stat.st_mtime_ns, stat.st_size)).encode())
        self._made_from = b"".join(made_from)
        self._name = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"

    def _file(self, sig: Any, codegen: Any) -> str:
        types_of = ", ".join(str(one) for one in sigutils.normalize_signature(sig)[0])
        made_by = repr((types_of, codegen.magic_tuple(), numba.__version__, sys.version_info, np.__version__))
        return f"{self._name}-{hashlib.sha256(self._made_from + made_by.encode()).hexdigest()[:16]}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load what was compiled for a signature.

        numba would first register all that it can compile, which takes ten times longer than to load. Our kernels
        call nothing of it at run time but the runtime that is started here.

        Args:
            sig: Types of the arguments.
            target_context: Where the code goes.
        """
        rtsys.initialize(target_context)
        file = self._file(sig, target_context.codegen())
        content = store.read(file)
        if content is None:
            return None
        try:
            return compiler.CompileResult._rebuild(target_context, *pickle.loads(content))
        except Exception:  # noqa: BLE001 - whatever it is that this numba cannot do with it: it is compiled anew
            store.damaged(file)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled.

        Args:
            sig: Types of the arguments.
            data: The result.
        """
        if not data.library.has_dynamic_globals:
            store.write(self._file(sig, data.codegen), dumps(data._reduce()))


class WholeDispatcher(CPUDispatcher):
    """A kernel that is called from Python, or at its address; compiled with all that it calls, cached on disk."""

    def __init__(self, function: Any, **options: Any) -> None:
        """Wrap a function.

        Args:
            function: The kernel.
            options: Options of ``numba.njit``.
        """
        super().__init__(function, {}, {"nopython": True, "boundscheck": None, **options}, KernelCompiler)
        self._cache = _KernelCache(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile for types, never for a literal's value.

        Args:
            args: Types of the arguments.
            kws: Types of the keyword arguments.
        """
        return super().get_call_template([types.unliteral(one) for one in args], kws)


class LoweredDispatcher(WholeDispatcher):
    """A kernel that other kernels call; called from Python, it is compiled whole like any other."""

    def __init__(self, function: Any, **options: Any) -> None:
        """Wrap a function.

        Args:
            function: The kernel.
            options: Options of ``numba.njit``.
        """
        super(WholeDispatcher, self).__init__(
            function, {}, {"nopython": True, "boundscheck": None, **options}, LoweredCompiler
        )
        self._options = options
        self._lowered: dict[Any, Any] = {}
        self._whole: WholeDispatcher | None = None

    def compile(self, sig: Any) -> Any:
        """Lower for a signature.

        Args:
            sig: Types of the arguments.
        """
        with global_compiler_lock, self._compiling_counter:
            args, return_type = sigutils.normalize_signature(sig)
            key = self._lowered.get(tuple(args))
            if key is None:
                progress.note(self.py_func.__name__)
                result = self._compiler.compile(args, return_type)
                key = (self, tuple(args))
                self.targetctx.insert_user_function(key, result.fndesc, [result.library])
                self._lowered[tuple(args)] = key
                self.overloads[tuple(args)] = result
            return key

    def get_overload(self, sig: Any) -> Any:
        """What the callers' code knows the kernel by.

        Args:
            sig: Types of the arguments.
        """
        args, _ = sigutils.normalize_signature(sig)
        return self._lowered[tuple(args)]

    @property
    def whole(self) -> WholeDispatcher:
        """The same function as a kernel of its own."""
        if self._whole is None:
            self._whole = WholeDispatcher(self.py_func, **self._options)
        return self._whole

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """Compile whole for a call from Python, which calls that from now on."""
        entry = self.whole._compile_for_args(*args, **kws)
        for types_of, result in self.whole.overloads.items():
            self._insert([one._code for one in types_of], result.entry_point, False)
        return entry
