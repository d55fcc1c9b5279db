"""The page of a controller in a browser of this machine: live values, write, force, tasks, log, inputs and outputs.

`serve` runs it: the controller in the thread that calls it, the web server in another one.
"""
