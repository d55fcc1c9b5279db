"""PLCopen XML out: a program as one file that other systems read. The reader is formats/plcopen.py."""
