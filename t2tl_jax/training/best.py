"""The best parameters so far, scored inside the compiled program by the episodes that they played."""

from functools import partial

import jax
import jax.numpy as jnp

from t2tl_jax.training.types import EpisodeTotals, Params

MINIMUM_EPISODES = 16
"""Fewer finished episodes than this score nothing: one lucky episode is no record."""


def keep_best(
    params: Params, totals: EpisodeTotals, frames: int, best_params: Params, best_score: jax.Array
) -> tuple[Params, jax.Array]:
    """The better of two parameter sets and its score, the average discounted return.

    Episodes that end are not all that there are: where half of the robots stand still, the other half's episodes make
    up the average until the time limit comes. So steps that ended episodes do not account for count as return 0.

    Args:
        params: those that played the episodes of `totals` (not those that the episodes led to).
        totals: sums over these episodes.
        frames: environment steps that were taken meanwhile, of all environments together.
        best_params: the best ones until now.
        best_score: their score, float32 scalar.
    """
    average = totals.discounted_return / jnp.maximum(totals.episodes, 1)
    share = jnp.minimum(totals.length / frames, 1.0)
    average = jnp.where(average > 0, average * share, average)  # a loss is none the smaller for it
    score = jnp.where(totals.episodes >= MINIMUM_EPISODES, average, -jnp.inf)
    is_better = score > best_score
    return jax.tree.map(partial(jnp.where, is_better), params, best_params), jnp.maximum(score, best_score)
