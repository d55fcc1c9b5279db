"""Names in the debugging information of variables on the stack."""

from __future__ import annotations

POINTER_TO = "&"  # before a name: on the stack is where the variable is
INSTANCE = "%self"  # the instance of a function block
