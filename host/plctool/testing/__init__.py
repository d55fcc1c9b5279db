"""Help for testing: a serial line that is slow or bad, and a real `plcrt` process."""
