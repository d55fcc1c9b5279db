"""Inputs and outputs: what an engineer writes about them (`NAME.io.toml`), what a vendor does (`device.toml`), and the
I/O configuration of the image that is made of both.

`description` reads a file; `kinds` has a row for each kind of table in it; `model` is what they become; `configuration`
writes and reads the bytes of IoConfig.h. Which variable a name stands for is found by the compiler
(`compiler/semantics/io_channels.py`).
"""
