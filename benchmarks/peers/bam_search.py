"""BAM's own search on the runs of a fold's outside; run by a Python that has BAM and optuna < 4.4.

    python -m benchmarks.bam --export RUNS
    BAM_PYTHON benchmarks/peers/bam_search.py RUNS m6 3000 kp800 [SEED]

Arguments: the folder of the runs, the model (m1 to m6), the number of trials, and the fold to
leave out (a gain or a trajectory).
Model, simulator, objective (mean absolute position error), bounds and sampler (CMA-ES, restarts
in two regimes) are those of `bam.fit`. Prints, as the trials go on, CPU seconds and the error of
the best numbers so far on both sides of the fold [mrad].
"""

from __future__ import annotations

import sys
import time
import warnings
from copy import copy

import numpy as np
import optuna
from bam.actuators import actuators
from bam.logs import Logs
from bam.model import models
from bam.simulate import Simulator


def main(folder, name, trials, fold, seed=0):
    warnings.simplefilter("ignore")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    everything = Logs(folder)
    seen, unseen = (batch(everything, fold, inside=inside) for inside in (False, True))

    def objective(trial):
        model = models[name]()
        model.set_actuator(actuators["xl330"]())
        for key, parameter in model.get_parameters().items():
            if parameter.optimize:
                parameter.value = trial.suggest_float(key, parameter.min, parameter.max)
        return error(model, seen)

    start = time.process_time()

    def say(study, trial):
        done = trial.number + 1
        if done % 500 == 0 or done == trials:
            model = models[name]()
            model.set_actuator(actuators["xl330"]())
            model.load_parameters_from_dict(study.best_params)
            numbers = (time.process_time() - start, 1e3 * study.best_value)
            other = 1e3 * error(model, unseen)
            print(f"{name} {fold:16s}{done:7d}{numbers[0]:9.1f} s{numbers[1]:8.1f}{other:8.1f}")
            sys.stdout.flush()

    sampler = optuna.samplers.CmaEsSampler(restart_strategy="bipop", seed=seed)
    study = optuna.create_study(sampler=sampler)
    study.optimize(objective, n_trials=trials, callbacks=[say])
    print(study.best_params)


def batch(logs, fold, *, inside):
    part = copy(logs)
    part.logs = [
        log for log in logs.logs if (fold in (f"kp{log['kp']}", log["trajectory"])) == inside
    ]
    return part.make_batch()


def error(model, runs):
    reached = Simulator(model).rollout_log(runs, simulate_control=True)[0]
    return np.mean(np.abs(np.array(reached) - [row["position"] for row in runs["entries"]]))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4], *map(int, sys.argv[5:]))
