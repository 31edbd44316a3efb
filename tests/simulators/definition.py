"""What "simulation-ready" means, point by point: written once, asked of every simulator.

A point is a generator over a twin and a reader (what one simulator made of one exported file). It yields the ways in
which the two disagree, as text, and what it measured, as `Measured`. No text means that the point holds. The truth is
always `twin.json`, the model that all files are written from; motion is compared with that model's equation of motion,
and what a recorded hand does with the parts (point 16) with what `validation.json` says that it did in rapier.
"""

import copy
import functools
import json
import math
import pathlib
import random
import re
from dataclasses import dataclass

import numpy as np
import replay

GRAVITY = np.array([0.0, 0.0, -9.81])

# Tolerances of the definition.
PLACE_M = 1e-5
MASS_SHARE = 1e-3
AT_REST = 1e-3
FINAL_SPEED = 1e-2
# How far past its stop per speed of arrival. A critically damped stop of 20 ms, the softest default (MuJoCo's), lets
# v * 20 ms / e through: 0.025 rad for a door that arrives at 3.3 rad/s, 0.010 m for a drawer at 1.3 m/s.
OVERSHOOT_SECS = 0.0077
PENETRATION_M = 1e-3
CLEARANCE_M = 1e-3
TIME_SHARE = 0.03
STEP_SHARE = 0.02
CREEP_SHARE = 0.02

# A slow simulator opens every part of a twin of up to so many.
FEW_PARTS = 6

# The hand: it pulls square to the lever at a hinge's handle, along the axis at a slide's.
PULL_N = {"revolute": 5.0, "prismatic": 15.0}
REST_SECS = 2.0
SETTLE_SECS = 0.5
LONGEST_SECS = 8.0
SWEEP_POSES = 51


# ---- the model ----


@dataclass(frozen=True)
class Body:
    """Mass, centre of mass (world, closed) and inertia about it (world axes, closed)."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Limits:
    """What a reader knows of a joint; None where it does not keep the value."""

    lower: float
    upper: float
    axis: np.ndarray | None = None
    damping: float | None = None
    friction: float | None = None
    effort: float | None = None
    velocity: float | None = None


def body(solids, density):
    """Boxes of one density as one body."""
    boxes = [(8 * np.prod(s["shape"]["half"]) * density, s["shape"]) for s in solids]
    mass = sum(m for m, _ in boxes)
    center = sum(m * np.array(b["center"]) for m, b in boxes) / mass
    inertia = np.zeros((3, 3))
    for m, b in boxes:
        x, y, z = (2 * np.array(b["half"])) ** 2
        turn = np.array(b["R"])
        d = np.array(b["center"]) - center
        inertia += turn @ np.diag([y + z, x + z, x + y]) @ turn.T * m / 12 + m * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(mass, center, inertia)


def corners(solids):
    """Corners of boxes in the world, closed."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return np.vstack(
        [
            np.array(s["shape"]["center"]) + signs * np.array(s["shape"]["half"]) @ np.array(s["shape"]["R"]).T
            for s in solids
        ]
    )


