"""Formulas that a run was not trained on: lists of them, certificates, and the prompt."""

import gc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax import Config, EnvConfig, NetworkConfig, OneHotConfig, PPOConfig, UserError
from t2tl_jax.evaluation.statistics import exact_rate
from t2tl_jax.ltl import TaskTable, compile_tasks
from t2tl_jax.ltl.tokens import FIRST_PROPOSITION
from t2tl_jax.networks.joined import JoinedConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.runs import any_task, certificates
from t2tl_jax.runs.experiment import Experiment, build
from t2tl_jax.runs.prompt import Prompt, _reads_rows_alone
from t2tl_jax.runs.result import Result
from tests.agents.sizes import GRU, PPO
from tests.evaluation.test_episodes import BROKEN, IDLE, SUCCESS, VIOLATION, FateEnv
from tests.probe import ProbeEnv

TASK = "F(Up & F Down)"
TASKS = ["F Up", TASK, "!Down U (Up & X Down)"]


def made(encoder: TaskEncoderConfig) -> Experiment:
    """Two seeds in the probe's world."""
    network = NetworkConfig(task_encoder=encoder, env_layers=(8,), actor_layers=(8,), critic_layers=(8,))
    learner = replace(PPO, network=network)
    config = Config(env=EnvConfig(), task=TASK, learner=learner, seeds="3,8", episode_length=8)
    return build(config, ProbeEnv())


def embed(params: Any, table: TaskTable) -> jax.Array:
    """The difference of how often a formula says Up, and how often Down."""
    up, down = ((table.tokens == FIRST_PROPOSITION + k).sum(-1) for k in (0, 1))
    return (up - down + 0.1)[:, None].astype(jnp.float32)


def act(params: Any, embedding: Any, carry: Any, obs: Any, row: Any, key: Any, deterministic: bool) -> jax.Array:
    """Sees to what the formula says more often, but for noise."""
    noise = 0.0 if deterministic else jax.random.normal(key, (*row.shape, 1))
    return params * embedding[row] + noise


READER = IDLE._replace(embed=embed, act=act)


@pytest.fixture(scope="module")
def run() -> Result:
    """The second seed does the opposite of the first."""
    params = np.array([1.0, -1.0], np.float32)
    return Result(replace(made(GRU), agent=READER), {"final": params, "best": params}, {}, 1)


def counting(result: Result) -> tuple[Result, list[int]]:
    """The same run, and how many rows were in each table whose codes a program was traced for."""
    traced: list[int] = []

    def counted(params: Any, table: TaskTable) -> jax.Array:
        traced.append(table.num_rows)
        return embed(params, table)

    agent = READER._replace(embed=counted)
    return replace(result, experiment=replace(result.experiment, agent=agent)), traced


@pytest.mark.slow
def test_a_list_is_played_in_one_program_and_each_task_as_if_alone(run):
    counted, traced = counting(run)
    reports = counted.evaluate(tasks=TASKS, episodes=20)
    assert list(reports) == TASKS
    assert len(traced) == 3  # to see whether the network can read them, and for each policy
    assert reports[TASK] == run.evaluate(episodes=20)  # the run's own, in a table without padding
    assert [seed.success_rate.value for seed in reports["F Up"]["deterministic"].seeds] == [1.0, 0.0]
    assert len({reports[task]["sampled"].success_rate.value for task in TASKS}) == 3


@pytest.mark.parametrize(
    ("tasks", "said"),
    [
        (["F Up", "F Sideways"], 'F Sideways: unknown proposition "Sideways"; known: Up, Down'),
        (["F Up & F Dwn & F x"], 'unknown propositions "Dwn", "x"; known: Up, Down; did you mean "Down" for "Dwn"?'),
        (["F Up", "Up & !Up"], "Up & !Up can never be satisfied"),
        (["F Up", "z9"], 'unknown task "z9"'),
        ([], "the list of tasks is empty"),
        ("F Up", "tasks is a list of names and formulas, got the text 'F Up'"),
    ],
)
def test_a_list_with_a_mistake_says_which_task_it_is(run, tasks, said):
    with pytest.raises(UserError) as error:
        run.evaluate(tasks=tasks)
    assert said in str(error.value)


