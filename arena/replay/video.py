"""Video of a trial: GIF with Pillow, MP4 with an installed ffmpeg or the one of `imageio-ffmpeg`."""

from __future__ import annotations

import base64
import importlib
import math
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from PIL import Image, ImageDraw

from arena.camera.appearance import COLOURS
from arena.replay.page import sample_data
from arena.robots.controller import STRIP_PIXELS
from arena.scene import geometry, palette
from arena.scene.loader import Scene
from arena.scene.robot_kind import EPUCK, KILOBOT
from arena.trial.record import RecordError, Trial, reason_of
from emu.host.files import atomic_file

SCALE: Final = 1.6
"""Pixels per cm in a scene of e-pucks. The smallest robot of a scene is as large as an e-puck."""
FRAMES_PER_S: Final = 12.5
"""Frame rate of the video: a frame lasts 80 ms, because GIF counts in hundredths of a second."""
LIMIT: Final = 20_000
"""Maximum number of frames of a video; more are probably a mistake in --speed."""
MAX_NUMBERED: Final = 50
"""Maximum number of robots whose numbers and camera strips a frame shows: of more, numbers would overlap, and the frame
would be too high."""
_LINE: Final = 14
_PIXEL: Final = 6
_INK, _PAPER, _PALE = palette.rgb(palette.INK), palette.rgb(palette.PAPER), (221, 221, 221)
_SEEN: Final = tuple(map(palette.rgb, palette.SEEN))
_CLUSTERS: Final = tuple(map(palette.rgb, palette.GROUPS))


def write_video(trial: Trial, path: Path, speed: float, seconds: float | None = None) -> None:
    """Write a video at `speed` times real time, of the first `seconds` simulated seconds.

    An incomplete file is deleted. Raises ValueError for a name that is neither .gif nor .mp4, a wrong speed or
    duration, or a missing ffmpeg; RecordError if the file cannot be written."""
    kind = path.suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise ValueError(f"--export {path}: expected a name that ends in .gif or .mp4")
    end = float(trial.times[-1]) if seconds is None else min(seconds, float(trial.times[-1]))
    if not speed > 0 or not end >= 0:
        raise ValueError("--speed must be positive, --seconds must not be negative")
    count = int(end / speed * FRAMES_PER_S) + 1
    if count > LIMIT:
        raise ValueError(f"--speed {speed:g} makes {count} frames of {end:g} s; the limit is {LIMIT} frames")
    pictures = frames(trial, [frame / FRAMES_PER_S * speed for frame in range(count)])
    try:
        with atomic_file(path) as part:
            if kind == ".gif":
                _gif(pictures, part)
            else:
                _mp4(pictures, part)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {reason_of(error)}") from None


def frames(trial: Trial, times: list[float]) -> Iterator[Image.Image]:
    """Yield a picture for each time in s: arena from above, time and metrics, camera strips."""
    data = sample_data(trial)
    metrics = trial.experiment.curves[:2]
    shown = [
        [f"{time:6.1f} s", *(f"{one.label} {one.shown(data['curves'][one.name][sample])}" for one in metrics)]
        for sample, time in enumerate(data["t"])
    ]
    captions = _fitted(shown, round(trial.scene.arena.width_cm * _scale(trial.scene, len(data["robots"]))))
    least_width, sample = max(map(_text_width, captions)), 0
    for time in times:
        while sample + 1 < len(data["t"]) and data["t"][sample + 1] <= time + 1e-3:
            sample += 1
        yield _frame(trial.scene, data, sample, captions[sample], least_width)


def _fitted(captions: list[list[str]], width: int) -> list[str]:
    """Return the captions of all frames in one line each, or with a line for each part if one is wider than `width`."""
    joined = ["   ".join(parts) for parts in captions]
    return joined if max(map(_text_width, joined)) <= width else ["\n".join(parts) for parts in captions]


def _text_width(text: str) -> int:
    """Return the width of a text with its margins, in pixels."""
    return math.ceil(ImageDraw.Draw(Image.new("RGB", (1, 1))).multiline_textbbox((0, 0), text)[2]) + 8


