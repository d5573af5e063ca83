"""The scenes of `person_films`: experiments of students and laboratories, and what a person wants from each."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

import numpy as np

from tests.validation.person_films import (
    SKIN,
    Picture,
    Place,
    Scene,
    ball,
    block,
    clutter,
    curtain,
    disc,
    hand,
    line,
    moved,
    person,
    plaster,
    shake,
    tiles,
    wood,
)

Places = Mapping[str, Place | None]


def swing(t: float, start: float, period: float, decay: float) -> float:
    """A swing that dies away."""
    return float(start * np.exp(-t / decay) * np.cos(2 * np.pi * t / period))


def hang(pivot: Place, length: float, angle: float) -> Place:
    """The end of a link that hangs."""
    return pivot[0] + length * float(np.sin(angle)), pivot[1] + length * float(np.cos(angle))


def bob_curtain() -> Scene:
    """A steel ball on a thread before a curtain, with exposure that drifts."""
    behind, pivot = curtain(1, (640, 480)), (320.0, 20.0)

    def at(t: float) -> Place:
        return hang(pivot, 360, swing(t, 0.45, 36.2, 900))

    def draw(t: float) -> Picture:
        out = behind.copy()
        line(out, pivot, at(t), 0.8, (200, 195, 190), 0.8)
        ball(out, at(t), 17, (92, 95, 104))
        return out

    def gain(t: float) -> float:
        return 1 + 0.06 * float(np.sin(t / 25))

    return Scene((640, 480), 30, 220, draw, lambda t: {"bob": at(t)}, 6, gain=gain, wants="the bob")


def puck_tiles() -> Scene:
    """A red puck that a hand pushes over tiles, to a rim and to rest; MPEG-4 at 60 frames a second."""
    behind = tiles(2, (960, 540), 70)

    def at(t: float) -> Place:
        if t < 30:
            return 150 + 0.03 * t * t, 380.0
        u = min(t - 30, 130.0)
        s = 177 + 7.2 * u - 0.0277 * u * u
        return (s if s < 860 else 1720 - s), 380 - 0.9 * u + 0.0035 * u * u

    def draw(t: float) -> Picture:
        out = behind.copy()
        disc(out, (at(t)[0] + 5, at(t)[1] + 6), 24, (40, 38, 36), 0.45)
        disc(out, at(t), 24, (190, 40, 45))
        disc(out, at(t), 9, (235, 235, 230))
        back = max(0.0, t - 28) * 6
        hand(out, (at(min(t, 30))[0] - 26 - back, at(min(t, 30))[1] + 2), 2.9, 1.1)
        return out

    codec = "-c:v mpeg4 -q:v 5"
    return Scene((960, 540), 60, 220, draw, lambda t: {"puck": at(t)}, 8, codec, "avi", wants="the puck")


def balls_cross() -> Scene:
    """Two orange balls of one look that are thrown through each other's paths."""
    behind = clutter(3, plaster(3, (640, 360), (165, 170, 150)), 5)

    def places(t: float) -> dict[str, Place | None]:
        a = (-30 + 9.0 * t, 300 - 9.5 * t + 0.13 * t * t)
        b = (670 - 8.2 * (t - 3), 260 - 8.1 * (t - 3) + 0.125 * (t - 3) ** 2)
        return {"left": a, "right": b if t > 3 else None}

    def draw(t: float) -> Picture:
        out = behind.copy()
        for place in places(t).values():
            if place:
                ball(out, place, 10, (225, 120, 40))
        return out

    return Scene((640, 360), 30, 76, draw, places, 5, wants="both balls")


def building() -> Scene:
    """A model of three storeys on a shaking table, a dark sticker on a card at each floor."""
    behind = wood(4, (640, 480), (175, 140, 100))
    shapes = np.array([[0.25, 0.55, 0.9], [0.75, 0.45, -0.6]])

    def shifts(t: float) -> list[float]:
        ground = 4 * float(np.sin(t / 9))
        m = (
            9 * np.sin(t / 7.1) * np.exp(-((t - 150) ** 2) / 9000),
            4 * np.sin(t / 2.9) * np.exp(-((t - 80) ** 2) / 4000),
        )
        return [ground] + [ground + float(m[0] * shapes[0, k] + m[1] * shapes[1, k]) for k in range(3)]

    def places(t: float) -> dict[str, Place | None]:
        return {f"floor{k}": (320 + d, 420.0 - 115 * k) for k, d in enumerate(shifts(t))}

    def draw(t: float) -> Picture:
        out = behind.copy()
        d = shifts(t)
        for k in range(4):
            y = 420 - 115 * k
            if k:
                for x in (215, 425):
                    line(out, (x + d[k - 1], y + 115.0), (x + d[k], float(y)), 3, (190, 192, 198))
            block(out, (320 + d[k], float(y)), (120, 8), 0, (130, 132, 140))
            block(out, (320 + d[k], float(y)), (14, 14), 0, (232, 230, 224))
            disc(out, (320 + d[k], float(y)), 6, (30, 30, 32))
        return out

    codec = "-c:v libx264 -preset veryfast -b:v 2500k"
    return Scene(
        (640, 480), 60, 300, draw, places, 4, codec, noise=2.5, optional=["floor0"], wants="the floors"
    )


