"""The open arena of DeepLTL's PointLtl2-v0: its published test vector, its edge, its maps, more colours."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones import EPISODE_LENGTH, OPEN, OPEN_6, OPEN_8, OPEN_10, ZoneConfig, ZoneEnv, ZoneParams
from envs.zones import layouts as zone_layouts
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_robot import PointState
from experiments.paper.fixed_set import ZONES, capitals, discs, start
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import env_names, make_env
from t2tl_jax.task_env import TaskEnv, TaskParams
from tests.envs.test_zones_sensors import published_lidar

CLOSED_FORM = replace(OPEN, physics="closed_form", pool_size=4)

# Where the parts of the published observation are.
ORDER = {
    "accelerometer": slice(0, 3),
    "Blue": slice(3, 19),
    "Green": slice(19, 35),
    "gyro": slice(35, 38),
    "Magenta": slice(38, 54),
    "magnetometer": slice(54, 57),
    "velocimeter": slice(57, 60),
    "Yellow": slice(60, 76),
    "edge": slice(76, 80),
}
PRINTED = 5.1e-5  # four decimals are published


@pytest.fixture(scope="module")
def open_env() -> ZoneEnv:
    return ZoneEnv(CLOSED_FORM)


@pytest.fixture(scope="module", params=[pytest.param("mjx", marks=pytest.mark.slow), "closed_form"])
def driven(request):
    """The first published map under a held action: ``(action, steps) -> (first state, State [steps], labels)``."""
    env = ZoneEnv(replace(CLOSED_FORM, physics=request.param))
    only_map = ZoneParams(starts=start(ZONES[0])[None], zones=discs(ZONES[0])[None])
    first = env.reset(jax.random.key(0), only_map)

    @jax.jit
    def run(action):
        def step(state, _):
            state = env.step(state, action)
            return state, (state, env.labels(state))

        return jax.lax.scan(step, first, None, length=165)[1]

    return lambda action: (first, *run(jnp.asarray(action, jnp.float32)))


@pytest.mark.slow
def test_the_published_vector(driven):
    first, states, labels = driven((1, 0))
    np.testing.assert_allclose(first.obs[ORDER["magnetometer"]], [0.1574, -0.4746, 0], atol=PRINTED)
    blue = np.zeros(16)
    blue[[0, 8, 9, 10, 14, 15]] = 0.1024, 0.0801, 0.4994, 0.4193, 0.1387, 0.2411
    np.testing.assert_allclose(first.obs[ORDER["Blue"]], blue, atol=PRINTED)
    np.testing.assert_array_equal(first.obs[ORDER["edge"]], 0)
    positions = states.pipeline_state.qpos[:, :2]
    np.testing.assert_allclose(positions[0], [-0.5989, 1.7157], atol=PRINTED)
    np.testing.assert_allclose(positions[9], [-0.5506, 1.6996], atol=1.2e-4)  # by then the heading chatters
    np.testing.assert_allclose(states.obs[0, ORDER["accelerometer"]][jnp.array([0, 2])], [2.7817, 9.81], atol=1.1e-4)
    np.testing.assert_allclose(states.obs[0, ORDER["velocimeter"]], [0.0566, 0, 0], atol=4e-4)
    np.testing.assert_allclose(states.obs[0, ORDER["edge"]], [0.0203, 0.0066, 0.0671, 0.2051], atol=PRINTED)
    green = np.asarray(labels[:, 1])
    assert np.flatnonzero(green)[0] == 70  # the 71st step
    left = np.flatnonzero(states.done)[0]
    assert left == 162 and states.reward[left] == -1 and not states.reward[:left].any()  # the 163rd


def test_the_published_vector_of_a_turn(driven):
    """Its turn saturates the servo, so that nothing chatters and every digit is determined."""
    _, states, _ = driven((1, 0.5))
    obs = states.obs[0]
    np.testing.assert_allclose(obs[ORDER["accelerometer"]], [2.8478, 17.7043, 9.81], atol=5e-4)
    np.testing.assert_allclose(obs[ORDER["gyro"]], [0, 0, 1.8476], atol=1e-4)


def test_the_observation_has_the_published_order(open_env):
    """Each part holds what the sensors of the walled arena show, which are tested on their own."""
    assert open_env.observation_parts == ORDER and open_env.observation_size == 80
    assert ZoneEnv(ZoneConfig(physics="closed_form")).observation_parts.keys() == {
        *("accelerometer", "gyro", "magnetometer", "velocimeter", "Black", "Red", "White", "Yellow")
    }
    line, qvel = ZONES[7], np.array([0.3, -0.2, 1.5])
    obs = np.asarray(open_env.reset_to(start(line), qvel, discs(line)).obs)
    walled = ZoneEnv(replace(CLOSED_FORM, arena="walled"))
    same = np.asarray(walled.reset_to(start(line), qvel, discs(line)).obs)
    for name, part in walled.observation_parts.items():
        np.testing.assert_array_equal(obs[ORDER[name]], same[part])
    for colour in ("blue", "green", "magenta", "yellow"):
        expected = published_lidar(start(line), np.array(line["zones"][colour]), lambda d: np.exp(-0.5 * d))
        np.testing.assert_allclose(obs[ORDER[colour.capitalize()]], expected, atol=3e-6)


@pytest.mark.parametrize("reach", [1.2, 0.7])
def test_a_lidar_of_limited_range_is_linear(reach):
    env, line = ZoneEnv(replace(CLOSED_FORM, lidar_range=reach)), ZONES[3]
    rng = np.random.default_rng(0)
    qpos = np.concatenate([rng.uniform(-3, 3, (100, 2)), rng.uniform(-9, 9, (100, 1))], axis=1)
    obs = np.asarray(jax.jit(jax.vmap(env.reset_to, (0, None, None)))(qpos, np.zeros(3), discs(line)).obs)
    for colour in ("blue", "green", "magenta", "yellow"):
        centres = np.array(line["zones"][colour])
        for pose, lidar in zip(qpos, obs[:, ORDER[colour.capitalize()]], strict=True):
            expected = published_lidar(pose, centres, lambda d: max(0.0, reach - d) / reach)
            np.testing.assert_allclose(lidar, expected, atol=5e-6)
            if np.linalg.norm(centres - pose[:2], axis=1).min() >= reach:
                assert not lidar.any()


@pytest.mark.parametrize(("x", "y"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_leaving_ends_the_episode_with_a_reward_of_minus_one(open_env, x, y):
    step, way = jax.jit(open_env.step), np.array([x, y, 0.0])
    resting = open_env.reset_to(way * 3.2999, np.zeros(3), discs(ZONES[0]))
    inside = step(resting, jnp.zeros(2))
    assert inside.done == 0 and inside.reward == 0
    outside = step(open_env.reset_to(way * 3.29, way, discs(ZONES[0])), jnp.zeros(2))
    assert outside.done == 1 and outside.reward == -1
    assert np.abs(outside.pipeline_state.qpos[:2]).max() >= 3.3
    broken = step(resting, jnp.array([jnp.nan, 0.0]))
    assert broken.done == 1 and broken.reward == -10


def test_the_edge_sensor_is_in_the_world_frame(open_env):
    state = open_env.reset_to([3.0, -1.0, 2.2], np.zeros(3), discs(ZONES[0]))
    edge = jax.jit(open_env.step)(state, jnp.zeros(2)).obs[ORDER["edge"]]
    np.testing.assert_allclose(edge, np.exp([-0.3, -2.3, -6.3, -4.3]), rtol=1e-5)


def test_nothing_stops_the_robot(open_env):
    """Where the walled arena has its walls, at 2.4 m, it moves as anywhere else."""
    rng = np.random.default_rng(0)
    qpos, qvel = (np.float32(rng.uniform(-1, 1, (50, 3))) for _ in range(2))
    actions, away = np.float32(rng.uniform(-1, 1, (50, 2))), np.array([2.4, -2.4, 0], np.float32)
    step = jax.jit(jax.vmap(ClosedFormPoint(walls=False).step))
    here, there = step(PointState(qpos, qvel), actions), step(PointState(qpos + away, qvel), actions)
    np.testing.assert_allclose(there.qpos - away, here.qpos, atol=2e-6)
    np.testing.assert_array_equal(there.qvel, here.qvel)


@pytest.fixture(scope="module")
def published(open_env):
    """The 50 tasks in one table, the 50 maps as 50 environments' parameters."""
    table = compile_tasks([capitals(line["task"]) for line in ZONES], open_env.propositions, open_env.alphabet)
    maps = ZoneParams(
        starts=np.stack([start(line) for line in ZONES])[:, None],
        zones=np.stack([discs(line) for line in ZONES])[:, None],
    )
    return TaskEnv(open_env, table), maps


