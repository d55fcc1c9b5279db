"""Dataclasses whose methods are made when they are first called.

Making them at once took half of the time in which the compiler is imported. For type checkers, and for `fields` and
`replace` of the standard module, these are dataclasses as any other.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:
    import dataclasses
    from reprlib import recursive_repr

    def dataclass(cls=None, /, *, frozen=False, eq=True, slots=False, order=False):
        """The decorator, with the options that the project uses."""

        def wrap(cls):
            if order:
                return dataclasses.dataclass(cls, frozen=frozen, eq=eq, slots=slots, order=order)
            return _record(cls, frozen, eq, slots)

        return wrap if cls is None else wrap(cls)

    def _record(cls, frozen, eq, slots):
        own = vars(cls)
        cls.__doc__ = own.get("__doc__") or cls.__name__  # else the standard module writes the signature there
        has_init, has_repr, has_eq = "__init__" in own, "__repr__" in own, "__eq__" in own
        has_hash = own.get("__hash__") is not None
        cls = dataclasses.dataclass(cls, init=False, repr=False, eq=False, slots=slots)
        if not has_init:
            _later(cls, "__init__", lambda: _init(cls, frozen))
        if not has_repr:
            _later(cls, "__repr__", lambda: _repr(cls))
        if eq:
            if not has_eq:
                _later(cls, "__eq__", lambda: _eq(cls))
            if frozen and not has_hash:
                _later(cls, "__hash__", lambda: _hash(cls))
            elif not has_hash:
                cls.__hash__ = None
        if frozen:
            cls.__setattr__, cls.__delattr__ = _frozen_setattr, _frozen_delattr
        return cls

    def _later(cls, name, make):
        """Gives a class a method that makes the real one in its place."""

        def method(self, *args, **options):
            made = make()
            made.__qualname__ = f"{cls.__qualname__}.{name}"
            setattr(cls, name, made)
            return made(self, *args, **options)

        setattr(cls, name, method)

    def _frozen_setattr(self, name, value):
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")

    def _frozen_delattr(self, name):
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")

    def _function(name, parameters, body, names):
        found = {}
        lines = "".join(f"\n {line}" for line in body or ["pass"])
        exec(f"def {name}({', '.join(parameters)}):{lines}", names, found)
        return found[name]

    def _init(cls, frozen):
        """Sets all fields, and calls __post_init__."""
        names = {"_missing": dataclasses.MISSING, "_set": object.__setattr__}
        parameters, keywords, body = ["self"], [], []
        for field in dataclasses.fields(cls):
            name, value = field.name, field.name
            written = keywords if field.kw_only else parameters
            if field.default_factory is not dataclasses.MISSING:
                names[f"_make_{name}"] = field.default_factory
                value = f"_make_{name}()"
                if field.init:
                    written.append(f"{name}=_missing")
                    value = f"{value} if {name} is _missing else {name}"
            elif field.default is not dataclasses.MISSING:
                names[f"_default_{name}"] = field.default
                if field.init:
                    written.append(f"{name}=_default_{name}")
                elif hasattr(cls, "__slots__") and name in cls.__slots__:
                    value = f"_default_{name}"
                else:
                    continue  # the value of the class
            elif field.init:
                written.append(name)
            else:
                continue
            body.append(f"_set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
        if hasattr(cls, "__post_init__"):
            body.append("self.__post_init__()")
        return _function("__init__", [*parameters, *(["*", *keywords] if keywords else [])], body, names)

    def _compared(cls):
        return [field.name for field in dataclasses.fields(cls) if field.compare]

    def _tuple_of(name, fields):
        return f"({''.join(f'{name}.{field}, ' for field in fields)})"

    def _eq(cls):
        fields = _compared(cls)
        body = [
            "if other.__class__ is not self.__class__: return NotImplemented",
            f"return {_tuple_of('self', fields)} == {_tuple_of('other', fields)}",
        ]
        return _function("__eq__", ["self", "other"], body, {})

    def _hash(cls):
        hashed = [f.name for f in dataclasses.fields(cls) if (f.compare if f.hash is None else f.hash)]
        return _function("__hash__", ["self"], [f"return hash({_tuple_of('self', hashed)})"], {})

    def _repr(cls):
        shown = [field.name for field in dataclasses.fields(cls) if field.repr]

        @recursive_repr()
        def __repr__(self):
            return f"{self.__class__.__qualname__}({', '.join(f'{n}={getattr(self, n)!r}' for n in shown)})"

        return __repr__
