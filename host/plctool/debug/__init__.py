"""What is known about a program besides its code: the symbol file, variables by name, the calls that led to a line."""
