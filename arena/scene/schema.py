"""The tables of a scene: meaning and default of each value (limits: limits.py). Pure data.

    >>> from arena.scene.loader import load_scene
    >>> scene = load_scene("clustering")
    >>> scene.robots.count, scene.arena.width_cm
    (5, 400.0)
    >>> scene.with_values(robots__count=3).robots.count
    3

docs/scene-keys.md lists all keys.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from arena.scene import dimensions

Points = tuple[tuple[float, ...], ...]
"""Points (x, y) in cm, or poses (x, y, heading in degrees)."""
FCY: Final = 14_745_600
"""Tcy per second of the e-puck (epuck.md)."""


@dataclass(frozen=True, slots=True)
class Arena:
    """Inner size between the walls, or the corners of a room of any shape. A polygon determines the size.

    Without `walls` the world has no end. Robots can leave the rectangle, which then only defines start positions and
    the part of the world in pictures. Cameras see floor and sky up to the horizon.
    """

    width_cm: float = 400.0
    height_cm: float = 300.0
    polygon: Points = ()
    walls: bool = True

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height between the walls, cm; infinite without walls."""
        return (self.width_cm, self.height_cm) if self.walls else (math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Marks:
    """Grid of start positions, centred in the arena."""

    columns: int = 15
    rows: int = 11
    spacing_cm: float = 25.0


@dataclass(frozen=True, slots=True)
class Robots:
    """The e-pucks. Turning wheels pull with at most `thrust_n`, wheels at rest hold with `brake_n`.

    `wheel_noise` is a share of the speed, drawn every `noise_period_s`. The `_sd` values are standard deviations of
    normal distributions, drawn once per robot and trial: yaw (to the left) and pitch (upwards) of the camera, and the
    share by which each wheel is faster. `colour` is that of the skirt, as a camera shows it.
    """

    count: int = 5
    axle_cm: float = dimensions.AXLE
    thrust_n: float = dimensions.THRUST
    brake_n: float = dimensions.BRAKE
    wheel_noise: float = 0.05
    noise_period_s: float = 0.1
    camera_yaw_sd_deg: float = 0.0
    camera_pitch_sd_deg: float = 0.0
    wheel_bias_sd: float = 0.0
    colour: str = "green"


@dataclass(frozen=True, slots=True)
class Objects:
    """Movable discs of one kind on marks; [[objects]] tables describe other objects."""

    count: int = 20
    radius_cm: float = dimensions.OBJECT_RADIUS
    mass_kg: float = dimensions.OBJECT_MASS
    floor_friction: float = dimensions.FLOOR_FRICTION


@dataclass(frozen=True, slots=True)
class CameraSetting:
    """The camera in front; `lens.py` explains its mounting and its lens.

    `false_*` are probabilities per frame, for scripted controllers only. With `sees_leds` the picture shows other
    robots' LEDs, one quantum late.
    """

    sensor: str = "PO6030K"
    frame_tcy: int = 1_600_000
    range_cm: float = 150.0
    pitch_deg: float = 0.0
    mirrored: bool = False
    distortion: float = 0.0
    vignetting: float = 0.0
    pixel_noise: float = 3.0
    sees_leds: bool = False
    false_negative: float = 0.0
    false_positive: float = 0.0


@dataclass(frozen=True, slots=True)
class InfraredSetting:
    """Infrared light: reflection of surfaces, light between robots, noise and loss.

    The `_share` values of surfaces are reflections as a share of white paper's; black is 0.1 to 0.3. UNVERIFIED except
    for white walls.

    A proximity sensor casts a ray along its axis, and `side_rays` on either side of it, up to the half-angle of its
    beam, 15 degrees (epuck.md §5). UNVERIFIED: all rays count alike. They are scaled so that a white wall across the
    axis gives the published response at any distance.

    Light between robots (infrared/propagation.py) is `signal_gain` times the published amplitude. It falls with the
    angle to the axes of emitter and receiver as powers of the cosine: 20 and 3.3 halve it at 15 and 36 degrees.
    Receivers are low-passes with the time constant `tau_us`.

    Each sample has Gaussian noise of `noise_counts`, and `ripple_counts` of 100 Hz from lamps on the mains. UNVERIFIED:
    there is no published measurement; 1 to 4 counts of noise and 0 to 5 of ripple are plausible (swarmcom.md §7).

    `lost_share` is the share of other robots' transmissions that a robot loses, drawn for each robot and transmission.
    A transmission ends when the sender has been dark for 15.5 ms. Of a lost one the robot sees 0.8 ms in each 2.4 ms:
    it detects a sender, but never the start of a frame.
    """

    wall_share: float = 1.0
    object_share: float = 0.8
    robot_share: float = 0.5
    signal_gain: float = 1.0
    emitter_power: float = 20.0
    receiver_power: float = 3.3
    side_rays: int = 0
    tau_us: float = 60.0
    noise_counts: float = 0.0
    ripple_counts: float = 0.0
    lost_share: float = 0.0


@dataclass(frozen=True, slots=True)
class Light:
    """Room light. `brightness` scales the colours of the cameras; 1 is nominal.

    For infrared sensors: `ambient_counts` are the raw counts in the room, which fall with light. `ambient_sd_counts` is
    the standard deviation between sensors, drawn once per sensor and trial. A lamp lowers the counts of a sensor that
    faces it at 1 m by `lamp_counts`; 0: no lamp.
    """

    brightness: float = 1.0
    ambient_counts: int = 3800
    ambient_sd_counts: float = 0.0
    lamp_x_cm: float = 0.0
    lamp_y_cm: float = 0.0
    lamp_counts: float = 0.0


@dataclass(frozen=True, slots=True)
class BatterySetting:
    """Voltage at the start of the trial, and hours of the linear fall from full (4.2 V) to low (3.4 V)."""

    volts: float = 4.0
    hours: float = 3.0


@dataclass(frozen=True, slots=True)
class Start:
    """Power-on and inputs of the robots.

    - Each robot is powered on at a random cycle within `spread_tcy` (one camera frame).
    - `selector` is the position of its switch, 0 to 15; -1: as the run's controller needs, 0 = A, 1 = B.
    - `remote` is the key of the remote control that is pressed, a name or an RC-5 code; "": none. It is held for
      `remote_held_s`; frames repeat every 113.8 ms (epuck.md §6).
    - `stimulus` is a script of further inputs (emu/boards/epuck/stimulus.py), such as bytes on UART1, the state of the
      battery or the position of the switch. Its times are those of the trial.
    - `off` are pairs of a robot, numbered from 0, and the second at which its battery is removed. From then on it stays
      at rest and dark.
    - A robot without a motor step, a LED change or a byte on UART1 for `silent_s` is reported.
    - `robot_poses` and `object_poses` are the poses of all robots and of all objects, instead of those by `place`: x
      and y in cm, and of robots and polygons the heading in degrees. Bodies may overlap by 0.5 cm. `--start RECORD` of
      `arena run` sets those at the end of a recorded trial.
    """

    spread_tcy: int = 1_600_000
    selector: int = -1
    remote: str = "ok"
    remote_at_s: float = 1.0
    remote_held_s: float = 0.5
    stimulus: str = ""
    off: Points = ()
    silent_s: float = 60.0
    robot_poses: Points = ()
    object_poses: Points = ()


@dataclass(frozen=True, slots=True)
class Bluetooth:
    """Serial connections between robots. `links` are pairs of robots, numbered from 0.

    What one robot of a pair sends on UART1 reaches UART1 of the other one at the end of the period (UNVERIFIED: radios
    of the time took 10 to 50 ms).
    """

    links: Points = ()
    period_ms: float = 20.0


@dataclass(frozen=True, slots=True)
class Kilobots:
    """The Kilobots (kind = "kilobot"), and the overhead controller above the table.

    - `speed_cm_s`: speed ahead at the calibrated duties; `turn_deg_s`: turning rate of one motor at its calibrated duty
    - `motor_sd`: standard deviation of the strength of motors, which the calibration in the EEPROM compensates;
      `calibration_sd`: standard deviation of the error that remains after the calibration
    - `motion_noise`: share of the motion, drawn every `noise_period_s` of [chassis]
    - `thrust_n`: force of the legs on the table while motors run; `brake_n`: force that pushes a robot at rest
    - `clock_sd`: standard deviation of the frequency of the oscillators
    - `reach_cm`: range of infrared between two centres; `lost_share`: share of light pulses that a receiver misses;
      `lost_at`: instead, that share by distance, [[cm, share], ...], linear between two points
    - `ambient_counts`: counts of the sensor of ambient light; a lamp that lowers an infrared sensor of an e-puck by C
      counts at 1 m raises them by `lamp_gain` C at 1 m, and with the inverse square of its distance
    - `overhead`: the overhead controller's commands as "SECOND COMMAND SECONDS; ...": from that second on it repeats
      the command for so many seconds. Commands: boot, reset, sleep, wakeup, charge, voltage, run, readuid, calibrate
    - `records_messages`: whether the record has the messages that Kilobots send

    Robots are powered on within `spread_tcy` of [start]. UNVERIFIED: no measurement of the spreads, the noise, the
    forces and the lamps is published.
    """

    speed_cm_s: float = 1.0
    turn_deg_s: float = 45.0
    motor_sd: float = 0.05
    calibration_sd: float = 0.025
    motion_noise: float = 0.1
    thrust_n: float = 0.02
    brake_n: float = 0.05
    clock_sd: float = 0.005
    reach_cm: float = 7.0
    lost_share: float = 0.0
    lost_at: Points = ()
    ambient_counts: int = 300
    lamp_gain: float = 0.25
    overhead: str = "0.2 run 0.5"
    records_messages: bool = True


@dataclass(frozen=True, slots=True)
class Clock:
    """Quantum of the lock-step, the quantum if all controllers are scripted, and time between two samples."""

    quantum_ms: float = 1.0
    scripted_quantum_ms: float = 10.0
    sample_s: float = 0.5

    @property
    def quantum_tcy(self) -> int:
        """The quantum in whole Tcy."""
        return round(self.quantum_ms * FCY / 1000)


INHERIT: Final = "as in [start]"
"""Value of a group's key by which the group takes the value in [start]."""


@dataclass(frozen=True, slots=True)
class Placed:
    """Start positions of `count` robots or objects of one kind. `place` is one of:

    - `marks`: free marks of the grid
    - `uniform`: in a rectangle `width_cm` x `depth_cm` around the centre; 0: the whole arena
    - `normal`: normally distributed around the centre, standard deviation `sd_cm`
    - `circle`: at equal distances on a circle of radius `circle_cm` around the centre
    - `hexagonal`: on a hexagonal lattice with gaps of `spacing_cm`, nearest to the centre first
    - `poses`: the list `poses` of x, y, and for robots and polygons optionally the heading in degrees; or the name of a
      file with one `x,y` or `x,y,degrees` per line, relative to the scene file

    The centre is (`x_cm`, `y_cm`), by default that of the arena.
    """

    name: str = ""
    count: int = 1
    place: str = "marks"
    poses: Points = ()
    x_cm: float = math.nan
    y_cm: float = math.nan
    width_cm: float = 0.0
    depth_cm: float = 0.0
    sd_cm: float = 30.0
    circle_cm: float = 50.0
    spacing_cm: float = 4.0


@dataclass(frozen=True, slots=True)
class RobotGroup(Placed):
    """Robots of one kind.

    - `kind`: epuck or kilobot
    - `image`: their controller, as `--brain`, or a program of firmware/kilobot for Kilobots; a path is relative to the
      scene file; empty: that of the run. `--brain` replaces the images of a scene in which every group has one.
    - `controller`: table A, B or aggregate, the controller transport, or a Python file or entry point
      (robots/user_controller.py); a path is relative to the scene file; empty: that of the run
    - `id_first`: number of the first robot; the next ones count up. `{id}` in `stimulus` is replaced by it. It is the
      UID of a Kilobot.
    - `heading_deg`: heading at the start; nan: random
    - `selector`, `remote`, `stimulus`: as in [start]
    """

    kind: str = "epuck"
    image: str = ""
    controller: str = ""
    id_first: int = 0
    heading_deg: float = math.nan
    selector: int = -1
    remote: str = INHERIT
    stimulus: str = INHERIT


@dataclass(frozen=True, slots=True)
class ObjectKind(Placed):
    """Movable objects of one kind: discs, or convex polygons.

    - `polygon`: corners in cm; the position of such an object is the centroid. Its `radius_cm` is that of the
      circumscribed circle, within which no other body is placed at the start.
    - `heading_deg`: rotation of a polygon at the start; nan: random
    - `floor_friction`: coefficient for an even pressure on the floor
    - `colour`: a name of `NAMED`, or red, green and blue as `#rrggbb`, as a camera shows them
    - `share`: infrared reflection as a share of white paper's; an object lower than 2.5 cm neither reflects nor
      blocks infrared light
    """

    radius_cm: float = dimensions.OBJECT_RADIUS
    polygon: Points = ()
    heading_deg: float = math.nan
    height_cm: float = dimensions.OBJECT_HEIGHT
    mass_kg: float = dimensions.OBJECT_MASS
    floor_friction: float = dimensions.FLOOR_FRICTION
    colour: str = "red"
    share: float = 0.8


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Immovable obstacle: a polygon, or a disc of `radius_cm` at `x_cm`, `y_cm`.

    Obstacles lower than 2.5 cm reflect and block no infrared light.
    """

    name: str = ""
    polygon: Points = ()
    x_cm: float = 0.0
    y_cm: float = 0.0
    radius_cm: float = 0.0
    height_cm: float = 50.0
    colour: str = "wall"
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class Patch:
    """Coloured patch of the floor, without height."""

    name: str = ""
    polygon: Points = ()
    x_cm: float = 0.0
    y_cm: float = 0.0
    radius_cm: float = 0.0
    colour: str = "white"


@dataclass(frozen=True, slots=True)
class Lamp:
    """Lamp as in [light]: `counts` are the counts by which it lowers an infrared sensor at 1 m."""

    x_cm: float = 0.0
    y_cm: float = 0.0
    counts: float = 1000.0


TABLES: Final[Mapping[str, type[Any]]] = {
    "arena": Arena,
    "marks": Marks,
    "robots": Robots,
    "objects": Objects,
    "camera": CameraSetting,
    "infrared": InfraredSetting,
    "light": Light,
    "battery": BatterySetting,
    "start": Start,
    "bluetooth": Bluetooth,
    "kilobots": Kilobots,
    "clock": Clock,
}
LISTS: Final[Mapping[str, type[Any]]] = {
    "groups": RobotGroup,
    "kinds": ObjectKind,
    "obstacles": Obstacle,
    "patches": Patch,
    "lamps": Lamp,
}
"""Tables of which a scene can have several. In a file `groups` are [[robots]] and `kinds` are [[objects]]; [chassis]
has the values that all robots share."""

NAMED: Final = {
    "red": (90, 14, 14),
    "green": (10, 48, 14),
    "blue": (14, 18, 90),
    "yellow": (96, 84, 16),
    "white": (120, 112, 112),
    "grey": (60, 56, 56),
    "black": (8, 8, 8),
    "wall": (112, 100, 100),
    "floor": (100, 90, 88),
}
"""Colours by name as a camera shows them in the experiment's light; red, green and wall are those of
`appearance.COLOURS`. UNVERIFIED on a robot."""

PLACES: Final = ("marks", "uniform", "normal", "circle", "hexagonal", "poses")
