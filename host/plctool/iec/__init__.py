"""IEC 61131-3 as compiler, image and tool share it: types, values in memory and as strings, literals, memory areas."""
