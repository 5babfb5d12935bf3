"""Trials on a Dask cluster: the same files as on local workers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from arena.cli import main

distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra: cluster)")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Start a Dask cluster of two worker processes on this machine and return its address."""
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.parquet")}


def test_a_sweep_on_a_cluster_writes_the_same_bytes_as_here(
    address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sweep of two values with two trials each writes the same bytes on a cluster and locally; finished trials are
    not run again."""
    command = ["sweep", "clustering", "--brain", "scripted", "--minutes", "0.05", "--trials", "2", "--jobs", "1",
               "--vary", "camera.range_cm=100,inf", "--json"]  # fmt: skip
    assert main([*command, "--out", str(tmp_path / "here")]) == 0
    for _ in range(2):
        assert main([*command, "--out", str(tmp_path / "there"), "--scheduler", address]) == 0
    assert len(contents(tmp_path / "here")) == 4
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    hosts = json.loads(next((tmp_path / "there").glob("*/manifest.json")).read_text())["host"]
    assert sorted(one["trial"] for one in hosts) == [1, 2]


@pytest.mark.slow
def test_firmware_travels_to_the_workers(
    address: str, talking_image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Firmware is sent to the workers of a cluster, and a robot's fault on a worker is reported."""
    command = ["run", "clustering", "--brain", str(talking_image), "--robots", "1", "--trials", "1", "--minutes",
               "0.03", "--jobs", "1"]  # fmt: skip
    assert main([*command, "--out", str(tmp_path / "here")]) == 1
    assert main([*command, "--out", str(tmp_path / "there"), "--scheduler", address]) == 1
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    assert capsys.readouterr().err.count("robot 0 stopped") == 2


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scheduler address that is invalid, or whose port has no listener, ends with exit status 2."""
    command = ["run", "clustering", "--brain", "scripted", "--minutes", "0.05", "--trials", "1", "--out", str(tmp_path)]
    assert main([*command, "--scheduler", "nonsense://x"]) == 2
    assert "nonsense" in capsys.readouterr().err