class Part:
    """A moving part, from its entry in twin.json."""

    def __init__(self, furniture, density):
        part, joint = furniture["part"], furniture["part"]["joint"]
        phi = joint["articulation"]
        self.name, self.link, self.base = part["id"], f"{part['id']}_link", furniture["name"]
        self.kind, self.turns = phi["kind"], phi["kind"] == "revolute"
        self.axis, self.origin = np.array(phi["axis"]), np.array(phi["origin"])
        # v -> axis x v: what a step of a simulation asks several times.
        self.cross = np.cross(np.eye(3), self.axis)
        self.upper, self.damping, self.friction = joint["upper"], joint["damping"], joint["friction"]
        # A spring carries its weight.
        self.balanced = joint.get("balanced", False)
        self.handle = np.array(part["handle"])
        self.outward = np.array(part["bounds"]["R"])[:, 2]
        self.solids, self.carcass = part["solids"], furniture["carcass"]
        self.body = body(self.solids, density)

    def at(self, point, q):
        """Where a point of the closed part is when the joint stands at q."""
        if not self.turns:
            return point + self.axis * q
        r = point - self.origin
        turned = r * math.cos(q) + self.cross @ r * math.sin(q) + self.axis * (self.axis @ r) * (1 - math.cos(q))
        return self.origin + turned

    def square(self, q):
        """Unit direction in which opening moves the handle."""
        along = self.cross @ (self.at(self.handle, q) - self.origin) if self.turns else self.axis
        return along / np.linalg.norm(along)

    @functools.cached_property
    def lever(self):
        """Generalized force of 1 N at the handle, square to the lever: m for a hinge, 1 for a slide."""
        return float(np.linalg.norm(np.cross(self.axis, self.handle - self.origin))) if self.turns else 1.0

    @functools.cached_property
    def inertia(self):
        """What the joint has to accelerate: kg m^2 or kg."""
        if not self.turns:
            return self.body.mass
        arm = np.cross(self.axis, self.body.center - self.origin)
        return float(self.axis @ self.body.inertia @ self.axis + self.body.mass * arm @ arm)

    @functools.cached_property
    def _weight(self):
        r = self.body.center - self.origin
        r = r - self.axis * (self.axis @ r)
        return self.body.mass * np.array([np.cross(self.axis, r) @ GRAVITY, -r @ GRAVITY])

    def weight(self, q):
        """Generalized force of gravity, N m or N; positive opens."""
        if self.balanced:
            return 0.0
        if not self.turns:
            return float(self.body.mass * self.axis @ GRAVITY)
        return float(self._weight @ (math.cos(q), math.sin(q)))

    @functools.cached_property
    def heaviest(self):
        """The most that gravity helps to open and to close over the range."""
        loads = [self.weight(q) for q in np.linspace(0, self.upper, 51)]
        return max(0.0, *loads), max(0.0, *(-w for w in loads))

    def without_spring(self):
        """The same part where nothing carries its weight."""
        part = copy.copy(self)
        part.balanced = False
        part.__dict__.pop("heaviest", None)
        return part

    @property
    def heavy(self):
        """Whether gravity moves it against its own friction."""
        return max(self.heaviest) > self.friction

    def pull(self, sense):
        """A constant force of the hand along `square`, N: the usual one on top of what gravity pulls the other way."""
        return sense * (PULL_N[self.kind] + self.heaviest[0 if sense < 0 else 1] / self.lever)

    def carry(self, sense, q):
        """The usual force of a hand that also carries what the part weighs, N."""
        return sense * PULL_N[self.kind] - self.weight(q) / self.lever


class Twin:
    """The model behind a folder's files."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        raw = json.loads((self.folder / "twin.json").read_text(encoding="utf-8"))
        self.name = self.folder.name
        self.parts = [Part(f, raw["density_kg_per_m3"]) for f in raw["furniture"]]
        self.bodies = {p.link: p.body for p in self.parts}
        self.bodies |= {f["name"]: body(f["carcass"], raw["density_kg_per_m3"]) for f in raw["furniture"]}
        self.solids = {p.link: p.solids for p in self.parts} | {p.base: p.carcass for p in self.parts}
        # Walls and worktops: fixed, and of no interest but for where they are.
        self.room = raw.get("room", [])
        self._room_mass = body(self.room, raw["density_kg_per_m3"]).mass if self.room else 0.0

    @property
    def mass(self):
        """Everything together, kg."""
        return sum(b.mass for b in self.bodies.values()) + self._room_mass

    @property
    def boxes(self):
        """How many boxes there are."""
        return sum(len(s) for s in self.solids.values()) + len(self.room)

    @functools.cached_property
    def look(self):
        """Names of the textured meshes."""
        return sorted(f.stem for f in (self.folder / "look").glob("*.obj"))

    @functools.cached_property
    def hidden(self):
        """How many boxes meshes are shown for: a part's where it has some, all fixed ones where the room has."""
        worn = {name.rsplit("_look_", 1)[0] for name in self.look}
        parts = sum(len(p.solids) for p in self.parts if p.name in worn)
        return parts + (sum(len(p.carcass) for p in self.parts) + len(self.room) if "room" in worn else 0)

    def seen_by(self, reader):
        """The twin as far as the reader's format can tell it."""
        if reader.springs:
            return self
        twin = copy.copy(self)
        twin.parts = [p.without_spring() if p.balanced else p for p in self.parts]
        return twin

    def moved_by(self, reader):
        """The parts that a simulator opens one by one: all, or in a slow one a few, drawn by the twin's name."""
        if len(self.parts) <= max(reader.most, FEW_PARTS):
            return self.parts
        return random.Random(self.name).sample(self.parts, reader.most)


