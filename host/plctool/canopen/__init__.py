"""Commands to CANopen devices on a bus of python-can (CiA 301, CiA 305): NMT, SDO, EMCY, PDO and LSS."""
