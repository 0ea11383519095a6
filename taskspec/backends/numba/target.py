"""The machine that kernels are compiled for."""

from __future__ import annotations

import llvmlite.binding as llvm


def target_machine() -> llvm.TargetMachine:
    """This machine, as a target of code that is loaded at run time. An engine that is made with it becomes its owner."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = llvm.get_process_triple()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="default", codemodel="jitdefault", jit=True
    )