def _scale(scene: Scene, robots: int) -> float:
    """Return the pixels per cm of a scene's pictures: its smallest robot is as large as an e-puck with `SCALE`."""
    return (
        SCALE
        * EPUCK.radius_cm
        / min((scene.robot_kind(one).radius_cm for one in range(robots)), default=EPUCK.radius_cm)
    )


def arena_picture(
    scene: Scene, robots: Sequence[tuple[float, float, float]], seen: Sequence[int],
    objects: Sequence[tuple[float, ...]], labels: Sequence[int], leds: Sequence[int] = (),
) -> Image.Image:  # fmt: skip
    """Draw the arena from above, in the scale of `_scale`.

    `robots` are poses in cm and rad, `seen` the values of their line-of-sight sensors. `objects` are x and y in cm, and
    for polygons the heading in rad. `labels` are the cluster numbers of the objects. `leds` are the
    LEDs of the robots: a Kilobot has its colour, grey if it is dark.
    """
    scale = _scale(scene, len(robots))
    width, height = round(scene.arena.width_cm * scale), round(scene.arena.height_cm * scale)
    image = Image.new("RGB", (width, height), _PAPER)
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 0, width - 1, height - 1), outline=_INK)

    def disc(x: float, y: float, radius: float, fill: tuple[int, int, int]) -> None:
        left, low, r = x * scale, height - y * scale, radius * scale
        draw.ellipse((left - r, low - r, left + r, low + r), fill=fill, outline=_INK)

    for one in scene.obstacles:
        if one.polygon:
            draw.polygon([(x * scale, height - y * scale) for x, y in one.polygon], outline=_INK)
        else:
            disc(one.x_cm, one.y_cm, one.radius_cm, _PAPER)
    for thing, (place, label) in enumerate(zip(objects, labels, strict=True)):
        kind, fill = scene.kind_of(thing), _CLUSTERS[label % len(_CLUSTERS)] if labels.count(label) > 1 else _PALE
        if kind.polygon:
            corners = geometry.turned(geometry.centred(kind.polygon), *place)
            draw.polygon([(x * scale, height - y * scale) for x, y in corners], fill=fill, outline=_INK)
        else:
            disc(place[0], place[1], kind.radius_cm, fill)
    for number, ((x, y, heading), answer) in enumerate(zip(robots, seen, strict=True)):
        body = scene.robot_kind(number)
        is_kilobot, ahead = body is KILOBOT, body.radius_cm if body is KILOBOT else 9
        disc(x, y, body.radius_cm, _led_colour(leds[number] if leds else 0) if is_kilobot else _SEEN[answer])
        tip = (x + ahead * math.cos(heading)) * scale, height - (y + ahead * math.sin(heading)) * scale
        draw.line((x * scale, height - y * scale, *tip), fill=_INK, width=2)
        if len(robots) <= MAX_NUMBERED:
            draw.text((x * scale + 8, height - y * scale - 14), str(number), fill=_INK)
    return image


def _led_colour(leds: int) -> tuple[int, int, int]:
    """Return the colour of a Kilobot's LED; grey if it is dark."""
    return (85 * (leds & 3), 85 * (leds >> 2 & 3), 85 * (leds >> 4 & 3)) if leds else _PALE


