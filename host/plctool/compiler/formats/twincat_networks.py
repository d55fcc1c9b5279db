"""TwinCAT 3: bodies in LD and FBD of .TcPOU files (<NWL>), an archive of objects that the vendor does not describe.

An object is <o n="name" t="type">, a value <v>, a list <l2 cet="type of its elements">, nothing <n/>. What is read here
was seen in files of public repositories; every other type, flag and attribute is refused by name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.formats.network_trees import (
    Assignment,
    Box,
    Branch,
    Definition,
    Elements,
    Operand,
    Output,
    Rail,
    Target,
    Tree,
    TreeNetwork,
)
from plctool.compiler.formats.plcopen_body import NotTranslatedError
from plctool.compiler.formats.text import Place
from plctool.compiler.formats.xml_tree import Element

_NEGATION, _SET, _JUMP, _RETURN, _RISING, _FALLING = 1, 2, 4, 8, 16, 32
_STORAGE = {0: (False, ""), _NEGATION: (True, ""), _SET: (False, "set"), _SET | _NEGATION: (False, "reset")}
_EDGES = {0: "", _RISING: "rising", _FALLING: "falling"}
_OPEN = "???"  # what the editor writes for an operand that is missing


def read_networks(archive: Element, *, contacts: bool = False, first: int = 1) -> Elements:
    """Returns the networks of an <NWL>. `contacts`, `first`: as in Elements. Raises NotTranslatedError."""
    root = next((o for o in archive.every("o") if o.get("t") == "NWLImplementationObject"), None)
    if root is None:
        raise NotTranslatedError(archive.at, "it has no networks")
    ladder = _value(root, "DefaultViewMode").casefold() == "ld"
    made = Elements("LD" if ladder else "FBD", archive.at, contacts and ladder, first)
    for network in _elements(root, "NetworkList"):
        if _value(network, "OutCommented") != "true":
            made.add(_Network(network, ladder=ladder).read())
    return made


class _Network:
    def __init__(self, element: Element, *, ladder: bool) -> None:
        self._element = element
        self._ladder = ladder

    def read(self) -> TreeNetwork:
        element = self._element
        if _value(element, "ILActive") == "true":
            raise NotTranslatedError(element.at, "a network of it is shown as IL; show it as FBD or LD and save it")
        if _elements(element, "Connectors"):
            raise NotTranslatedError(element.at, "it has connectors")
        items = [made for item in _elements(element, "NetworkItems") if (made := self._item(item)) is not None]
        return TreeNetwork(_value(element, "Label").strip(), element.at, tuple(items))

    def _item(self, item: Element) -> Assignment | Definition | Box | None:
        kind = _type(item, self._element)
        if kind == "BoxTreeAssign":
            return self._assignment(item)
        if kind == "BoxTreeDemux":
            return self._definition(item)
        tree = self._tree(item, kind, power=True)
        return tree if isinstance(tree, Box) else None

    def _assignment(self, item: Element) -> Assignment:
        value = _object(item, "RValue")
        bits = _bits(item) & ~(_JUMP | _RETURN)
        if bits:
            raise NotTranslatedError(item.at, f"an assignment has the flags {bits}, which are not known")
        targets = [_target(o) for o in _elements(_object(item, "OutputItems"), "OutputItems")]
        found = None if value is None else self._tree(value, value.get("t"), power=True)
        return Assignment(found, tuple(targets), item.at)

    def _definition(self, item: Element) -> Definition | None:
        source = _object(item, "Input")
        tree = None if source is None else self._tree(source, source.get("t"), power=True)
        return None if tree is None else Definition(_value(item, "VarId"), tree)

    # ---- trees ----

    def _tree(self, element: Element, kind: str, *, power: bool) -> Tree | None:
        """A value; None for an open input. `power`: it is the line from the left rail."""
        if kind == "BoxTreeOperand":
            return _operand(element)
        if kind == "BoxTreeBox":
            return self._box(element)
        source = _object(element, "Input")
        if kind == "BoxTreeDemux" and source is None:
            return Branch(_value(element, "VarId"), element.at)
        if kind == "BoxTreeTerminator":
            if source is not None:
                return self._tree(source, source.get("t"), power=power)
            return Rail(element.at) if power else None
        if kind == "BoxTreeParallel":
            return self._parallel(element, source)
        raise NotTranslatedError(element.at, f"it has a {kind or 'node without a type'}, which is not known")

    def _parallel(self, element: Element, source: Element | None) -> Tree:
        """Branches beside each other, after what feeds them. With a function block in a branch, the others decide
        whether it is called, which has no translation."""
        branches = [
            self._tree(t, t.get("t") or _cet(element, "Trees"), power=True) for t in _elements(element, "Trees")
        ]
        if any(tree is None or _calls(tree) for tree in branches):
            raise NotTranslatedError(element.at, "a parallel branch has a function block or nothing in it")
        either = _gate("OR", element.at, branches)
        fed = None if source is None else self._tree(source, source.get("t"), power=True)
        return either if fed is None or isinstance(fed, Rail) else _gate("AND", element.at, [fed, either])

    def _box(self, box: Element) -> Box:
        kind, instance = _value(box, "BoxType").strip(), _object(box, "Instance")
        if _value(box, "ProvidesSTSnippet") == "true" or kind.upper() == "EXECUTE":
            raise NotTranslatedError(box.at, "it has an EXECUTE box")
        if any(_value(flags, "Flags") not in ("", "0") for flags in _listed(box, "InputFlags")):
            raise NotTranslatedError(box.at, f"an input of {kind} has flags of its own, which are not known")
        call = _value(box, "CallType")
        called = "" if instance is None else _value(instance, "Operand").strip()
        if called == _OPEN:
            raise NotTranslatedError(box.at, f"{kind} has no instance")
        called = called or (kind if call == "Program" else "")
        inputs, outputs = self._inputs(box, kind, called), _outputs(box, kind)
        negated, edge = _modifiers(box, box)
        return Box(kind, box.at, tuple(inputs), tuple(outputs), called, negated, edge)

    def _inputs(self, box: Element, kind: str, instance: str) -> list[tuple[str, Tree | None]]:
        items = _elements(box, "InputItems", nulls=True)
        names = _strings(_object(box, "InputParam"), "Names")
        found: list[tuple[str, Tree | None]] = []
        for number, item in enumerate(items):
            name = names[number] if number < len(names) else ""
            if instance and not name:
                raise NotTranslatedError(box.at, f"an input of {instance} has no name")
            power = name.upper() == "EN" or (self._ladder and number == 0)
            type_ = item.get("t") or _cet(box, "InputItems")
            found.append((name or f"IN{number + 1}", None if item.tag == "n" else self._tree(item, type_, power=power)))
        open_ = next((name for (name, value) in found if value is None), "")
        if open_ and not instance:
            raise NotTranslatedError(box.at, f"the input {open_} of {kind} is connected to nothing")
        return found


def _outputs(box: Element, kind: str) -> list[Output]:
    given = _object(box, "OutputParam")
    names, types = _strings(given, "Names"), _strings(given, "Types")
    items = _elements(_object(box, "OutputItems"), "OutputItems", nulls=True)
    if not names and len(items) > 1:
        raise NotTranslatedError(box.at, f"the outputs of {kind} have no names")
    targets = ["" if item.tag == "n" else _written(item) for item in items]
    found = []
    is_call = _value(box, "CallType") in ("Method", "Function")  # one without outputs has no result
    for number, name in enumerate(names or ([] if is_call and not items else [""])):
        type_ = types[number] if number < len(types) and types[number].isidentifier() else ""
        found.append(Output(name, targets[number] if number < len(targets) else "", type_))
    return found


def _written(item: Element) -> str:
    """The variable to which an output goes."""
    text = _value(item, "Operand").strip()
    if _bits(item) and text:
        raise NotTranslatedError(item.at, f"the output to {text} has flags, which are not known")
    return "" if text == _OPEN else text


def _target(item: Element) -> Target:
    text, bits = _value(item, "Operand").strip(), _bits(item)
    if bits in (_JUMP, _RETURN):
        return Target(text, item.at, way="jump" if bits == _JUMP else "return")
    if bits not in _STORAGE:
        raise NotTranslatedError(item.at, f"the coil {text} has the flags {bits}, which are not known")
    if text in ("", _OPEN):
        raise NotTranslatedError(item.at, "a coil or output has no variable")
    negated, storage = _STORAGE[bits]
    return Target(text, _place(item), negated, storage)


def _operand(element: Element) -> Operand | None:
    inner = _object(element, "Operand")
    text = "" if inner is None else _value(inner, "Operand").strip()
    if text == _OPEN:
        raise NotTranslatedError(element.at, f"an operand is missing ({_OPEN})")
    if inner is None or not text:
        return None
    negated, edge = _modifiers(inner, element)
    return Operand(text, _place(inner), negated, edge)


def _modifiers(owner: Element, at: Element) -> tuple[bool, str]:
    bits = _bits(owner)
    edge = bits & ~_NEGATION
    if edge not in _EDGES:
        raise NotTranslatedError(at.at, f"it has the flags {bits}, which are not known")
    return bool(bits & _NEGATION), _EDGES[edge]


def _calls(tree: Tree) -> bool:
    """True if a tree calls an instance."""
    return isinstance(tree, Box) and (
        bool(tree.instance) or any(value is not None and _calls(value) for _, value in tree.inputs)
    )


def _gate(kind: str, at: Place, values: list[Tree | None]) -> Box:
    return Box(kind, at, tuple((f"IN{n + 1}", v) for n, v in enumerate(values)), (Output("", "", "BOOL"),))


# ---- the archive ----


def _value(owner: Element, name: str) -> str:
    """A value without its quotes; "" for none."""
    found = next((v for v in owner.children if v.tag == "v" and v.get("n") == name), None)
    text = "" if found is None else "".join(chunk.text for chunk in found.chunks)
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def _place(operand: Element) -> Place:
    """Where the text of an operand stands."""
    found = next((v for v in operand.children if v.tag == "v" and v.get("n") == "Operand" and v.chunks), None)
    return operand.at if found is None else Place(found.chunks[0].line, found.chunks[0].column + 1)


def _object(owner: Element, name: str) -> Element | None:
    return next((o for o in owner.children if o.tag == "o" and o.get("n") == name), None)


def _list(owner: Element | None, name: str) -> Element | None:
    return next((e for e in (owner.children if owner else ()) if e.tag == "l2" and e.get("n") == name), None)


def _listed(owner: Element, name: str) -> list[Element]:
    """All values in a list or object."""
    found = [e for e in owner.children if e.get("n") == name]
    return [o for e in found for o in e.every("o")] + found


def _elements(owner: Element | None, name: str, *, nulls: bool = False) -> list[Element]:
    """The elements of a list; with `nulls` also those that are nothing (<n/>)."""
    found = _list(owner, name)
    return [] if found is None else found.all(*(("o", "n") if nulls else ("o",)))


def _strings(owner: Element | None, name: str) -> list[str]:
    found = _list(owner, name)
    return [] if found is None else ["".join(c.text for c in v.chunks).strip().strip('"') for v in found.all("v")]


def _cet(owner: Element, name: str) -> str:
    found = _list(owner, name)
    return "" if found is None else found.get("cet")


def _type(item: Element, network: Element) -> str:
    return item.get("t") or _cet(network, "NetworkItems")


def _bits(owner: Element) -> int:
    """The flags of an operand, box or assignment. Raises NotTranslatedError if they are not a number."""
    flags = _object(owner, "Flags")
    text = "0" if flags is None else _value(flags, "Flags") or "0"
    if not (text.isascii() and text.isdecimal() and len(text) < 10):
        raise NotTranslatedError(owner.at, f"it has the flags {text[:20]!r}, which are not known")
    return int(text)
