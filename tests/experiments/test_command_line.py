"""Flags to configuration: overrides of any depth, and mistakes answered before anything is written."""

import dataclasses
from pathlib import Path

import pytest

from envs.waterworld import WaterWorldConfig
from experiments import compare, evaluate, run
from experiments.benchmarks import env
from experiments.cli import request as command_line
from experiments.cli import words
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Chains, Mixture, Named
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import configs, named_config
from t2tl_jax.runs import config_files

CONFIGS = configs()
ZONE = named_config("zone_ppo")


def test_published_schedule():
    published = named_config("zone_ppo_published")
    ppo = published.learner
    assert (ppo.num_envs, ppo.unroll_length, ppo.epochs, ppo.num_minibatches) == (16, 4096, 10, 64)
    assert published.iterations == 153


def test_overrides_of_any_depth():
    flags = ["--learner.learning-rate", "1e-4", "--frames", "2e5", "--task", "F(Red & F White)"]
    config = command_line.override(ZONE, [*flags, "--learner.network.task-encoder.layers", "2"])
    assert config.learner.learning_rate == 1e-4
    assert config.frames == 200_000
    assert config.task == "F(Red & F White)"
    assert config.learner.network.task_encoder.layers == 2
    assert config.learner.clip_eps == ZONE.learner.clip_eps


def test_overrides_of_the_other_learner_and_environment():
    water = named_config("waterworld_dqn")
    flags = ["--learner.learning-rate", "2e-4", "--learner.counterfactual", "False", "--env.layout", "random"]
    config = command_line.override(water, [*flags, "--learner.network.state-layers", "32"])
    network = dataclasses.replace(water.learner.network, state_layers=(32,))
    assert config.learner == dataclasses.replace(
        water.learner, learning_rate=2e-4, counterfactual=False, network=network
    )
    assert config.env == WaterWorldConfig(layout="random")
    assert config_files.from_json(config_files.to_json(config), "test") == config


def test_a_part_can_be_changed_or_left_out():
    flags = ["--learner.network.context.length", "12", "--learner.network.context.reset", "False"]
    longer = command_line.override(ZONE, flags)
    assert longer.learner.network.context == ContextConfig(length=12, reset=False)
    assert config_files.from_json(config_files.to_json(longer), "test") == longer
    for flags in (["--learner.network.context", "None"], ["--learner.network.context=None"]):
        without = command_line.override(ZONE, ["--frames", "2e5", *flags])
        learner = dataclasses.replace(ZONE.learner, network=dataclasses.replace(ZONE.learner.network, context=None))
        assert without == dataclasses.replace(ZONE, frames=200_000, learner=learner)
    with pytest.raises(UserError, match="unknown learner 'None'"):
        command_line.override(ZONE, ["--learner", "None"])  # not an optional part
    with pytest.raises(UserError, match="unknown task encoder 'None'"):
        command_line.override(ZONE, ["--learner.network.task-encoder", "None"])
    with pytest.raises(UserError, match=r"None leaves out a part of which --learner\.network\.context\.FIELD sets"):
        command_line.override(ZONE, ["--learner.network.context", "None", "--learner.network.context.length", "3"])


def test_a_part_that_is_not_there_is_put_in_by_its_fields():
    without = command_line.override(ZONE, ["--learner.network.context", "None"])
    flags = ["--learner.network.context.length=12", "--learner.network.context.reader", "gru"]
    read_by_gru = command_line.override(without, flags)
    assert read_by_gru.learner.network.context == ContextConfig(length=12, reader=GRUConfig())
    carried = ["--learner.network.context.carried", "--learner.network.context.reader", "gru"]
    assert command_line.override(without, carried).learner.network.context == ContextConfig(
        reader=GRUConfig(), carried=True
    )
    assert command_line.override(without, ["--frames", "2e5"]).learner.network.context is None
    with pytest.raises(UserError, match=r"unknown option '--learner\.network\.context\.lenth'"):
        command_line.override(without, ["--learner.network.context.lenth", "3"])
    with pytest.raises(UserError, match=r"carried=True needs a reader with a state, network\.context\.reader=gru"):
        command_line.override(without, ["--learner.network.context.carried", "True"])


