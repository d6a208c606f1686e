"""A user's pipeline in a process of its own: the protocol, the host, the limits, and what can go wrong."""
