"""Files of other systems, read as Structured Text that keeps the lines and columns of the file."""
