"""Draw our infrared link together with the published values of SwarmCom and libIrcom, for docs/swarm.md.

    python docs/tools/infrared/published.py [--figure docs/figures/infrared-link.png]

Input: docs/results/infrared-link.csv, which link.py measures, and docs/results/infrared-published.csv, which
lists every published number with its source. Curves of the other systems are not available: only the abstract of the
SwarmCom article was read, and libIrcom has published rates and a range but no errors. The figure therefore shows single
numbers, dashed if UNVERIFIED.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

from link import CODE, WORDS, Job, LinkResult, expected
from scipy.stats import beta

from arena.scene import palette

DOCS = Path(__file__).parents[2]
MESSAGE_BITS = 64
SCARCE = 3.0
"""Rule of three: if n bits had no error, the error rate is below 3 / n with a confidence of 95 %."""
RANGE_SHARE = 0.5
"""Share of the frames of a single sender that still arrive at our range."""
GAPS_DEG = (116, 180, 244)
"""Bearings of the gaps between a robot's sensors, in degrees clockwise (swarmcom.md 4); UNVERIFIED by measurement."""
OURS, THEIRS, OTHERS = palette.BLUE, palette.VERMILION, palette.GREEN
UNSURE = (0, (4, 2))


def read_runs(path: Path) -> list[tuple[Job, LinkResult]]:
    """Return the runs in a data file of link.py."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            (
                Job(int(one["senders"]), float(one["cm"]), float(one["turned_deg"]), float(one["seconds"]),
                    float(one["noise_counts"])),
                LinkResult(int(one["sent"]), int(one["arrived"]), int(one["damaged"]), int(one["repaired_bits"])),
            )
            for one in csv.DictReader(file)
        ]  # fmt: skip


def published_values(path: Path, system: str, what: str) -> list[float]:
    """Return the values that a system has published of a quantity."""
    with path.open(newline="", encoding="utf-8") as file:
        return [float(one["value"]) for one in csv.DictReader(file) if (one["system"], one["what"]) == (system, what)]


def by_distance(runs: list[tuple[Job, LinkResult]], senders: int) -> list[tuple[float, Job, LinkResult]]:
    """Return the first run of each distance with this number of senders, for robots that face each other."""
    found = dict[float, tuple[float, Job, LinkResult]]()
    for job, one in runs:
        if job.senders == senders and not job.turned:
            found.setdefault(job.distance, (job.distance, job, one))
    return [found[distance] for distance in sorted(found)]


def throughput(job: Job, one: LinkResult) -> float:
    """Return the received payload in bit/s."""
    return one.arrived * MESSAGE_BITS / job.seconds


def our_range(runs: list[tuple[Job, LinkResult]]) -> float:
    """Return our range in cm, interpolated between the last distance at which RANGE_SHARE arrives and the next one."""
    alone = by_distance(runs, 1)
    last = max(number for number, (_, _, one) in enumerate(alone) if one.share >= RANGE_SHARE)
    (near, _, here), (far, _, there) = alone[last], alone[last + 1]
    return near + (far - near) * (here.share - RANGE_SHARE) / (here.share - there.share)


def interval(found: int, of: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson), for independent bits."""
    return float(beta.ppf(0.025, found, of - found + 1)), float(beta.ppf(0.975, found + 1, of - found))


def draw_errors(axes: Any, runs: list[tuple[Job, LinkResult]], reach: float, factor: float) -> None:
    alone = [(cm, one) for cm, _, one in by_distance(runs, 1) if one.arrived]
    noise = runs[0][0].noise
    seen = [(cm, one.bit_errors) for cm, one in alone if one.repaired]
    unseen = [(cm, SCARCE / (one.arrived * WORDS * CODE)) for cm, one in alone if not one.repaired]
    fine = [18 + step / 5 for step in range(81)]
    model = [expected(one, noise) for one in fine]
    axes.fill_between(fine, [one.low for one in model], [one.high for one in model], color="k", alpha=0.15, lw=0,
                      label="expected, 10 to 90 % of phases")  # fmt: skip
    axes.semilogy(fine, [one.repaired for one in model], "k:", lw=1, label="expected in frames that arrived")
    bounds = [interval(one.repaired, one.arrived * WORDS * CODE) for _, one in alone if one.repaired]
    reach_of_bars = [[rate - low for (_, rate), (low, _) in zip(seen, bounds, strict=True)],
                     [high - rate for (_, rate), (_, high) in zip(seen, bounds, strict=True)]]  # fmt: skip
    axes.errorbar(*zip(*seen, strict=True), yerr=reach_of_bars, fmt="s-", capsize=2, color=OURS,
                  label="ours, in frames that arrived, 95 %")  # fmt: skip
    axes.semilogy(*zip(*unseen, strict=True), "v", color=OURS, mfc="none", label="ours: none seen, less than this")
    axes.axvline(reach, color=OTHERS, ls=UNSURE, lw=1.2, label="libIrcom: nominal range")
    axes.axvline(reach * factor, color=THEIRS, ls=UNSURE, lw=1.2, label="SwarmCom: up to 3 times that")
    axes.set(xlabel="cm between the middles", ylabel="bit error rate", xlim=(10, 70), ylim=(1e-5, 0.5))
    axes.set_title("Bit errors over distance")