def time_to(part, share, force, damping, friction, armature=0.0):
    """Seconds from closed and at rest to a share of the range under a constant pull: the integral of the motion.

    Without gravity that is theta(t) = (tau - f) / d * (t - J / d * (1 - exp(-d t / J))): see `self_check`.
    """
    push, inertia = force * part.lever - friction, part.inertia + armature

    def slope(q, v):
        return v, (push - damping * v + part.weight(q)) / inertia

    h, t, q, v, goal = 1e-3, 0.0, 0.0, 0.0, share * part.upper
    while q < goal:
        if t > 20.0:
            return math.inf
        k1 = slope(q, v)
        k2 = slope(q + h / 2 * k1[0], v + h / 2 * k1[1])
        k3 = slope(q + h / 2 * k2[0], v + h / 2 * k2[1])
        k4 = slope(q + h * k3[0], v + h * k3[1])
        before = q
        q += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        v += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        t += h
    return t - h * (q - goal) / (q - before)


def self_check():
    """Holds the integrator to the closed form, without gravity (an upright hinge has none)."""
    part = object.__new__(Part)
    part.__dict__.update(turns=True, upper=1.92, lever=0.557, inertia=0.53669, balanced=False, _weight=np.zeros(2))
    for damping, friction in ((0.5, 0.2), (0.5, 0.0), (2.0, 1.0)):
        t = time_to(part, 0.95, 5.0, damping, friction)
        tau, j = 5.0 * part.lever - friction, part.inertia
        angle = tau / damping * (t - j / damping * (1 - math.exp(-damping * t / j)))
        assert abs(angle - 0.95 * part.upper) < 1e-6, (damping, friction, t, angle)


# ---- what a simulator makes of it ----


class Unanswered(Exception):
    """A reader cannot answer a point this time; its text says why."""


class Reader:
    """One simulator's view of one file. A driver overrides what its simulator can tell and says what it cannot."""

    format, simulator = "", ""
    # Point number -> why this simulator has no answer.
    cannot: dict[int, str] = {}
    # Warnings that are known and harmless: pattern -> why.
    harmless: dict[str, str] = {}
    warnings: str = ""
    # A reader that keeps something as single precision says how exact it is.
    exact = 1e-6
    # Whether it knows that a spring carries a part.
    springs = False
    # How many parts of a large twin it opens one by one: not all where a step of a whole kitchen takes long.
    most = math.inf

    def limits(self):
        """Joint name -> Limits."""
        raise NotImplementedError

    def bodies(self):
        """Link name -> Body."""
        raise NotImplementedError

    def handles(self, share):
        """Joint name -> where its handle is with every joint at a share of its range, world."""
        raise NotImplementedError

    def structure(self):
        """Problems of base and structure that only this reader can see."""
        return []

    def names(self):
        """Problems of names and shapes."""
        return []

    def own(self):
        """Problems of the format's own point (6 MJCF, 7 glTF, 8 USD)."""
        return []


class Engine(Reader):
    """A reader that moves."""

    step_secs = 0.0
    # The terms of the equation of motion that the engine has.
    has_friction, armature = True, 0.0

    def again(self, step_secs):
        """A fresh engine with the same file and another time step."""
        raise NotImplementedError

    def alone(self, clip, step_secs):
        """A fresh engine where the part of a `replay.Clip` meets what it meets in rapier, and nothing else does."""
        raise NotImplementedError

    def repeated(self, twin):
        """Two fresh engines and the same pull end in the same bits."""

        def run():
            engine = self.again(self.step_secs)
            engine.put({})
            for part in twin.parts[:2]:
                for _ in range(50):
                    engine.step((part, part.pull(1) * part.square(0.0), part.handle))
            return [engine.state(p.name) for p in twin.parts]

        if run() != run():
            yield "two runs end in different states"

    def put(self, positions):
        """Sets joint positions by name (others 0), at rest."""
        raise NotImplementedError

    def step(self, pull=None):
        """One time step; `pull` is (part, force in the world, point in the world)."""
        raise NotImplementedError

    def state(self, name):
        """Position and velocity of a joint."""
        raise NotImplementedError

    def touching(self, within=0.0):
        """[(what, what, distance)] of everything that moves and is that near, as it stands; negative is penetration."""
        raise NotImplementedError

    def complaints(self):
        """What the engine has said while it ran."""
        return ""

    def kinetic(self, part):
        """Kinetic energy of a part, J: with the engine's own inertia where it tells."""
        return 0.5 * (part.inertia + self.armature) * self.state(part.name)[1] ** 2

    @functools.cached_property
    def _trials(self):
        return {}

    def trial(self, part):
        """Opening and closing of a part, done once."""
        if part.name not in self._trials:
            self._trials[part.name] = Trial(self, part)
        return self._trials[part.name]