def wing() -> Scene:
    """A blue wing that flutters in a tunnel, five white stickers on it."""
    behind = clutter(5, plaster(5, (800, 450), (105, 110, 112)), 6)

    def places(t: float) -> dict[str, Place | None]:
        rise = np.exp(min(t, 200) / 90) * 0.9

        def bend(s: float) -> float:
            return float(rise * (9 * s**2 * np.sin(t / 4.3) + 5 * s**1.5 * np.sin(t / 4.3 + 0.9)))

        return {f"s{k}": (140 + 125.0 * k, 240 + bend((k + 0.6) / 4)) for k in range(5)}

    def draw(t: float) -> Picture:
        out = behind.copy()
        dots = [p for p in places(t).values() if p]
        for a, b in itertools.pairwise(dots):
            line(out, a, b, 21, (45, 75, 140))
        for p in dots:
            disc(out, p, 5.5, (225, 226, 220))
        return out

    return Scene((800, 450), 120, 240, draw, places, 4, optional=["s0"], wants="the stickers")


def leg() -> Scene:
    """A person on a treadmill, three white markers on the near leg."""
    behind = clutter(6, plaster(6, (640, 480), (150, 150, 155)), 9)

    def joints(t: float, phase: float) -> tuple[Place, Place, Place]:
        p = 2 * np.pi * t / 52 + phase
        hip = (330 + 3 * float(np.sin(2 * p)), 120 + 4 * float(np.sin(2 * p + 1)))
        thigh = 0.08 + 0.42 * float(np.sin(p))
        knee = hang(hip, 140, thigh)
        ankle = hang(knee, 140, thigh - 0.35 - 0.5 * float(np.sin(p - 1.2)))
        return hip, knee, ankle

    def draw(t: float) -> Picture:
        out = behind.copy()
        block(out, (330, 440), (260, 16), 0, (45, 45, 48))
        for phase, shade in ((np.pi, (58, 62, 80)), (0.0, (40, 45, 62))):
            hip, knee, ankle = joints(t, phase)
            line(out, hip, knee, 26, shade)
            line(out, knee, ankle, 18, shade)
            line(out, ankle, (ankle[0] + 40, ankle[1] + 12), 11, (120, 50, 40))
        hip, knee, ankle = joints(t, 0)
        line(out, (hip[0], hip[1] - 20), (hip[0], -60), 48, (60, 90, 80))
        swing_ = 40 * float(np.sin(2 * np.pi * t / 52 + np.pi))
        line(out, (hip[0], -30), (hip[0] + swing_, 130), 13, SKIN)
        for p in (hip, knee, ankle):
            disc(out, p, 7, (238, 238, 235))
        return out

    def places(t: float) -> Places:
        return dict(zip(("hip", "knee", "ankle"), joints(t, 0), strict=True))

    return Scene((640, 480), 50, 260, draw, places, 5, wants="hip, knee and ankle")


def equal_luma() -> Scene:
    """A green ball of the brightness of the rough red wall behind it, small picture, tossed up thrice."""
    behind = plaster(7, (320, 240), (168, 96, 90), 1.5)

    def at(t: float) -> Place:
        u = t % 42
        return 60 + 1.3 * t, 210 - 9.2 * u + 0.219 * u * u

    def draw(t: float) -> Picture:
        out = behind.copy()
        ball(out, at(t), 8, (60, 148, 72), 0.3)
        return out

    return Scene((320, 240), 25, 126, draw, lambda t: {"ball": at(t)}, 4, wants="the ball")


def walker() -> Scene:
    """A yellow bob on a string in a room, a person walks behind it and back."""
    behind, pivot = clutter(8, plaster(8, (854, 480), (185, 178, 165)), 10), (420.0, -40.0)

    def at(t: float) -> Place:
        return hang(pivot, 390, swing(t, 0.5, 44.0, 500))

    def draw(t: float) -> Picture:
        out = behind.copy()
        person(out, -80 + 7 * t if t < 150 else 970 - 6.5 * (t - 150), t, 400, (90, 60, 90))
        line(out, pivot, at(t), 0.9, (70, 70, 70), 0.8)
        ball(out, at(t), 15, (222, 190, 40))
        return out

    return Scene((854, 480), 30, 300, draw, lambda t: {"bob": at(t)}, 5, wants="the bob")