def _frame(scene: Scene, data: dict[str, Any], sample: int, caption: str, least_width: int) -> Image.Image:
    """Draw one frame of at least `least_width` pixels: the arena from above, `caption`, and the camera strips."""
    robots = [(one["x"][sample], one["y"][sample], one["heading"][sample]) for one in data["robots"]]
    seen = [one["seen"][sample] for one in data["robots"]]
    picture = arena_picture(scene, robots, seen, data["objects"][sample], data["clusters"][sample],
                            [one["leds"][sample] for one in data["robots"]])  # fmt: skip
    cameras = sum(scene.robot_kind(number).has_camera for number in range(len(robots)))
    (width, height), rows = picture.size, len(robots) if cameras and len(robots) <= MAX_NUMBERED else 0
    width, below = max(width, least_width), height + _LINE * (caption.count("\n") + 1) + 2
    total = below + _LINE * rows + 2
    image = Image.new("RGB", (width + width % 2, total + total % 2), _PAPER)
    image.paste(picture)
    draw = ImageDraw.Draw(image)
    draw.text((4, height + 2), caption, fill=_INK, spacing=_LINE - 11)
    for number in range(rows):
        if scene.robot_kind(number).has_camera:
            _strip(draw, number, data["robots"][number], sample, below + _LINE * number)
    return image


def _strip(draw: ImageDraw.ImageDraw, number: int, robot: dict[str, Any], sample: int, y: int) -> None:
    """Draw the camera strip of one robot, left to right, and the names of its lit LEDs."""
    strip = base64.b64decode(robot["strip"][sample])
    draw.text((4, y), str(number), fill=_INK)
    for place in range(len(strip) // 3):
        red, green, blue = strip[3 * place : 3 * place + 3]
        draw.rectangle((20 + _PIXEL * place, y + 1, 19 + _PIXEL * (place + 1), y + _LINE - 3), fill=(red, green, blue))
    names = [*map(str, range(8)), "front", "body"]
    lit = [name for bit, name in enumerate(names) if robot["leds"][sample] >> bit & 1]
    draw.text((30 + STRIP_PIXELS * _PIXEL, y), " ".join(lit), fill=_INK)


def _gif_colours() -> list[tuple[int, int, int]]:
    """Return the colours of a GIF: drawn colours, colours of the camera, and ramps for noise and smooth edges."""
    leds = [(85 * red, 85 * green, 85 * blue) for red in range(4) for green in range(4) for blue in range(4)]
    drawn = [_INK, _PAPER, _PALE, *leds, *_SEEN, *_CLUSTERS, *(tuple(map(int, colour)) for colour in COLOURS)]
    ramps = [(grey, grey, grey) for grey in range(0, 256, 8)]
    ramps += [(level, level // 6, level // 6) for level in range(8, 256, 8)]
    ramps += [(level // 5, level, level // 4) for level in range(8, 160, 8)]
    return [(red, green, blue) for red, green, blue in (*drawn, *ramps)]


def _gif(pictures: Iterator[Image.Image], part: Path) -> None:
    """Write the frames as a GIF."""
    table = Image.new("P", (1, 1))
    table.putpalette([value for colour in _gif_colours() for value in colour])
    coloured = (picture.quantize(palette=table, dither=Image.Dither.NONE) for picture in pictures)
    first = next(coloured)
    first.save(part, "GIF", save_all=True, append_images=coloured, duration=round(1000 / FRAMES_PER_S), loop=0)


def _mp4(pictures: Iterator[Image.Image], part: Path) -> None:
    """Write the frames as an MP4 with ffmpeg. Raises RecordError if ffmpeg fails."""
    first = next(pictures)
    size = f"{first.width}x{first.height}"
    command = [_ffmpeg(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r",
               str(FRAMES_PER_S), "-i", "-", "-pix_fmt", "yuv420p", "-f", "mp4", str(part)]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        assert encoder.stderr is not None
        with suppress(BrokenPipeError):
            encoder.stdin.write(first.tobytes())
            for picture in pictures:
                encoder.stdin.write(picture.tobytes())
            encoder.stdin.close()
        caption = encoder.stderr.read().decode(errors="replace").strip()
    if encoder.returncode:
        raise RecordError(f"{part}: ffmpeg failed: {caption}")


def _ffmpeg() -> str:
    """Return the path of ffmpeg. Raises ValueError if there is none."""
    found = shutil.which("ffmpeg")
    if found is None:
        with suppress(ImportError):
            found = str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    if found is None:
        raise ValueError(".mp4 needs ffmpeg (Debian package ffmpeg, or pip install imageio-ffmpeg); .gif does not")
    return found
