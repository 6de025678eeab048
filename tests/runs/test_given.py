"""What is given to the library's functions and cannot be used: one kind of error, which says what was expected."""

import numpy as np
import pytest

import t2tl_jax
from t2tl_jax import LTLError, PPOConfig, Prompt, UserError, compile_tasks, load, parse, progress, resume, sample, train

STORED = "results/paper/zone-dfa"
SMALL = {"frames": 640, "seeds": 1}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"frames": "abc"}, "frames must be a whole number, got 'abc'"),
        ({"frames": True}, "frames must be a whole number, got True"),
        ({"frames": 1.5}, "frames must be a whole number, got 1.5"),
        ({"seeds": 1.5}, "seeds are a count such as 4 or a list such as"),
        ({"seeds": "x"}, "seeds are a count such as 4 or a list such as"),
        ({"task": 5}, "task is a formula, the name of a task, or a family of tasks, got 5"),
        ({"labels": "nxt"}, "labels must be one of next, state, got 'nxt'; did you mean 'next'"),
        ({"plan": "crtic"}, "plan must be one of none, critic, got 'crtic'; did you mean 'critic'"),
        ({"progression": "x"}, "progression must be one of exact, paper, got 'x'$"),
        ({"until_solved": "yes"}, "until_solved must be True or False, got 'yes'"),
        ({"pool": 3}, "pool must be of type PoolConfig, got 3"),
        ({"run": None}, "run must be of type RunConfig, got None"),
        ({"random_starts": "x"}, "random_starts must be a number, got 'x'"),
        ({"callbacks": [print]}, "a callback is an object of a class that derives from t2tl_jax.Callback"),
        ({"callbacks": print}, "callbacks must be of type list or tuple, got <built-in"),
        ({"pretrained": 5}, "pretrained must be of type Result or str or PathLike, got 5"),
        ({"folder": 3}, "a folder is a path"),
        ({"simultaneous": 0.5}, "no field 'simultaneous'; since version 0.2 it is 'random_starts'"),
        ({"framse": 3}, "no field 'framse'; did you mean 'frames'"),
    ],
)
def test_training_refuses_what_it_cannot_use(given, said):
    with pytest.raises(UserError, match=said):
        train("zone_ppo_closed_form", **(SMALL | given))


@pytest.mark.parametrize("folder", [None, 5, ["a"]])
def test_a_folder_is_a_path(folder):
    with pytest.raises(UserError, match="a folder is a path"):
        load(folder)
    with pytest.raises(UserError, match="a folder is a path"):
        resume(folder)


def test_words_of_parts_are_checked_too():
    with pytest.raises(UserError, match=r"learner.minibatches_of must be one of .*; did you mean 'environments'"):
        train("zone_ppo_closed_form", learner=PPOConfig(minibatches_of="enviroments"), **SMALL)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"num_envs": "x"}, "num_envs must be a whole number, got 'x'"),
        ({"num_envs": None}, "num_envs must be a whole number, got None"),
        ({"learning_rate": "fast"}, "learning_rate must be a number, got 'fast'"),
    ],
)
def test_a_part_made_by_itself_says_what_it_takes(fields, said):
    with pytest.raises(ValueError, match=said):
        PPOConfig(**fields)


def test_errors_of_formulas_are_errors_of_the_user():
    assert issubclass(LTLError, UserError) and t2tl_jax.LTLError is LTLError
    with pytest.raises(UserError, match="expected"):
        parse("F(Blue")
    with pytest.raises(UserError, match=r"progress takes a formula, such as parse\('F a'\), got 'F a'"):
        progress("F a", {"a"})
    with pytest.raises(UserError, match="a label is a set of propositions"):
        progress(parse("F Red"), "Red")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: parse(5), "parse takes a text, got 5"),
        (lambda: progress(parse("F Red"), 5), "a label is a set of propositions, such as {'a'}, got 5"),
        (lambda: sample(5, ("a",), 0), "the name of a family is a text, got 5"),
        (lambda: sample("Default", 5, 0), "propositions is a sequence of names, got 5"),
        (lambda: sample("Default", tuple("abcd"), 1.5), "seed is a whole number, got 1.5"),
        (lambda: compile_tasks(5, ("a",)), "tasks are formulas, as text or parsed, got 5"),
        (lambda: compile_tasks(["F a", None], ("a",)), "tasks are formulas, as text or parsed, got None"),
        (lambda: compile_tasks("F a", 5), "propositions is a sequence of names, got 5"),
        (lambda: compile_tasks("F a", ("a",), max_rows="x"), "max_rows must be a whole number, got 'x'"),
        (lambda: compile_tasks("F a", ("a",), length="x"), "length is a whole number of tokens, got 'x'"),
        (lambda: compile_tasks("F a", ("a",), limits=5), r"limits are Limits\(...\), got 5"),
    ],
)
def test_functions_of_formulas_take_formulas(call, said):
    with pytest.raises(LTLError, match=said):
        call()


