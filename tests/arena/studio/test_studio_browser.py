"""`arena studio --open`: the browser gets the address of the page without showing its token to other users."""

from __future__ import annotations

import os
import re
import stat
import urllib.request
import webbrowser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from arena.cli import main
from arena.commands.studio import StudioServer

WORDS = ["studio", "clustering", "--brain", "scripted", "--robots", "1", "--objects", "1", "--port", "0", "--open"]


def test_the_token_is_in_a_private_file_and_not_in_the_arguments_of_the_browser(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[tuple[str, str, int]] = []

    def browse(address: str) -> bool:
        path = Path(urllib.request.url2pathname(urlsplit(address).path))
        opened.append((address, path.read_text(), stat.S_IMODE(path.stat().st_mode)))
        return True

    def end(_server: StudioServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(webbrowser, "open", browse)
    monkeypatch.setattr(StudioServer, "serve_forever", end)
    assert main(WORDS) == 0
    ((address, text, mode),) = opened
    printed = re.search(r"http://\S+/\?token=(\S+)", capsys.readouterr().out)
    assert printed is not None
    assert printed[1] not in address
    assert f'content="0; url={printed[0]}"' in text
    assert mode == 0o600 or os.name != "posix"
    assert not Path(urllib.request.url2pathname(urlsplit(address).path)).exists()
