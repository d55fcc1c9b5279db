"""A debug adapter: an editor that speaks the Debug Adapter Protocol debugs a program in the simulator, on plcrt or on a
controller."""
