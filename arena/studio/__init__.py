"""The interactive trial in the browser: its session and the process it runs in."""
