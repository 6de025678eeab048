"""WaterWorld once more, body by body as it is described, in NumPy and float64; shares nothing with the package."""

import math
import random

import numpy as np

SIZE, SPEED, LIMIT, TIME = 400.0, 30.0, 90.0, 0.1
PUSH = {0: (0, 0), 1: (0, 1), 2: (1, 0), 3: (0, -1), 4: (-1, 0)}


class ReferenceWorld:
    """Balls in slots, `per_colour` of each colour next to each other; one radius per ball and one for the agent."""

    def __init__(self, agent, balls, velocities, per_colour=2, radii=None, agent_radius=15.0):
        self.agent = [np.array(agent, float), np.zeros(2)]
        self.balls = [[np.array(p, float), np.array(v, float)] for p, v in zip(balls, velocities, strict=True)]
        self.per_colour, self.agent_radius = per_colour, agent_radius
        self.radii = [15.0] * len(self.balls) if radii is None else list(radii)
        self.smallest_margin = math.inf
        self.bounces = 0
        self.touching = self.contacts()

    def contacts(self):
        found = set()
        for k, (position, _) in enumerate(self.balls):
            gap = math.dist(position, self.agent[0]) - (self.radii[k] + self.agent_radius)
            self.smallest_margin = min(self.smallest_margin, abs(gap))
            if gap <= 0:
                found.add(k)
        return found

    def step(self, action):
        """Move; returns the colours whose contact began, and those in contact."""
        self.agent[1] = np.clip(self.agent[1] + SPEED * np.array(PUSH[action], float), -LIMIT, LIMIT)
        for body, radius in [(self.agent, self.agent_radius), *zip(self.balls, self.radii, strict=True)]:
            body[0] = body[0] + TIME * body[1]
            for axis in (0, 1):
                if body[0][axis] - radius < 0:
                    body[0][axis], body[1][axis] = radius, -body[1][axis]
                    self.bounces += 1
                elif body[0][axis] + radius > SIZE:
                    body[0][axis], body[1][axis] = SIZE - radius, -body[1][axis]
                    self.bounces += 1
        before, self.touching = self.touching, self.contacts()
        return self.colours(self.touching - before), self.colours(self.touching)

    def colours(self, balls):
        return {ball // self.per_colour for ball in balls}

    def observation(self):
        parts = [self.agent[0] / SIZE, self.agent[1] / LIMIT]
        for position, velocity in self.balls:
            parts += [(position - self.agent[0]) / SIZE, (velocity - self.agent[1]) / (SPEED + LIMIT)]
        return np.concatenate(parts)


def published_map(seed, balls):
    """Agent, ball positions and ball velocities of a numbered map, all radii 15."""
    draw = random.Random(seed).random

    def spot():
        return np.array([30 + 370 * draw(), 30 + 370 * draw()])

    agent, positions, velocities = spot(), [], []
    for _ in range(balls):
        angle = 2 * math.pi * draw()
        velocities.append((30 * math.sin(angle), 30 * math.cos(angle)))
        while True:
            centre = spot()
            if math.dist(centre, agent) > 60 and all(math.dist(centre, other) >= 30 for other in positions):
                break
        positions.append(centre)
    return agent, np.array(positions), np.array(velocities)
