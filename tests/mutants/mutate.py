"""Makes one C file that contains all mutants of another: a number chooses at run time which one is active.

A mutant changes one decision of a function: the operator of a comparison (`<` becomes `<=`), its bound by one, an
operand of `&&` or `||` (dropped), a condition (always true, always false), or an error that a function returns (ERR_OK
instead). A decision is first evaluated as written, so each run also shows which mutants would have decided otherwise: a
test that sees no difference need not run with that mutant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import tree_sitter
import tree_sitter_c

PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_c.language()))

# What the parser does not know, as what it knows; of the same length, so that places stay.
LOOPS = re.compile(rb"\bFOR_EACH_\w+(?= \()")
ATTRIBUTES = re.compile(rb"(?<=^static )[A-Z][A-Z_]+ (?=\w+ )", re.MULTILINE)

# A macro, or a value of an enum.
CONSTANT = re.compile(rb"[A-Z][A-Z0-9_]*")

# The operators that move a bound by one, and the bounds that do the same in the other direction.
OTHER_OPERATOR = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
OTHER_BOUND = {"<": "- 1", "<=": "+ 1", ">": "+ 1", ">=": "- 1"}
COMPARISONS = {*OTHER_OPERATOR, "==", "!="}

# Constant expressions, and text that is compiled by itself.
LEFT_ALONE = {"sizeof_expression", "offsetof_expression", "alignof_expression", "enumerator_list", "preproc_def",
              "preproc_function_def", "preproc_call", "preproc_include", "comment", "ERROR"}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    number: int
    line: int
    function: str
    was: str
    becomes: str

    @property
    def change(self) -> str:
        """Names the mutant without its line, which other changes move."""
        return f"{self.function}: {self.was} -> {self.becomes}"


def plain(text: bytes) -> str:
    return " ".join(text.decode().split())


class Mutator:
    """Rewrites one file. `mutants` is complete when `text` is."""

    def __init__(self, source: bytes) -> None:
        self.source = source
        self.mutants: list[Mutant] = []
        self.unread: list[int] = []  # lines in functions that the parser does not understand
        self.function = ""
        self.result = ""
        known = LOOPS.sub(lambda found: b"while".ljust(len(found[0])), source)
        known = ATTRIBUTES.sub(lambda found: b" " * len(found[0]), known)
        self.text = self.rewrite(PARSER.parse(known).root_node)

    # -- the walk

    def own(self, node: tree_sitter.Node) -> bytes:
        return self.source[node.start_byte : node.end_byte]

    def rewrite(self, node: tree_sitter.Node) -> bytes:
        if node.type == "ERROR" and self.function:
            self.unread.append(node.start_point.row + 1)
        if node.type in LEFT_ALONE or (not self.function and node.type != "function_definition" and not outside(node)):
            return self.own(node)
        if node.type == "function_definition":
            return self.rewrite_function(node)
        if node.type == "declaration" and node.children[0].text == b"static":
            return self.own(node)
        if node.type == "call_expression" and b"ASSERT" in self.own(node.children[0]):
            return self.own(node)
        change = self.changes().get(node.type)
        return change(node) if change else self.inner(node)

    def inner(self, node: tree_sitter.Node, replaced: dict[int, bytes] | None = None) -> bytes:
        """Returns a node with its children rewritten; `replaced` has those by index that are already."""
        parts = []
        at = node.start_byte
        for index, child in enumerate(node.children):
            parts.append(self.source[at : child.start_byte])
            constant = node.type == "case_statement" and node.field_name_for_child(index) == "value"
            constant = constant or (node.type.endswith("array_declarator") and index > 0)
            constant = constant or (node.field_name_for_child(index) == "condition" and node.type.startswith("preproc"))
            if replaced and index in replaced:
                parts.append(replaced[index])
            else:
                parts.append(self.own(child) if constant else self.rewrite(child))
            at = child.end_byte
        parts.append(self.source[at : node.end_byte])
        return b"".join(parts)

    def changes(self) -> dict[str, Callable[[tree_sitter.Node], bytes]]:
        return {
            "if_statement": self.rewrite_condition,
            "while_statement": self.rewrite_loop,
            "do_statement": self.rewrite_loop,
            "for_statement": self.rewrite_loop,
            "conditional_expression": self.rewrite_condition,
            "binary_expression": self.rewrite_binary,
            "return_statement": self.rewrite_return,
        }

    def rewrite_function(self, node: tree_sitter.Node) -> bytes:
        body = node.child_by_field_name("body")
        declarator = node.child_by_field_name("declarator")
        if body is None or declarator is None:
            return self.own(node)
        while declarator.type != "identifier" and declarator.children:
            declarator = declarator.child_by_field_name("declarator") or declarator.children[0]
        self.function = self.own(declarator).decode()
        self.result = plain(self.source[node.start_byte : declarator.start_byte]).split()[-1]
        head = self.source[node.start_byte : body.start_byte]
        text = head + self.inner(body)
        self.function = ""
        return text

    # -- the mutants

    def mutant(self, node: tree_sitter.Node, becomes: str) -> int:
        number = len(self.mutants) + 1
        self.mutants.append(Mutant(number, node.start_point.row + 1, self.function, plain(self.own(node)), becomes))
        return number

    def picks(self, decided: bytes, choices: list[tuple[int, bytes]]) -> bytes:
        for number, other in choices:
            decided = b"mutant_pick(%d, %s, %s)" % (number, decided, other)
        return decided

    def decision(self, node: tree_sitter.Node, values: dict[str, bytes]) -> bytes:
        """Returns a truth value with mutants that make it constant; of a comparison also its own."""
        inner = self.rewrite(node)
        if self.is_constant(node):
            return inner
        constant = [(self.mutant(node, name), value) for name, value in values.items()]
        return self.picks(b"((%s) != 0)" % inner, constant)

    def is_constant(self, node: tree_sitter.Node) -> bool:
        """True for what a configuration decides, such as `APP_RETAIN_SIZE > 0`."""
        if node.children:
            return node.type != "call_expression" and all(self.is_constant(child) for child in node.children)
        return node.type != "identifier" or CONSTANT.fullmatch(self.own(node)) is not None

    def rewrite_condition(self, node: tree_sitter.Node) -> bytes:
        return self.with_condition(node, {"true": b"1", "false": b"0"})

    def rewrite_loop(self, node: tree_sitter.Node) -> bytes:
        if not self.source.startswith((b"while", b"for (", b"do"), node.start_byte):
            return self.with_condition(node, {})
        return self.with_condition(node, {"false": b"0"})

    def with_condition(self, node: tree_sitter.Node, values: dict[str, bytes]) -> bytes:
        for index, child in enumerate(node.children):
            if node.field_name_for_child(index) == "condition" and values:
                inner = bare(child)
                if inner.type in ("number_literal", "true", "false"):
                    break
                decided = self.decision(inner, values)
                return self.inner(node, {index: b"(%s)" % decided})
        return self.inner(node)

    def rewrite_binary(self, node: tree_sitter.Node) -> bytes:
        operator = node.children[1].type
        if operator in ("&&", "||"):
            neutral = {"true": b"1"} if operator == "&&" else {"false": b"0"}
            left, right = (
                self.rewrite(side) if is_both(side, operator) else self.decision(side, neutral)
                for side in (node.children[0], node.children[2])
            )
            return b"%s %s %s" % (left, operator.encode(), right)
        return self.rewrite_comparison(node, operator) if operator in COMPARISONS else self.inner(node)

    def rewrite_comparison(self, node: tree_sitter.Node, operator: str) -> bytes:
        if operator not in OTHER_OPERATOR or self.is_constant(node):
            return self.inner(node)
        left, right = node.children[0], node.children[2]
        place = len(self.mutants)
        sides = b"__typeof__((%s) + 0) left_%d = (%s); __typeof__((%s) + 0) right_%d = (%s);"
        text = sides % (self.own(left), place, self.rewrite(left), self.own(right), place, self.rewrite(right))
        compared = b"left_%d %%s right_%d %%s" % (place, place)
        choices = []
        was_left, was_right = plain(self.own(left)), plain(self.own(right))
        if not is_smaller_or_greater(self, node):
            other = OTHER_OPERATOR[operator]
            number = self.mutant(node, f"{was_left} {other} {was_right}")
            choices.append((number, compared % (other.encode(), b"")))
        bound = OTHER_BOUND[operator]
        number = self.mutant(node, f"{was_left} {operator} {was_right} {bound}")
        choices.append((number, compared % (operator.encode(), bound.encode())))
        return b"({ %s %s; })" % (text, self.picks(compared % (operator.encode(), b""), choices))

    def rewrite_return(self, node: tree_sitter.Node) -> bytes:
        value = next((child for child in node.children if child.type not in ("return", ";", "comment")), None)
        if value is None:
            return self.own(node)
        if self.result == "bool" and bare(value).type == "binary_expression":
            return b"return %s;" % self.decision(value, {"true": b"1", "false": b"0"})
        condition = bare(value).child_by_field_name("condition")
        if condition is not None and self.is_constant(condition):
            return self.inner(node)
        if self.result == "RTS_RESULT" and self.own(value) != b"ERR_OK" and not is_guarded(node):
            inner = self.rewrite(value)
            return b"return (RTS_RESULT)%s;" % self.picks(inner, [(self.mutant(node, "return ERR_OK;"), b"ERR_OK")])
        return self.inner(node)


def outside(node: tree_sitter.Node) -> bool:
    """True if functions may be in it."""
    return node.type == "translation_unit" or node.type.startswith("preproc_")


def bare(node: tree_sitter.Node) -> tree_sitter.Node:
    while node.type == "parenthesized_expression" and len(node.children) == 3:
        node = node.children[1]
    return node


def is_both(node: tree_sitter.Node, operator: str) -> bool:
    """True if the operands of a chain of `operator` have mutants of their own."""
    return node.type == "binary_expression" and node.children[1].type == operator


def is_smaller_or_greater(self: Mutator, node: tree_sitter.Node) -> bool:
    """True for `a < b ? a : b` and `if (a > b) a = b;`: where a equals b, either is as good."""
    above = node.parent
    while above is not None and above.type == "parenthesized_expression":
        above = above.parent
    if above is None or above.type not in ("conditional_expression", "if_statement"):
        return False
    condition, yes, no = (above.child_by_field_name(name) for name in ("condition", "consequence", "alternative"))
    statement = yes.children[0] if yes is not None and yes.type == "expression_statement" else None
    if statement is not None and statement.type == "assignment_expression":
        yes, no = statement.child_by_field_name("left"), statement.child_by_field_name("right")
    if condition is None or yes is None or no is None or bare(condition) != node:
        return False
    return {self.own(yes), self.own(no)} == {self.own(node.children[0]), self.own(node.children[2])}


def is_guarded(node: tree_sitter.Node) -> bool:
    """True for `if (..) return ..;`: the mutant "false" of its condition drops the return."""
    above = node.parent
    if above is not None and above.type == "compound_statement" and above.named_child_count == 1:
        above = above.parent
    return above is not None and above.type == "if_statement" and above.child_by_field_name("alternative") is None


def used(preprocessed: str) -> Iterator[int]:
    """Returns the numbers of the mutants that a configuration compiles."""
    for found in re.finditer(r"\bmutant_pick\((\d+),", preprocessed):
        yield int(found[1])