@dataclass
class Run:
    """One way of a hand with a part: when it came 95 % of it, how far it went at most, where it ended."""

    when: float | None
    farthest: float
    end: float
    speed: float
    finite: bool
    # Kinetic energy: the most of it, and the most that nobody had put in.
    peak: float
    excess: float


def run(engine, part, sense, force, settle=True):
    """Moves a part to its open (sense +1) or closed end (-1) with force(q) along `square` at the handle."""
    start = last = engine.state(part.name)[0]
    goal = (0.95 if sense > 0 else 0.05) * part.upper
    made = Run(None, start, start, 0.0, True, 0.0, 0.0)
    work, i = 0.0, 0
    until = LONGEST_SECS
    while (i := i + 1) * engine.step_secs < until:
        pull = force(last)
        engine.step((part, pull * part.square(last), part.at(part.handle, last)))
        q, v = engine.state(part.name)
        if not (math.isfinite(q) and math.isfinite(v)):
            made.finite = False
            break
        # Gravity works along the way too.
        work += (pull * part.lever + part.weight(0.5 * (q + last))) * (q - last)
        kinetic = engine.kinetic(part)
        made.peak, made.excess = max(made.peak, kinetic), max(made.excess, kinetic - work)
        if made.when is None and sense * (q - goal) >= 0:
            made.when = (i - (q - goal) / (q - last)) * engine.step_secs
            until = made.when + SETTLE_SECS if settle else 0.0
        made.farthest = sense * max(sense * made.farthest, sense * q)
        made.end, made.speed, last = q, v, q
    return made


class Trial:
    """A hand pulls a closed part open with a constant force, to be timed; then with care, and pushes it back."""

    def __init__(self, engine, part):
        engine.put({})
        self.timed = self.open = run(engine, part, 1, lambda _: part.pull(1))
        if part.heavy:
            # Nobody lets a dishwasher's door fall on its stop.
            engine.put({})
            self.open = run(engine, part, 1, lambda q: part.carry(1, q))
        self.back = run(engine, part, -1, lambda q: part.carry(-1, q))


# ---- the points ----


@dataclass(frozen=True)
class Measured:
    """A number worth reporting: the worst of it over all twins is shown."""

    what: str
    value: float
    unit: str


@dataclass(frozen=True)
class Point:
    number: int
    title: str
    check: object
    # Asked of this format alone.
    format: str | None

    def concerns(self, reader):
        """Whether the point has a meaning for the reader's format."""
        return self.format in (None, reader.format)


POINTS: list[Point] = []


def point(number, title, format=None):
    def register(check):
        POINTS.append(Point(number, title, check, format))
        return check

    return register


def off(a, b):
    """Largest difference; what is not a number is infinitely far."""
    return float(np.max(np.nan_to_num(np.abs(np.asarray(a, float) - np.asarray(b, float)), nan=math.inf)))


@point(1, "loads without a word")
def loads(twin, reader):
    for line in reader.warnings.splitlines():
        if line.strip() and not any(re.search(p, line) for p in reader.harmless):
            yield f"says: {line.strip()[:160]}"