def test_one_task_or_a_list(run):
    with pytest.raises(UserError, match="one task or a list"):
        run.evaluate("F Up", tasks=["F Up"])


def test_codes_by_place_are_refused():
    run = Result(made(OneHotConfig(2)), {"final": None}, {}, 1)
    for use in (lambda: run.evaluate(tasks=["F Up"]), lambda: Prompt(run)):
        with pytest.raises(UserError, match=r"cannot read a new formula: it was trained on F\(Up & F Down\) .*OneHot"):
            use()


def test_rows_grow_with_what_is_asked_for(run):
    shapes = [run.tables([text])[text].tokens.shape for text in ("F Up", "X " * 40 + "Up", "X " * 70 + "Up")]
    assert shapes == [(32, 64), (64, 64), (128, 128)]


def test_padding_that_is_read_is_as_much_as_in_training():
    experiment = made(TransformerConfig(layers=1, width=8, heads=1, feed_forward=8, output=4, masked=False))
    own = experiment.table.tokens.shape[-1]
    (table,) = any_task.compile_each(experiment, ["F Up"]).values()
    assert table.tokens.shape == (32, own)
    with pytest.raises(UserError, match=f"the table has room for 32 rows of {own}"):
        any_task.compile_each(experiment, ["F Up", "F(Up & F(Down & F Up))"])


class MappedFateEnv(FateEnv):
    """Its map, a number in [0, 1), is the fate, which `FateEnv` draws at the reset."""

    def make_params(self, seed, purpose="training"):
        return np.float32([0.0])

    def independent_params(self, seed, count):
        return (np.arange(count, dtype=np.float32) / count)[:, None]

    def reset(self, rng, params=None):
        return super().reset(rng).replace(pipeline_state=jnp.stack([params[0], 0.0]))


def certifier(env: FateEnv) -> Callable[..., certificates.Certificates]:
    """Certifies tasks in a world of known outcomes, of two seeds."""
    tables = {text: compile_tasks([text], env.propositions) for text in ("!Down U Up", "!Up U Down")}
    config = Config(env=EnvConfig(), task="!Down U Up", learner=PPOConfig(), seeds="2", episode_length=4)
    experiment = Experiment(config, env, tables["!Down U Up"], IDLE, None)

    def certify(episodes: int, deterministic: bool = False, batch: int | None = None) -> certificates.Certificates:
        return certificates.certify(experiment, np.zeros(2), 1, tables, episodes, 4, deterministic, batch)

    return certify


@pytest.fixture(scope="module")
def fate() -> Callable[..., certificates.Certificates]:
    """Certifies where every outcome has a known probability."""
    return certifier(FateEnv())


@pytest.mark.slow
@pytest.mark.parametrize("batch", [64, 300, 1000])
def test_each_map_is_played_once(batch):
    found = certifier(MappedFateEnv())(1000, batch=batch)
    assert found.own_maps
    for task, outcomes in (("!Down U Up", (500, 300)), ("!Up U Down", (300, 500))):
        one = found.by_task[task]
        assert (one.successes, one.violations, one.env_terminations, one.timeouts) == (*outcomes, 99, 101)


@pytest.mark.slow
def test_certificates_hold(fate):
    found = fate(2000, batch=700)  # 2,000 are two batches and most of a third
    one, other = found.by_task.values()
    assert one.successes + one.violations + one.env_terminations + one.timeouts == 2000
    assert (one.successes, one.violations) == (other.violations, other.successes)
    assert one.success == exact_rate(one.successes, 2000, intervals=4)
    for estimate, truth in ((one.success, SUCCESS), (one.violation, VIOLATION)):
        assert estimate.low < truth < estimate.high and estimate.high - estimate.low < 0.07
    assert abs(one.env_terminations / 2000 - BROKEN) < 0.03
    assert found.batch == 700 and fate(2000).batch == certificates.CPU_BATCH
    assert not found.own_maps  # this world has no maps
    whole = fate(2000, batch=2000).by_task["!Down U Up"]
    assert whole.successes != one.successes  # batches have random numbers of their own


