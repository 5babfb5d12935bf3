"""Debug Adapter Protocol server, through which editors debug emulated firmware."""
