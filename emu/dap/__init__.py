"""A server of the Debug Adapter Protocol: editors debug emulated firmware through it."""