@point(2, "limits: closed at 0, positive opens, a part stays in its furniture")
def limits(twin, reader):
    read = reader.limits()
    if set(read) != {p.name for p in twin.parts}:
        yield f"joints {sorted(read)}, the twin has {sorted(p.name for p in twin.parts)}"
        return
    for p in twin.parts:
        j = read[p.name]
        most = math.pi if p.turns else depth(p)
        if abs(j.lower) > 1e-9 or not 0 < j.upper <= most + 1e-6:
            yield f"{p.name}: limits {j.lower:.4f} to {j.upper:.4f}, wanted 0 to at most {most:.4f}"
        for what in ("effort", "velocity", "damping", "friction"):
            value = getattr(j, what)
            if value is not None and not 0 < value < 1e4:
                yield f"{p.name}: {what} {value}"
        if j.axis is not None and abs(np.linalg.norm(j.axis) - 1) > 1e-6:
            yield f"{p.name}: axis of length {np.linalg.norm(j.axis):.6f}"
    try:
        closed, ajar = reader.handles(0.0), reader.handles(0.05)
    except NotImplementedError:
        return
    for p in twin.parts:
        outward = float((ajar[p.name] - closed[p.name]) @ p.outward)
        along_face = not p.turns and abs(p.axis @ p.outward) < 0.5
        if outward <= 0 and not along_face:
            yield f"{p.name}: opening moves the handle {-1000 * outward:.1f} mm into the furniture"


def depth(p):
    """How far a slide can go before it leaves its furniture: as deep as its tray, or its carcass if it has none."""
    inside = [s for s in p.solids if s["role"] != "handle"]
    trayless = all(s["role"] == "front" for s in inside)
    reach = corners(inside + p.carcass if trayless else inside) @ p.axis
    return float(np.ptp(reach))


@point(3, "masses, centres, inertias of the boxes")
def masses(twin, reader):
    read = reader.bodies()
    for name in sorted(twin.bodies):
        wanted = twin.bodies[name]
        if name not in read:
            yield f"{name}: no mass"
            continue
        have = read[name]
        if not 0.05 <= have.mass <= 200:
            yield f"{name}: {have.mass:.4g} kg"
        if abs(have.mass - wanted.mass) > MASS_SHARE * wanted.mass:
            yield f"{name}: {have.mass:.4g} kg, density x volume is {wanted.mass:.4g} kg"
        if off(have.center, wanted.center) > 1e-4:
            yield f"{name}: centre of mass off by {1000 * off(have.center, wanted.center):.2f} mm"
        if off(have.inertia, wanted.inertia) > MASS_SHARE * np.abs(wanted.inertia).max():
            yield f"{name}: inertia off by {off(have.inertia, wanted.inertia) / np.abs(wanted.inertia).max():.2%}"
        a, b, c = np.linalg.eigvalsh(have.inertia)
        if a <= 0 or a + b < c * (1 - 1e-9):
            yield f"{name}: impossible inertia {a:.3g} {b:.3g} {c:.3g}"
        box = corners(twin.solids[name])
        if (have.center < box.min(0) - 1e-6).any() or (have.center > box.max(0) + 1e-6).any():
            yield f"{name}: centre of mass outside its boxes"


@point(4, "fixed base, nothing lost")
def base(twin, reader):
    yield from reader.structure()


@point(5, "a box per board, safe names, handles")
def names(twin, reader):
    yield from reader.names()


@point(6, "MJCF: radians, limited, excludes, visual geoms that do not collide", "MJCF")
def mjcf(twin, reader):
    yield from reader.own()


@point(7, "glTF: validator, pivots, animations, +Y up; bodies, colliders, joint frames", "glTF")
def gltf(twin, reader):
    yield from reader.own()


@point(8, "USD: articulations, joint frames, colliders, units, validators", "USD")
def usd(twin, reader):
    yield from reader.own()


@point(9, "handles closed, half, open in the same place in all files")
def places(twin, reader):
    worst = 0.0
    for share in (0.0, 0.5, 1.0):
        read = reader.handles(share)
        for p in twin.parts:
            if p.name not in read:
                yield f"{p.name}: no handle"
                continue
            error = float(np.linalg.norm(read[p.name] - p.at(p.handle, share * p.upper)))
            worst = max(worst, error)
            if not error <= PLACE_M:
                yield f"{p.name} at {share}: handle off by {1000 * error:.3f} mm"
    yield Measured("handle off by", 1e6 * worst, "um")


