"""Compiler of numba with fewer passes and a cache of types, to save compile time."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from types import FrameType
from typing import Any

from llvmlite.binding import parse_bitcode
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.core.types.misc import unliteral
from numba.core.typing import Context

__all__ = ["InnerCompiler", "KernelCompiler", "Loop"]

Handler = Callable[[int, FrameType | None], object]

DEFAULTS = Flags().values()

# Passes for closures, `with`, literal types, array expressions and listings. The passes that fold constants and prune
# dead branches are kept, because loops over tetrahedra give different bits without them.
NOT_NEEDED = {
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.AnnotateTypes,
    typed_passes.DumpParforDiagnostics,
}


class KernelCompiler(Compiler):
    def __init__(self, typingctx: Any, targetctx: Any, library: Any, args: Any, returned: Any, flags: Any, *rest: Any):
        super().__init__(typingctx, targetctx, library, args, returned, _Flags(flags), *rest)

    def define_pipelines(self) -> list[PassManager]:
        (manager,) = super().define_pipelines()
        lean = PassManager(manager.pipeline_name)
        lean.passes = [(step, reason) for step, reason in manager.passes if step not in NOT_NEEDED]
        lean.finalize()
        return [lean]


class InnerCompiler(KernelCompiler):
    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *rest: Any) -> None:
        super().__init__(typingctx, targetctx, _LinkedCode(targetctx.codegen(), "inner loop"), *rest)


class _Flags(Flags):
    __slots__ = ()

    def values(self) -> dict[str, Any]:
        return {**DEFAULTS, **self._values}


class _LinkedCode(JITCodeLibrary):
    """Code of an inner loop, compiled to machine code after linking only."""

    KIND = "linked"

    def _optimize_final_module(self) -> None:
        """Skip the optimisation, which follows after linking."""

    def _finalize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration:
                function.linkage = "linkonce_odr"
        self.set_module(self._final_module)

    def set_module(self, module: Any) -> None:
        self._shared_module, self._finalized = module, True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        return self.name, self.KIND, self._get_module_for_linking().as_bitcode()


class _Codegen(JITCPUCodegen):
    def __init__(self, codegen: JITCPUCodegen) -> None:
        self.__dict__.update(codegen.__dict__)  # both share the machine code

    def unserialize_library(self, serialized: Any) -> Any:
        name, kind, data = serialized
        if kind != _LinkedCode.KIND:
            return super().unserialize_library(serialized)
        library = _LinkedCode(self, name)
        library.set_module(parse_bitcode(data))
        return library

    def set_env(self, env_name: str, env: Any) -> None:
        if self._engine.get_global_value_address(env_name):
            super().set_env(env_name, env)


class _CachedTypes(Context):
    """Typing context of numba with a cache of function signatures.

    numba checks some ten rules for each of the thousands of operators in a loop, mostly products of two numbers.
    """

    def __init__(self, context: Context) -> None:
        self.__dict__.update(context.__dict__)  # both share the declarations
        self._found: dict[Any, Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        if kws or not isinstance(func, types.Function):
            return super().resolve_function_type(func, args, kws)
        key = (func, tuple(args))
        if key not in self._found:
            self._found[key] = super().resolve_function_type(func, args, kws)
        return self._found[key]


class _Target(CPUTarget):
    @cached_property
    def _toplevel_typing_context(self) -> Context:
        return _CachedTypes(cpu_target.typing_context)

    @cached_property
    def _toplevel_target_context(self) -> Any:
        context = cpu_target.target_context
        return context.subtarget(_internal_codegen=_Codegen(context.codegen()))


class Loop(CPUDispatcher):
    """Dispatcher of a loop, compiled by calls from kernels for one type of integer.

    Without this, constants and 32-bit indices as arguments would each cause another compilation.
    """

    targetdescr = _Target("cpu")

    def compile(self, sig: Any) -> Any:
        with interrupts_held():
            return super().compile(sig)

    def get_call_template(self, args: Iterable[Any], kws: dict[str, Any]) -> Any:
        return super().get_call_template([_widened(kind) for kind in args], {k: _widened(kws[k]) for k in kws})


def _widened(kind: types.Type) -> types.Type:
    kind = unliteral(kind)
    return types.int64 if isinstance(kind, types.Integer) else kind


class _DelayedHandler:
    def __init__(self, handler: Handler) -> None:
        self._handler = handler
        self._signals: list[tuple[int, FrameType | None]] = []

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self._signals.append((number, frame))

    def deliver(self) -> None:
        while self._signals:
            self._handler(*self._signals.pop())


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the end of the outermost block.

    LLVM calls Python while it makes machine code. A KeyboardInterrupt in such a call would be lost, and numba would
    later raise a RuntimeError because of the incomplete call.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Python runs handlers in the main thread only
        return
    before = signal.getsignal(signal.SIGINT)
    delayed = before if isinstance(before, _DelayedHandler) else _DelayedHandler(before) if callable(before) else None
    if delayed is None:  # Ctrl-C is ignored or ends the process
        yield
        return
    signal.signal(signal.SIGINT, delayed)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        delayed.deliver()
