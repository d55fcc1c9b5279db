"""What declarations mean: types, variables, functions, classes and instances of programs."""
