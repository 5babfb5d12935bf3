"""One trial: its main loop, its record on disk, versions and manifest, checkpoints and snapshots."""
