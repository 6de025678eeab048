"""The attention figure over seeds: what each attends to, what it depends on, where it goes, and whether these agree.

One reading is one formula of one seed at one stage of its training. The summary over seeds has intervals; both can be
stored as files, from which tables and figures can be made again.
"""

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np
from flax import linen as nn

from t2tl_jax.evaluation import attention as reading
from t2tl_jax.evaluation.attention import Attention, Queries, Removal
from t2tl_jax.evaluation.first_entered import first_entered, shares
from t2tl_jax.evaluation.statistics import Estimate, mean, mean_rate, rate
from t2tl_jax.ltl.tokens import token_names
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, Params


@dataclass(frozen=True)
class Reading:
    """One formula, read in one seed at one stage."""

    seed: int
    """Number of the seed."""
    stage: str
    """When: "start" or "end" of training."""
    row: int
    """Of the task table."""
    whole: bool
    """Whether an episode begins in this row."""
    formula: str
    """What it says."""
    tokens: tuple[str, ...]
    """Its n tokens."""
    attention: Attention | None
    """What each token receives; None for an encoder without attention."""
    removal: Removal
    """What the decisions lose without each token."""
    first: dict[str, float]
    """Share of the policy's episodes by the proposition that they enter first."""

    @property
    def agrees(self) -> bool | None:
        """Whether token* is also the token without which the policy moves most; None where either is unknown."""
        if self.attention is None or self.removal.strongest is None:
            return None
        return self.attention.strongest == self.removal.strongest

    def cells(self) -> dict[str, Any]:
        """One line of a table; empty cells are unknown."""
        star = None if self.attention is None else self.attention.strongest
        needed = self.removal.strongest
        return {
            "seed": self.seed,
            "stage": self.stage,
            "row": self.row,
            "formula": self.formula,
            "token_star": None if star is None else self.tokens[star],
            "token_star_position": star,
            "needed_token": None if needed is None else self.tokens[needed],
            "needed_token_position": needed,
            "agrees": None if self.agrees is None else int(self.agrees),
            "rank_correlation": None if self.attention is None else self.removal.agreement(self.attention),
            "observations": self.removal.observations,
            "observations_met_in_row": int(self.removal.met),
            **{f"first_{name}": share for name, share in self.first.items()},
        }


@dataclass(frozen=True, eq=False)
class Reader:
    """Everything that does not differ between seeds and stages."""

    env: TaskEnv
    """The environment with the task."""
    agent: Agent
    """Offers ``compare``."""
    encoder: nn.Module
    """Its task encoder, which reads tokens."""
    episodes: int
    """Played to meet observations, and to see what is entered first."""
    episode_length: int
    """Time limit, in steps."""
    layers: tuple[int, ...] | None = None
    """As `attention_received`."""
    queries: Queries = "all"
    """As `attention_received`."""

    def attention(self, params: Params, row: int) -> Attention | None:
        """What the tokens of a row receive; None for an encoder without attention."""
        if not reading.has_attention(self.encoder):
            return None
        own, table = params["params"]["task_encoder"], self.env.table
        return reading.attention_received(self.encoder, own, table, row, self.layers, self.queries)

    def removal(self, params: Params, env_params: TaskParams, key: jax.Array, row: int) -> Removal:
        """What the decisions of a seed lose without each token of a row."""
        play = _played(reading.meet, self.env, self.agent, self.episodes, self.episode_length)
        met = play(params, env_params, key, row)
        codes = reading.codes_without_tokens(self.encoder, params["params"]["task_encoder"], self.env.table, row)
        return reading.removal_effects(self.agent, params, codes, met)

    def first(self, params: Params, env_params: TaskParams, key: jax.Array) -> dict[str, float]:
        """Share of episodes by the proposition that they enter first."""
        play = _played(_first, self.env, self.agent, self.episodes, self.episode_length)
        return shares(np.asarray(play(params, env_params, key, 0)), tuple(self.env.table.propositions))

    def read(
        self, seed: int, stage: str, params: Params, env_params: TaskParams, key: jax.Array, rows: Sequence[int]
    ) -> list[Reading]:
        """Readings of one seed at one stage, one a row.

        Args:
            seed: its number.
            stage: "start" or "end".
            params: of this seed, then.
            env_params: of this seed.
            key: of the episodes.
            rows: open rows of the table.
        """
        table, first = self.env.table, self.first(params, env_params, key)
        whole = set(np.asarray(table.initial_row).tolist())
        found = []
        for row in rows:
            ids = np.asarray(table.tokens[row])[np.asarray(table.mask[row])].tolist()
            found.append(
                Reading(
                    seed,
                    stage,
                    row,
                    row in whole,
                    table.text(row),
                    token_names(ids, table.propositions),
                    self.attention(params, row),
                    self.removal(params, env_params, key, row),
                    first,
                )
            )
        return found