def test_repeats_of_one_episode_are_no_certificate(fate, monkeypatch):
    monkeypatch.setattr(FateEnv, "fixed_start", True)
    with pytest.raises(UserError, match="repeats one episode"):
        fate(10, deterministic=True)


@pytest.mark.slow
def test_the_prompt_plays_without_compiling_again(run):
    """And what it shows first is what the policy does."""
    result, traced = counting(run)
    prompt = Prompt(result, seed=8)
    first = prompt.play("F Up")
    assert first.is_new_shape and first.table.tokens.shape == (32, 64)
    so_far = len(traced)
    *_, played = [prompt.play(text) for text in TASKS]
    assert len(traced) == so_far and not played.is_new_shape and 0 < played.compile_ms < played.action_ms
    policy = run.policy(8, task=TASKS[-1])
    np.testing.assert_allclose(played.action, policy(np.ones(3, np.float32), TASKS[-1]), atol=1e-5)
    assert played.progress()[0] == (0, policy.table.text(int(policy.table.initial_row[0])))
    assert len(played.recording.rows) <= 9


@pytest.mark.slow
def test_the_first_action_after_warming_up_comes_at_once(run):
    """Asked for are 5 ms; the median over formulas may be four times that, for machines that others use too."""
    prompt = Prompt(run)
    prompt.play(TASKS[0])
    formulas = (
        *TASKS,
        "F Down",
        "!Up U Down",
        "F(Down & F Up)",
        "F Up & F Down",
        "!Up U (Down & F Up)",
        "F(Up | Down)",
    )
    played = [prompt.play(formula) for formula in formulas]
    assert not any(one.is_new_shape for one in played)
    assert np.median([one.action_ms for one in played]) < 20
    assert np.median([one.compile_ms for one in played]) < 10


@pytest.mark.parametrize("collecting", [True, False])
def test_no_garbage_is_collected_before_the_first_action(run, collecting, monkeypatch):
    """Looking through all objects takes longer than the whole formula; afterwards things are as they were."""
    meanwhile = []
    prompt = Prompt(run)

    def refuse(formula):
        meanwhile.append(gc.isenabled())
        raise UserError("no")

    monkeypatch.setattr(prompt, "_compiled", refuse)
    before = gc.isenabled()
    try:
        (gc.enable if collecting else gc.disable)()
        with pytest.raises(UserError):
            prompt.play("F Up")
        assert meanwhile == [False] and gc.isenabled() == collecting
    finally:
        (gc.enable if before else gc.disable)()


@pytest.mark.parametrize(
    ("encoder", "alone"), [(GRU, True), (JoinedConfig(LookaheadConfig(2), GRU), False), (LookaheadConfig(2), False)]
)
def test_codes_that_need_other_rows_are_known(encoder, alone):
    experiment = made(encoder)
    params = jax.eval_shape(experiment.agent.init, jax.random.key(0), experiment.task_env.make_params(0)).params
    assert _reads_rows_alone(experiment.agent, params, experiment.table) == alone


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("F Up &", "ends after '&' at character 7; expected a proposition"),
        ("F Upp", 'unknown proposition "Upp"; known: Up, Down; did you mean "Up"?'),
        ("G Up", "not co-safe"),
        ("true", "true from the start"),
        ("phi_zon", 'did you mean "phi_zone"?'),
        ("F Up)", "at character 5"),
    ],
)
def test_a_mistake_at_the_prompt_is_one_line(run, text, said):
    with pytest.raises(UserError) as error:
        Prompt(run).play(text)
    assert said in str(error.value) and "\n" not in str(error.value)
