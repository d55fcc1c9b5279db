"""The typed program: what the front end gives to the back end, and what is computed on it."""
