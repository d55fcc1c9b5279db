"""Questions about the typed program: what a statement writes, what a call may touch."""

from __future__ import annotations

from plctool.compiler.typed import (
    AddressOf,
    Assign,
    Call,
    Const,
    DerefPlace,
    FbCall,
    For,
    Load,
    MemberPlace,
    Pou,
    SelfPlace,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed_nodes import root_of, walk, written_places


def only_copies(pou: Pou) -> bool:
    """Whether a unit does no more than assign variables and constants, which cannot fail."""
    return all(isinstance(node, Assign | Const | Load | MemberPlace | VarPlace) for node in walk(pou.body))


class Effects:
    """Remembers answers about POUs."""

    def __init__(self) -> None:
        self._local: dict[Pou, bool] = {}
        self._addressed: dict[Pou, set[Variable]] = {}

    def is_local(self, pou: Pou) -> bool:
        """Whether a call touches nothing but the callee's own variables and its arguments."""
        known = self._local.get(pou)
        if known is None:
            self._local[pou] = False  # the answer within a recursion
            known = pou.external is None and all(self._is_local_node(node) for node in walk(pou.body))
            self._local[pou] = known
        return known

    def _is_local_node(self, node: object) -> bool:
        if isinstance(node, VarPlace):
            return node.var.storage in (Storage.LOCAL, Storage.REFERENCE)
        if isinstance(node, Call):
            return node.dispatch is None and self.is_local(node.function)
        if isinstance(node, FbCall):
            return node.dispatch is None and self.is_local(node.block)
        return not isinstance(node, DerefPlace | SelfPlace)

    def owns_loop_variable(self, loop: For, pou: Pou) -> Variable | None:
        """The FOR variable when nothing but the loop itself can write it while the loop runs."""
        if not isinstance(loop.var, VarPlace) or loop.var.var.storage is Storage.REFERENCE:
            return None
        var = loop.var.var
        if var in self._addressed_in(pou):
            return None
        for node in walk([*loop.body, loop.stop, loop.step] if loop.each_turn else loop.body):
            for place in written_places(node):
                root = root_of(place)
                if root is var or (root is None and var.storage is not Storage.LOCAL):
                    return None
            if var.storage is not Storage.LOCAL and not self._leaves_alone(node):
                return None
        return var

    def _leaves_alone(self, node: object) -> bool:
        if isinstance(node, Call):
            return node.dispatch is None and self.is_local(node.function)
        return not isinstance(node, FbCall)

    def has_address_taken(self, variable: Variable, pou: Pou) -> bool:
        """Whether the POU takes the address of a variable or of a part of it."""
        return variable in self._addressed_in(pou)

    def _addressed_in(self, pou: Pou) -> set[Variable]:
        """Variables whose address the POU takes."""
        known = self._addressed.get(pou)
        if known is None:
            places = [node.place for node in walk(pou.body) if isinstance(node, AddressOf)]
            known = {root for place in places if (root := root_of(place)) is not None}
            self._addressed[pou] = known
        return known
