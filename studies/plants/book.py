"""Plants by the book: ten textbook systems in units of their fields, from um to km, ms to days.

The models under test in `studies/plants/models` are what an engineer writes first about each.
Quantities are in the units that the model declares; the time is in s, and in a file in whatever the
logger counts.
"""

from __future__ import annotations

from math import sin
from pathlib import Path

from studies.plants.plant import Loop, Plant, Range, Signals
from studies.plants.simulation import Values

_MODELS = Path(__file__).with_name("models")
_UM = 1e6  # um in a metre
_MM = 1e3  # mm in a metre
_HOUR = 3600.0  # s
_RATIO = 20.0  # of the gear


class Accelerometer(Plant):
    """A proof mass on a spring in a gas film: x'' = a - w0^2 x - (w0 / Q) x'."""

    model = f"{_MODELS / 'accelerometer.py'}:Accelerometer"
    nominal = {"omega0": 1.5e4, "quality": 1.5}
    own_states = ("travel", "slip")
    inputs = {"shake": Range("m/s^2", 0.0, 50.0)}
    outputs = {"deflection": "um"}
    shown_by = ("travel",)
    rate = 4e4
    duration = 0.05
    period = 5e-4
    clock = ("ms", 1e-3)
    timings = ("usual",)
    coarsest = 1.25e-5
    aliases = {"spring": "spring + travel", "film": "film + slip"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the accelerations of the proof mass, um/s^2."""
        k = {"travel": x[0], "slip": x[1], "deflection": x[0]}
        shake = self.law("shake", u[0], k, x)
        spring = self.law("spring", p["omega0"] ** 2 * x[0], k, x)
        film = self.law("film", p["omega0"] / p["quality"] * x[1], k, x)
        self.law("slip_rate", _UM * shake - spring - film, k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return speed and acceleration."""
        return [k["slip"], k["slip_rate"]]


class Loudspeaker(Plant):
    """A woofer: i = (u - Bl v) / R, M v' = Bl i - K x - R v (Thiele and Small), x in mm."""

    model = f"{_MODELS / 'loudspeaker.py'}:Loudspeaker"
    nominal = {"Re": 6.0, "Bl": 6.0, "Mms": 15e-3, "Rms": 1.2, "Kms": 1.2}
    own_states = ("cone", "cone_speed")
    inputs = {"amplifier": Range("V", 0.0, 6.0)}
    outputs = {"current": "A", "excursion": "mm"}
    shown_by = ("coil", "cone")
    rate = 2000.0
    duration = 1.0
    period = 0.02
    clock = ("ms", 1e-3)
    timings = ("usual",)
    coarsest = 5e-4
    aliases = {"suspension": "suspension + cone", "losses": "losses + cone_speed"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the current and the forces on the cone."""
        k = {"cone": x[0], "cone_speed": x[1], "excursion": x[0]}
        fed = self.law("amplifier", u[0], k, x)
        current = self.law("coil", (fed - p["Bl"] * x[1]) / p["Re"], k, x)
        suspension = self.law("suspension", p["Kms"] * x[0], k, x)
        losses = self.law("losses", p["Rms"] * x[1], k, x)
        force = p["Bl"] * current - suspension - losses
        self.law("cone_acceleration", force / p["Mms"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return speed and acceleration."""
        return [_MM * k["cone_speed"], k["cone_acceleration"]]


class Vessel(Plant):
    """Air in a volume between a valve and an outlet, isothermal: C p' = feed u - leak p.

    The pressure is that above the atmosphere's.
    """

    model = f"{_MODELS / 'vessel.py'}:Vessel"
    nominal = {"volume": 12.0, "feed": 5.0, "leak": 1.5}
    own_states = ("pressure",)
    inputs = {"opening": Range("1", 0.5, 0.4)}
    outputs = {"gauge": "bar", "meter": "g/s"}
    shown_by = ("pressure", "inflow")
    rate = 5.0
    duration = 300.0
    period = 4.0
    written = {"opening": ("%", 1e-2)}
    timings = ("usual",)
    coarsest = 0.1
    loops = {"pressure": Loop("gauge", "opening", 0.3, 0.05, 0.5)}
    aliases = {"outflow": "outflow + pressure", "store": "_store + pressure"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate flows of mass, g/s; what is stored elsewhere is one, too."""
        k = {"pressure": x[0], "gauge": x[0]}
        opening = self.law("opening", u[0], k, x)
        inflow = self.law("inflow", p["feed"] * opening, k, x)
        outflow = self.law("outflow", p["leak"] * x[0], k, x)
        store = self.law("_store", 0.0, k, x)
        self.law("pressure_rate", (inflow - outflow - store) / p["volume"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the balance of mass."""
        return [k["pressure_rate"]]


class Crane(Plant):
    """A load that swings out: swing'' = -(g / l) sin(swing) - c swing'."""

    model = f"{_MODELS / 'crane.py'}:Crane"
    nominal = {"rope": 9.0, "loss": 0.02}
    known = ("g",)
    own_states = ("swing", "sway")
    released = {"swing": 0.35}
    inputs = {}
    outputs = {"inclination": "rad"}
    shown_by = ("swing",)
    rate = 10.0
    duration = 150.0
    period = 6.0
    written = {"inclination": ("mrad", 1e-3)}
    timings = ("usual",)
    linear = False
    coarsest = 0.1
    aliases = {"pull": "pull + swing", "air": "air + sway"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the angular accelerations."""
        k = {"swing": x[0], "sway": x[1], "inclination": x[0]}
        pull = self.law("pull", 9.81 / p["rope"] * sin(x[0]), k, x)
        air = self.law("air", p["loss"] * x[1], k, x)
        self.law("sway_rate", -pull - air, k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return rate and acceleration."""
        return [k["sway"], k["sway_rate"]]


class Ship(Plant):
    """A ship that is steered: T r' = K delta - r (Nomoto)."""

    model = f"{_MODELS / 'ship.py'}:Ship"
    nominal = {"K": 0.05, "T": 60.0}
    own_states = ("yaw", "course")
    inputs = {"rudder": Range("deg", 0.0, 15.0)}
    outputs = {"compass": "deg", "turn": "deg/s"}
    shown_by = ("course", "yaw")
    rate = 0.5
    duration = 3600.0
    period = 60.0
    clock = ("min", 60.0)
    written = {"turn": ("deg/min", 1.0 / 60.0)}
    timings = ("usual",)
    coarsest = 1.0
    loops = {"course": Loop("compass", "rudder", 0.6, 0.004, 40.0)}
    aliases = {"hull": "hull + yaw"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate rates of turn, deg/s."""
        k = {"yaw": x[0], "course": x[1], "turn": x[0], "compass": x[1]}
        rudder = self.law("rudder", u[0], k, x)
        hull = self.law("hull", x[0], k, x)
        self.law("yaw_rate", (p["K"] * rudder - hull) / p["T"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the rate of the rate of turn, and the rate of turn."""
        return [k["yaw_rate"], k["yaw"]]


class Tanks(Plant):
    """Two tanks in a row whose outflow grows with the level."""

    model = f"{_MODELS / 'tanks.py'}:Tanks"
    nominal = {"A1": 2.0, "A2": 3.0, "pipe": 0.01, "drain": 0.008}
    own_states = ("upper", "lower")
    starts = {"upper": 2.0, "lower": 1.2}
    inputs = {"pump": Range("m^3/s", 0.01, 0.007)}
    outputs = {"upper_level": "m", "lower_level": "m"}
    shown_by = ("upper", "lower")
    rate = 0.1
    duration = 14400.0
    period = 120.0
    clock = ("min", 60.0)
    written = {"pump": ("l/s", 1e-3), "upper_level": ("cm", 1e-2), "lower_level": ("cm", 1e-2)}
    timings = ("usual",)
    coarsest = 10.0
    loops = {"level": Loop("lower_level", "pump", 0.01, 5e-5, 0.3)}
    aliases = {"passing": "passing + upper", "draining": "draining + lower"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate flows, m^3/s."""
        k = {"upper": x[0], "lower": x[1], "upper_level": x[0], "lower_level": x[1]}
        pump = self.law("pump", u[0], k, x)
        passing = self.law("passing", p["pipe"] * (x[0] - x[1]), k, x)
        draining = self.law("draining", p["drain"] * x[1], k, x)
        self.law("upper_rate", (pump - passing) / p["A1"], k, x)
        self.law("lower_rate", (passing - draining) / p["A2"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the balances of both tanks."""
        return [k["upper_rate"], k["lower_rate"]]

    def settled(self, p: Values) -> list[float]:
        """Return the levels at first."""
        return [2.0, 1.2]


class House(Plant):
    """A heated building: C T' = P - UA (T - To), in kW and kWh."""

    model = f"{_MODELS / 'house.py'}:House"
    nominal = {"UA": 0.25, "C": 12.0}
    own_states = ("room",)
    starts = {"room": 291.0}
    inputs = {"heating": Range("kW", 4.0, 3.0), "outdoor": Range("K", 275.0, 6.0)}
    outputs = {"indoor": "K"}
    shown_by = ("room",)
    rate = 1.0 / 900.0
    duration = 691200.0
    period = 14400.0
    clock = ("h", 3600.0)
    timings = ("usual",)
    coarsest = 900.0
    loops = {"thermostat": Loop("indoor", "heating", 1.0, 5e-5, 2.0)}
    aliases = {"envelope": "envelope + _drop", "walls": "_walls + room"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate flows of heat, kW; what the walls store is one, too."""
        k = {"room": x[0], "outdoor": u[1], "indoor": x[0], "_drop": x[0] - u[1]}
        heating = self.law("heating", u[0], k, x)
        envelope = self.law("envelope", p["UA"] * k["_drop"], k, x)
        walls = self.law("_walls", 0.0, k, x)
        self.law("room_rate", (heating - envelope - walls) / (_HOUR * p["C"]), k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the balance of heat."""
        return [k["room_rate"]]

    def settled(self, p: Values) -> list[float]:
        """Return the temperature at first."""
        return [291.0]


class LithiumCell(Plant):
    """A cell over hours: v = U0 - s q - R i, the charge q that was drawn in A*h."""

    model = f"{_MODELS / 'lithium_cell.py'}:LithiumCell"
    nominal = {"U0": 3.9, "slope": 0.12, "R": 0.04}
    slight = {"U0": 0.02}
    # else the open-circuit voltage would be what it was when nobody looked
    known = ("drawn_start",)
    begins_at_rest = True
    own_states = ("drawn",)
    inputs = {"load": Range("A", 1.0, 1.5)}
    outputs = {"terminal": "V"}
    shown_by = ("terminal",)
    rate = 0.1
    duration = 10800.0
    period = 120.0
    clock = ("h", 3600.0)
    written = {"terminal": ("mV", 1e-3)}
    timings = ("usual",)
    coarsest = 5.0
    aliases = {"sag": "sag + drawn", "inner": "inner + load"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the voltages."""
        k = {"load": u[0], "drawn": x[0]}
        sag = self.law("sag", p["slope"] * x[0], k, x)
        inner = self.law("inner", p["R"] * u[0], k, x)
        self.law("terminal", p["U0"] - sag - inner, k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Count the charge."""
        return [k["load"] / _HOUR]

    def settled(self, p: Values) -> list[float]:
        """Return the open-circuit voltage."""
        return [p["U0"]]


class GearMotor(Plant):
    """A DC motor seen from behind its gear: u = R i + n k w, J w' = n k i - b w."""

    model = f"{_MODELS / 'gear_motor.py'}:GearMotor"
    nominal = {"R": 1.2, "k": 0.045, "J": 0.1, "b": 0.02}
    own_states = ("shaft",)
    inputs = {"supply": Range("V", 0.0, 12.0)}
    outputs = {"ammeter": "A", "tachometer": "rad/s"}
    shown_by = ("armature", "shaft")
    rate = 100.0
    duration = 20.0
    period = 0.4
    written = {"tachometer": ("rpm", 0.10471975511965977)}
    timings = ("usual",)
    loops = {"speed": Loop("tachometer", "supply", 0.5, 4.0, 8.0)}
    aliases = {"bearing": "bearing + shaft"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the current and the torques behind the gear."""
        k = {"shaft": x[0], "tachometer": x[0]}
        supply = self.law("supply", u[0], k, x)
        constant = _RATIO * p["k"]
        armature = self.law("armature", (supply - constant * x[0]) / p["R"], k, x)
        bearing = self.law("bearing", p["b"] * x[0], k, x)
        self.law("shaft_rate", (constant * armature - bearing) / p["J"], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return the balance of torques."""
        return [k["shaft_rate"]]


class Train(Plant):
    """A train that coasts: v' = -(A + B v), in km/h and km."""

    model = f"{_MODELS / 'train.py'}:Train"
    nominal = {"rolling": 0.07, "growth": 4e-4}
    own_states = ("pace", "way")
    starts = {"pace": 105.0}
    released = {"pace": 25.0}
    inputs = {}
    outputs = {"speedometer": "km/h", "position": "km"}
    shown_by = ("pace", "way")
    rate = 2.0
    duration = 600.0
    period = 100.0
    clock = ("min", 60.0)
    timings = ("usual",)
    linear = False  # A is no matrix
    coarsest = 0.5
    aliases = {"resistance": "resistance + pace"}

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate the deceleration, km/h/s."""
        k = {"pace": x[0], "way": x[1], "speedometer": x[0], "position": x[1]}
        self.law("resistance", p["rolling"] + p["growth"] * x[0], k, x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return deceleration and speed."""
        return [-k["resistance"], k["pace"] / _HOUR]


BOOK: tuple[Plant, ...] = (
    Accelerometer(),
    Loudspeaker(),
    Vessel(),
    Crane(finest=Crane.coarsest),
    Ship(),
    Tanks(),
    House(),
    LithiumCell(),
    GearMotor(),
    Train(finest=Train.coarsest),
)
