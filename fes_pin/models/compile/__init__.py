"""Expressions to machine code: CasADi SX lowered to LLVM, one lane per trial or parameter set."""
