"""The gateway: a process that owns a serial line and serves several tools of this machine (docs/internals.md)."""