@point(10, "rest: closed stays closed for 2 s, touching nothing")
def rest(twin, engine):
    engine.put({})
    for _ in range(int(REST_SECS / engine.step_secs)):
        engine.step()
    moved = {p.name: engine.state(p.name)[0] for p in twin.parts}
    for p in twin.parts:
        if not abs(moved[p.name]) <= AT_REST:
            tilt = p.weight(0.0)
            yield f"{p.name} stands at {moved[p.name]:.4f} after {REST_SECS:.0f} s (gravity turns it by {tilt:+.3f})"
    if engine.touching():
        yield f"{len(engine.touching())} contacts at rest: {engine.touching()[0]}"
    if engine.complaints():
        yield engine.complaints()
    yield Measured("drift", max((abs(q) for q in moved.values()), default=0.0), "rad|m")


@point(11, "sweep: no penetration over each range, a millimetre free when closed")
def sweep(twin, engine):
    engine.put({})
    close = [c for c in engine.touching(CLEARANCE_M) if c[2] < CLEARANCE_M - 1e-6]
    if close:
        a, b, distance = min(close, key=lambda c: c[2])
        yield f"{a} and {b} are {1000 * distance:.2f} mm apart when closed"
    worst = 0.0
    for p in twin.parts:
        deepest = (0.0, "")
        for share in np.linspace(0, 1, SWEEP_POSES):
            engine.put({p.name: share * p.upper})
            for a, b, distance in engine.touching():
                deepest = min(deepest, (distance, f"{a} in {b} at {share:.2f} of its range"))
        worst = min(worst, deepest[0])
        if deepest[0] < -PENETRATION_M:
            yield f"{p.name}: {-1000 * deepest[0]:.1f} mm, {deepest[1]}"
    yield Measured("penetration", -1000 * worst, "mm")


@point(12, "hand: opens in the closed form's time, stops, closes again")
def hand(twin, engine):
    slowest, past = 0.0, 0.0
    for p in twin.moved_by(engine):
        t = engine.trial(p)
        if not all(r.finite for r in (t.timed, t.open, t.back)):
            yield f"{p.name}: not finite"
            continue
        if t.timed.when is None or t.open.when is None:
            yield f"{p.name}: does not open: {t.timed.end:.4f} of {p.upper:.4f}"
            continue
        expected = time_to(p, 0.95, p.pull(1), p.damping, p.friction if engine.has_friction else 0.0, engine.armature)
        error = t.timed.when / expected - 1
        if abs(error) > TIME_SHARE:
            yield f"{p.name}: 95 % open after {t.timed.when:.4f} s, in theory {expected:.4f} s ({error:+.1%})"
        for r, stop in ((t.timed, p.upper), (t.open, p.upper)):
            if abs(r.end - stop) > AT_REST or abs(r.speed) > FINAL_SPEED:
                yield f"{p.name}: held open at {r.end - stop:+.4f} from its stop, moving at {r.speed:.4f}"
        for r, over in (
            (t.timed, t.timed.farthest - p.upper),
            (t.open, t.open.farthest - p.upper),
            (t.back, -t.back.farthest),
        ):
            speed = math.sqrt(2 * r.peak / (p.inertia + engine.armature))
            past = max(past, over / speed)
            if over > OVERSHOOT_SECS * speed:
                yield f"{p.name}: goes {over:.4f} past its stop, arriving at {speed:.2f}"
        if t.back.when is None or abs(t.back.end) > AT_REST:
            yield f"{p.name}: closes to {t.back.end:.4f}"
        slowest = max(slowest, abs(error))
    yield Measured("t95 off by", 100 * slowest, "%")
    yield Measured("past a stop, per speed of arrival", 1000 * past, "ms")
    yield Measured("parts of one twin that were opened", len(twin.moved_by(engine)), "at most")


@point(13, "energy: no more than was put in; half the time step changes nothing")
def energy(twin, engine):
    parts = twin.moved_by(engine)
    for p in parts:
        t = engine.trial(p)
        for r in (t.timed, t.open, t.back):
            if r.excess > 0.01 * r.peak + 1e-6:
                yield f"{p.name}: {r.excess:.4f} J more than the hand and gravity put in (peak {r.peak:.2f} J)"
    fine, worst = engine.again(engine.step_secs / 2), 0.0
    # The lightest of each kind is the quickest.
    for kind in sorted({p.kind for p in parts}):
        p = min((p for p in parts if p.kind == kind), key=lambda p: p.inertia)
        fine.put({})
        coarse, half = engine.trial(p).timed.when, run(fine, p, 1, lambda _, p=p: p.pull(1), settle=False).when
        if coarse is None or half is None:
            yield f"{p.name}: does not open"
            continue
        worst = max(worst, abs(half / coarse - 1))
        if abs(half / coarse - 1) > STEP_SHARE:
            yield f"{p.name}: {coarse:.4f} s, with half the time step {half:.4f} s"
    yield Measured("half step changes", 100 * worst, "%")


