"""The link to a controller: serial framing, router, channel, services (codesys-v3-protocol)."""
