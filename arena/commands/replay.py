"""`arena replay TRIAL`: write a page or a video of a trial, or serve a page that follows a running trial."""

from __future__ import annotations

import argparse
from contextlib import suppress
from functools import partial
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from arena.commands.options.arguments import count, duration, port
from arena.commands.options.trust import add_trust_options, load_trusted
from arena.replay.http import LOOPBACK, PageServer, RequestHandler
from arena.replay.live_feed import Follower
from arena.replay.page import page
from arena.replay.video import write_video
from arena.trial.record import RecordError, read_trial, write_text
from emu.host.errors import CommandParser
from emu.host.files import is_standard


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="write an HTML page or a video of a trial, or serve a page that follows a running trial",
        epilog="examples: arena replay results/clustering-scripted-A/trial-0001.parquet --out trial.html\n"
        "          arena replay results/clustering-scripted-A/trial-0001.parquet --export trial.gif --speed 60\n"
        "          arena replay results/clustering-openswarm-A --live",
    )
    command.add_argument(
        "trial", type=Path, metavar="TRIAL", help="file trial-NNNN.parquet; with --live the folder of the run"
    )
    command.add_argument(
        "--out", type=Path, metavar="FILE", help="page to write (default: name of the trial with .html)"
    )
    command.add_argument("--export", type=Path, metavar="FILE", help="write a video instead: .gif, or .mp4 with ffmpeg")
    command.add_argument(
        "--speed",
        type=duration,
        default=30.0,
        metavar="X",
        help="speed of the video as a multiple of real time (default 30)",
    )
    command.add_argument(
        "--seconds", type=float, metavar="S", help="simulated time that the video shows (default: the whole trial)"
    )
    add_trust_options(command)
    command.add_argument("--live", action="store_true", help="serve a page that follows a running trial")
    command.add_argument(
        "--number", type=count, metavar="N", help="with --live: number of the trial (default: the newest)"
    )
    command.add_argument(
        "--port", type=port, default=8765, metavar="P", help="with --live: TCP port (default 8765, 0: any free port)"
    )
    return command


def run(options: argparse.Namespace) -> int:
    """Write the page or video and print its path. Raises RecordError, ValueError, OSError."""
    if options.live:
        follower = Follower(options.trial, options.number)
        load_trusted(follower.metadata(), options)
        with server(follower, options.port) as serving:
            print(f"http://{LOOPBACK}:{serving.server_port}/ (Ctrl-C ends)", flush=True)
            with suppress(KeyboardInterrupt):
                serving.serve_forever()
        return 0
    if not is_standard(options.trial) and not options.trial.is_file():
        raise RecordError(f"{options.trial}: no such file; expected a trial-NNNN.parquet")
    if options.out is not None and options.out.suffix.lower() in (".gif", ".mp4"):
        raise ValueError(f"--out {options.out}: writes an HTML page; --export {options.out} writes a video")
    trial = read_trial(options.trial)
    load_trusted([trial], options)
    beside = options.trial if is_standard(options.trial) else options.trial.with_suffix(".html")
    out: Path = options.export or options.out or beside
    if options.export is not None:
        write_video(trial, out, options.speed, options.seconds)
    else:
        write_text(out, page(trial))
    if not is_standard(out):
        print(out)
    return 0


def server(follower: Follower, port: int) -> PageServer:
    """Return a server on the loopback address: `/` is the page, `/more?from=N` the samples from number N on."""
    return PageServer((LOOPBACK, port), partial(_LiveHandler, follower))


class _LiveHandler(RequestHandler):
    def __init__(self, follower: Follower, *arguments: object) -> None:
        self._follower = follower
        super().__init__(*arguments)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Handle a GET request. An unknown path is status 404; a record that cannot be read is status 503."""
        if not self.has_own_host():
            return
        place = urlsplit(self.path)
        first = parse_qs(place.query).get("from", ["0"])[0]
        try:
            if place.path == "/":
                self.send_page(self._follower.page())
            elif place.path == "/more" and first.isdecimal():
                self.send_json(self._follower.more(int(first)))
            else:
                self.send_error_text(404, "no such path; expected / or /more?from=N")
        except RecordError as error:
            self.send_error_text(503, str(error))
