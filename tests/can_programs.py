"""A program with CAN frames of its own, for the tests of the simulator and of plcrt."""

PROGRAM = """
PROGRAM Main
VAR
    sender : CAN_SEND;
    receiver, extendedReceiver : CAN_RECEIVE := (Enable := TRUE);
    bytes : ARRAY[1..8] OF BYTE;
    go, extended, remote : BOOL;
    id : DWORD := 16#123;
    network, length : USINT;
    done, count, count29 : UDINT;
    last, last29 : DWORD;
    lastLength : USINT;
    data : ARRAY[0..7] OF BYTE;
    i : INT;
END_VAR
FOR i := 1 TO 8 DO bytes[i] := INT_TO_BYTE(16 * i); END_FOR
sender(Execute := go, Network := network, ID := id, Extended := extended, Remote := remote, Length := length,
    Data := bytes);
IF sender.Done THEN done := done + 1; go := FALSE; END_IF
receiver(ID := 16#200, Mask := 16#700);
WHILE receiver.Received DO
    count := count + 1; last := receiver.FrameID; lastLength := receiver.Length; data := receiver.Data;
    receiver();
END_WHILE
extendedReceiver(ID := 16#18FEF100, Mask := 16#1FFFFF00, Extended := TRUE);
IF extendedReceiver.Received THEN count29 := count29 + 1; last29 := extendedReceiver.FrameID; END_IF
END_PROGRAM
"""
