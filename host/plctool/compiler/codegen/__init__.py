"""Typed program to LLVM IR, object, and linked code of one target."""
