"""Have numba compile each kernel once, in less of the time that it takes by default."""

from collections.abc import Iterable
from functools import cached_property
from typing import Any

from llvmlite.binding import parse_bitcode
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.core.types.misc import unliteral
from numba.core.typing import Context

from kohonen_adapt.kernels.interrupts import interrupts_held

__all__ = ["InnerCompiler", "KernelCompiler", "Loop"]

DEFAULTS = Flags().values()

# Passes over closures, `with`, constants as types, arrays made by arithmetic, and for a listing. Those that fold
# constants and cut dead branches stay: without them loops over tetrahedra give other bits.
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
    """numba's compiler, for loops that Python calls."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, args: Any, returned: Any, flags: Any, *rest: Any):
        super().__init__(typingctx, targetctx, library, args, returned, _Flags(flags), *rest)

    def define_pipelines(self) -> list[PassManager]:
        """The one that numba has without objects, less what looks for things that no kernel has."""
        (manager,) = super().define_pipelines()
        lean = PassManager(manager.pipeline_name)
        lean.passes = [(each, says) for each, says in manager.passes if each not in NOT_NEEDED]
        lean.finalize()
        return [lean]


class InnerCompiler(KernelCompiler):
    """The same for loops that only kernels call."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *rest: Any) -> None:
        super().__init__(typingctx, targetctx, _LinkedCode(targetctx.codegen(), "inner loop"), *rest)


class _Flags(Flags):
    """How to compile, of which numba makes a table for every operator that it looks up."""

    __slots__ = ()

    def values(self) -> dict[str, Any]:
        """The table, without asking for one after the other."""
        return {**DEFAULTS, **self._values}


class _LinkedCode(JITCodeLibrary):
    """The code of a loop that nobody runs but where it is linked in, which is where machine code is made of it."""

    KIND = "linked"

    def _optimize_final_module(self) -> None:
        """Leave that to what it is linked into."""

    def _finalize_final_module(self) -> None:
        """Let it be linked into whatever calls it."""
        for each in self._final_module.functions:
            if not each.is_declaration:
                each.linkage = "linkonce_odr"
        self.become(self._final_module)

    def become(self, module: Any) -> None:
        """Have this for all code."""
        self._shared_module, self._finalized = module, True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is kept on disk."""
        return self.name, self.KIND, self._get_module_for_linking().as_bitcode()


class _Codegen(JITCPUCodegen):
    """What numba makes machine code with, which knows of loops of which there is none."""

    def __init__(self, codegen: JITCPUCodegen) -> None:
        self.__dict__.update(codegen.__dict__)  # there is one place for machine code

    def unserialize_library(self, serialized: Any) -> Any:
        """The code of a loop as it was kept on disk."""
        name, kind, data = serialized
        if kind != _LinkedCode.KIND:
            return super().unserialize_library(serialized)
        library = _LinkedCode(self, name)
        library.become(parse_bitcode(data))
        return library

    def set_env(self, env_name: str, env: Any) -> None:
        """Tell machine code where Python's objects are that it refers to."""
        if self._engine.get_global_value_address(env_name):
            super().set_env(env_name, env)


class _Remembering(Context):
    """What numba knows of types, with what it has found of a function and its arguments.

    It asks some ten rules for each operator in a loop, and there are thousands; most are a product of two numbers.
    """

    def __init__(self, context: Context) -> None:
        self.__dict__.update(context.__dict__)  # what is declared to one is known to both
        self._found: dict[Any, Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a function for these arguments; those of loops depend on what is being compiled."""
        if kws or not isinstance(func, types.Function):
            return super().resolve_function_type(func, args, kws)
        key = (func, tuple(args))
        if key not in self._found:
            self._found[key] = super().resolve_function_type(func, args, kws)
        return self._found[key]


class _Target(CPUTarget):
    """The processor that numba compiles for, by types that are remembered."""

    @cached_property
    def _toplevel_typing_context(self) -> Context:
        return _Remembering(cpu_target.typing_context)

    @cached_property
    def _toplevel_target_context(self) -> Any:
        context = cpu_target.target_context
        return context.subtarget(_internal_codegen=_Codegen(context.codegen()))


class Loop(CPUDispatcher):
    """A loop, which calls of other loops compile for one type of integer.

    Otherwise each takes a constant or an index of 32 bits for another type, and the loop is compiled for that, too.
    """

    targetdescr = _Target("cpu")

    def compile(self, sig: Any) -> Any:
        """Compile the loop for a signature; Ctrl-C waits until the loop or one that it calls is compiled."""
        with interrupts_held():
            return super().compile(sig)

    def get_call_template(self, args: Iterable[Any], kws: dict[str, Any]) -> Any:
        """What a call of these types is compiled to."""
        return super().get_call_template([_widened(kind) for kind in args], {k: _widened(kws[k]) for k in kws})


def _widened(kind: types.Type) -> types.Type:
    kind = unliteral(kind)
    return types.int64 if isinstance(kind, types.Integer) else kind