def floor_roll() -> Scene:
    """A blue ball that rolls over boards with its shadow, enters and leaves."""
    behind = wood(9, (960, 540))

    def at(t: float) -> Place:
        return (-40 + 8.4 * t - 0.006 * t * t, 300 + 30 * float(np.sin(t / 60)))

    def draw(t: float) -> Picture:
        out = behind.copy()
        x, y = at(t)
        line(out, (x + 10, y + 24), (x + 38, y + 28), 13, (30, 22, 15), 0.55)
        ball(out, (x, y), 25, (40, 70, 170))
        return out

    return Scene((960, 540), 120, 150, draw, lambda t: {"ball": at(t)}, 7, shutter=0.3, wants="the ball")


def golf() -> Scene:
    """A golf ball in flight, streaks of three times its size, grass below."""
    behind = plaster(10, (720, 480), (100, 125, 140), 0.6)
    behind[330:] = plaster(11, (720, 150), (70, 95, 50), 3.0)

    def at(t: float) -> Place:
        return (40 + 26.0 * t, 400 - 29.5 * t + 1.08 * t * t) if t >= 0 else (40.0, 400.0)

    def draw(t: float) -> Picture:
        out = behind.copy()
        ball(out, at(t - 12), 6, (236, 236, 232), 0.2)
        club = -1.2 + min(t - 12, 8) * 0.16
        line(out, (10, 250), (10 + 160 * np.sin(club + 1.3), 250 + 160 * np.cos(club + 1.3)), 4, (45, 45, 50))
        return out

    return Scene(
        (720, 480),
        30,
        44,
        draw,
        lambda t: {"ball": at(t - 12)},
        8,
        shutter=0.6,
        exposures=17,
        wants="the ball",
    )


def double_arm() -> Scene:
    """A double pendulum of dark arms with a red and a blue sticker, a camera held in a hand."""
    behind, hold = clutter(12, plaster(12, (1280, 720), (180, 175, 165)), 8), shake(12, 240, 1.5)
    steps: list[tuple[float, float]] = []
    a, b, va, vb = 1.9, 2.3, 0.0, 0.0
    for _ in range(260 * 20):
        steps.append((a, b))
        s, c, g, h = np.sin(a - b), np.cos(a - b), 0.011, 0.05
        den = 2 - c * c
        aa = (-g * (2 * np.sin(a) - np.sin(b) * c) - s * (vb * vb + va * va * c)) / den
        ab = (2 * s * (va * va + vb * vb * c / 2) + 2 * g * (np.sin(a) * c - np.sin(b))) / den
        va, vb = va + h * aa - h * 0.002 * va, vb + h * ab - h * 0.002 * vb
        a, b = a + h * va, b + h * vb

    def pose(t: float) -> tuple[Place, Place, Place]:
        first, second = steps[max(0, min(int(t * 20), len(steps) - 1))]
        pivot = (640.0, 330.0)
        elbow = hang(pivot, 150, first)
        return pivot, elbow, hang(elbow, 150, second)

    def shifted(t: float, p: Place) -> Place:
        dx, dy = hold(t)
        return p[0] + dx, p[1] + dy

    def draw(t: float) -> Picture:
        out = moved(behind, hold(t))
        pivot, elbow, tip = (shifted(t, p) for p in pose(t))
        line(out, pivot, elbow, 16, (50, 42, 38))
        line(out, elbow, tip, 14, (60, 52, 46))
        disc(out, elbow, 10, (205, 40, 50))
        disc(out, tip, 10, (40, 80, 200))
        return out

    def places(t: float) -> Places:
        return {n: shifted(t, p) for n, p in zip(("elbow", "tip"), pose(t)[1:], strict=True)}

    return Scene((1280, 720), 30, 240, draw, places, 8, exposures=3, wants="elbow and tip")


def bounce() -> Scene:
    """A tennis ball that bounces, dark floor, comes in and goes out; 50 frames a second."""
    behind = clutter(13, plaster(13, (640, 480), (120, 118, 125)), 6)
    behind[430:] = wood(13, (640, 50))
    heights = []
    y, v = 60.0, 0.0
    for _ in range(200 * 10):
        heights.append(y)
        v += 0.032
        y += 0.1 * v
        if y > 415:
            y, v = 415.0, -0.82 * v

    def at(t: float) -> Place:
        return (-20 + 3.9 * t, heights[max(0, min(int(10 * t), 1999))])

    def draw(t: float) -> Picture:
        out = behind.copy()
        disc(out, (at(t)[0], 432), 11, (35, 30, 25), 0.4)
        ball(out, at(t), 13, (190, 205, 60), 0.3)
        return out

    return Scene((640, 480), 50, 180, draw, lambda t: {"ball": at(t)}, 5, wants="the ball")


