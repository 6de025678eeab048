"""A search for settings: Optuna proposes them in batches, which train side by side, and is told what they came to.

What was proposed and told lies in the folder of the search, one JSON object a line. A proposal depends on what was told
before, on the number of the trial and on the seed of the search, so that a search goes on as if it had never stopped.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.sweeps.space import Dimension
from t2tl_jax.errors import UserError
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import writing

FILE = "search.jsonl"
"""Optuna's journal."""

NAME, CONTENT = "search", "search"
"""Of the study, and of its attribute that says what is searched."""

CONFIGURATION = "configuration"
"""Of what is searched, the configuration that all trials start from, as `recorded` writes it."""

RANDOM_FIRST = 16
"""Trials that are drawn at random, before Optuna's model has something to go by."""

WORST = -1.0
"""What a seed counts whose training failed, or in which no episode ended: the lowest discounted return."""


def worth(returns: np.ndarray) -> float:
    """What a trial is told to be worth: the mean over its seeds of the discounted return at the end."""
    return float(np.where(np.isfinite(returns), returns, WORST).mean())


def recorded(config: Config) -> dict[str, Any]:
    """A configuration for the record of a search: without its seeds, and what happens around the training."""
    config_as_json = json.loads(config_files.to_json(config))
    return {name: value for name, value in config_as_json.items() if name not in ("run", "seeds")}


class Search:
    """The trials of a search, numbered from 0, on disk."""

    def __init__(
        self,
        base: Path,
        dimensions: Sequence[Dimension],
        seed: int,
        content: Mapping[str, Any],
        begins: bool = True,
    ) -> None:
        """Begin a search, or go on with the one that the folder holds.

        Args:
            base: the folder.
            dimensions: what is searched, of `space.check`.
            seed: of the proposals.
            content: what makes it the same search, as JSON.
            begins: whether this process is the one that proposes; others only read.

        Raises:
            UserError: if Optuna is not there, or the folder holds another search or a damaged one.
        """
        try:
            import optuna
        except ModuleNotFoundError as error:
            raise UserError("a search needs Optuna: pip install 't2tl_jax[search]'") from error
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._optuna, self._dimensions, self._seed, self._begins = optuna, dimensions, seed, begins
        self._file = base / FILE
        if not begins and not self._file.is_file():
            raise self._no_search()
        base.mkdir(parents=True, exist_ok=True)
        with writing(self._file):
            if begins:
                _cut_unfinished_line(self._file)
            self._study = self._opened()
            known = self._study.user_attrs.get(CONTENT)
            if known is None and not begins:
                raise self._no_search()
            if known is None:
                self._study.set_user_attr(CONTENT, known := dict(content))
            else:
                known = self._of_this_version(known)
        if known != content:
            differ = sorted(name for name in content if not isinstance(known, dict) or known.get(name) != content[name])
            raise UserError(f"{base} holds a search that differs in {', '.join(differ)}; take another --folder")

    def _no_search(self) -> UserError:
        return UserError(f"{self._file.parent} holds no search yet whose trials could be trained by themselves")

    def _of_this_version(self, known: Any) -> Any:
        """What is searched, with its configuration as this version writes it: fields that are new have defaults."""
        if not isinstance(known, dict) or CONFIGURATION not in known:
            return known
        config = config_files.from_json(json.dumps(known[CONFIGURATION]), f"the configuration in {self._file}")
        return {**known, CONFIGURATION: recorded(config)}

    def _opened(self) -> Any:
        from optuna.storages.journal import JournalFileBackend, JournalStorage

        try:
            # Of Optuna's storages the one that is plain text: what it reads are numbers and names, never code.
            storage = JournalStorage(JournalFileBackend(str(self._file)))
            if NAME in [study.study_name for study in storage.get_all_studies()]:
                return self._optuna.load_study(storage=storage, study_name=NAME)
            if not self._begins:
                raise self._no_search()
            return self._optuna.create_study(storage=storage, study_name=NAME, direction="maximize")
        except (OSError, UserError):
            raise
        except Exception as error:  # of any kind, by what is wrong with the file
            raise UserError(
                f"cannot read {self._file}: {error}; bring back a copy, or take another --folder"
            ) from error

    @property
    def values(self) -> dict[int, float]:
        """What every trial that has been told is worth."""
        return {trial.number: trial.value for trial in self._study.trials if trial.value is not None}

    def texts(self, number: int) -> dict[str, str]:
        """The setting of a trial as texts of flags, by field; it is proposed if it is the next one.

        Only the process that holds the lock of the search proposes: two that did would make different trials of one
        number.

        Raises:
            UserError: for a trial that is not there, what lies outside of the space, or cannot be written.
        """
        trials = self._study.trials
        if number > len(trials) or (number == len(trials) and not self._begins):
            raise UserError(f"{self._file} has no trial {number}; the first {len(trials)} are proposed")
        params = trials[number].params if number < len(trials) else self._proposed(number)
        if set(params) != {dimension.field for dimension in self._dimensions}:
            raise UserError(f"cannot read {self._file}: trial {number} has other fields than the space")
        return {dimension.field: dimension.in_words(params[dimension.field]) for dimension in self._dimensions}

    def _proposed(self, number: int) -> dict[str, Any]:
        """A new trial: proposed in memory, and then written in one line, so that it is on disk whole or not at all."""
        optuna = self._optuna
        seed = int(np.random.SeedSequence([self._seed, number]).generate_state(1)[0])
        sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=RANDOM_FIRST)
        memory = optuna.create_study(direction="maximize", sampler=sampler)
        memory.add_trials(self._study.trials)
        trial = memory.ask()
        for dimension in self._dimensions:
            _suggest(trial, dimension)
        running = optuna.trial.create_trial(
            state=optuna.trial.TrialState.RUNNING, params=trial.params, distributions=trial.distributions
        )
        with writing(self._file):
            self._study.add_trial(running)
        return trial.params

    def tell(self, number: int, value: float) -> None:
        """What a trial came to."""
        with writing(self._file):
            self._study.tell(number, value, skip_if_finished=True)


def _suggest(trial: Any, dimension: Dimension) -> None:
    """Let a trial have a value of a dimension."""
    if not dimension.is_range:
        trial.suggest_categorical(dimension.field, dimension.axis.values)
        return
    low, high = dimension.ends
    if dimension.whole:
        trial.suggest_int(dimension.field, int(low), int(high), log=dimension.log)
    else:
        trial.suggest_float(dimension.field, low, high, log=dimension.log)


def _cut_unfinished_line(file: Path) -> None:
    """Drop what a killed process left of a line, which would spoil the next one."""
    if not file.is_file():
        return
    with open(file, "rb+") as journal:
        content = journal.read()
        journal.truncate(content.rfind(b"\n") + 1)
