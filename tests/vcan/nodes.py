"""The controllers on the bus: their names by number."""

NODES = {1: "press", 2: "mixer", 3: "oven"}
