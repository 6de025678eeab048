"""The LTL library alone, with somebody else's loop: tabular Q-learning on a grid, in plain Python and NumPy.

    python examples/ltl_alone.py 2000

The task is compiled to a table once. A state of the task is a row, a step looks up the next one, and what is learned of
a step for one row is learned for every row (counterfactual experience).
"""

import argparse

import numpy as np

from t2tl_jax import compile_tasks

SIZE, MOVES = 5, ((0, 1), (0, -1), (1, 0), (-1, 0))
PLACES = {"key": {(0, 4)}, "door": {(4, 0)}, "lava": {(2, 1), (2, 2), (1, 2)}, "grass": {(0, 4), (0, 3), (1, 4)}}
TASK = "!lava U (key & grass & (!lava U door))"


def label(place: tuple[int, int]) -> list[bool]:
    """Which propositions hold, in the order of `PLACES`; several may."""
    return [place in cells for cells in PLACES.values()]


def move(place: tuple[int, int], action: int) -> tuple[int, int]:
    """The neighbouring cell, or the same at a wall."""
    down, right = MOVES[action]
    return min(max(place[0] + down, 0), SIZE - 1), min(max(place[1] + right, 0), SIZE - 1)


def main(episodes: int = 2000) -> list[str]:
    """Learn, then walk greedily; return what was left to do after each step."""
    table = compile_tasks(TASK, tuple(PLACES))
    machine = table.automaton()  # the same as NumPy arrays
    letters = {(x, y): int(np.dot(label((x, y)), machine.letter_weights)) for x in range(SIZE) for y in range(SIZE)}
    first, verdict, following = int(machine.initial_row[0]), machine.verdict, machine.next_row
    rng, value = np.random.default_rng(0), np.zeros((SIZE, SIZE, len(verdict), len(MOVES)))
    rows = np.flatnonzero(verdict == 0)
    for _ in range(episodes):
        place, row = (0, 0), first
        for _ in range(50):
            greedy = value[*place, row] + 1e-6 * rng.random(len(MOVES))
            action = int(rng.integers(len(MOVES)) if rng.random() < 0.3 else greedy.argmax())
            after = move(place, action)
            next_rows = following[rows, letters[after]]  # the one step, seen by every sub-task
            future = np.where(verdict[next_rows] == 0, value[*after, next_rows].max(axis=-1), 0.0)
            value[*place, rows, action] += 0.2 * (verdict[next_rows] + 0.95 * future - value[*place, rows, action])
            place, row = after, int(following[row, letters[after]])
            if verdict[row]:
                break

    place, row, left = (0, 0), first, [table.text(first)]
    print(f"{place}  {left[-1]}")
    while not verdict[row] and len(left) < 50:
        place = move(place, int(value[*place, row].argmax()))
        row = int(following[row, letters[place]])
        left.append(table.text(row))
        print(f"{place}  {left[-1]}")
    return left


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("episodes", type=int, nargs="?", default=2000)
    main(**vars(parser.parse_args()))
