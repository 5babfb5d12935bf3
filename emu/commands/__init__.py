"""One module per command of `python -m emu`; see `emu.cli` for what a command module must have."""
