"""Debug Adapter Protocol server: editors use it to debug emulated firmware."""
