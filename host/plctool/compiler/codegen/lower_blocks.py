"""Calls of function blocks, and assignments to what is not a scalar."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.analysis import walk
from plctool.compiler.codegen.lower_arith import is_real
from plctool.compiler.codegen.lower_frame import Ref
from plctool.compiler.codegen.lower_init import Initialising
from plctool.compiler.codegen.lower_unit import value_type
from plctool.compiler.typed import (
    Binary,
    BinaryOp,
    Const,
    Convert,
    Expr,
    FbCall,
    IntrinsicCall,
    Load,
    MemberPlace,
    Place,
    Pou,
    Storage,
    Unary,
    Variable,
    VarPlace,
)
from plctool.compiler.types import BOOL, PointerType, StringType, StructType, is_scalar

_POINTER = PointerType(BOOL)  # what an instance stores for a VAR_IN_OUT


class BlockCalls(Initialising):
    """Calls of function blocks in the function being written."""

    def fb_call(self, s: FbCall) -> None:
        instance = self.ref(s.instance)
        base = self.address(instance)
        instance = replace(instance, pointer=base, offset=0)
        arguments = self._inputs(s, instance)
        for variable, place in s.in_outs:
            slot = Ref(base, variable.offset, _POINTER)
            self.store(slot, self.address(self.ref(place)))
        if s.block.external:
            target = self.import_function(self.unit.import_slot(s.block.external))
            self.fn.do(f"call void {target}(ptr {base}) {self.unit.external_call}")
        else:
            words = ["ptr %ctx", f"ptr {base}", *arguments]
            self.fn.do(f"call void @{self.unit.target_of(s.block, s.dispatch)}({', '.join(words)})")
        for variable, place in s.outputs:
            self._copy_out(self._member(s.block, instance, variable), self.ref(place))

    def _inputs(self, s: FbCall, instance: Ref) -> list[str]:
        """Stores the inputs in the instance. Returns the values of those that the block stores itself; they must be
        stored here as well in front of an expression that could see it."""
        handed = self.unit.handed.get(s.block, [])
        values: dict[Variable, str] = {}
        arguments = [argument for _, argument in s.inputs + s.in_outs]
        last = max((n for n, argument in enumerate(arguments) if not self._is_plain(argument, s.block)), default=0)
        for number, (variable, value) in enumerate(s.inputs):
            if variable in handed and number >= last:
                values[variable] = self.value(value)
            else:
                self._assign_member(self._member(s.block, instance, variable), value)
        for variable in handed:
            if variable not in values:
                values[variable] = self.load(self._member(s.block, instance, variable))
        return [f"{value_type(variable.type)} {values[variable]}" for variable in handed]

    def _is_plain(self, argument: Expr | Place, block: Pou) -> bool:
        """Whether an argument neither fails nor calls anything, nor reads an input of such a block."""
        return all(self._is_plain_node(node, block) for node in walk(argument))

    def _is_plain_node(self, node: object, block: Pou) -> bool:
        assert block.instance is not None
        root = block.instance.root
        if isinstance(node, Binary):
            return node.op not in (BinaryOp.DIV, BinaryOp.MOD) or is_real(node.type)
        if isinstance(node, Convert):
            return node.check is None
        if isinstance(node, VarPlace):
            own = self.pou.instance.root if self.pou is not None and self.pou.instance is not None else None
            storage = node.var.storage
            return storage is not Storage.REFERENCE and (storage is not Storage.SELF or own is not root)
        if isinstance(node, MemberPlace) and isinstance(node.base.type, StructType) and node.base.type.root is root:
            return all(node.offset != variable.offset for variable in self.unit.handed.get(block, []))
        return isinstance(node, Const | Load | Unary | IntrinsicCall | MemberPlace)

    def take_inputs(self, block: Pou) -> None:
        """Stores the inputs that the block was handed."""
        for number, variable in enumerate(self.unit.handed.get(block, [])):
            self.store(self.ref(VarPlace(variable, variable.type, block.pos)), f"%p{number}")

    def _member(self, block: Pou, instance: Ref, variable: Variable) -> Ref:
        tag = ""
        if instance.direct and (instance.tag or instance.pointer == "%self"):
            assert block.instance is not None
            tag = self.unit.tag((block.instance.root.name, variable.offset))
        return instance.member(variable.offset, variable.type, tag)

    def _assign_member(self, target: Ref, value: Expr) -> None:
        if is_scalar(target.type):
            self.store(target, self.value(value))
        else:
            self.assign_aggregate(target, value)

    def assign_aggregate(self, target: Ref, value: Expr) -> None:
        """target := string, array or struct."""
        if not isinstance(target.type, StringType):
            self.copy(target, self.aggregate(value), target.type.size)
        elif isinstance(value, Const):
            self.copy_literal(target, str(value.value))
        else:
            self.copy_string(target, self.aggregate(value))

    def _copy_out(self, source: Ref, target: Ref) -> None:
        if target.bit >= 0 or is_scalar(target.type):
            wanted = BOOL if target.bit >= 0 else target.type
            self.store(target, self.convert(self.load(source), source.type, wanted))
        elif isinstance(target.type, StringType):
            self.copy_string(target, source)
        else:
            self.copy(target, source, target.type.size)