@pytest.mark.slow
def test_the_published_tasks_are_played_on_their_maps(published):
    """Random episodes: each begins as published, and ends by a verdict or beyond the edge, each with its reward."""
    env, maps = published
    assert len(ZONES) == env.table.num_tasks == 50
    assert len(set(map(int, env.table.initial_row))) == len({line["task"] for line in ZONES}) == 36

    @jax.jit
    @jax.vmap
    def play(key, row, maps):
        params = TaskParams(maps, env.table)
        first = env.reset_to_row(key, row, params)

        def step(state, key):
            drive = 2 * jnp.sin(jnp.arange(2.0) + 40 * jax.random.uniform(jax.random.fold_in(key, 0)))
            after = env.step(state, drive, params)
            after = jax.tree.map(lambda new, old: jnp.where(state.done > 0, old, new), after, state)
            return after, (after, env.env.labels(after.replace(pipeline_state=after.pipeline_state.env)))

        return first, *jax.lax.scan(step, first, jnp.repeat(jax.random.split(key, 20), 20))[1]

    keys = jax.random.split(jax.random.key(0), 50)
    first, states, labels = jax.device_get(play(keys, env.table.initial_row, maps))
    np.testing.assert_array_equal(first.pipeline_state.env.qpos, maps.starts[:, 0])
    np.testing.assert_array_equal(first.pipeline_state.env.zones, maps.zones[:, 0])
    assert np.isfinite(states.obs).all()
    last = jax.tree.map(lambda x: x[:, -1], states)
    verdict = np.asarray(env.table.verdict)[last.pipeline_state.row]
    left = np.abs(last.pipeline_state.env.qpos[:, :2]).max(1) >= 3.3
    np.testing.assert_array_equal(last.done > 0, left | (verdict != 0))
    np.testing.assert_array_equal(last.reward, verdict - 1.0 * left)
    assert {-1, 0} <= set(verdict) and left.sum() > 5
    assert labels.any((0, 1)).all() and labels.sum(-1).max() == 1


