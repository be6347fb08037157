"""Tune a training with Optuna: python examples/tune.py --preset quick --trials 20 (extra `tune`).

Each trial is a run folder (`drlsl runs list FOLDER`); the same command continues the study.
"""

import argparse
from pathlib import Path
from statistics import mean

import optuna

from drlsl.learning import drive, load_policy, make_evaluation_env, train

parser = argparse.ArgumentParser()
parser.add_argument("--preset", default="tiny", help="settings that the trials share")
parser.add_argument("--trials", type=int, default=3, help="trials to add to the study")
parser.add_argument("--out", type=Path, default=Path("runs/tune"), help="folder of the study and its runs")
wanted = parser.parse_args()


def objective(trial: optuna.Trial) -> float:
    """Return the mean return behind the shield, in episodes that the training has not seen."""
    target_every = trial.suggest_int("target_every", 50, 2_000, log=True)
    learning = {"discount": trial.suggest_float("discount", 0.9, 0.99), "target_every": target_every}
    schedule = {"learning_rate_start": trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True)}
    out = wanted.out / f"trial-{trial.number}"
    folder = train(out, preset=wanted.preset, force=True, learning=learning, schedule=schedule)
    env = make_evaluation_env(folder.config.env)
    policy = load_policy(folder, env)
    test = drive(env, policy, shield="on", episodes=folder.config.evaluation.episodes, seed=1)
    return mean(episode.total_return for episode in test)


wanted.out.mkdir(parents=True, exist_ok=True)
place = {"storage": f"sqlite:///{wanted.out}/optuna.db", "study_name": "drlsl", "load_if_exists": True}
study = optuna.create_study(**place, direction="maximize")
study.optimize(objective, n_trials=wanted.trials)
best = study.best_trial
print(f"best of {len(study.trials)}: trial-{best.number}, return {best.value:.2f}, {best.params}")