def spring() -> Scene:
    """A brass weight on a spring, up and down before a poster wall."""
    behind = clutter(14, plaster(14, (480, 640), (200, 196, 185)), 12)

    def at(t: float) -> Place:
        return (250 + 5 * float(np.sin(t / 31)), 370 + swing(t, 90, 27.3, 300))

    def draw(t: float) -> Picture:
        out = behind.copy()
        x, y = at(t)
        coils = 24
        for k in range(coils):
            top, step = 30.0, (y - 60) / coils
            line(out, (x - 11, top + k * step), (x + 11, top + (k + 0.5) * step), 1.3, (120, 122, 128))
            line(out, (x + 11, top + (k + 0.5) * step), (x - 11, top + (k + 1) * step), 1.3, (95, 96, 104))
        block(out, (x, y), (24, 30), 0, (176, 130, 60))
        block(out, (x - 10, y), (3, 30), 0, (225, 200, 140))
        return out

    return Scene((480, 640), 30, 260, draw, lambda t: {"weight": at(t)}, 8, wants="the weight")


def wheel() -> Scene:
    """A grey wheel with one white sticker, read row by row (rolling shutter)."""
    behind = curtain(15, (640, 480), (70, 85, 90))

    def at(t: float) -> Place:
        return hang((320.0, 240.0), 130, 0.16 * t - 0.0001 * t * t)

    def draw(t: float) -> Picture:
        out = behind.copy()
        disc(out, (320, 240), 165, (110, 112, 116))
        for k in range(5):
            line(
                out,
                (320, 240),
                hang((320, 240), 160, 0.16 * t - 0.0001 * t * t + 0.7 + k * 1.2566),
                6,
                (80, 82, 88),
            )
        disc(out, at(t), 9, (240, 240, 236))
        return out

    def seen(t: float) -> Place:
        p = at(t)
        for _ in range(4):
            p = at(t + (int(p[1] * 8 / 480) + 0.0) / 8 - 0.5)
        return p

    return Scene(
        (640, 480), 30, 240, draw, lambda t: {"mark": seen(t)}, 6, bands=8, exposures=3, wants="the sticker"
    )


def toy_car() -> Scene:
    """A dark car with a bright sticker on a wooden ramp: rolls in, hits a block and rests."""
    behind = wood(16, (640, 360), (160, 120, 75))

    def x(t: float) -> float:
        u = max(0.0, t - 15)
        s = -60 + 0.11 * u * u
        hit = (500 + 60) / 0.11
        if u * u > hit:
            w = min(u - hit**0.5, 22.0)
            s = 500 - 2.6 * w + 0.059 * w * w
        return s

    def draw(t: float) -> Picture:
        out = behind.copy()
        block(out, (575, 210), (22, 40), 0, (90, 40, 40))
        p = x(t)
        block(out, (p + 3, 238), (52, 6), 0, (45, 33, 20))
        block(out, (p, 215), (50, 16), 0, (38, 40, 46))
        block(out, (p - 6, 195), (25, 10), 0, (50, 52, 60))
        for wx in (-30, 30):
            disc(out, (p + wx, 231), 10, (20, 20, 20))
            disc(out, (p + wx, 231), 5, (140, 140, 140))
        disc(out, (p, 213), 8, (240, 220, 60))
        return out

    return Scene((640, 360), 60, 190, draw, lambda t: {"sticker": (x(t), 213.0)}, 6, wants="the sticker")


def glider_dots() -> Scene:
    """A white card with two dark dots on a glider that goes to and fro; a hand lets it go."""
    behind = clutter(17, plaster(17, (640, 360), (95, 92, 88)), 8)

    def at(t: float) -> float:
        return 330 + (-230 if t < 25 else -230 * float(np.cos((t - 25) / 17) * np.exp(-(t - 25) / 400)))

    def draw(t: float) -> Picture:
        out = behind.copy()
        block(out, (320, 275), (320, 12), 0, (170, 172, 176))
        block(out, (at(t), 235), (60, 28), 0, (228, 226, 220))
        for dx in (-35, 35):
            disc(out, (at(t) + dx, 235), 9, (28, 28, 34))
        if t < 45:
            hand(out, (at(min(t, 25)) - 65 - 8 * max(0.0, t - 25), 235), 3.0, 0.9)
        return out

    def places(t: float) -> Places:
        return {"dotA": (at(t) - 35, 235.0), "dotB": (at(t) + 35, 235.0)}

    return Scene((640, 360), 60, 300, draw, places, 5, "-c:v mpeg4 -q:v 6", "avi", wants="both dots")


SCENES: Mapping[str, Callable[[], Scene]] = {
    scene.__name__: scene
    for scene in (
        bob_curtain,
        puck_tiles,
        balls_cross,
        building,
        wing,
        leg,
        equal_luma,
        walker,
        floor_roll,
        golf,
        double_arm,
        bounce,
        spring,
        wheel,
        toy_car,
        glider_dots,
    )
}
