"""Ground of the compiler: positions in sources, nesting, errors of its own."""
