"""What files say about CANopen devices: EDS and DCF (CiA 306), and the data types of CiA 301."""
