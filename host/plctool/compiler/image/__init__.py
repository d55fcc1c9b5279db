"""From the checked program to an image: tasks, inputs and outputs, code, and whether it fits the device."""
