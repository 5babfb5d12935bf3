"""Commands of `arena`: one module each, with `parser()` and `run(options)`; `verify` is in the module of `bundle`."""

from __future__ import annotations

from typing import Final

COMMANDS: Final = {
    "run": "run trials; finished ones are kept and skipped",
    "debug": "debug one robot of a trial; the whole world pauses with it",
    "experiment": "run all combinations of brains and controllers, then write the report; finished trials are kept",
    "sweep": "run every combination of the given scene values and print a table",
    "sensitivity": "vary one scene value at a time with scripted robots and print the experiment's first metric",
    "compare": "compare two runs by equivalence tests",
    "plot": "draw snapshots, clustering over time, trajectories and CPU load",
    "figures": "draw all figures of a study: one set per controller, and the filmstrip of one robot",
    "report": "write tables and figures of runs as Markdown, grouped by controller",
    "bundle": "pack runs with their firmware, experiments and manifests into one file, and print its hash",
    "verify": "check the files of a bundle and run some of its trials again; exit status 1 if a result differs",
    "channel": "print the infrared amplitude between two robots beside the published values, and draw it",
    "reaction": "measure the time from the last line of a frame to the new wheel speed, and missed frames",
    "replay": "write an HTML page or a video of a trial, or serve a page that follows a running trial",
    "studio": "run one trial in a browser page: pause, step, rewind, move robots and objects, inspect firmware",
    "scenes": "list the built-in scenes",
    "keys": "list the keys of scene files with unit, range and default",
    "completion": "print a completion script for a shell",
}
"""Name of every command and the first line of its description."""
