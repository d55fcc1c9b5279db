"""What is kept of a check or build for the next one: on disk for other processes, in memory for one that stays."""
