"""The best parameters of a run: at some points of it, those so far play episodes that nothing else is judged by.

Training learns from other episodes and the reported evaluation plays others again, so that a lucky choice does not pass
for a good policy. Where maps are random these are other maps, and where tasks are random, other tasks.
"""

import threading
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from t2tl_jax.evaluation.episodes import player_of_seeds
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.training import hosts
from t2tl_jax.training.devices import padded, put
from t2tl_jax.training.program import place_params
from t2tl_jax.training.seeds import SELECTION, stream_keys
from t2tl_jax.training.types import Params


def points(config: Config) -> Sequence[int]:
    """The iterations after which parameters are scored: evenly spaced over the second half, the last one among them.

    A run that may converge before that has as many in its first half.
    """
    parts = 2 * config.selection.points
    first = 1 if config.convergence.window else config.selection.points + 1
    if parts >= config.iterations:  # every iteration from the first of them on, however many points were asked for
        return range(-(-config.iterations * first // parts), config.iterations + 1)
    return tuple(sorted({-(-config.iterations * part // parts) for part in range(first, parts + 1)})) if parts else ()


@dataclass(frozen=True)
class Scores:
    """How the sampled policies of all seeds did."""

    discounted_return: np.ndarray
    """float64[seeds], mean over the episodes."""
    success_rate: np.ndarray
    """float64[seeds]."""


@dataclass(frozen=True)
class Selected:
    """The best parameters of every seed so far."""

    params: Params
    """NumPy arrays with leading axis [seeds]."""
    scores: Scores
    """What they scored."""
    iteration: np.ndarray
    """int64[seeds], behind which of them."""

    def info(self) -> dict[str, list[float]]:
        """All but the parameters, for a checkpoint."""
        return {
            "iteration": self.iteration.tolist(),
            "discounted_return": self.scores.discounted_return.tolist(),
            "success_rate": self.scores.success_rate.tolist(),
        }

    @classmethod
    def of(cls, params: Params, info: Mapping[str, list[float]]) -> "Selected":
        """What `info` and the parameters came from."""
        scores = Scores(np.array(info["discounted_return"], float), np.array(info["success_rate"], float))
        return cls(params, scores, np.array(info["iteration"], int))


class Scorer:
    """Plays complete episodes with parameters of every seed, always the same ones; compiles in a thread of its own."""

    def __init__(self, experiment: Experiment) -> None:
        """Begin to compile."""
        self._experiment = experiment
        self._future: Future[Any] = Future()
        self.thread = threading.Thread(target=self._compile, name="selection")
        self.thread.start()

    def __call__(self, params: Params) -> Scores:
        """The scores of parameters with leading axis [seeds]; waits for the program, and raises what went wrong."""
        play, env_params, keys, device = self._future.result()
        played = play(params if hosts.are_several() else jax.device_put(params, device), env_params, keys)
        episodes = self._experiment.program.unpadded(played)
        return Scores(
            np.asarray(episodes.discounted_return, float).mean(-1), np.asarray(episodes.success, float).mean(-1)
        )

    def check(self) -> None:
        """Raise what went wrong so far, rather than hours later."""
        if self._future.done():
            self._future.result()

    def _compile(self) -> None:
        experiment = self._experiment
        try:
            config, sharding = experiment.config, experiment.program.sharding
            device = sharding or jax.sharding.SingleDeviceSharding(jax.devices()[0])
            env_params = place_params(experiment.env_params("selection"), sharding)
            keys = padded(stream_keys(experiment.seeds, SELECTION), sharding)
            keys = jax.device_put(keys, device) if sharding is None else put(keys, sharding)
            play = player_of_seeds(
                experiment.task_env,
                experiment.agent,
                config.selection.episodes,
                config.episode_length,
                config.learner.discount,
                deterministic=False,
            )
            params = jax.tree.map(
                lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=device), experiment.program.state.params
            )
            self._future.set_result((play.lower(params, env_params, keys).compile(), env_params, keys, device))
        except BaseException as error:  # handed to whoever waits, whatever it is
            self._future.set_exception(error)


class Selection:
    """Keeps the best parameters of every seed: by discounted return, then by success, then the later ones.

    Parameters that compete with none are not scored.
    """

    def __init__(self, config: Config, earlier: Selected | None = None) -> None:
        """Begin, or go on with what an earlier session selected, unless it came before the first point of this one."""
        self._points = points(config)
        if earlier is not None and self._points and (earlier.iteration < self._points[0]).any():
            earlier = None
        self.best = earlier
        """Of the points so far; None before the first one."""

    def competes(self, iteration: int) -> bool:
        """Whether the parameters behind an iteration are to be scored."""
        return iteration in self._points and (len(self._points) > 1 or self.best is not None)

    def is_near(self, iteration: int) -> bool:
        """Whether half of the way to the next parameters that are to be scored is done: time to compile for it."""
        following = bisect_left(self._points, iteration)
        if following == len(self._points):
            return False
        return self._points[following] <= 2 * iteration and self.competes(self._points[following])

    def add(self, iteration: int, params: Params, scores: Scores) -> None:
        """Let parameters compete."""
        self.best = self.with_last(iteration, params, scores)

    def with_last(self, iteration: int, params: Params, scores: Scores) -> Selected:
        """What would be the best parameters with these among them: those of a run that ends here."""
        count, best = len(scores.success_rate), self.best
        new = Selected(params, scores, np.full(count, iteration))
        if best is None:
            return _chosen(np.ones(count, bool), new, new)
        gained, before = scores.discounted_return, best.scores.discounted_return
        better = (gained > before) | ((gained == before) & (scores.success_rate >= best.scores.success_rate))
        return _chosen(better, new, best)


def _chosen(which: np.ndarray, new: Selected, old: Selected) -> Selected:
    """By seed, `new` where `which` is true; always copies, since training goes on in the memory of its parameters."""

    def choose(a: Any, b: Any) -> np.ndarray:
        return np.where(which.reshape(-1, *[1] * (np.ndim(a) - 1)), np.asarray(a), np.asarray(b))

    scores = Scores(
        choose(new.scores.discounted_return, old.scores.discounted_return),
        choose(new.scores.success_rate, old.scores.success_rate),
    )
    return Selected(
        jax.tree.map(choose, jax.device_get(new.params), old.params if old is not new else jax.device_get(new.params)),
        scores,
        choose(new.iteration, old.iteration),
    )