@point(14, "half the dry friction does not move it")
def stays(twin, engine):
    # Engines that regularise friction let a part creep: two hundredths of the way it would go without friction.
    worst = 0.0
    for p in twin.parts:
        pull = 0.5 * p.friction
        # Half open where gravity leaves it there, else closed: what gravity alone moves says nothing about friction.
        start = next((q for q in (0.5 * p.upper, 0.0) if abs(p.weight(q)) + pull < 0.9 * p.friction), None)
        if start is None:
            continue
        engine.put({p.name: start})
        point, force = p.at(p.handle, start), pull / p.lever * p.square(start)
        for _ in range(int(1.0 / engine.step_secs)):
            engine.step((p, force, point))
        moved = abs(engine.state(p.name)[0] - start) / (0.5 * pull / p.inertia)
        worst = max(worst, moved)
        if not moved <= CREEP_SHARE:
            yield f"{p.name}: goes {moved:.1%} of the way that it would go without friction"
    yield Measured("creep under half the friction", 100 * worst, "% of the way without friction")


@point(15, "read back: limits, damping, friction as in the model")
def read_back(twin, reader):
    read = reader.limits()
    for p in twin.parts:
        if p.name not in read:
            yield f"{p.name}: lost"
            continue
        for what in ("upper", "damping", "friction", "axis"):
            have, wanted = getattr(read[p.name], what), getattr(p, what)
            if have is not None and off(have, wanted) > reader.exact * max(1, off(wanted, 0)):
                yield f"{p.name}: {what} {have}, the model has {wanted}"


@point(16, "MJCF: a recorded hand moves its part as it did in rapier", "MJCF")
def replayed(twin, engine):
    clips = replay.clips(twin)
    if not clips:
        raise Unanswered("no recorded hand: a twin of joints alone")
    law, share, length = replay.law(twin), 0.0, 0.0
    for clip in clips:
        error, rapier = replay.track(engine.alone(clip, law.step_secs), clip, law), clip.rapier_rms_m
        off_by = abs(error - rapier)
        # What is not a number does not agree.
        if not off_by <= max(replay.AGREE_SHARE * rapier, replay.AGREE_M):
            found = f"follows the hand to {1000 * error:.2f} mm, in rapier to {1000 * rapier:.2f} mm"
            yield f"{clip.part.name}, {clip.name}: {found}"
        share, length = max(share, off_by / max(rapier, 1e-9)), max(length, off_by)
    yield Measured("tracking error beside rapier's", 100 * share, "%")
    yield Measured("tracking error beside rapier's", 1000 * length, "mm")


@point(17, "the same run twice, the same file twice")
def same(twin, reader):
    yield from reader.repeated(twin)


# ---- one reader through all points ----


def evaluate(twin, reader, numbers=None):
    """[(point, status, reasons, measured)] of the points that concern the format; status ok, FAIL or n.a."""
    rows, twin = [], twin.seen_by(reader)
    for p in POINTS:
        if not p.concerns(reader) or (numbers and p.number not in numbers):
            continue
        if p.number in reader.cannot:
            rows.append((p, "n.a.", [reader.cannot[p.number]], []))
            continue
        try:
            found = list(p.check(twin, reader))
        except Unanswered as why:
            rows.append((p, "n.a.", [str(why)], []))
            continue
        except Exception as error:
            found = [f"{type(error).__name__}: {str(error).strip()[:200]}"]
        reasons = [f for f in found if isinstance(f, str)]
        rows.append((p, "FAIL" if reasons else "ok", reasons, [f for f in found if not isinstance(f, str)]))
    return rows


def all_but(points, why):
    """`cannot` of a reader that only answers some points."""
    return {p.number: why for p in POINTS if p.number not in points}
