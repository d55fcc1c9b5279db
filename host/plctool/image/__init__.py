"""The application image, and the processors it is made for."""