def _played(function: Any, env: TaskEnv, agent: Agent, episodes: int, episode_length: int) -> Any:
    """The jitted `function`, one program for all seeds, stages and rows."""
    return partial(_play, function, env, agent, episodes, episode_length)


@partial(jax.jit, static_argnums=(0, 1, 2, 3, 4))
def _play(
    function: Any,
    env: TaskEnv,
    agent: Agent,
    episodes: int,
    episode_length: int,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    row: jax.Array,
) -> Any:
    return function(env, agent, params, env_params, key, row, episodes, episode_length)


def _first(
    env: TaskEnv,
    agent: Agent,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    row: jax.Array,
    episodes: int,
    episode_length: int,
) -> jax.Array:
    del row
    return first_entered(env, agent, params, env_params, key, episodes, episode_length)


def summarise(readings: Sequence[Reading]) -> dict[str, Any]:
    """What the seeds have in common, by stage: nested dictionaries for JSON, estimates with their intervals.

    `token_star` and `needed_token` count seeds, by token of the whole task. `agreement` is the share of seeds in which
    these two are one token of the whole task, `agreement_over_rows` the mean over seeds of the share of rows in which
    they are. `first` are means over seeds of the share of episodes that enter a proposition first, and
    `attention_received` those of what each token of the whole task receives.
    """
    stages = dict.fromkeys(one.stage for one in readings)
    return {stage: _stage([one for one in readings if one.stage == stage]) for stage in stages}


def _stage(readings: Sequence[Reading]) -> dict[str, Any]:
    whole = [r for r in readings if r.whole] or list(readings)
    cells = [r.cells() for r in whole]
    agrees = [r.agrees for r in whole if r.agrees is not None]
    shares_of_rows = []
    for seed in dict.fromkeys(r.seed for r in readings):
        known = [r.agrees for r in readings if r.seed == seed and r.agrees is not None]
        if known:
            shares_of_rows.append(float(np.mean(known)))
    correlations = [cell["rank_correlation"] for cell in cells if cell["rank_correlation"] is not None]
    received = [r.attention.total for r in whole if r.attention is not None]
    return {
        "seeds": [r.seed for r in whole],
        "formula": whole[0].formula,
        "tokens": list(whole[0].tokens),
        "token_star": _counts(cells, "token_star"),
        "needed_token": _counts(cells, "needed_token"),
        "agreement": asdict(rate(sum(agrees), len(agrees))),
        "agreement_over_rows": asdict(mean_rate(shares_of_rows)),
        "rank_correlation": asdict(mean(correlations, -1.0, 1.0)),
        "first": {name: asdict(mean_rate([r.first[name] for r in whole])) for name in whole[0].first},
        "attention_received": [asdict(mean(of_token, 0.0)) for of_token in np.transpose(received)]
        if received
        else None,
    }


def _counts(cells: Sequence[dict[str, Any]], name: str) -> dict[str, int]:
    known = [cell for cell in cells if cell[name] is not None]
    return dict(Counter(f"{cell[f'{name}_position']}: {cell[name]}" for cell in known).most_common())


def table(readings: Sequence[Reading]) -> str:
    """One line per seed and stage, for the whole task, then those over the seeds."""
    names = list(readings[0].first)
    lines = [f"{'stage':6} {'seed':>5}  {'token*':>12}  {'needed':>12}  agrees  enters first"]
    for one in readings:
        if one.whole:
            cells = one.cells()
            agrees = {None: "-", True: "yes", False: "no"}[one.agrees]
            first = ", ".join(f"{name} {one.first[name]:.2f}" for name in names if one.first[name] > 0)
            star, needed = (cells[name] or "-" for name in ("token_star", "needed_token"))
            lines.append(f"{one.stage:6} {one.seed:>5}  {star:>12}  {needed:>12}  {agrees:>6}  {first}")
    for stage, found in summarise(readings).items():
        lines += [
            f"{stage}: token* {_most(found['token_star'])}; needed {_most(found['needed_token'])}",
            f"  token* is the needed one in {_text(found['agreement'])} of the seeds, "
            f"in {_text(found['agreement_over_rows'])} of a seed's rows; rank correlation "
            f"{_text(found['rank_correlation'])}",
            "  enters first: " + ", ".join(f"{name} {_text(share)}" for name, share in found["first"].items()),
        ]
    return "\n".join([*lines, "Brackets: 95 % intervals over seeds."])


def _most(counts: dict[str, int]) -> str:
    return ", ".join(f"{token} ({count} seeds)" for token, count in counts.items()) or "-"


def _text(estimate: dict[str, Any]) -> str:
    return Estimate(**estimate).text(2)


def write_csv(path: Path, readings: Sequence[Reading]) -> None:
    """All readings as a table, one line each."""
    rows = [one.cells() for one in readings]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows([{name: "" if value is None else value for name, value in row.items()} for row in rows])
