"""Structure of a mechanism: its links, and the rig's joints between them and with the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydpend.kinematics.names import LinkJoint
from pydpend.nodes import Joint, Rig


@dataclass(frozen=True)
class Structure:
    """Links by name and their joints.

    ``joints``: those of the rig that are of links among these only, with one link where it is a fixed pivot; the link
    nearer the ground comes first. ``inner`` (one per link): the joint from which it hangs, ``None`` where that is not
    known. ``on`` (one per link): the link from which it hangs, ``None`` for the ground or where that is not known.
    ``loops``: joints beside those, where chains close. ``outwards``: the links' indices, each after that on which it
    hangs.
    """

    links: tuple[str, ...]
    joints: tuple[Joint, ...]
    inner: tuple[Joint | None, ...]
    on: tuple[str | None, ...]
    loops: tuple[Joint, ...]
    outwards: tuple[int, ...]

    @staticmethod
    def of(rig: Rig, links: Sequence[str]) -> Structure:
        """The joints of a rig between some of its bodies, and the tree in which they hang from the ground."""
        joints = [j for j in rig.joints if set(j.bodies) <= set(links)]
        inner: dict[str, Joint] = {}
        on: dict[str, str | None] = {}
        used: list[Joint] = []
        for joint in joints:
            if len(joint.bodies) == 1 and joint.bodies[0] not in inner:
                inner[joint.bodies[0]], on[joint.bodies[0]] = joint, None
                used.append(joint)
        # Outwards from the ground, then outwards from the first link of what hangs on nothing.
        roots = [link for link in links if link not in inner]
        found = True
        reached = list(inner)
        while found or len(reached) < len(links):
            found = False
            for joint in joints:
                ends = [b for b in joint.bodies if b not in reached]
                if len(joint.bodies) == 2 and len(ends) == 1 and joint not in used:
                    inner[ends[0]] = joint
                    on[ends[0]] = next(b for b in joint.bodies if b != ends[0])
                    used.append(joint)
                    reached.append(ends[0])
                    found = True
            if not found and len(reached) < len(links):
                reached.append(next(link for link in roots if link not in reached))
                found = True
        return Structure(
            tuple(links),
            tuple(joints),
            tuple(inner.get(link) for link in links),
            tuple(on.get(link) for link in links),
            tuple(j for j in joints if j not in used),
            tuple(links.index(link) for link in reached),
        )

    def as_pendulum(self) -> Structure:
        """One or two links that may be a pendulum with a pivot and an elbow, of which no place is known.

        Others as they are.
        """
        if not self.is_chain or len(self.links) > 2 or all(self.inner):
            return self
        unknown = (
            Joint("pivot", self.links[:1], math.nan, math.nan),
            Joint("elbow", self.links, math.nan, math.nan),
        )
        joints = tuple(known or made for known, made in zip(self.inner, unknown, strict=False))
        on = (None, *self.links[:-1])
        return Structure(self.links, joints, joints, on, (), tuple(range(len(self.links))))

    def beside(self) -> Structure:
        """The first link with a pivot of its own, of which no place is known, where another link has the only one.

        Chains as they are.
        """
        if self.is_chain or self.inner[0] is not None:
            return self
        first = self.links[0]
        name = next(
            n for n in (f"pivot_{first}", f"pivot of {first}") if n not in {j.name for j in self.joints}
        )
        pivot = Joint(name, (first,), math.nan, math.nan)
        return replace(self, joints=(pivot, *self.joints), inner=(pivot, *self.inner[1:]))

    def part(self, links: Sequence[str]) -> Structure:
        """Some of the links, with the joints between them and the ground."""
        index = [self.links.index(link) for link in links]
        joints = tuple(j for j in self.joints if set(j.bodies) <= set(links))
        return Structure(
            tuple(links),
            joints,
            tuple(self.inner[k] if self.inner[k] in joints else None for k in index),
            tuple(self.on[k] if self.inner[k] in joints else None for k in index),
            tuple(j for j in self.loops if j in joints),
            tuple(index.index(k) for k in self.outwards if k in index),
        )

    def with_ancestors(self, links: Sequence[str]) -> tuple[str, ...]:
        """Links and all on which they hang, in the order of `links`."""
        wanted: set[str] = set()
        for link in links:
            now: str | None = link
            while now is not None and now not in wanted:
                wanted.add(now)
                now = self.on[self.links.index(now)]
        return tuple(link for link in self.links if link in wanted)

    @property
    def is_chain(self) -> bool:
        """Whether each link hangs from the one before it and the first from the ground, as far as the joints tell.

        A rig without joints says nothing else, so that one or two bodies are taken for a pendulum.
        """
        expected = (None, *self.links[:-1])
        hung = zip(self.inner, self.on, expected, strict=True)
        return not self.loops and all(joint is None or on == before for joint, on, before in hung)

    def between(self) -> tuple[LinkJoint, ...]:
        """The joints of two links each, the one that carries the other first."""
        out = []
        for joint in self.joints:
            if len(joint.bodies) == 2:
                first, second = joint.bodies
                if self.on[self.links.index(first)] == second and joint in self.inner:
                    first, second = second, first
                out.append(LinkJoint(joint.name, (first, second)))
        return tuple(out)
