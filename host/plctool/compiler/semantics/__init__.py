"""Syntax tree to typed program: names, types, conversions, every rule of the language."""