def test_a_part_can_be_of_another_kind():
    flags = ["--learner.network.task-encoder", "gru", "--learner.network.task-encoder.width", "8"]
    read_otherwise = command_line.override(ZONE, flags)
    network = dataclasses.replace(ZONE.learner.network, task_encoder=GRUConfig(width=8))
    assert read_otherwise == dataclasses.replace(ZONE, learner=dataclasses.replace(ZONE.learner, network=network))
    flags_of_reader = ["--learner.network.context.reader", "gru", "--learner.network.context.reader.width", "24"]
    read_by_gru = command_line.override(ZONE, [*flags_of_reader, "--learner.task-encoder-learning-rate", "1e-5"])
    assert read_by_gru.learner.network.context == ContextConfig(reader=GRUConfig(width=24))
    assert read_by_gru.learner.task_encoder_learning_rate == 1e-5
    assert config_files.from_json(config_files.to_json(read_by_gru), "test") == read_by_gru
    assert command_line.override(read_by_gru, ["--learner.task-encoder-learning-rate", "None"]) == (
        command_line.override(ZONE, flags_of_reader)
    )
    # Flags may come in any order, and underscores count as hyphens.
    assert command_line.override(ZONE, [*flags[2:], "--learner.network.task_encoder=gru"]) == read_otherwise
    water = command_line.override(ZONE, ["--env", "waterworld", "--task", "phi_water", "--learner", "dqn"])
    assert water.env == WaterWorldConfig() and water.learner == DQNConfig()
    one_hot = command_line.override(ZONE, ["--learner.network.task-encoder", "one_hot", "--pretrained", ""])
    assert one_hot.learner.network.task_encoder == OneHotConfig()
    # Parts that fit only together: either flag alone is refused.
    with pytest.raises(UserError, match="cannot be pre-trained"):
        command_line.override(ZONE, ["--learner.network.task-encoder", "one_hot"])
    for config in (read_otherwise, water, one_hot):
        assert config_files.from_json(config_files.to_json(config), "test") == config


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--config", "zone_pp"], "did you mean 'zone_ppo'"),
        (["--config", "zone_ppo", "--learner.epsilon-end", "1"], "unknown option '--learner.epsilon-end'"),
        (["--config", "waterworld_dqn", "--learner.num-env", "1"], "did you mean '--learner.num-envs'"),
        (["--config", "waterworld_dqn", "--env.physics", "mjx"], "unknown option '--env.physics'"),
        (["--config", "zone_ppo", "--learner", "pp"], "unknown learner 'pp'; did you mean 'ppo'?"),
        (["--config", "zone_ppo", "--env", "zone"], "unknown environment 'zone'; did you mean 'zones'?"),
        (["--config", "zone_ppo", "--env", "zone"], "is known once its module is imported. --import MODULE imports"),
        (
            ["--config", "zone_ppo", "--learner.network.task-encoder", "onehot"],
            "unknown task encoder 'onehot'; did you mean 'one_hot'?",
        ),
        (
            ["--config", "zone_ppo", "--learner.learning-rate", "fast"],
            "error: --learner.learning-rate takes a number, got 'fast'",
        ),
        (["--config", "zone_ppo", "--learner.clip-eps", "0.1", "0.2"], "takes a number, got '0.1 0.2'"),
        (["--config", "zone_ppo", "0.2"], "every option begins with --, got '0.2'"),
        (["--config", "waterworld_dqn", "--learner.buffer-size", "1"], "buffer_size must hold"),
        (["--config", "zone_ppo", "--frames", "2.5"], "whole number"),
        (["--config", "zone_ppo", "--frames", "0"], "error: frames must be at least 1, got 0"),
        (["--config", "zone_ppo", "--frames", "1e15"], "error: frames must be at most 70,368,744,144,896 with these"),
        (
            ["--config", "waterworld_dqn", "--frames", "1e14"],
            "error: frames must be at most 17,592,186,036,224 with these",
        ),
        (["--config", "zone_ppo", "--episode-length", "1e10"], "episode_length must be at most 2,147,483,646, since"),
        (["--config", "zone_ppo", "--learner.num-envs", "0"], "error: learner: num_envs must be at least 1, got 0"),
        (
            ["--config", "zone_ppo", "--learner.learning-rate", "nan"],
            "error: learner: learning_rate must be a finite number",
        ),
        (
            ["--config", "zone_ppo", "--learner.network.env-layers", "0"],
            "learner.network: env_layers are sizes of layers",
        ),
        (["--config", "zone_ppo", "--run.checkpoint-period", "nan"], "checkpoint_period is in seconds"),
        (["--config", "fake", "--seeds", "a"], "seeds are a count"),
        (["--config", "fake", "--seeds", "1,1"], "once"),
        (["--config", "zone_ppo", "--learner.minibatch-size", "1000"], "error: learner: minibatch_size must divide"),
        (["--config"], "expected one argument"),
        ([], "choose a configuration with --config NAME"),
        ([], "or --config FILE.json, or a run with --resume RUN"),
        (["zone_ppo"], "every option begins with --, got 'zone_ppo'; did you mean --config zone_ppo?"),
        (["zone_pp", "--seeds", "2"], "did you mean --config zone_ppo?"),
        (["my.json"], "did you mean --config my.json?"),
        (["--config", "zone_pp"], "did you mean 'zone_ppo'?"),
        (["--config", "zone_pp"], "--config takes one of these names, or a path to a file"),
        (["--config", "no/such.json"], "error: cannot read no/such.json: there is no such file; --config takes a path"),
        (["--config", "zone_ppo", "--resume", "x"], "leave --config and --method out"),
        (["--resume", "no/such/run"], "there is no folder"),
        (["--config", "zone_ppo", "--import", "no.such.module"], "--import no.such.module: No module named"),
    ],
)
def test_mistakes_are_explained_before_anything_is_written(flags, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run.main([*flags, *([] if "--resume" in flags else ["--run.compilation-cache", ""])]) == 2
    message = capsys.readouterr().err
    assert said in " ".join(message.split())
    assert message.count("\n") < 25
    assert not list(tmp_path.iterdir())


def test_a_configuration_in_a_file_is_as_good_as_a_name(tmp_path):
    """Also one that no flag can say, a family that is made of others."""
    mixture = Mixture((Chains(depth=(1, 2)), Named("Until_1_2_1_1")), (0.8, 0.2))
    stored = dataclasses.replace(named_config("zone_ppo_long"), task=mixture)
    file = tmp_path / "mine.json"
    file.write_text(config_files.to_json(stored))
    asked = command_line.read(["--config", str(file), "--frames", "2e5"])
    config, name = command_line.configuration(asked, "", "run")
    assert config == dataclasses.replace(stored, frames=200_000) and name == "mine"
    asked = command_line.read(["--config", str(file), "--method", "gnn"])
    assert command_line.configuration(asked, "", "run")[1] == "mine_gnn"
    file.write_text("{}")
    with pytest.raises(UserError, match=r"mine\.json does not fit this version"):
        command_line.configuration(command_line.read(["--config", str(file)]), "", "run")


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (
            ["--learner.network.context.lenght", "3"],
            "unknown option '--learner.network.context.lenght'; did you mean '--learner.network.context.length'?",
        ),
        (
            ["--learner.learnin_rate=1"],
            "unknown option '--learner.learnin_rate'; did you mean '--learner.learning-rate'?",
        ),
        (["--metod", "t1tl"], "unknown option '--metod'; did you mean '--method'?"),
        # Nothing is like it: a guess would mislead.
        (["--quarter", "1"], "unknown option '--quarter'"),
        (["--ppo.clip", "1"], "unknown option '--ppo.clip'; since version 0.2 it is --learner.clip-eps"),
        (["--ppo.epochs", "1"], "unknown option '--ppo.epochs'; since version 0.2 it is --learner.epochs"),
        (["--simultaneous", "1"], "unknown option '--simultaneous'; since version 0.2 it is --random-starts"),
        # Both at once: that values do not fit together may come of the misspelt option.
        (
            ["--learner.clp-eps", "3", "--learner.minibatch-size", "7"],
            "unknown option '--learner.clp-eps'; did you mean '--learner.clip-eps'?",
        ),
        (["--env.physics", "mj"], "unknown --env.physics 'mj'; did you mean 'mjx'?"),
        (
            ["--learner.network.task-encoder.norm", "pots"],
            "unknown --learner.network.task-encoder.norm 'pots'; did you mean 'post'?",
        ),
    ],
)
def test_misspelt_options_and_choices_are_answered_in_the_first_of_two_lines(flags, said, capsys):
    assert run.main(["--config", "zone_ppo", *flags, "--run.compilation-cache", ""]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first == f"error: {said}"
    assert second.startswith(("All options: python -m experiments.run", "Known: "))


@pytest.mark.parametrize(
    ("config", "flag", "said"),
    [
        ("zone_ppo", "--network.transformer.heads", "it is --learner.network.task-encoder.heads"),
        ("zone_ppo", "--network.context.transformer.width", "it is --learner.network.context.reader.width"),
        ("zone_ppo", "--network.context.lenght", "did you mean '--learner.network.context.length'?"),
        ("zone_ppo", "--dqn.simultaneous", "it is --learner.counterfactual, which this configuration does not have"),
        ("waterworld_dqn", "--dqn.simultaneous", "it is --learner.counterfactual"),
        # Alike in the part, which says nothing.
        ("zone_ppo", "--learner.zzz", "unknown option '--learner.zzz'"),
        ("zone_ppo", "--selection.zzz", "option '--selection.zzz'; known: --selection.points, --selection.episodes"),
        ("zone_ppo", "--lerner.gae-lambda", "did you mean '--learner.gae-lambda'?"),
    ],
)
def test_options_of_then_and_far_away_ones(config, flag, said, capsys):
    assert run.main(["--config", config, flag, "1", "--run.compilation-cache", ""]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.endswith(said) and second.startswith("All options: ")


def test_every_misspelt_option_is_answered(capsys):
    assert run.main(["--config", "zone_ppo", "--learner.clp-eps", "3", "--frame", "3", "--seeds", "1"]) == 2
    assert [line.split("'")[1::2] for line in capsys.readouterr().err.splitlines()[:2]] == [
        ["--learner.clp-eps", "--learner.clip-eps"],
        ["--frame", "--frames"],
    ]


@pytest.mark.parametrize(
    ("command", "words", "said"),
    [
        (evaluate, [], "python -m experiments.evaluate takes one run, got none; see"),
        (evaluate, ["here", "there", "--gif", "True"], "takes one run, got here there; see"),
        (evaluate, ["here", "--gif", "True", "there"], "takes one run, got here there; see"),
        (evaluate, ["--run", "here"], "--run is no option: give it by itself; see"),
        (evaluate, ["here", "-q"], "every option begins with --, got '-q'; see python -m experiments.evaluate --help"),
        (evaluate, ["here", "--seed", "3"], "--seed belongs to --certify, and without it every seed"),
        (evaluate, ["here", "--policy", "deterministic"], "--policy belongs to --certify, and without it every seed"),
        (evaluate, ["here", "--episodes", "few"], "--episodes takes a whole number, got 'few'"),
        (evaluate, ["here", "--plan"], "--plan takes none or critic, got nothing"),
        (compare, [], "name one run or more"),
        (env, ["zones"], "every option begins with --, got 'zones'; see python -m experiments.benchmarks.env --help"),
        (env, ["--steps", "0"], "steps must be at least 1, got 0"),
    ],
)
def test_mistakes_of_other_commands_are_told_in_one_line(command, words, said, capsys):
    assert command.main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {said}") or f" {said}" in line


@pytest.mark.parametrize("words", [["--gif", "true", "here"], ["here", "--gif", "TRUE"], ["here", "--plan", "None"]])
def test_words_that_differ_in_capitals_are_answered_with_the_choices(words, capsys):
    assert evaluate.main(words) == 2
    flag, given = words[-2:] if words[0] == "here" else words[:2]
    nearest, known = ("none", "critic, none") if flag == "--plan" else ("True", "False, True")
    said = f"error: unknown {flag} {given!r}; did you mean {nearest!r}?\nKnown: {known}\n"
    assert capsys.readouterr().err == said


def test_unknown_tasks_are_refused_with_the_nearest(capsys, tmp_path):
    flags = ["--config", "zone_ppo_closed_form", "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    assert run.main([*flags, "--task", "phi_zon"]) == 2
    assert "phi_zone" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("name", "absent"), [("zone_ppo", "--learner.epsilon-end"), ("waterworld_dqn", "--learner.clip-eps")]
)
def test_help_documents_every_field(name, absent, capsys):
    chosen = named_config(name)
    with pytest.raises(SystemExit) as stop:
        command_line.override(chosen, ["--help"])
    assert stop.value.code == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--resume RUN" in text

    def check(config: object, prefix: str = "--") -> None:
        for field in dataclasses.fields(config):  # type: ignore[arg-type]
            value = getattr(config, field.name)
            name = prefix + field.name.replace("_", "-")
            if dataclasses.is_dataclass(value):
                check(value, name + ".")
            elif value is not None:
                assert name in text, name

    check(chosen)
    assert absent not in text.partition("The defaults shown")[2]


def test_help_without_a_configuration_says_whose_defaults_it_shows(capsys):
    with pytest.raises(SystemExit):
        run.main(["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"The defaults shown are those of {next(iter(CONFIGS))}, since no configuration is chosen." in text
    assert "(default: 'a family of the kind chains')" in text and "Chains(" not in text


def test_one_thing_is_no_plural():
    assert [words.counted(count, "iteration") for count in (1, 2000)] == ["1 iteration", "2,000 iterations"]


def test_list_names_every_config(capsys):
    assert run.main(["--list"]) == 0
    output = capsys.readouterr().out
    assert all(name in output for name in CONFIGS)
    assert "environments: " in output and "learners: " in output and "one_hot" in output


@pytest.mark.slow
def test_runs_never_share_a_folder(train):
    folders = {train("--frames", "100", "--run.evaluation-episodes", "0") for _ in range(2)}
    assert len(folders) == 2


def test_unwritable_folder(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    assert run.main(["--config", "fake", "--run.folder", str(tmp_path / "file")]) == 2
    assert "cannot create a run" in capsys.readouterr().err
    assert Path(tmp_path / "file").read_text() == ""