def test_a_policy_refuses_observations_and_tasks_of_another_kind():
    run = load(STORED)
    policy, size = run.policy(), run.experiment.task_env.observation_size
    row = int(policy.table.initial_row[0])
    with pytest.raises(UserError, match=rf"an observation has {size} numbers along its last axis, got .* \(3,\)"):
        policy(np.zeros(3), row)
    with pytest.raises(UserError, match=r"a task is a row of the table, by its number, or a formula .*, got 1\.5"):
        policy(np.zeros(size), 1.5)
    for given in (99, -1):
        with pytest.raises(UserError, match=f"the table has rows 0 to .*, got {given}"):
            policy(np.zeros(size), given)
    for given in (None, parse("F Red")):
        with pytest.raises(UserError, match="a task is a row of the table"):
            policy(np.zeros(size), given)
    with pytest.raises(UserError, match="an observation is an array of numbers, got 'abc'"):
        policy("abc", row)
    with pytest.raises(UserError, match="an observation has"):
        policy.decide((), np.zeros(3), row)
    assert policy(np.zeros(size), row).shape == policy(np.zeros((1, size)), np.array([row])).shape[1:]


@pytest.mark.parametrize("episodes", [0, -1, 1.5, True])
def test_an_evaluation_has_episodes(episodes):
    with pytest.raises(UserError, match=f"episodes is a whole number of at least 1, got {episodes}"):
        load(STORED).evaluate(episodes=episodes)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"episode_length": 0}, "episode_length must be at least 1, got 0"),
        ({"task": 5}, "task must be of type str or TaskFamily or TaskTable, got 5"),
        ({"task": parse("F Red")}, r"of a formula give the text, str\(formula\)"),
        ({"env": 5}, "env must be of type LabelledEnv or None, got 5"),
        ({"tasks": [5]}, "got 5|cannot read a new formula"),
    ],
)
def test_an_evaluation_refuses_what_it_cannot_use(given, said):
    with pytest.raises(UserError, match=said):
        load(STORED).evaluate(**given)


def test_runs_are_results_and_environments_are_objects():
    with pytest.raises(UserError, match=r"result must be of type Result, got 'runs/x'; load\(folder\) gives"):
        Prompt("runs/x")
    with pytest.raises(UserError, match="env must be of type LabelledEnv or None, got 3"):
        load(STORED, env=3)


def test_a_resumed_run_does_not_take_back_what_it_did(finished, resume, capsys):
    """The folder stays as it is, to the byte."""
    before = {file: file.read_bytes() for file in finished.rglob("*") if file.is_file()}
    assert resume(finished, "--frames", "100") == 2
    assert "frames=100 is less than the 200 that every seed of" in capsys.readouterr().err
    assert resume(finished, "--frames", "150") == 2  # of which as many iterations would be made
    assert {file: file.read_bytes() for file in finished.rglob("*") if file.is_file()} == before
    assert resume(finished, "--frames", "200") == 0


def test_what_may_not_change_is_named_by_its_flag(finished, resume, capsys):
    assert resume(finished, "--learner.discount", "0.5", "--episode-length", "7", "--run.gif", "False") == 2
    assert capsys.readouterr().err == (
        "error: a resumed run keeps its configuration; only --frames, --convergence.*, --until-solved, --run.* may "
        "change, not --learner.discount, --episode-length\n"
    )
