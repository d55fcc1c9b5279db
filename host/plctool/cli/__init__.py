"""The command line: `main` reads arguments and prints, `documents` does what the commands say, `output` lays it out."""
