"""The rules of expressions and statements: one function for each kind of node, and what they share.

A rule has the parts of its node checked by the `Checker` it gets, so the modules import each other in one direction
only. All of them are imported here, so that a user of one of them has all.

SPDX-License-Identifier: Apache-2.0
"""

from plctool.compiler.semantics.rules import (
    assignments,
    call_statements,
    calls,
    control,
    literals,
    operators,
    parts,
    temps,
    variables,
)

__all__ = ["assignments", "call_statements", "calls", "control", "literals", "operators", "parts", "temps", "variables"]
