"""Questions about the typed program: what a statement writes, what a call may touch."""

from __future__ import annotations

from plctool.compiler.typed.nodes import (
    Call,
    DerefPlace,
    FbCall,
    For,
    Place,
    Pou,
    SelfPlace,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import referenced_places, root_of, walk, written_places
from plctool.iec.areas import EXCLUSIVE_AREAS
from plctool.iec.types import ArrayType, StructType, Type


class Effects:
    """Remembers answers about POUs."""

    def __init__(self) -> None:
        self._local: dict[Pou, bool] = {}
        self._addressed: dict[Pou, set[Variable]] = {}
        self._renewing: dict[Pou, bool] = {}

    def is_local(self, pou: Pou) -> bool:
        """Whether a call touches nothing but the callee's own variables and its arguments."""
        known = self._local.get(pou)
        if known is None:
            self._local[pou] = False  # the answer within a recursion
            known = pou.external is None and all(self._is_local_node(node, pou) for node in walk(pou.body))
            self._local[pou] = known
        return known

    def _is_local_node(self, node: object, pou: Pou) -> bool:
        if isinstance(node, VarPlace):
            if node.var.storage is Storage.REFERENCE:  # in a method it may be one of the block
                return any(parameter.variable is node.var for parameter in pou.parameters)
            return node.var.storage is Storage.LOCAL
        if isinstance(node, Call):
            return node.dispatch is None and self.is_local(node.function)
        if isinstance(node, FbCall):
            return node.dispatch is None and self.is_local(node.block)
        return not isinstance(node, DerefPlace | SelfPlace)

    def renews_in_outs(self, pou: Pou) -> bool:
        """Whether a block gives its base other VAR_IN_OUTs than it was called with: SUPER^(io := x)."""
        known = self._renewing.get(pou)
        if known is None:
            calls = (node for node in walk(pou.body) if isinstance(node, FbCall) and node.in_outs)
            known = self._renewing[pou] = any(isinstance(call.instance, SelfPlace) for call in calls)
        return known

    def owns_loop_variable(self, loop: For, pou: Pou) -> Variable | None:
        """The FOR variable when nothing but the loop itself can write it while the loop runs."""
        if not isinstance(loop.var, VarPlace) or loop.var.var.storage is Storage.REFERENCE:
            return None
        var = loop.var.var
        if self.has_address_taken(var, pou):
            return None
        for node in walk([*loop.body, loop.stop, loop.step] if loop.each_turn else loop.body):
            if any(self.may_share(place, var, pou) for place in written_places(node)):
                return None
            if var.storage is not Storage.LOCAL and not self._leaves_alone(node):
                return None
        return var

    def _leaves_alone(self, node: object) -> bool:
        if isinstance(node, Call):
            return node.dispatch is None and self.is_local(node.function)
        return not isinstance(node, FbCall)

    def may_share(self, place: Place, variable: Variable, pou: Pou) -> bool:
        """Whether a place that the POU names may have memory of a variable that it names. `variable`: a local one only
        if its address is not taken."""
        root = root_of(place)
        if root is None:
            return variable.storage is not Storage.LOCAL
        return root is variable or may_overlap(root, variable, pou)

    def has_address_taken(self, variable: Variable, pou: Pou) -> bool:
        """Whether the POU takes the address of a variable, or of a part of it, so that it may be kept."""
        known = self._addressed.get(pou)
        if known is None:
            places = [place for node in walk(pou.body) for place in referenced_places(node)]
            known = {root for place in places if (root := root_of(place)) is not None}
            self._addressed[pou] = known
        return variable in known


def may_overlap(one: Variable, other: Variable, pou: Pou | None) -> bool:
    """Whether two variables that a POU names, none of them a reference, may have the same memory."""
    if one.storage is other.storage is Storage.AREA:
        if one.area is not other.area or one.area in EXCLUSIVE_AREAS:
            return False
        return one.offset < other.offset + other.type.size and other.offset < one.offset + one.type.size
    if {one.storage, other.storage} != {Storage.AREA, Storage.SELF}:
        return False
    outside = one if one.storage is Storage.AREA else other
    return pou is not None and pou.instance is not None and _holds(outside.type, pou.instance.root)


def _holds(t: Type, block: StructType) -> bool:
    """Whether a variable of the type is or contains an instance of a block, or of one that is derived from it."""
    if isinstance(t, ArrayType):
        return _holds(t.element, block)
    return isinstance(t, StructType) and (t.root is block or any(_holds(f.type, block) for f in t.fields))
