"""Runs the demo and records it as docs/demo.svg, the README's picture: python docs/make_demo_svg.py"""

from pathlib import Path

from rich.console import Console

from plctool.cli import demo

console = Console(record=True, width=96, force_terminal=True)
demo.run(console)
console.save_svg(str(Path(__file__).parent / "demo.svg"), title="make demo")
