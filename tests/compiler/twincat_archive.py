"""Bodies in LD and FBD as TwinCAT 3 stores them in .TcPOU files."""

from __future__ import annotations

NULL = "<n />"


def value(name: str, text: str) -> str:
    """A text in quotes."""
    escaped = text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return f'<v n="{name}">"{escaped}"</v>\n'


def flags(bits: int = 0) -> str:
    """The flags of an object."""
    return f'<o n="Flags" t="Flags"><v n="Flags">{bits}</v><v n="Fixed">true</v></o>\n'


def operand(text: str, bits: int = 0, head: str = 't="Operand"', kind: str = "") -> str:
    """An operand by itself, as a target has it."""
    return f"<o {head}>\n{value('Operand', text)}{value('Type', kind)}{flags(bits)}</o>\n"


def given(text: str, bits: int = 0, name: str = "", kind: str = "") -> str:
    """A variable or literal that is read."""
    inner = operand(text, bits, 'n="Operand" t="Operand"', kind)
    return f'<o{name} t="BoxTreeOperand">\n{inner}</o>\n'


def box(
    kind: str,
    inputs: dict[str, str] | list[str],
    outputs: dict[str, str] | None = None,
    instance: str = "",
    bits: int = 0,
    call: str = "",
    more: str = "",
) -> str:
    """A box. `inputs`: by name, or without names. `outputs`: `name:TYPE` and the target, "" for none."""
    names = list(inputs) if isinstance(inputs, dict) else []
    values = list(inputs.values()) if isinstance(inputs, dict) else inputs
    found = [(name.partition(":"), target) for name, target in (outputs or {}).items()]
    slots = "".join(operand(target) if target else NULL for _, target in found)
    given_names = "".join(f"<v>{name}</v>" for name in names)
    made_names = "".join(f"<v>{name[0]}</v>" for name, _ in found)
    made_types = "".join(f"<v>{name[2]}</v>" for name, _ in found)
    return (
        f't="BoxTreeBox">\n{value("BoxType", kind)}<o n="Instance" t="Operand">'
        f"{value('Operand', instance) if instance else '<n n=' + chr(34) + 'Operand' + chr(34) + ' />'}</o>\n"
        f'<o n="OutputItems" t="OutputItemList"><l2 n="OutputItems" cet="Operand">{slots}</l2></o>\n{flags(bits)}'
        f'<n n="InputFlags" />\n<l2 n="InputItems">{"".join(values)}</l2>\n'
        f'<o n="InputParam" t="ParamList"><l2 n="Names" cet="String">{given_names}</l2></o>\n'
        f'<o n="OutputParam" t="ParamList"><l2 n="Names" cet="String">{made_names}</l2>'
        f'<l2 n="Types" cet="String">{made_types}</l2></o>\n'
        f'<v n="CallType" t="Operator">{call or kind.title()}</v><v n="ProvidesSTSnippet">false</v>{more}</o>\n'
    )


def item(made: str, name: str = "") -> str:
    """A box as an element of a list, or as a member."""
    return f"<o {f'n={chr(34)}{name}{chr(34)} ' if name else ''}{made}"


def assign(made: str, *targets: tuple[str, int]) -> str:
    """What is assigned to targets with their flags."""
    outputs = "".join(operand(text, bits) for text, bits in targets)
    source = made.replace("<o", '<o n="RValue"', 1)
    return (
        f'<o t="BoxTreeAssign"><o n="OutputItems" t="OutputItemList"><l2 n="OutputItems">{outputs}</l2></o>\n'
        f"{flags()}{source}</o>\n"
    )


RAIL = '<o t="BoxTreeTerminator"><n n="Input" /></o>\n'


def demux(number: int, source: str = "") -> str:
    """A branch: its definition with a source, else its use."""
    given_source = source.replace("<o", '<o n="Input"', 1) if source else '<n n="Input" />'
    return f'<o t="BoxTreeDemux"><v n="VarId">{number}</v>{given_source}</o>\n'


def parallel(source: str, *branches: str) -> str:
    """Branches beside each other."""
    fed = source.replace("<o", '<o n="Input"', 1) if source else '<n n="Input" />'
    return f'<o t="BoxTreeParallel">{fed}<l2 n="Trees">{"".join(branches)}</l2><v n="Mode">BoxShortCircuit</v></o>\n'


def network(*items: str, label: str = "", out: bool = False, il: bool = False) -> str:
    """A network."""
    return (
        f'<o><v n="ILActive">{str(il).lower()}</v>{value("Comment", "seen")}{value("Label", label)}'
        f'<v n="OutCommented">{str(out).lower()}</v>\n<l2 n="NetworkItems">{"".join(items)}</l2>'
        '<l2 n="Connectors" /></o>\n'
    )


def archive(*networks: str, mode: str = "Fbd") -> str:
    """A body."""
    return (
        '<NWL><XmlArchive><Data><o xml:space="preserve" t="NWLImplementationObject">\n'
        f'{value("DefaultViewMode", mode)}<l2 n="NetworkList" cet="Network">\n{"".join(networks)}</l2>'
        "</o></Data><TypeList /></XmlArchive></NWL>"
    )


def unit(declaration: str, body: str, more: str = "", name: str = "Main") -> str:
    """A .TcPOU file."""
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<TcPlcObject Version="1.1.0.1">\n'
        f'<POU Name="{name}"><Declaration><![CDATA[{declaration}]]></Declaration>\n'
        f"<Implementation>{body}</Implementation>\n{more}</POU></TcPlcObject>\n"
    )