def draw_throughput(axes: Any, runs: list[tuple[Job, LinkResult]], data: Path, reach: float) -> None:
    for senders, mark, name in ((1, "o-", "ours, one sends"), (2, "o:", "ours, both send, sum")):
        found = [(cm, throughput(job, one)) for cm, job, one in by_distance(runs, senders)]
        axes.plot(*zip(*found, strict=True), mark, color=OURS, mfc="none" if senders == 2 else OURS, label=name)
    for rate, name in zip(published_values(data, "SwarmCom", "payload rate"), ("fast", "slow"), strict=True):
        axes.axhline(rate, color=THEIRS, lw=1)
        axes.text(69, rate + 12, f"SwarmCom, {name}: {rate:g}", color=THEIRS, ha="right", fontsize=8)
    for rate in published_values(data, "libIrcom", "payload rate"):
        axes.plot([10, reach], [rate, rate], color=OTHERS, lw=1.4)
        axes.plot([reach], [rate], "|", color=OTHERS, ms=9)
        axes.text(reach + 5, rate - 8, f"libIrcom: {rate:g}", color=OTHERS, fontsize=8)
    axes.set(xlabel="cm between the middles", ylabel="payload that arrives, bit/s", xlim=(10, 70), ylim=(0, 720))
    axes.set_title("Throughput; theirs: as the protocol gives, any range")


def draw_angle(axes: Any, runs: list[tuple[Job, LinkResult]]) -> None:
    """Draw the share of received frames over the bearing of the light.

    A robot that is turned by 90 degrees receives on its left.
    """
    cm = next(job.distance for job, _ in runs if job.turned)
    alone = [(job.turned, one.share) for job, one in runs if (job.senders, job.distance) == (1, cm)]
    found = sorted(((270 + turned) % 360, share) for turned, share in alone)
    for gap in GAPS_DEG:
        axes.axvline(gap, color="0.5", ls=UNSURE, lw=1, label="gap between two sensors" if gap == 116 else None)
    axes.plot(*zip(*found, strict=True), "o-", color=OURS, label=f"ours at {cm:g} cm")
    axes.set(xlabel="bearing of the sender, degrees clockwise", ylabel="frames that arrive", ylim=(-0.05, 1.1))
    axes.set(xticks=range(0, 361, 60), title="By angle; SwarmCom, libIrcom: none published")


def draw_ratios(axes: Any, runs: list[tuple[Job, LinkResult]], data: Path, reach: float) -> None:
    best = max(throughput(job, one) for _, job, one in by_distance(runs, 1))
    rates = published_values(data, "libIrcom", "payload rate")
    errors = published_values(data, "SwarmCom", "bit error rate over libIrcom's")
    (far,), (fast,) = (published_values(data, "SwarmCom", f"{one} over libIrcom's") for one in ("range", "throughput"))
    axes.barh([2.18, 1.18], [far, fast], 0.34, color="none", edgecolor=THEIRS, ls=UNSURE, label="SwarmCom, up to")
    axes.barh([0], [errors[1] - errors[0]], 0.34, left=errors[0], color="none", edgecolor=THEIRS, ls=UNSURE)
    axes.barh([1.82], [our_range(runs) / reach], 0.34, color=OURS, label="ours, over its nominal values")
    axes.barh([0.82], [best / max(rates)], 0.34, color=OURS)
    axes.axvline(1, color=OTHERS, lw=1.2, label="libIrcom")
    axes.text(1.15, -0.08, "ours: none, libIrcom's is not published", fontsize=8, color=OURS)
    axes.set(yticks=[2, 1, 0], xlabel="times libIrcom's", xlim=(0, 8.6), ylim=(-0.6, 2.6))
    axes.set_yticklabels(["range", "throughput", "bit errors"])
    axes.set_title("Against libIrcom, as published")


def draw(path: Path, runs: list[tuple[Job, LinkResult]], data: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    (reach,), (factor,) = (
        published_values(data, "libIrcom", "range"),
        published_values(data, "SwarmCom", "range over libIrcom's"),
    )
    figure, ((errors, speed), (angle, ratios)) = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    draw_errors(errors, runs, reach, factor)
    draw_throughput(speed, runs, data, reach)
    draw_angle(angle, runs)
    draw_ratios(ratios, runs, data, reach)
    errors.legend(fontsize=8, loc="lower right", bbox_to_anchor=(0.94, 0.02))
    speed.legend(fontsize=8, loc="lower right")
    angle.legend(fontsize=8, loc="lower right")
    ratios.legend(fontsize=8, loc="upper right")
    figure.supxlabel("dashed, red or green or grey: UNVERIFIED", fontsize=9, x=0.99, ha="right")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--measured", type=Path, default=DOCS / "results" / "infrared-link.csv")
    parser.add_argument("--published", type=Path, default=DOCS / "results" / "infrared-published.csv")
    parser.add_argument("--figure", type=Path, default=DOCS / "figures" / "infrared-link.png")
    chosen = parser.parse_args()
    runs = read_runs(chosen.measured)
    draw(chosen.figure, runs, chosen.published)
    (reach,) = published_values(chosen.published, "libIrcom", "range")
    best = max(throughput(job, one) for _, job, one in by_distance(runs, 1))
    print(f"range {our_range(runs):.1f} cm, {our_range(runs) / reach:.2f} times libIrcom's nominal one")
    print(f"{best:.0f} bit/s of payload at most", *(
        f"{best / rate:.2f} times the {rate:g} of libIrcom's protocol"
        for rate in published_values(chosen.published, "libIrcom", "payload rate")), sep=", ")  # fmt: skip


if __name__ == "__main__":
    main()