def test_the_published_maps_keep_their_distances():
    for line in ZONES:
        zone_layouts.check_disjoint(discs(line), 0.4)
        apart = np.linalg.norm(discs(line) - start(line)[:2], axis=1)
        assert apart.min() >= 0.95 - 1e-6 and np.abs(discs(line)).max() <= 1.95 and np.abs(line["robot"]).max() <= 2.1


@pytest.mark.slow
@pytest.mark.parametrize(("config", "colours"), [(OPEN, 4), (OPEN_6, 6), (OPEN_8, 8), (OPEN_10, 10)])
def test_more_colours(config, colours):
    env = ZoneEnv(replace(config, physics="closed_form", pool_size=4))
    assert len(env.propositions) == colours and env.observation_size == 16 + 16 * colours
    names = [f"{name}_zones_lidar".lower() if name in env.propositions else name for name in env.observation_parts]
    assert names[:-1] == sorted(names[:-1]) and names[-1] == "edge"
    params = env.make_params(3)
    zone_layouts.check_disjoint(params.zones, config.radius)
    between = np.linalg.norm(params.zones[:, :, None] - params.zones[:, None], axis=-1) + 9 * np.eye(2 * colours)
    to_robot = np.linalg.norm(params.zones - params.starts[:, None], axis=-1)
    assert between.min() >= 2 * config.keepout - 1e-6 and to_robot.min() >= config.keepout + 0.4 - 1e-6
    assert np.abs(params.zones).max() <= 2.5 - config.keepout
    label = jax.jit(
        jax.vmap(lambda centre: env.labels(env.reset_to(jnp.append(centre, 0), jnp.zeros(3), params.zones[0])))
    )
    np.testing.assert_array_equal(label(params.zones[0]).sum(0), np.full(colours, 2))
    first = jax.jit(env.reset)(jax.random.key(0), params)
    assert not env.labels(first).any()


def test_colours_can_be_added_to_random_maps():
    """Of each as many discs as of the rarest colour; the order of the names makes no difference."""
    more = OPEN.with_colours(("Red", "Blue", "White"))
    assert more == replace(OPEN, colours="GGYYBBMMWWRR") == OPEN.with_colours(["White", "Red"])
    assert replace(OPEN, colours="GGGYB").with_colours(("Teal",)).colours == "GGGYBT"
    assert ZoneConfig(layout="random").with_colours({"Blue"}).colours == "JJRRWWYYBB"
    assert OPEN.with_colours(("Blue",)) is OPEN and ZoneConfig().with_colours(("Black",)) == ZoneConfig()
    env = ZoneEnv(replace(more, physics="closed_form", pool_size=4))
    assert env.propositions == ("White", "Blue", "Green", "Red", "Yellow", "Magenta")
    zone_layouts.check_disjoint(env.make_params(3).zones, OPEN.radius)


def test_colours_that_cannot_be_added():
    with pytest.raises(ValueError, match=r"unknown colour 'Redd'; did you mean 'Red'\?"):
        OPEN.with_colours(("Redd",))
    with pytest.raises(ValueError, match="the fixed map has no discs of other colours than its own, got Black, Blue"):
        ZoneConfig().with_colours(("Black", "Blue"))
    with pytest.raises(ValueError, match="14 zones cannot be placed"):
        ZoneEnv(OPEN.with_colours(("Red", "White", "Cyan")))


def test_discs_never_touch_however_small_their_keepout():
    pool = zone_layouts.sample_layouts(20, 20, 0, radius=0.4, keepout=0.4)
    zone_layouts.check_disjoint(pool.zones, 0.4)


def test_names_and_horizon():
    assert make_env("PointLtl2-v0").config == OPEN
    assert {"PointLtl2-6-colours", "PointLtl2-8-colours", "PointLtl2-10-colours"} <= set(env_names())
    assert EPISODE_LENGTH == 1000


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"arena": "round"}, "must be 'walled' or 'open'"),
        ({"radius": 0.4}, r"two zones overlap: their centres are 0\.707 m apart"),
        ({"layout": "random", "radius": 0.6}, r"keepout is 0\.55; it must be no less than the radius, 0\.6"),
        ({"layout": "random", "keepout": 2.5}, r"less than 2\.5"),
        ({"lidar_gain": 0.0}, "lidar_gain is 0.0; it must be positive"),
        ({"lidar_range": -1.0}, "or 0 for no limit"),
    ],
)
def test_bad_configurations_fail_clearly(config, message):
    with pytest.raises(ValueError, match=message):
        ZoneConfig(**config)
